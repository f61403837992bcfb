"""The phase of a path as a one-dimensional motion: states, legs, and jerk-limited ramps between states by Ruckig."""

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
"""Grid points tried as the end of a ramp onto the grid; the fastest ramp is used."""
GRID_PATIENCE_CYCLES = 25
"""A ramp onto the grid may take this much longer than a free one; otherwise it first goes to half the rate."""
BEGINNING_CYCLES = 64
"""Number of first rows of a ramp that are searched for a negative rate."""
CLOSE = 1e-9
"""Rates and phases this close count as equal."""


class Segment(StrEnum):
    """Which part of a run a setpoint belongs to."""

    APPROACH = "approach"
    SLOW = "slow"
    """On the path at a rate other than 1: the slow round, overrides, pauses, and the transitions to and from them."""
    RAMP_UP = "ramp_up"
    PERIODS = "periods"
    RAMP_DOWN = "ramp_down"
    HOLD = "hold"
    """At rest, while torque is ramped in and out."""


@dataclass(frozen=True, slots=True)
class PhaseState:
    """State of the phase.

    Attributes:
        rate: Its time derivative.
        acceleration_1_s: Its second time derivative.
    """

    phase_s: float
    rate: float
    acceleration_1_s: float


@dataclass(frozen=True, eq=False)
class Leg:
    """A motion from rest to rest along a path.

    Attributes:
        bounds: Limits of its phase.
        start_s: Phase at the start, at rest.
        end_s: Phase at the end: at rest (`rest_at_end`), or where the periods end and the ramp down begins.
        rate: Its rate, at most 1.
        segment: Segment recorded for its rows; PERIODS for a leg with ramps and complete periods.
    """

    path: Path
    bounds: PhaseLimits
    start_s: float
    end_s: float
    rate: float
    segment: Segment


class PhaseRamp:
    """A jerk-limited transition of the phase, sampled at whole cycles.

    Args:
        problem: Ruckig's input for one degree of freedom; its limits are set here.
        cycle_s: Time between rows.

    Attributes:
        cycles: Number of rows without the start; at least 1.

    Raises:
        InfeasibleMotion: Ruckig finds no ramp.
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
        """The lowest rate in its first rows, where the initial acceleration still matters."""
        return min(self.row(cycle).rate for cycle in range(1, min(self.cycles, BEGINNING_CYCLES) + 1))

    @property
    def end(self) -> PhaseState:
        """The final state."""
        return self.row(self.cycles)


def ramp_to_rate(state: PhaseState, rate: float, bounds: PhaseLimits, cycle_s: float) -> PhaseRamp:
    """The fastest ramp to a rate, at any final phase."""
    problem = _problem(state)
    problem.control_interface = ControlInterface.Velocity
    problem.target_velocity = [rate]
    return PhaseRamp(problem, bounds, cycle_s)


def ramp_to_rest_at(state: PhaseState, phase_s: float, rate: float, bounds: PhaseLimits, cycle_s: float) -> PhaseRamp:
    """The fastest ramp to rest at a phase, without exceeding a rate."""
    problem = _problem(state)
    problem.target_position, problem.target_velocity = [phase_s], [0.0]
    problem.max_velocity = [rate]
    return PhaseRamp(problem, bounds, cycle_s)


def ramp_to_grid(state: PhaseState, bounds: PhaseLimits, cycle_s: float) -> PhaseRamp:
    """The fastest ramp to rate 1 at a phase that is a whole number of cycles.

    From some states with high acceleration no such ramp is fast; the ramp then goes to half the rate, and the caller
    plans again from there.
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
