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
from armload_controller.export.template import filled, written
from armload_controller.export.text_format import bracketed, positional, provenance
from armload_controller.export.urdf import inertial_lines, payload_comment


def export_ros2(subject: ExportSubject) -> dict[str, str]:
    """A URDF xacro and a parameter file."""
    name, body = f"{subject.identifier}_payload", subject.payload.model
    about = payload_comment(
        subject,
        f"Include the file and call {name} with parent, the link whose frame is the flange of the robot's "
        "configuration; prefix is prepended to the names of link and joint.",
    )
    inertial = (f"      {line}" for line in inertial_lines(body))
    macro = {"name": name, "about": "\n".join(about), "inertial": "\n".join(inertial)}
    parameters = {
        "provenance": provenance(subject),
        "center": bracketed(body.center_of_mass_m),
        "weight": positional(body.mass_kg * float(np.sqrt(np.sum(subject.chain.gravity_m_s2**2)))),
    }
    return {
        f"{name}.urdf.xacro": filled("ros2_macro.xacro", macro),
        f"{name}.yaml": written("ros2_parameters.yaml", "#", parameters),
    }
