"""The payload of a calibrated arm on which something may act: held until it is decided what acts.

The recursive estimator runs all the time, and its state is kept every half second. Until something is decided, the
payload of before is reported. A decision for another payload takes the estimator back to before the onset, lets it
forget the payload there, and gives it the samples since. After a push it goes on from before the onset with the samples
after the end. So a push changes nothing in the estimate. Forces are looked for in parts that the stamps alone delimit:
the same samples give the same result, however they arrive.

Not for a control loop: a call takes up to some tens of milliseconds.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Final

import numpy as np

from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.calibration.session_gains import SessionGains
from armload_identification.contact.contact_levels import BIN_S, KEPT_S, OVER_S, SETTLED_S, STATE_S
from armload_identification.contact.force_rows import MotionRow, RowMaker
from armload_identification.contact.force_watch import Force, ForceEvent, ForceEventKind, ForceWatch
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.pipeline.estimator_constants import estimator_constants
from armload_identification.pipeline.recursive_estimator import LivePayload, PayloadEstimator
from armload_identification.signals.joint_torque import Transmission

Samples = tuple[FloatArray, FloatArray, FloatArray]
"""(N,) stamps, (N, n) positions, (N, n) efforts."""
_CLOCK_BACK_S: Final = 1.0
"""Stamps that go back by more than this are from a clock that was set."""


class WatchedPayload:
    """Payload and forces of one arm.

    Args:
        chain: The configured arm.
        transmission: Nominal gains, and coupling.
        session: Drift of the gains since the calibration, for the intervals; None to allow for none.

    Raises:
        ModelError: the calibration belongs to another arm.
    """

    def __init__(
        self,
        calibration: ArmCalibration,
        chain: Chain,
        transmission: Transmission,
        session: SessionGains | None = None,
    ) -> None:
        self._arm, self._session = (calibration, chain, transmission), session
        self._estimator = PayloadEstimator(*self._arm, session)
        self._onset_s, self._part_changes = 0.0, 0
        self._events: list[ForceEvent] = []
        self._begin()

    def _begin(self, *unseen: Samples) -> None:
        """Begin to look for forces, in samples that are not processed yet."""
        self._maker = RowMaker(*self._arm[:2], estimator_constants(*self._arm).from_effort)
        self._force = ForceWatch(self._maker.chain, self._arm[0].known_arm.noise_nm ** 2)
        self._states: list[tuple[float, PayloadEstimator]] = []
        self._samples: list[Samples] = []
        self._unseen, self._rows, self._count = list(unseen), list[MotionRow](), 0
        self._part_end_s = -np.inf
        self._held: LivePayload | None = None

    @property
    def force(self) -> Force:
        """Whether something acts."""
        return self._force.state

    @property
    def changes(self) -> int:
        """Number of changes of the payload that were decided."""
        return self._estimator.changes if self._held is None else self._held.changes

    @property
    def has_news(self) -> bool:
        """Whether `take_events` would return any."""
        return bool(self._events)

    def take(self, time_s: FloatArray, position: FloatArray, effort: FloatArray) -> None:
        """Process samples.

        Args:
            time_s: (N,) stamps.
            position: (N, n) joint positions in rad.
            effort: (N, n) as calibrated.
        """
        start = 0
        self._unseen.append((time_s, position, effort))
        while start < time_s.size:
            if self._samples and time_s[start] < self._samples[-1][0][-1] - _CLOCK_BACK_S:
                self._begin((time_s[start:], position[start:], effort[start:]))
            end = start + int(np.searchsorted(time_s[start:], self._part_end_s)) + 1
            piece = time_s[start:end], position[start:end], effort[start:end]
            self._estimator.update_all(*piece)
            self._samples.append(piece)
            self._count += piece[0].size
            if piece[0][-1] >= self._part_end_s:
                self._end_part(float(piece[0][-1]))
            start = end

    def estimate(self) -> LivePayload:
        """The payload; while something acts, that of before."""
        if self._held is None:
            return self._estimator.estimate()
        return replace(self._held, time_s=float(self._samples[-1][0][-1]))

    def take_events(self) -> list[ForceEvent]:
        """What happened since the last call."""
        events, self._events = self._events, []
        return events

    def _end_part(self, now_s: float) -> None:
        """Look for forces in a part."""
        self._part_end_s = now_s + BIN_S
        if self._unseen:  # at once what came at once, also samples of later parts
            self._rows += self._maker.take(*_joined(self._unseen))
            self._unseen = []
        while self._samples[0][0][-1] < now_s - KEPT_S:
            del self._samples[0]
        was = self._force.state
        events: list[ForceEvent] = []
        while self._rows and self._rows[0].number < self._count:
            events += self._force.take(self._rows.pop(0))
        if self._estimator.changes != self._part_changes and was is self._force.state is Force.FREE:
            events += self._force.suspect()
        for event in events:
            self._follow(event)
        self._events += events
        self._part_changes = self._estimator.changes
        if self._force.state is Force.FREE and (not self._states or now_s - self._states[-1][0] >= STATE_S):
            # states are used in turn, because each has the memory of a minute
            full = len(self._states) * STATE_S > KEPT_S
            kept = self._states.pop(0)[1] if full else PayloadEstimator(*self._arm, self._session)
            kept.become(self._estimator)
            self._states.append((now_s, kept))

    def _follow(self, event: ForceEvent) -> None:
        """Hold, exchange or go on."""
        if event.kind is ForceEventKind.ACTING:
            self._onset_s = event.since_s - OVER_S
            before = self._kept_state_before(self._onset_s)
            self._held = None if before is None else before[1].estimate()
        elif event.kind is ForceEventKind.PAYLOAD:
            self._go_back(event.since_s)
            self._estimator.exchange(event.since_s)
            self._replay(event.since_s + SETTLED_S)
        elif event.kind is ForceEventKind.PUSH:
            self._onset_s = min(self._onset_s, event.since_s - OVER_S)
        elif event.kind is ForceEventKind.OVER:
            self._go_back(self._onset_s)
            self._replay(event.time_s)
        if event.kind not in (ForceEventKind.ACTING, ForceEventKind.PUSH):
            self._held = None

    def _kept_state_before(self, time_s: float) -> tuple[float, PayloadEstimator] | None:
        """The last kept state before a time."""
        return next((each for each in reversed(self._states) if each[0] <= time_s), None)

    def _go_back(self, time_s: float) -> None:
        """The estimator as it was at a time."""
        before = self._kept_state_before(time_s)
        if before is None:
            return
        self._estimator.become(before[1])
        self._replay(before[0], time_s)
        self._states = [each for each in self._states if each[0] <= time_s]

    def _replay(self, after_s: float, until_s: float = np.inf) -> None:
        """Give the estimator kept samples again."""
        time_s, position, effort = _joined(self._samples)
        again = (after_s < time_s) & (time_s <= until_s)
        self._estimator.update_all(time_s[again], position[again], effort[again])


def _joined(pieces: list[Samples]) -> tuple[FloatArray, ...]:
    """Samples in turn."""
    return tuple(np.concatenate(values) for values in zip(*pieces, strict=True))
