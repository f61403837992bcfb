"""Universal Robots: the URScript line that sets the payload.

    set_target_payload(m, cog, inertia=[0, 0, 0, 0, 0, 0], transition_time=0)

- m: mass in kg.
- cog: centre of mass in m from the tool mount, in the flange's axes.
- inertia: [Ixx, Iyy, Izz, Ixy, Ixz, Iyz] in kg m2, origin in the centre of mass, axes along the flange's. The manual
  calls them elements of the inertia matrix, so the products are tensor elements, Ixy = -int xy dm.
- transition_time in s: omitted, so the change is immediate.

What is not determined: the argument `inertia` is omitted, which means zero, if none of it is determined; the complete
model is written and marked if a part is.

References:
    Universal Robots, Script Manual (PolyScope X 10.6, also PolyScope 5), "set_target_payload".
"""

from __future__ import annotations

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import TENSOR, InertiaSource, inertia_or_point_mass
from armload_controller.export.text_format import bracketed, heading, positional
from armload_identification.model.payload import tensor_elements


def export_ur(subject: ExportSubject) -> dict[str, str]:
    """A URScript file with one line."""
    body = subject.payload.model
    inertia = inertia_or_point_mass(subject.payload, TENSOR)
    arguments = [positional(body.mass_kg), bracketed(body.center_of_mass_m)]
    if inertia.source is not InertiaSource.POINT_MASS:
        arguments.append(bracketed(tensor_elements(inertia.tensor_kg_m2)))
    lines = heading(
        subject,
        "Mass in kg, centre of mass in m from the tool mount, inertia [Ixx, Iyy, Izz, Ixy, Ixz, Iyz] in kg m2 "
        "about the centre of mass in the flange's axes, products as tensor elements (Ixy = -int xy dm).",
        inertia.statement,
        "#",
    )
    lines.append(f"set_target_payload({', '.join(arguments)})")
    return {f"{subject.identifier}_payload.script": "\n".join(lines) + "\n"}
