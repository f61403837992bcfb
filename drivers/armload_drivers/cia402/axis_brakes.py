"""Axes that lose their torque: at standstill, and held by a brake or not at all.

Torque is removed at standstill, and from axes without a brake (`has_brake` in the configuration) last, when all others
are held. An axis that then moves is reported to the operator immediately: the program can no longer hold it, because
nothing is re-enabled automatically.
"""

from __future__ import annotations

from armload_drivers.cia402.arm_settings import DriveSettings
from armload_drivers.driver_errors import AxisMoves

STANDSTILL_RAD_S = 0.005
"""An axis slower than this is at standstill."""
HOLDING_WATCH_S = 0.2
"""Time for which the axes are watched after their torque is removed."""
HELD_RAD = 0.01
"""An axis that moves further than this in that time is not held."""


def axis_moves(drive: DriveSettings, moved_rad: float) -> AxisMoves:
    """Error for an axis that is not held."""
    why = "its brake does not hold it" if drive.has_brake else "it has no brake (has_brake)"
    return AxisMoves(
        drive.node_id,
        drive.joint,
        "removing torque",
        f"the axis has moved by {moved_rad:.3f} rad within {HOLDING_WATCH_S} s of losing its torque: {why}",
        "Keep clear of the arm, and support it before anyone approaches it",
    )
