"""The limits of motion, and the check of every setpoint before it is sent."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from armload_controller.control_errors import ControlError
from armload_identification.float_array import FloatArray

RELATIVE_TOLERANCE = 1e-9
"""Rounding error allowed beyond a limit, as a share of it; for a position limit as a share of the joint's range."""


@dataclass(frozen=True, eq=False, slots=True)
class MotionLimits:
    """Limits of the joints; every array has shape (n,).

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
    _least: FloatArray = field(init=False, repr=False)
    _greatest: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        low, high, wider = self.position_min_rad, self.position_max_rad, 1.0 + RELATIVE_TOLERANCE
        rounding_rad = RELATIVE_TOLERANCE * (high - low)
        speed, acceleration = self.velocity_max_rad_s * wider, self.acceleration_max_rad_s2 * wider
        for name, rows in (
            ("_least", (low - rounding_rad, -speed, -acceleration)),
            ("_greatest", (high + rounding_rad, speed, acceleration)),
        ):
            object.__setattr__(self, name, np.array(rows)[:, None])

    def excess(self, states: FloatArray) -> FloatArray:
        """Distance of positions, velocities and accelerations beyond their limits, allowing for rounding.

        Args:
            states: (3, N, n) in rad, rad/s and rad/s2.

        Returns:
            (3, N, n) in the same units; 0 or less within the limits, NaN where the input is NaN.
        """
        return np.maximum(states - self._greatest, self._least - states)


class LimitViolation(ControlError):
    """A motion or one of its setpoints lies outside the limits.

    Attributes:
        joint: Name of the joint, or for a speed the name of a point of the arm.
        quantity: "position", "velocity", "acceleration", "jerk", "following error" or "speed".
        value: The requested value.
        bound: The limit that it exceeds.
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


class BeyondLimit(ControlError):
    """The arm stands outside its position limits.

    Attributes:
        joint: Name of the joint.
    """

    def __init__(self, joint: str, position_rad: float, bound_rad: float) -> None:
        super().__init__(f"{joint} stands at {position_rad:.4f} rad, beyond its limit of {bound_rad:.4f} rad")
        self.joint = joint


def require_within(position_rad: FloatArray, limits: MotionLimits) -> None:
    """Check the position at which an arm stands.

    Args:
        position_rad: (n,) the position.
        limits: Limits of the joints.

    Raises:
        BeyondLimit: naming the joint that is furthest beyond its limit.
    """
    still = np.zeros_like(position_rad)
    try:
        check_setpoints(position_rad, still, still, limits)
    except LimitViolation as error:
        raise BeyondLimit(error.joint, error.value, error.bound) from error


def check_setpoints(
    position_rad: FloatArray,
    velocity_rad_s: FloatArray,
    acceleration_rad_s2: FloatArray,
    limits: MotionLimits,
) -> None:
    """Check one setpoint (n,) or a plan (N, n).

    Raises:
        LimitViolation: naming joint, quantity, value and bound of the worst excess.
    """
    joints = len(limits.joint_names)
    states = np.array((position_rad, velocity_rad_s, acceleration_rad_s2)).reshape(3, -1, joints)
    excess = limits.excess(states)
    if excess.item(excess.argmax()) <= 0.0:  # argmax returns a NaN, if any, and that fails the test
        return
    for row, (quantity, unit, low, high) in enumerate(
        (
            ("position", "rad", limits.position_min_rad, limits.position_max_rad),
            ("velocity", "rad/s", None, limits.velocity_max_rad_s),
            ("acceleration", "rad/s2", None, limits.acceleration_max_rad_s2),
        )
    ):
        worst = int(excess[row].argmax())
        if not excess[row].item(worst) <= 0.0:
            joint = worst % joints
            value = states[row].item(worst) if low is not None else abs(states[row].item(worst))
            bound = low[joint] if low is not None and value < low[joint] else high[joint]
            raise LimitViolation(limits.joint_names[joint], quantity, value, float(bound), unit)
