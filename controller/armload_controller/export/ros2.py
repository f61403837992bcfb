"""ROS 2: the payload as a link in a URDF xacro, and the parameters of gravity compensation.

The xacro macro adds a link fixed to the flange with the inertial block of `urdf`. The parameters are those with which
`admittance_controller` of ros2_controllers compensates for the payload's weight in a wrist sensor's reading:

- gravity_compensation.frame.id: frame of the centre of mass, here the flange.
- gravity_compensation.CoG.pos: centre of mass in m in that frame.
- gravity_compensation.CoG.force: weight in N, mass times the gravity of the robot's configuration.

What is not determined: as in `urdf` for the link; the parameters contain no inertia.

References:
    ros2_controllers, admittance_controller, parameter definitions `admittance_controller_parameters.yaml`.
"""

from __future__ import annotations

import numpy as np

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.text_format import bracketed, comment, positional, provenance
from armload_controller.export.urdf import inertial_lines, payload_comment


def export_ros2(subject: ExportSubject) -> dict[str, str]:
    """A URDF xacro and a parameter file."""
    return {
        f"{subject.identifier}_payload.urdf.xacro": _xacro(subject),
        f"{subject.identifier}_payload.yaml": _parameters(subject),
    }


def _xacro(subject: ExportSubject) -> str:
    name = f"{subject.identifier}_payload"
    lines = [
        '<?xml version="1.0"?>',
        *payload_comment(
            subject,
            f"Include the file and call {name} with parent, the link whose frame is the flange of the robot's "
            "configuration; prefix is prepended to the names of link and joint.",
        ),
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">',
        f'  <xacro:macro name="{name}" params="parent prefix:=\'\'">',
        '    <link name="${prefix}payload">',
        *(f"      {line}" for line in inertial_lines(subject.payload.model)),
        "    </link>",
        '    <joint name="${prefix}payload_joint" type="fixed">',
        '      <parent link="${parent}"/>',
        '      <child link="${prefix}payload"/>',
        '      <origin xyz="0 0 0" rpy="0 0 0"/>',
        "    </joint>",
        "  </xacro:macro>",
        "</robot>",
    ]
    return "\n".join(lines) + "\n"


def _parameters(subject: ExportSubject) -> str:
    body = subject.payload.model
    weight_n = body.mass_kg * float(np.sqrt(np.sum(subject.chain.gravity_m_s2**2)))
    lines = comment(
        (
            provenance(subject),
            "Gravity compensation of ros2_controllers' admittance_controller.",
            "frame.id: the link whose frame is the flange of the robot's configuration; put its name here.",
            "CoG.pos: centre of mass in m in that frame. CoG.force: weight in N, positive.",
        ),
        "#",
    )
    lines += [
        "admittance_controller:",
        "  ros__parameters:",
        "    gravity_compensation:",
        "      frame:",
        "        id: flange",
        "      CoG:",
        f"        pos: {bracketed(body.center_of_mass_m)}",
        f"        force: {positional(weight_n)}",
    ]
    return "\n".join(lines) + "\n"
