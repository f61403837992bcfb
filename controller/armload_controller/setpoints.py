"""Setpoints: from where the arm stands onto the excitation's path, along it, and to rest on it.

The path is the excitation q(s) over its phase s, in seconds. What varies is the phase rate ds/dt: 0 at
rest, 1 in the measured periods. Since every ramp and every stop is a change of the phase rate, the arm
never leaves the path that was checked:

    dq/dt   = q'(s) r                   r = ds/dt
    d2q/dt2 = q''(s) r^2 + q'(s) dr/dt

A `MotionPlan` holds every setpoint of a run before anything moves, so that it can be checked as a whole.
`RuckigFollower` is the last instance before the drives: it passes a feasible reference through unchanged
(within 4e-10 rad) and turns anything else into a jerk-limited motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from ruckig import (
    ControlInterface,
    DurationDiscretization,
    InputParameter,
    OutputParameter,
    Result,
    Ruckig,
    Synchronization,
    Trajectory,
)

from armload_controller.errors import ControlError
from armload_controller.limits import MotionLimits
from armload_drivers.servos import FloatArray
from armload_identification.fourier import Excitation, FourierTrajectory

APPROACH_SHARE = 0.25
"""Share of the velocity and acceleration limits that the approach uses."""
RAMP_ACCELERATION_SHARE = 0.95
"""Share of a joint's acceleration limit that path and ramp together use."""
CYCLE_ROUNDING = 1e-6
"""Share of a cycle by which a period may differ from a whole number of cycles."""
SHORTEST_RAMP_S = 0.5
"""A phase ramp lasts at least about this long, however strong the arm."""


class Segment(StrEnum):
    """Which part of a run a setpoint belongs to."""

    APPROACH = "approach"
    RAMP_UP = "ramp_up"
    PERIODS = "periods"
    RAMP_DOWN = "ramp_down"


class InfeasibleMotion(ControlError):
    """Ruckig finds no motion between two states within the limits."""


@dataclass(frozen=True, slots=True)
class PhaseLimits:
    """Bounds of the phase's second and third derivative, from the path's own derivatives."""

    acceleration_1_s: float
    jerk_1_s2: float


@dataclass(frozen=True, slots=True)
class MotionPlan:
    """Every setpoint of a run; N cycles, n joints.

    Attributes:
        position_rad: (N, n).
        velocity_rad_s: (N, n).
        acceleration_rad_s2: (N, n).
        phase_s: (N,) phase of the path; NaN in the approach.
        phase_rate: (N,) ds/dt; NaN in the approach.
        phase_acceleration_1_s: (N,) its derivative; NaN in the approach.
        segment: (N,) part of the run.
    """

    position_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    phase_s: FloatArray
    phase_rate: FloatArray
    phase_acceleration_1_s: FloatArray
    segment: tuple[Segment, ...]

    def __len__(self) -> int:
        return len(self.segment)


def plan_path(excitation: Excitation, limits: MotionLimits, cycle_s: float) -> MotionPlan:
    """Ramp up, whole periods, ramp down: everything but the way there.

    Args:
        excitation: Path and number of periods.
        limits: Of the joints.
        cycle_s: Time between setpoints.

    Raises:
        InfeasibleMotion: no ramp within the limits, or a period that is no whole number of cycles.
    """
    path = excitation.trajectory
    in_period = path.period_s / cycle_s
    if abs(in_period - round(in_period)) > CYCLE_ROUNDING:
        raise InfeasibleMotion(
            f"one period of {path.period_s:g} s is {in_period:.3f} cycles of {cycle_s * 1e3:g} ms: choose a rate at "
            "which it is a whole number of cycles"
        )
    phase_limits = bound_phase(path, limits)
    up = _phase_ramp(0.0, 0.0, 1.0, phase_limits, cycle_s)
    up = np.vstack([np.zeros(3), up])
    up[:, 0] -= up[-1, 0]
    cycles = round(excitation.periods * path.period_s / cycle_s)
    whole = np.column_stack([np.arange(1, cycles + 1) * cycle_s, np.ones(cycles), np.zeros(cycles)])
    down = _phase_ramp(1.0, 0.0, 0.0, phase_limits, cycle_s)
    down[:, 0] += cycles * cycle_s
    return _along(
        path,
        np.vstack([up, whole, down]),
        (Segment.RAMP_UP,) * len(up) + (Segment.PERIODS,) * len(whole) + (Segment.RAMP_DOWN,) * len(down),
    )


