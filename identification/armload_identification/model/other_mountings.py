"""Where else an arm may be mounted than its configuration says: floor, ceiling or wall."""

from __future__ import annotations

import numpy as np

from armload_identification.float_array import FloatArray


def directions(gravity_m_s2: FloatArray) -> dict[str, FloatArray]:
    """The other possible mountings of an arm, as gravity in its base frame.

    Args:
        gravity_m_s2: (3,) as configured.
    """
    size = float(np.sqrt(np.sum(gravity_m_s2**2)))
    entered = gravity_m_s2 / size
    found = {}
    for axis, sign in ((2, -1.0), (2, 1.0), (0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)):
        way = sign * np.eye(3)[axis]
        if way @ entered < 0.9:
            how = "on the floor" if (axis, sign) == (2, -1.0) else "on the ceiling" if axis == 2 else "on a wall"
            found[f"{how}, gravity_m_s2 = {((size * way).round(3) + 0.0).tolist()}"] = size * way
    return found
