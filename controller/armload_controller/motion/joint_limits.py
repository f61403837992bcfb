"""The limits of motion, and the pure check that every setpoint passes before it is sent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_controller.control_errors import ControlError
from armload_core.arrays import FloatArray

RELATIVE_TOLERANCE = 1e-9
"""Rounding allowed beyond a limit: as a share of it, and for a position limit as a share of the joint's range."""


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """What the joints may do; every array has shape (n,).

    Attributes:
        joint_names: Names, for messages.
        position_min_rad: Lower position limits.
        position_max_rad: Upper position limits.
        velocity_max_rad_s: Greatest speeds.
        acceleration_max_rad_s2: Greatest accelerations.
        jerk_max_rad_s3: Greatest jerks.
        following_error_rad: Greatest distance between target and measured position.
    """

    joint_names: tuple[str, ...]
    position_min_rad: FloatArray
    position_max_rad: FloatArray
    velocity_max_rad_s: FloatArray
    acceleration_max_rad_s2: FloatArray
    jerk_max_rad_s3: FloatArray
    following_error_rad: FloatArray


class LimitViolation(ControlError):
    """A setpoint lies outside the limits.

    Attributes:
        joint: Name of the joint.
        quantity: "position", "velocity" or "acceleration".
        value: The value asked for.
        bound: The limit it breaks.
    """

    def __init__(self, joint: str, quantity: str, value: float, bound: float, unit: str) -> None:
        super().__init__(
            f"{joint}: {quantity} {value:.4f} {unit} is beyond the limit of {bound:.4f} {unit}; "
            "slow the motion down or correct the limit in the configuration"
        )
        self.joint = joint
        self.quantity = quantity
        self.value = value
        self.bound = bound


def check_setpoints(
    position_rad: FloatArray,
    velocity_rad_s: FloatArray,
    acceleration_rad_s2: FloatArray,
    limits: MotionLimits,
) -> None:
    """Check one setpoint (n,) or a whole plan (N, n).

    Raises:
        LimitViolation: naming joint, quantity, value and bound of the worst excess.
    """
    speed, acceleration = np.abs(velocity_rad_s), np.abs(acceleration_rad_s2)
    low, high = limits.position_min_rad, limits.position_max_rad
    rounding_rad = RELATIVE_TOLERANCE * (high - low)
    wider = 1.0 + RELATIVE_TOLERANCE
    if (
        (position_rad <= high + rounding_rad).all()
        and (position_rad >= low - rounding_rad).all()
        and (speed <= limits.velocity_max_rad_s * wider).all()
        and (acceleration <= limits.acceleration_max_rad_s2 * wider).all()
    ):
        return
    for quantity, unit, value, bound, allowed, sign in (
        ("position", "rad", position_rad, high, high + rounding_rad, 1),
        ("position", "rad", position_rad, low, low - rounding_rad, -1),
        ("velocity", "rad/s", speed, limits.velocity_max_rad_s, limits.velocity_max_rad_s * wider, 1),
        (
            "acceleration",
            "rad/s2",
            acceleration,
            limits.acceleration_max_rad_s2,
            limits.acceleration_max_rad_s2 * wider,
            1,
        ),
    ):
        excess = np.atleast_2d(sign * (value - allowed))
        joint = int(np.argmax(np.where(np.isnan(excess), np.inf, excess).max(axis=0)))
        column = np.atleast_2d(value)[:, joint]
        worst = float(column[np.argmax(np.where(np.isnan(column), np.inf, sign * column))])
        if not sign * (worst - allowed[joint]) <= 0:
            raise LimitViolation(limits.joint_names[joint], quantity, worst, float(bound[joint]), unit)
