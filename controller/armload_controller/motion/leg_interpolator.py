"""Interpolation of a leg, one row per cycle, replanned whenever the operator's goal changes.

Rows of (phase, rate, acceleration) come from ramps (`phase`), with rows at constant rate in between. Rules:

- The rate is never negative and never above the leg's.
- Measured periods run at rate 1 with the phase on the grid of cycles. After a pause the ramp ends on a grid point
  (position interface, target rate 1), so that later periods are sampled at the same phases as the first.
- A change of the goal discards all rows after the last one taken and replans from there. That costs a few Ruckig
  calls (8 us each) and one chunk of rows, whatever the leg's length.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

import numpy as np

from armload_controller.motion.motion_control import MotionControl
from armload_controller.motion.paths import Path
from armload_controller.motion.phase import (
    CLOSE,
    Leg,
    PhaseRamp,
    PhaseState,
    Segment,
    ramp_to_grid,
    ramp_to_rate,
    ramp_to_rest_at,
)
from armload_identification.float_array import FloatArray

CHUNK = 32
"""Rows evaluated at once."""


@dataclass(frozen=True, eq=False, slots=True)
class Reference:
    """The reference of one cycle.

    Attributes:
        position_rad: (n,) joint positions.
        velocity_rad_s: (n,) joint velocities.
        acceleration_rad_s2: (n,) joint accelerations.
        segment: Part of the run.
        state: The phase.
    """

    position_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray
    segment: Segment
    state: PhaseState


class _Mode(Enum):
    RAMP = auto()
    STEADY = auto()
    ON_GRID = auto()
    REST = auto()
    PLAN = auto()
    OVER = auto()


class LegInterpolator:
    """Rows of one leg, one per cycle, following the operator's goal.

    Args:
        cycle_s: Time between rows.
        control: The goal; read before every row.
    """

    def __init__(self, leg: Leg, cycle_s: float, control: MotionControl) -> None:
        self._leg, self._cycle_s, self._control = leg, cycle_s, control
        self._sent = PhaseState(leg.start_s, 0.0, 0.0)
        self._goal = control.goal
        self._chunk: list[Reference] = []
        self._next = 0
        self._plan(self._sent)

    @property
    def done(self) -> float:
        """Completed fraction of the leg, 0 to 1."""
        whole = self._leg.end_s - self._leg.start_s
        return min(max((self._sent.phase_s - self._leg.start_s) / whole, 0.0), 1.0) if whole > 0 else 1.0

    def next_reference(self) -> Reference | None:
        """The next row; None if the leg has ended or was stopped."""
        goal = self._control.goal
        if goal != self._goal:
            self._goal = goal
            self._chunk, self._next = [], 0
            self._plan(self._sent)
        if self._next == len(self._chunk):
            rows = [row for row in (self._advance() for _ in range(CHUNK)) if row is not None]
            if not rows:
                return None
            joints = along(self._leg.path, [state for state, _ in rows])
            self._chunk = [
                Reference(*values, segment, state)
                for values, (state, segment) in zip(zip(*joints, strict=True), rows, strict=True)
            ]
            self._next = 0
        reference = self._chunk[self._next]
        self._next += 1
        self._sent = reference.state
        return reference

    # Planning: everything below is up to one chunk ahead of the rows taken. -----------------------------------

    def _plan(self, state: PhaseState) -> None:
        """Choose the next ramp or mode from a state."""
        leg, goal, cycle_s = self._leg, self._goal, self._cycle_s
        self._state = state
        rate = leg.rate * goal.share
        if goal.stop is not None or goal.paused:
            self._come_to_rest(_Mode.OVER if goal.stop is not None else _Mode.REST, Segment.SLOW)
        elif leg.segment is not Segment.PERIODS:  # which pass `end_s`, and then ramp down
            self._go_to_end(rate)
        elif state.phase_s >= leg.end_s - CLOSE:
            self._come_to_rest(_Mode.OVER, Segment.RAMP_DOWN)
        elif rate == 1.0:
            segment = Segment.RAMP_UP if state.phase_s < 0.0 else Segment.SLOW
            self._begin_forward(ramp_to_grid(state, leg.bounds, cycle_s), _Mode.ON_GRID, segment)
        else:
            self._begin_forward(ramp_to_rate(state, rate, leg.bounds, cycle_s), _Mode.STEADY, Segment.SLOW)

    def _go_to_end(self, rate: float) -> None:
        """Come to rest at the leg's end, first slowing down to the given rate if the distance allows it."""
        leg, state, cycle_s = self._leg, self._state, self._cycle_s
        if abs(leg.end_s - state.phase_s) < CLOSE and state.rate < CLOSE:
            self._mode = _Mode.OVER
            return
        coming = max(state.acceleration_1_s, 0.0) ** 2 / (2.0 * leg.bounds.jerk_1_s2) + state.rate
        if coming > rate + CLOSE:
            slower = ramp_to_rate(state, rate, leg.bounds, cycle_s)
            if ramp_to_rate(slower.end, 0.0, leg.bounds, cycle_s).end.phase_s < leg.end_s:
                self._begin(slower, _Mode.PLAN, leg.segment)
                return
            rate = coming
        ramp = ramp_to_rest_at(state, leg.end_s, rate, leg.bounds, cycle_s)
        self._begin_forward(ramp, _Mode.OVER, leg.segment)

    def _begin_forward(self, ramp: PhaseRamp, then: _Mode, segment: Segment) -> None:
        """Begin a ramp, or first come to rest if the ramp would run backwards, as it may just before a rest."""
        if self._state.rate > CLOSE and ramp.lowest_rate < -CLOSE:
            self._come_to_rest(_Mode.PLAN, Segment.SLOW)
        else:
            self._begin(ramp, then, segment)

    def _come_to_rest(self, then: _Mode, segment: Segment) -> None:
        """Come to rest anywhere on the path: all of it was checked."""
        if abs(self._state.rate) < CLOSE and abs(self._state.acceleration_1_s) < CLOSE:
            self._mode, self._segment = then, segment
        else:
            self._begin(ramp_to_rate(self._state, 0.0, self._leg.bounds, self._cycle_s), then, segment)

    def _begin(self, ramp: PhaseRamp, then: _Mode, segment: Segment) -> None:
        self._ramp, self._ramp_row = ramp, 0
        self._mode, self._then = _Mode.RAMP, then
        self._segment = segment

    def _advance(self) -> tuple[PhaseState, Segment] | None:
        """The next row of the plan."""
        match self._mode:
            case _Mode.OVER | _Mode.PLAN:
                return None
            case _Mode.RAMP:
                self._ramp_row += 1
                self._state = state = self._ramp.row(self._ramp_row)
                segment = self._segment
                if self._ramp_row == self._ramp.cycles:
                    self._end_ramp(state)
            case _Mode.REST:
                state, segment = self._state, self._segment
            case _Mode.ON_GRID:
                self._cycle += 1
                self._state = state = PhaseState(self._cycle * self._cycle_s, 1.0, 0.0)
                segment = Segment.PERIODS if self._cycle > 0 else Segment.RAMP_UP
                self._end_periods(state)
            case _Mode.STEADY:
                before, segment = self._state, Segment.SLOW
                phase_s = before.phase_s + before.rate * self._cycle_s
                self._state = state = PhaseState(phase_s, before.rate, 0.0)
                self._end_periods(state)
        return state, segment if self._leg.segment is Segment.PERIODS else self._leg.segment

    def _end_ramp(self, state: PhaseState) -> None:
        """Continue after a ramp's last row."""
        self._mode = self._then
        if self._mode is _Mode.PLAN:
            self._plan(PhaseState(state.phase_s, max(state.rate, 0.0), 0.0))
        elif self._mode is _Mode.ON_GRID:
            self._cycle = round(state.phase_s / self._cycle_s)
            if state.rate < 1.0 - CLOSE:  # the ramp went to half the rate only, see ramp_to_grid
                self._plan(state)
        if self._mode in (_Mode.ON_GRID, _Mode.STEADY):
            self._end_periods(state)

    def _end_periods(self, state: PhaseState) -> None:
        """Ramp down at the end of the periods."""
        if state.phase_s >= self._leg.end_s - CLOSE:
            self._come_to_rest(_Mode.OVER, Segment.RAMP_DOWN)


def along(path: Path, states: list[PhaseState]) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Joint positions, velocities and accelerations (N, n) at phase states."""
    s, rate, acceleration = np.array([(x.phase_s, x.rate, x.acceleration_1_s) for x in states]).T
    state = path.evaluate(s)
    joints = (
        state.position_rad,
        state.velocity_rad_s * rate[:, None],
        state.acceleration_rad_s2 * rate[:, None] ** 2 + state.velocity_rad_s * acceleration[:, None],
    )
    for values in joints:
        values.setflags(write=False)  # plug-ins receive them before the drives do
    return joints
