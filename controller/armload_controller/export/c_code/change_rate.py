"""The shortest transition of a payload that keeps the rate of the joints' torque within limits.

At rest a change of mass dm and of first moment ds, both at the origin of the last frame, changes joint i's torque by at
most g (|dm| L_i + |ds|), L_i being the greatest distance of that origin from the joint's axis. The blend's greatest
rate is 1.5 times its mean, so to keep the torque rate r_i of every joint it takes at least

    T = 1.5 g max_i (|dm| L_i + |ds|) / r_i  <=  |dm| 1.5 g max_i L_i / r_i  +  |ds| 1.5 g max_i 1 / r_i
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_controller.export.straight_line.planar_groups import PlanarGroup, PlanarGroups, planar_groups
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain

_GREATEST_SLOPE: Final = 1.5
"""Greatest slope of (3 - 2 u) u^2."""


def change_rate(chain: Chain, torque_rate_nm_s: FloatArray) -> tuple[float, float]:
    """The shortest transition of a payload.

    Args:
        torque_rate_nm_s: (n,) greatest rate of each joint's torque.

    Returns:
        Its duration in s/kg, per change of mass, and in s/(kg m), per change of first moment.
    """
    g = _GREATEST_SLOPE * float(np.linalg.norm(chain.gravity_m_s2))
    levers_m = _levers(planar_groups(chain))
    return g * float(np.max(levers_m / torque_rate_nm_s)), g * float(np.max(1.0 / torque_rate_nm_s))


def _levers(groups: PlanarGroups) -> FloatArray:
    """(n,) bound on the distance of the last frame's origin from each joint's axis: the sum of all lengths."""
    levers: dict[int, float] = {}
    beyond_m = 0.0  # from the end of a group to the last origin
    following: PlanarGroup | None = None
    for group in reversed(groups.groups):
        # a shift along a group's axis is no lever about it
        across_m = beyond_m + (abs(following.shift_m[0]) if following else 0.0)
        for joint in reversed(group.joints):
            across_m += abs(joint.shift_m[0])
            levers[joint.index] = across_m
        lengths = [np.hypot(*joint.shift_m) for joint in group.joints]
        beyond_m += float(np.hypot(*following.shift_m) if following else 0.0) + float(np.sum(lengths))
        following = group
    return np.array([levers[i] for i in range(len(levers))])
