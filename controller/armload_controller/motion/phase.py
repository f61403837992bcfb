"""The phase of a path as a motion of its own: states, legs, and jerk-limited ramps between states by Ruckig."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

from ruckig import (
    ControlInterface,
    DurationDiscretization,
    InputParameter,
    Result,
    Ruckig,
    RuckigError,
    Trajectory,
)

from armload_controller.motion.paths import InfeasibleMotion, Path, PhaseLimits

GRID_TRIES = 6
"""Grid points that a ramp onto the grid may end on; the soonest is taken."""
GRID_PATIENCE_CYCLES = 25
"""A ramp onto the grid may take this much longer than one that need not hit it; else it goes by half the rate."""
BEGINNING_CYCLES = 64
"""Rows of a new ramp that are searched for a rate below zero."""
CLOSE = 1e-9
"""Rates and phases this close are the same."""


class Segment(StrEnum):
    """Which part of a run a setpoint belongs to."""

    APPROACH = "approach"
    SLOW = "slow"
    """On the path at another rate than 1: the slow round, overrides, pauses and what leads there and back."""
    RAMP_UP = "ramp_up"
    PERIODS = "periods"
    RAMP_DOWN = "ramp_down"
    HOLD = "hold"
    """At rest, where torque is ramped in and out."""


@dataclass(frozen=True, slots=True)
class PhaseState:
    """Where the phase is.

    Attributes:
        phase_s: Phase.
        rate: Its derivative to time.
        acceleration_1_s: Its second derivative.
    """

    phase_s: float
    rate: float
    acceleration_1_s: float


@dataclass(frozen=True, eq=False)
class Leg:
    """One way from rest to rest along a path.

    Attributes:
        path: The path.
        bounds: What its phase may do.
        start_s: Phase at which it begins, at rest.
        end_s: Where it ends: at rest (`rest_at_end`), or where whole periods end and the ramp down begins.
        rate: Its rate, 1 or less.
        segment: What its rows are recorded as; PERIODS for a leg with ramps and whole periods.
    """

    path: Path
    bounds: PhaseLimits
    start_s: float
    end_s: float
    rate: float
    segment: Segment

    @property
    def rest_at_end(self) -> bool:
        """Whether the leg ends at rest at `end_s`; a leg of whole periods passes it and ramps down."""
        return self.segment is not Segment.PERIODS


class PhaseRamp:
    """A jerk-limited transition of the phase, sampled at whole cycles.

    Args:
        problem: Ruckig's, one degree of freedom; its limits are set here.
        bounds: Limits of the phase.
        cycle_s: Time between rows.

    Attributes:
        cycles: Rows of the ramp, the start left out; at least 1.

    Raises:
        InfeasibleMotion: Ruckig finds none.
    """

    def __init__(self, problem: InputParameter, bounds: PhaseLimits, cycle_s: float) -> None:
        problem.duration_discretization = DurationDiscretization.Discrete
        problem.max_acceleration, problem.max_jerk = [bounds.acceleration_1_s], [bounds.jerk_1_s2]
        self._trajectory = Trajectory(1)
        try:
            result = Ruckig(1, cycle_s).calculate(problem, self._trajectory)
        except RuckigError as error:
            raise InfeasibleMotion(f"Ruckig finds no motion within the limits: {error}") from error
        if result not in (Result.Working, Result.Finished):
            raise InfeasibleMotion(f"Ruckig finds no motion within the limits: {result}")
        self._cycle_s = cycle_s
        self.cycles = max(1, round(self._trajectory.duration / cycle_s))

    def row(self, cycle: int) -> PhaseState:
        """State `cycle` cycles after the start."""
        time_s = min(cycle * self._cycle_s, self._trajectory.duration)
        phase, rate, acceleration = self._trajectory.at_time(time_s)[:3]
        return PhaseState(phase[0], rate[0], acceleration[0])

    @property
    def lowest_rate(self) -> float:
        """The lowest rate at its beginning, where the state it starts from is still felt."""
        return min(self.row(cycle).rate for cycle in range(1, min(self.cycles, BEGINNING_CYCLES) + 1))

    @property
    def end(self) -> PhaseState:
        """Where it ends."""
        return self.row(self.cycles)


def ramp_to_rate(state: PhaseState, rate: float, bounds: PhaseLimits, cycle_s: float) -> PhaseRamp:
    """The quickest way to a rate, wherever that ends."""
    problem = _problem(state)
    problem.control_interface = ControlInterface.Velocity
    problem.target_velocity = [rate]
    return PhaseRamp(problem, bounds, cycle_s)


def ramp_to_rest_at(state: PhaseState, phase_s: float, rate: float, bounds: PhaseLimits, cycle_s: float) -> PhaseRamp:
    """The quickest way to rest at a phase, at most at a rate."""
    problem = _problem(state)
    problem.target_position, problem.target_velocity = [phase_s], [0.0]
    problem.max_velocity = [rate]
    return PhaseRamp(problem, bounds, cycle_s)


def ramp_to_grid(state: PhaseState, bounds: PhaseLimits, cycle_s: float) -> PhaseRamp:
    """The quickest way to rate 1 at a phase that is a whole number of cycles; None of it runs backwards.

    From some states with much acceleration left no such ramp is quick; from them it goes to half the rate, and the
    caller asks again from there.
    """
    free = ramp_to_rate(state, 1.0, bounds, cycle_s)
    first = free.end.phase_s / cycle_s
    if abs(first - round(first)) < CLOSE / cycle_s:
        return free
    best: PhaseRamp | None = None
    for further in range(GRID_TRIES):
        problem = _problem(state)
        problem.target_position = [(math.ceil(first) + further) * cycle_s]
        problem.target_velocity, problem.max_velocity = [1.0], [1.0]
        try:
            ramp = PhaseRamp(problem, bounds, cycle_s)
        except InfeasibleMotion:
            continue
        if best is None or ramp.cycles < best.cycles:
            best = ramp
    if best is None or best.cycles > free.cycles + GRID_PATIENCE_CYCLES:
        return ramp_to_rate(state, 0.5, bounds, cycle_s)
    return best


def _problem(state: PhaseState) -> InputParameter:
    problem = InputParameter(1)
    problem.current_position = [state.phase_s]
    problem.current_velocity = [state.rate]
    problem.current_acceleration = [state.acceleration_1_s]
    problem.target_acceleration = [0.0]
    return problem
