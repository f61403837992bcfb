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
from armload_controller.export.inertia import TENSOR, inertia_or_point_mass, principal_inertia
from armload_controller.export.load_data.makers_flange import in_makers_flange
from armload_controller.export.text_format import bracketed, heading, positional
from armload_core.arrays import FloatArray

LONGEST_NAME = 32
"""Greatest length of an identifier in RAPID."""


def export_abb(subject: ExportSubject) -> dict[str, str]:
    """A RAPID module with the payload as persistent loaddata."""
    payload = in_makers_flange(subject)
    body = payload.model
    inertia = inertia_or_point_mass(payload, TENSOR)
    principal = principal_inertia(inertia.tensor_kg_m2)
    cog = bracketed(body.center_of_mass_m * 1e3)
    aom = bracketed(_quaternion(principal.rotation))
    moments = ",".join(positional(i) for i in principal.moments_kg_m2)
    name = subject.identifier[: LONGEST_NAME - len("_payload")]
    lines = [f"MODULE {name}_payload"]
    lines += heading(
        subject,
        "mass: kg. cog: centre of mass in mm. aom: principal axes of inertia, quaternion, scalar first. "
        "ix, iy, iz: moments about them through the centre of mass in kg m2. All in the wrist frame (tool0): use "
        "it as tload of a tooldata, or with GripLoad while the tool frame is tool0.",
        inertia.statement,
        "  !",
        "No limits of the numbers are stated in: ABB, RAPID Reference Manual, data types loaddata and tooldata (order, "
        "units, frames; ix = iy = iz = 0 is a point mass). A name has at most 32 characters. Principal axes have no "
        "products of inertia.",
    )
    lines.append(f"  PERS loaddata {name}_load := [{positional(body.mass_kg)},{cog},{aom},{moments}];")
    lines.append("ENDMODULE")
    return {f"{subject.identifier}_payload.mod": "\n".join(lines) + "\n"}


def _quaternion(rotation: FloatArray) -> FloatArray:
    """(4,) unit quaternion, scalar first; the rotation is less than 63 degrees, so the scalar is large."""
    scalar = math.sqrt(1.0 + float(np.trace(rotation))) / 2.0
    twice_axis = np.array(
        [rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]]
    )
    return np.concatenate([[scalar], twice_axis / (4.0 * scalar)])
