"""Checked motion: the only thing that can be commanded to an arm.

`PoweredArm.follow` takes a `CheckedLeg` and nothing else. Legs come from a `CheckedPath`, and that from `check_path`,
which refuses an excitation that anywhere, at any speed up to the planned one and under any pause or stop

    breaks a joint's limit of position, velocity, acceleration or jerk, or fills its following-error window,
    requires more torque than a joint has, for the arm alone or with its heaviest payload,
    touches an obstacle of the workspace, or brings collision meshes too close to each other.

The way onto a path is straight in joint space and begins wherever the arm stands, so it is checked in the same way when
that is known, on its own line: `CheckedPath.approach_from`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Never, final

from armload_controller.control_errors import ConfigurationError
from armload_controller.motion.motion_constraints import MotionConstraints
from armload_controller.motion.path_checks import require_joint_limits, torque_objection
from armload_controller.motion.paths import BlockedWay
from armload_controller.motion.phase import Leg
from armload_controller.motion.setpoints import plan_approach, plan_legs
from armload_core.arrays import FloatArray
from armload_identification.excitation.fourier import Excitation


@final
@dataclass(frozen=True, eq=False, init=False)
class CheckedLeg:
    """One way from rest to rest that passed every check; only the functions of this module make one.

    Attributes:
        leg: The way.
    """

    leg: Leg

    def __init__(self, *unchecked: Never, **fields: Never) -> None:
        raise TypeError(
            "a CheckedLeg is made by check_path and CheckedPath.approach_from, which check the motion first"
        )


@final
@dataclass(frozen=True, eq=False, init=False)
class CheckedPath:
    """An excitation that passed every check of one arm; only `check_path` makes one.

    Attributes:
        excitation: Path and number of periods.
        constraints: What it was checked against.
        slow: One period at a quarter of the speed.
        measured: Ramp up, whole periods, ramp down; begins where the slow round ends.
    """

    excitation: Excitation
    constraints: MotionConstraints
    slow: CheckedLeg
    measured: CheckedLeg

    def __init__(self, *unchecked: Never, **fields: Never) -> None:
        raise TypeError("a CheckedPath is made by check_path, which checks the motion first")

    @property
    def start_rad(self) -> FloatArray:
        """(n,) where both legs begin."""
        leg = self.measured.leg
        return leg.path.evaluate(leg.start_s).position_rad

    def approach_from(self, position_rad: FloatArray) -> CheckedLeg | None:
        """The straight way from where the arm stands to where the legs begin; None where it is there already.

        Args:
            position_rad: (n,) where it stands.

        Raises:
            LimitViolation: the arm stands beyond a joint's limit.
            BlockedWay: something would be touched on the way, or a joint is too weak for it.
        """
        constraints = self.constraints
        line = plan_approach(position_rad, self.start_rad, constraints.limits)
        if line is None:
            return None
        require_joint_limits(line.path.bounds(), line.bounds, constraints)
        objection = torque_objection(line.path, line.bounds, constraints)
        if objection is None:
            objection = constraints.obstacles.objection_on_line(position_rad, self.start_rad)
        if objection is not None:
            raise BlockedWay(f"the straight way {objection}")
        return _checked_leg(line)


def check_path(
    excitation: Excitation, constraints: MotionConstraints, cycle_s: float, *, file: str, key: str
) -> CheckedPath:
    """Check an excitation against everything that a motion of the arm must respect.

    Args:
        excitation: Path and number of periods.
        constraints: Of the arm.
        cycle_s: Time between setpoints.
        file: Where the excitation is named, for messages: a file, or the command line.
        key: Its key or option there.

    Raises:
        LimitViolation: a joint's limit is broken.
        InfeasibleMotion: no ramp onto the path within the limits, or a period that is no whole number of cycles.
        ConfigurationError: the excitation is another arm's, touches something, or requires more torque than a joint
            has.
    """
    path, limits = excitation.trajectory, constraints.limits
    n = len(limits.joint_names)
    if path.n != n:
        raise ConfigurationError(file, key, f"a path of {path.n} joints", f"one of this arm's {n} joints")
    legs = plan_legs(excitation, limits, cycle_s)
    phase = legs.measured.bounds
    require_joint_limits(path.bounds(), phase, constraints)
    objection = torque_objection(path, phase, constraints)
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
        ("slow", _checked_leg(legs.slow)),
        ("measured", _checked_leg(legs.measured)),
    ):
        object.__setattr__(checked, name, value)
    return checked


def _checked_leg(leg: Leg) -> CheckedLeg:
    """Mark a leg as checked, past the constructor that refuses everybody else."""
    checked = object.__new__(CheckedLeg)
    object.__setattr__(checked, "leg", leg)
    return checked
