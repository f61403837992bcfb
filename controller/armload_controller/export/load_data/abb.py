"""ABB: loaddata of RAPID.

    [mass, [x, y, z], [q1, q2, q3, q4], ix, iy, iz]

- mass in kg.
- cog [x, y, z]: centre of mass in mm; of a tool (`tload` of tooldata) in the WRIST frame, which is the flange (tool0);
  of a payload (GripLoad) in the frame of the tool that holds it. Here: the flange.
- aom [q1, q2, q3, q4]: orientation of the principal axes of inertia at the centre of mass in the same frame, unit
  quaternion with q1 the scalar.
- ix, iy, iz: moments of inertia in kg m2 about those axes. All three zero is a point mass.

What is not determined: zero moments with aom = [1, 0, 0, 0] if none of the inertia is determined; the complete model,
marked, if a part is.

References:
    ABB, RAPID Reference Manual (BaseWare), data types "loaddata" and "tooldata": order, units, frames, point mass.
    ABB, Technical reference manual, RAPID Instructions, Functions and Data types, "loaddata", as quoted in the message
        definition `abb_rapid_msgs/LoadData` of ROS-Industrial: principal axes with origin in cog.
"""

from __future__ import annotations

import math

import numpy as np

from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.inertia import TENSOR, complete_inertia, principal_inertia
from armload_controller.export.load_data.makers_flange import in_makers_flange
from armload_controller.export.template import written
from armload_controller.export.text_format import bracketed, load_data
from armload_identification.float_array import FloatArray

LONGEST_NAME = 32
"""Greatest length of an identifier in RAPID."""


def export_abb(subject: ExportSubject) -> dict[str, str]:
    """A RAPID module with the payload as persistent loaddata."""
    payload = in_makers_flange(subject)
    inertia = complete_inertia(payload, TENSOR, or_point_mass=True)
    principal_kg_m2, rotation = principal_inertia(inertia.tensor_kg_m2)
    moments = dict(zip(("ix", "iy", "iz"), principal_kg_m2, strict=True))
    fields = load_data(subject, inertia, mass=payload.model.mass_kg, **moments) | {
        "short": subject.identifier[: LONGEST_NAME - len("_payload")],
        "cog": bracketed(payload.model.center_of_mass_m * 1e3),
        "aom": bracketed(_quaternion(rotation)),
    }
    return {f"{subject.identifier}_payload.mod": written("load_data/abb", "  !", fields)}


def _quaternion(rotation: FloatArray) -> FloatArray:
    """(4,) unit quaternion, scalar first; the rotation is less than 63 degrees, so the scalar is large."""
    scalar = math.sqrt(1.0 + float(np.trace(rotation))) / 2.0
    twice_axis = np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    return np.concatenate([[scalar], twice_axis / (4.0 * scalar)])
