"""Universal Robots: the URScript line that sets the payload, and the same for UR's ROS 2 driver.

    set_target_payload(m, cog, inertia=[0, 0, 0, 0, 0, 0], transition_time=0)

- m: mass in kg.
- cog: centre of mass in m from the tool mount, in the flange's axes.
- inertia: [Ixx, Iyy, Izz, Ixy, Ixz, Iyz] in kg m2, origin in the centre of mass, axes along the flange's. The manual
  calls them elements of the inertia matrix, so the products are tensor elements, Ixy = -int xy dm. Each at most 133 in
  magnitude, moments not negative, or the call throws.
- transition_time in s: the payload changes gradually, so that the arm does not jump.
- The call zeroes the force and torque readings, as `zero_ftsensor()` does.

What is not determined: zeros, the manual's value of an omitted inertia, if none of it is determined; the complete model
is written and marked if a part is.

References:
    Universal Robots, Script Manual (PolyScope X 10.6, also PolyScope 5), "set_target_payload": limits, force sensor.
    ur_msgs 2.5 (Jazzy), SetPayload: mass, center_of_gravity, ixx .. iyz, transition_time; ur_msgs 3.0 (Rolling):
        geometry_msgs/Inertia payload. UR's driver, pull requests 1808 (3.0) and 1811 (2.5).
"""

from __future__ import annotations

import numpy as np

from armload_controller.control_errors import ExportError
from armload_controller.export.body_parameters import TRANSITION_S
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import TENSOR, complete_inertia
from armload_controller.export.load_data.makers_flange import in_makers_flange
from armload_controller.export.template import written
from armload_controller.export.text_format import bracketed, load_data, positional
from armload_identification.model.payload import TENSOR_ELEMENTS, tensor_elements

GREATEST_ELEMENT_KG_M2 = 133.0
"""Greatest magnitude of an element of the inertia (Script Manual)."""


def export_ur(subject: ExportSubject) -> dict[str, str]:
    """A URScript file with one line.

    Raises:
        ExportError: an element of the inertia is beyond what the call accepts.
    """
    payload = in_makers_flange(subject)
    body = payload.model
    inertia = complete_inertia(payload, TENSOR, or_point_mass=True)
    elements = tensor_elements(inertia.tensor_kg_m2)
    if np.abs(elements).max() > GREATEST_ELEMENT_KG_M2:
        raise ExportError(
            subject.payload_file,
            f"an element of the inertia is {np.abs(elements).max():.4g} kg m2; set_target_payload accepts at most "
            f"{GREATEST_ELEMENT_KG_M2:g}. No UR arm carries such a payload: check the recordings' units",
        )
    numbers = {"mass": body.mass_kg, "transition": TRANSITION_S}
    numbers |= zip("xyz", body.center_of_mass_m, strict=True)
    tensor = zip(TENSOR_ELEMENTS, elements, strict=True)
    fields = load_data(subject, inertia, **numbers) | {
        "hash": "#",
        "elements": bracketed(elements),
        "tensor": ", ".join(f"{name}: {positional(value)}" for name, value in tensor),
        "duration": f"{{sec: {int(TRANSITION_S)}, nanosec: {round(TRANSITION_S % 1.0 * 1e9)}}}",
    }
    return {f"{subject.identifier}_payload.script": written("load_data/ur", "#", fields)}