def plan_run(start_rad: FloatArray, on_path: MotionPlan, limits: MotionLimits, cycle_s: float) -> MotionPlan:
    """The way to where a path plan begins, and the plan itself.

    Args:
        start_rad: (n,) position the arm stands at.
        on_path: What `plan_path` made.
        limits: Of the joints.
        cycle_s: Time between setpoints.

    Raises:
        InfeasibleMotion: no approach within the limits.
    """
    return _join(_approach(start_rad, on_path.position_rad[0], limits, cycle_s), on_path)


def plan_stop(plan: MotionPlan, row: int, path: FourierTrajectory, limits: MotionLimits, cycle_s: float) -> MotionPlan:
    """From one row of a plan to rest, along the path.

    Raises:
        InfeasibleMotion: the row lies in the approach, where there is no path to stop on.
    """
    rate, acceleration = plan.phase_rate[row], plan.phase_acceleration_1_s[row]
    if np.isnan(rate):
        raise InfeasibleMotion("the approach is not on the path: stop with the drives' own quick stop")
    ramp = _phase_ramp(rate, acceleration, 0.0, bound_phase(path, limits), cycle_s)
    ramp[:, 0] += plan.phase_s[row]
    return _along(path, ramp, (Segment.RAMP_DOWN,) * len(ramp))


def bound_phase(path: FourierTrajectory, limits: MotionLimits) -> PhaseLimits:
    """Phase acceleration and jerk that keep every joint within its limits, anywhere on the path.

    Raises:
        InfeasibleMotion: the path itself uses up a joint's acceleration or jerk.
    """
    samples = path.evaluate(np.linspace(0.0, path.period_s, 512, endpoint=False))
    v, a, j = (
        np.abs(x).max(axis=0) for x in (samples.velocity_rad_s, samples.acceleration_rad_s2, samples.jerk_rad_s3)
    )
    moving = v > 0
    if not moving.any():
        return PhaseLimits(1 / SHORTEST_RAMP_S, 1 / SHORTEST_RAMP_S**2)
    spare = RAMP_ACCELERATION_SHARE * limits.acceleration_max_rad_s2 - a
    acceleration = min(1 / SHORTEST_RAMP_S, float((spare[moving] / v[moving]).min()))
    spare_jerk = limits.jerk_max_rad_s3 - j - 3 * a * max(acceleration, 0.0)
    jerk = min(4 / SHORTEST_RAMP_S**2, float((spare_jerk[moving] / v[moving]).min()))
    if acceleration <= 0 or jerk <= 0:
        joint = limits.joint_names[int(np.argmin(np.where(moving, spare, np.inf)))]
        raise InfeasibleMotion(
            f"{joint}: the excitation leaves no acceleration for getting onto it: design it with at most 90 % of "
            "the joint's acceleration_max_rad_s2"
        )
    return PhaseLimits(acceleration, jerk)


