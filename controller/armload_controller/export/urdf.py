"""URDF: the inertial block of a payload, for the flange's link.

- origin xyz: centre of mass in m in the link's frame, here the flange; rpy zero, so the axes are the flange's.
- mass in kg.
- inertia: tensor elements about the centre of mass in kg m2, ixy = -int xy dm.

What is not determined: URDF has no point mass, and simulators reject a zero inertia, so the complete model is written
and marked.

References:
    ROS wiki, urdf/XML/link, element "inertial": fields, units, frame, and the sign of the products.
"""

from __future__ import annotations

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import TENSOR, complete_inertia
from armload_controller.export.text_format import exact, exact_numbers, provenance, xml_comment
from armload_identification.model.payload import InertialParameters


def export_urdf(subject: ExportSubject) -> dict[str, str]:
    """An `<inertial>` element."""
    lines = payload_comment(
        subject,
        "The inertial element of a link whose frame is the flange of the robot's configuration. A link can have only "
        "one: if the flange's link already has one, add the payload as a separate link (armload export, format ros2).",
    )
    lines += inertial_lines(subject.payload.model)
    return {f"{subject.identifier}_payload_inertial.xml": "\n".join(lines) + "\n"}


def inertial_lines(body: InertialParameters) -> list[str]:
    """The `<inertial>` element of a body in its link's frame, line by line."""
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = (
        [exact(element) for element in row] for row in body.inertia_about_com
    )
    return [
        "<inertial>",
        f'  <origin xyz="{exact_numbers(body.center_of_mass_m)}" rpy="0 0 0"/>',
        f'  <mass value="{exact(body.mass_kg)}"/>',
        f'  <inertia ixx="{ixx}" ixy="{ixy}" ixz="{ixz}" iyy="{iyy}" iyz="{iyz}" izz="{izz}"/>',
        "</inertial>",
    ]


def payload_comment(subject: ExportSubject, purpose: str) -> list[str]:
    """A comment with provenance, purpose, units, signs and the source of the inertia.

    Args:
        subject: The payload.
        purpose: Purpose of the element.
    """
    return xml_comment(
        (
            provenance(subject),
            purpose,
            "Mass in kg, centre of mass in m in the flange frame, inertia in kg m2 about the centre of mass in the "
            "flange's axes, as tensor elements (ixy = -int xy dm).",
            complete_inertia(subject.payload, TENSOR).statement,
        )
    )
