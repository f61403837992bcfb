"""What holds an axis once its torque has gone: a brake, or nothing.

Torque is removed at standstill, and from axes without a brake (`has_brake`, named in the configuration) last, when all
others are held. What then moves is reported to the operator at once: no program can hold it any more, because
nothing is enabled again by itself.
"""

from __future__ import annotations

from armload_drivers.cia402.arm_settings import DriveSettings
from armload_drivers.driver_errors import AxisMoves

HOLDING_WATCH_S = 0.2
"""After the torque has gone, the axes are watched for this long."""
HELD_RAD = 0.01
"""An axis that moves further than this meanwhile is not held by anything."""


def axis_moves(drive: DriveSettings, moved_rad: float) -> AxisMoves:
    """Error about an axis that nothing holds."""
    why = "its brake does not hold it" if drive.has_brake else "it has no brake (has_brake)"
    return AxisMoves(
        drive.node_id,
        drive.joint,
        "removing torque",
        f"the axis has moved by {moved_rad:.3f} rad within {HOLDING_WATCH_S} s of losing its torque: {why}",
        "Keep clear of the arm, and support it before anyone approaches it",
    )
