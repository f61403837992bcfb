"""MJCF: the payload as a body for MuJoCo, to be placed in the body whose frame is the flange.

- pos: centre of mass in m in the body's frame, here the flange.
- mass in kg.
- fullinertia: Ixx Iyy Izz Ixy Ixz Iyz about the centre of mass in kg m2 in the body's axes, tensor elements
  (Ixy = -int xy dm).

What is not determined: MuJoCo refuses a moving body without inertia, so the complete model is written and marked.

References:
    MuJoCo documentation, XML reference, body/inertial: fields, units, frame.
"""

from __future__ import annotations

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.text_format import exact, exact_numbers
from armload_controller.export.urdf import payload_comment
from armload_identification.model.payload import InertialParameters, tensor_elements


def export_mjcf(subject: ExportSubject) -> dict[str, str]:
    """A `<body>` with an `<inertial>`."""
    lines = payload_comment(
        subject, "Put this element into the MJCF body whose frame is the flange of the robot's configuration."
    )
    lines += [
        f'<body name="{subject.identifier}_payload">',
        f"  {mjcf_inertial(subject.payload.model)}",
        "</body>",
    ]
    return {f"{subject.identifier}_payload_body.xml": "\n".join(lines) + "\n"}


def mjcf_inertial(body: InertialParameters) -> str:
    """The `<inertial>` element of a body in its frame."""
    center, full = exact_numbers(body.center_of_mass_m), exact_numbers(tensor_elements(body.inertia_about_com))
    return f'<inertial pos="{center}" mass="{exact(body.mass_kg)}" fullinertia="{full}"/>'
