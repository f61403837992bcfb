"""Checked motion: the only motion that can be commanded to an arm.

`PoweredArm.follow` accepts only a `CheckedLeg`. Legs come from a `CheckedPath`, which comes from `check_path`. That
refuses an excitation that anywhere, at any speed up to the planned one and under any pause or stop

    exceeds a joint's limit of position, velocity, acceleration or jerk, or its following error window,
    requires more torque than a joint has, for the arm alone or with its heaviest payload,
    touches an obstacle of the workspace, or brings collision meshes too close to each other,
    moves a point of the arm faster than the robot's file allows,
    or in the slow round a point of the arm or of what it carries faster than reduced speed.

The approach to a path begins at the arm's present position, so it is checked in the same way once that is known,
segment by segment: `CheckedPath.approach_from`.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Never, final

import numpy as np

from armload_controller.control_errors import ConfigurationError
from armload_controller.motion.joint_and_speed_checks import (
    greatest_speed_m_s,
    require_joint_limits,
    require_reduced_speed,
    require_tcp_speed,
    torque_objection,
)
from armload_controller.motion.joint_limits import require_within
from armload_controller.motion.motion_constraints import MotionConstraints
from armload_controller.motion.paths import BlockedWay, LinePath, PhaseLimits
from armload_controller.motion.phase import Leg
from armload_controller.motion.setpoints import plan_approach, plan_measured, plan_slow
from armload_controller.motion.way_round import find_way
from armload_identification.excitation.fourier import Excitation
from armload_identification.float_array import FloatArray

STANDING_RAD = 1e-9
"""Within this distance of its target the arm has arrived."""
SAG_RAD = 0.01
"""Greatest movement of a joint while it is enabled and its brake opens."""


@final
@dataclass(frozen=True, eq=False, init=False)
class CheckedLeg:
    """A leg from rest to rest that passed the checks for its kind; only the functions of this module create one.

    Legs of a path and segments of an approach passed all checks; the leg of `CheckedPath.back_to`, which the arm has
    just moved along by itself, passed those of the joints' limits only.

    """

    leg: Leg

    def __init__(self, *unchecked: Never, **fields: Never) -> None:
        raise TypeError(
            "a CheckedLeg is made by check_path, CheckedPath.approach_from and CheckedPath.back_to, which check the "
            "motion first"
        )


@final
@dataclass(frozen=True, eq=False, init=False)
class CheckedPath:
    """An excitation that passed every check of one arm; only `check_path` creates one.

    Attributes:
        excitation: Path and number of periods.
        constraints: The constraints it was checked against.
        cycle_s: The time between setpoints it was checked for.
        slow: One period at reduced speed.
        measured: Ramp up, complete periods, ramp down; begins where the slow round ends.
    """

    excitation: Excitation
    constraints: MotionConstraints
    cycle_s: float
    slow: CheckedLeg
    measured: CheckedLeg

    def __init__(self, *unchecked: Never, **fields: Never) -> None:
        raise TypeError("a CheckedPath is made by check_path, which checks the motion first")

    def again(self, times: int) -> CheckedLeg:
        """The measured leg after `times` of it: the same motion, whose phase goes on where theirs ended."""
        leg = self.measured.leg
        by_s = times * leg.end_s
        return _checked_leg(replace(leg, start_s=leg.start_s + by_s, end_s=leg.end_s + by_s))

    @property
    def start_rad(self) -> FloatArray:
        """(n,) start position of both legs."""
        leg = self.measured.leg
        return leg.path.evaluate(leg.start_s).position_rad

    @property
    def slow_round_s(self) -> float:
        """Duration of the slow round, without ramps and pauses."""
        return self.slow.leg.end_s - self.slow.leg.start_s

    @property
    def slow_speed_m_s(self) -> float:
        """Greatest speed of any point of the arm and of what it carries in the slow round."""
        return greatest_speed_m_s(self.slow.leg, self.constraints.points)

    def approach_from(self, position_rad: FloatArray) -> tuple[CheckedLeg, ...]:
        """The approach from the arm's present position to the start of the legs: straight, or through via points.

        Args:
            position_rad: (n,) present position.

        Returns:
            The segments, each from rest to rest; empty if the arm is already there.

        Raises:
            BeyondLimit: the present position is beyond a joint's limit.
            LimitViolation: on the approach a servo would lag too far.
            BlockedWay: on every approach found, something would be touched or a joint is too weak.
        """
        if np.abs(self.start_rad - position_rad).max() < STANDING_RAD:
            return ()
        constraints = self.constraints
        limits, speed = constraints.limits, constraints.reduced_speed
        require_within(position_rad, limits)

        def objection(begin_rad: FloatArray, end_rad: FloatArray) -> str | None:
            touched = constraints.obstacles.objection_on_line(begin_rad, end_rad)
            if touched is not None:
                return touched
            if np.array_equal(begin_rad, end_rad):
                return torque_objection(LinePath(begin_rad, end_rad, 1.0), PhaseLimits(0.0, 0.0), constraints)
            line = LinePath.within(begin_rad, end_rad, limits, speed)
            return torque_objection(line, line.phase_limits(limits), constraints)

        legs, begin_rad = [], position_rad
        for end_rad in find_way(position_rad, self.start_rad, limits, objection):
            line = LinePath.within(begin_rad, end_rad, limits, speed)
            leg = plan_approach(line, limits)
            require_joint_limits(line.bounds(), leg.bounds, constraints)
            require_reduced_speed(leg, speed)
            legs.append(_checked_leg(leg))
            begin_rad = end_rad
        return tuple(legs)

    def back_to(self, stood_rad: FloatArray, position_rad: FloatArray) -> CheckedLeg | None:
        """The leg back to the position before the arm was enabled and its brakes opened, where the approach begins.

        It is so short that only the joints' limits are checked: the arm has just moved along it by itself.

        Args:
            stood_rad: (n,) position before enabling.
            position_rad: (n,) present position.

        Returns:
            The leg; None if the arm has not moved.

        Raises:
            BeyondLimit: the present position is beyond a joint's limit.
            LimitViolation: on the way back a servo would lag too far.
            BlockedWay: the arm has moved by more than `SAG_RAD`.
        """
        moved = np.abs(position_rad - stood_rad)
        if moved.max() < STANDING_RAD:
            return None
        constraints = self.constraints
        joint = int(moved.argmax())
        if not moved[joint] <= SAG_RAD:
            raise BlockedWay(
                f"{constraints.limits.joint_names[joint]} moved by {moved[joint]:.4f} rad while the arm was being "
                f"enabled, {SAG_RAD} rad allowed: the checked path starts elsewhere"
            )
        require_within(position_rad, constraints.limits)
        line = LinePath.within(position_rad, stood_rad, constraints.limits, constraints.reduced_speed)
        leg = plan_approach(line, constraints.limits)
        require_joint_limits(line.bounds(), leg.bounds, constraints)
        return _checked_leg(leg)


def check_path(
    excitation: Excitation, constraints: MotionConstraints, cycle_s: float, *, file: str, key: str
) -> CheckedPath:
    """Check an excitation against everything that a motion of the arm must respect.

    Args:
        excitation: Path and number of periods.
        constraints: Constraints of the arm.
        cycle_s: Time between setpoints.
        file: The file or command line that names the excitation, for messages.
        key: Its key or option there.

    Raises:
        LimitViolation: a limit of a joint, or of the arm's speed, is exceeded.
        InfeasibleMotion: no ramp onto the path within the limits, or a period that is not a whole number of cycles.
        ConfigurationError: the excitation has another number of joints, touches something, or requires more torque
            than a joint has.
    """
    path, limits = excitation.trajectory, constraints.limits
    n = len(limits.joint_names)
    if path.n != n:
        raise ConfigurationError(file, key, f"a path of {path.n} joints", f"one of this arm's {n} joints")
    # First the path without its ramps: where it exceeds a limit by itself, planning a ramp would blame the ramp.
    require_joint_limits(path.bounds(), PhaseLimits(0.0, 0.0), constraints)
    measured = plan_measured(excitation, limits, cycle_s)
    require_joint_limits(path.bounds(), measured.bounds, constraints)
    require_tcp_speed(path, constraints)
    slow = plan_slow(excitation, measured, constraints.reduced_speed)
    require_reduced_speed(slow, constraints.reduced_speed)
    objection = torque_objection(path, measured.bounds, constraints)
    if objection is not None:
        raise ConfigurationError(
            file, key, f"a path that {objection}", "one designed for this arm and its heaviest payload"
        )
    objection = constraints.obstacles.objection(path)
    if objection is not None:
        raise ConfigurationError(file, key, f"a path that {objection}", "one designed for this workspace")
    checked = object.__new__(CheckedPath)
    for name, value in (
        ("excitation", excitation),
        ("constraints", constraints),
        ("cycle_s", cycle_s),
        ("slow", _checked_leg(slow)),
        ("measured", _checked_leg(measured)),
    ):
        object.__setattr__(checked, name, value)
        _seal(value)
    return checked


def _seal(value: object) -> None:
    """Make the arrays within a value read-only: what was checked stays as it was."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif isinstance(value, tuple):
        for part in value:
            _seal(part)
    elif is_dataclass(value):
        _seal(tuple(getattr(value, part.name) for part in fields(value)))


def _checked_leg(leg: Leg) -> CheckedLeg:
    """Create a CheckedLeg, bypassing the constructor, which always raises."""
    checked = object.__new__(CheckedLeg)
    object.__setattr__(checked, "leg", leg)
    return checked