class RuckigFollower:
    """The last instance before the drives: every setpoint passes through Ruckig."""

    def __init__(self, start_rad: FloatArray, limits: MotionLimits, cycle_s: float) -> None:
        n = len(start_rad)
        self._otg = Ruckig(n, cycle_s)
        self._input = InputParameter(n)
        self._output = OutputParameter(n)
        self._input.synchronization = Synchronization.Time
        self._input.duration_discretization = DurationDiscretization.Discrete
        self._input.max_velocity = limits.velocity_max_rad_s
        self._input.max_acceleration = limits.acceleration_max_rad_s2
        self._input.max_jerk = limits.jerk_max_rad_s3
        self._input.current_position = start_rad
        self._input.current_velocity = np.zeros(n)
        self._input.current_acceleration = np.zeros(n)

    def follow(
        self, position_rad: FloatArray, velocity_rad_s: FloatArray, acceleration_rad_s2: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The state to command for this cycle: the reference itself, or the nearest feasible one.

        Raises:
            InfeasibleMotion: Ruckig refuses the reference.
        """
        self._input.target_position = position_rad
        self._input.target_velocity = velocity_rad_s
        self._input.target_acceleration = acceleration_rad_s2
        result = self._otg.update(self._input, self._output)
        if result not in (Result.Working, Result.Finished):
            raise InfeasibleMotion(f"Ruckig refuses a setpoint: {result}")
        self._output.pass_to_input(self._input)
        return (
            np.array(self._output.new_position),
            np.array(self._output.new_velocity),
            np.array(self._output.new_acceleration),
        )


def _approach(start_rad: FloatArray, goal_rad: FloatArray, limits: MotionLimits, cycle_s: float) -> MotionPlan:
    """Rest to rest, at a share of the limits; the last setpoint is the goal."""
    n = len(start_rad)
    problem = InputParameter(n)
    problem.duration_discretization = DurationDiscretization.Discrete
    problem.current_position, problem.target_position = start_rad, goal_rad
    problem.max_velocity = APPROACH_SHARE * limits.velocity_max_rad_s
    problem.max_acceleration = APPROACH_SHARE * limits.acceleration_max_rad_s2
    problem.max_jerk = APPROACH_SHARE * limits.jerk_max_rad_s3
    states = _sample(problem, cycle_s)
    nothing = np.full(len(states), np.nan)
    return MotionPlan(
        states[:, 0], states[:, 1], states[:, 2], nothing, nothing, nothing, (Segment.APPROACH,) * len(states)
    )


def _phase_ramp(rate: float, acceleration: float, goal: float, bounds: PhaseLimits, cycle_s: float) -> FloatArray:
    """(N, 3) phase, rate and acceleration per cycle from one rate to another; the phase starts at 0."""
    problem = InputParameter(1)
    problem.control_interface = ControlInterface.Velocity
    problem.duration_discretization = DurationDiscretization.Discrete
    problem.current_position, problem.current_velocity = [0.0], [rate]
    problem.current_acceleration = [acceleration]
    problem.target_velocity, problem.target_acceleration = [goal], [0.0]
    problem.max_acceleration, problem.max_jerk = [bounds.acceleration_1_s], [bounds.jerk_1_s2]
    return _sample(problem, cycle_s)[:, :, 0]


def _sample(problem: InputParameter, cycle_s: float) -> FloatArray:
    """(N, 3, dof) position, velocity and acceleration at every cycle, the start left out."""
    dof = problem.degrees_of_freedom
    trajectory = Trajectory(dof)
    result = Ruckig(dof, cycle_s).calculate(problem, trajectory)
    if result not in (Result.Working, Result.Finished):
        raise InfeasibleMotion(f"Ruckig finds no motion within the limits: {result}")
    cycles = max(1, round(trajectory.duration / cycle_s))
    times = np.arange(1, cycles + 1) * cycle_s
    return np.array([trajectory.at_time(min(t, trajectory.duration))[:3] for t in times])


def _along(path: FourierTrajectory, phase: FloatArray, segment: tuple[Segment, ...]) -> MotionPlan:
    """The plan that runs along the path; phase is (N, 3) phase, rate, acceleration."""
    s, rate, acceleration = phase.T
    state = path.evaluate(s)
    return MotionPlan(
        state.position_rad,
        state.velocity_rad_s * rate[:, None],
        state.acceleration_rad_s2 * rate[:, None] ** 2 + state.velocity_rad_s * acceleration[:, None],
        s,
        rate,
        acceleration,
        segment,
    )


def _join(first: MotionPlan, second: MotionPlan) -> MotionPlan:
    return MotionPlan(
        np.vstack([first.position_rad, second.position_rad]),
        np.vstack([first.velocity_rad_s, second.velocity_rad_s]),
        np.vstack([first.acceleration_rad_s2, second.acceleration_rad_s2]),
        np.concatenate([first.phase_s, second.phase_s]),
        np.concatenate([first.phase_rate, second.phase_rate]),
        np.concatenate([first.phase_acceleration_1_s, second.phase_acceleration_1_s]),
        first.segment + second.segment,
    )
