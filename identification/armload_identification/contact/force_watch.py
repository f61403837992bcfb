"""Notice that something acts on a calibrated arm in motion, and decide within 3 s what it is.

    FREE      nothing acts
    ACTING    something acts; what it is, is not decided yet
    PUSHED    it is a push, which lasts

Nothing here belongs in a control loop: a decision takes tens of milliseconds.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from armload_identification.contact.arm_memory import ArmMemory, RememberedState
from armload_identification.contact.contact_levels import (
    AT_ONCE,
    BACK_S,
    COLOUR_S,
    EVIDENCE,
    EVIDENT,
    FAR_SIGMAS,
    HELD_ROWS,
    KNOWN_S,
    LOOK_S,
    LOOKS_FROM_S,
    LOOKS_S,
    OLD_S,
    OUTLASTS_S,
    OVER_S,
    PART_ROWS,
    PAYLOAD_FROM_S,
    PUSH_SURE,
    REMEMBERED_S,
    SETTLED_S,
    SURE,
    SUSPECT,
    WHITE_MEMORY_S,
    WHITE_S,
)
from armload_identification.contact.force_rows import PAYLOAD, ForceRows, MotionRow, RecentRows
from armload_identification.contact.load_or_push import Assessment, assess, payload_evidence
from armload_identification.contact.something_acts import ResidualNoise, acting
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain


class Force(StrEnum):
    """The state of the watch."""

    FREE = "free"
    ACTING = "something acts"
    PUSHED = "push"


class ForceEventKind(StrEnum):
    """What happened."""

    ACTING = "something acts"
    PAYLOAD = "payload"
    PUSH = "push"
    OVER = "over"
    NOTHING = "nothing evident"


@dataclass(frozen=True, eq=False)
class ForceEvent:
    """One step of an event.

    Attributes:
        kind: What happened.
        time_s: Time of the newest row when it was known.
        since_s: Most likely onset; the time of the notice while nothing is decided.
        joints: (n,) True for joints whose residual showed it at the notice.
        assessment: What decided; None for a notice, an end, and where nothing is evident.
    """

    kind: ForceEventKind
    time_s: float
    since_s: float
    joints: NDArray[np.bool_]
    assessment: Assessment | None = None


class ForceWatch:
    """Watches one arm.

    Args:
        chain: The arm, with the tilt of its calibration.
        coloured_nm2: (n,) variances of the calibration's residual.

    Attributes:
        state: The present state.
    """

    def __init__(self, chain: Chain, coloured_nm2: FloatArray) -> None:
        self._chain = chain
        self._know_nothing(coloured_nm2)
        self._noticed_s = self._evident_s = self._before_s = 0.0
        self._push_end_s, self._looked_s = np.inf, -np.inf
        self._looks, self._joints = list(LOOKS_S), np.zeros(chain.n, dtype=np.bool_)

    def _know_nothing(self, coloured_nm2: FloatArray) -> None:
        """Begin, with (n,) variances of the calibration's residual."""
        self.state = Force.FREE
        self._memory = ArmMemory(PAYLOAD + 3 * self._chain.n)
        self._recent = RecentRows(self._chain.n)
        self._unlearnt: list[ForceRows] = []
        self._noise = ResidualNoise(coloured_nm2, coloured_nm2)
        self._seen_s, self._above = 0.0, 0
        self._last_mean: FloatArray | None = None
        self._base: RememberedState | None = None

    def take(self, seen: MotionRow) -> list[ForceEvent]:
        """Process one row."""
        known = self._base or self._memory.before(np.inf)
        row = seen.about(np.zeros(PAYLOAD) if known is None else known.value[:PAYLOAD])
        now_s = float(row.time_s[0])
        self._recent.rows = self._recent.rows.since(now_s - REMEMBERED_S)
        self._recent.add(row)
        self._seen_s += 0.02
        predicted = self._base or self._memory.before(now_s)
        if predicted is None or self._seen_s < KNOWN_S:
            self._learn(row)
            return []
        ratio, joints = acting(self._recent.rows, predicted, self._noise)
        if self._base is None:
            return self._notice(row, ratio, joints)
        if ratio > EVIDENT:
            self._evident_s = now_s
        return list(self._decide(self._base, now_s))

    def suspect(self) -> list[ForceEvent]:
        """Something else says, while nothing acts, that the payload has changed: look at it as after a notice."""
        rows = self._recent.rows
        return self._begin(float(rows.time_s[-1]), np.zeros_like(self._joints)) if rows.size else []

    def _learn(self, row: ForceRows) -> None:
        """Use a row in which nothing acts, some together."""
        self._unlearnt.append(row)
        if len(self._unlearnt) < PART_ROWS:
            return
        rows, self._unlearnt = ForceRows.joined(self._unlearnt), []
        predicted = self._memory.before(float(rows.time_s[0]))
        self._memory.add(rows, self._noise.density)
        if predicted is None:
            return
        white, coloured = self._noise.white_nm2, self._noise.coloured_nm2
        mean = np.mean(rows.residual_nm - rows.columns @ predicted.value, axis=0)
        if self._last_mean is not None:
            apart_s = float(rows.time_s[-1] - rows.time_s[0]) + 0.02
            remembered = coloured * (1.0 - np.exp(-apart_s / COLOUR_S))
            found = np.minimum(0.5 * (mean - self._last_mean) ** 2, 9.0 * (white + remembered)) - remembered
            found = np.maximum(found, 0.0) * apart_s / WHITE_S
            white = white + apart_s / WHITE_MEMORY_S * (found - white)
            self._noise = ResidualNoise(np.maximum(white, 0.05 * coloured), coloured)
        self._last_mean = mean

    def _notice(self, row: ForceRows, ratio: float, joints: FloatArray) -> list[ForceEvent]:
        """Begin where the test has been above its bound for long enough, or a payload over some seconds is evident."""
        now_s, far = float(row.time_s[0]), np.abs(joints)
        self._above = self._above + 1 if ratio > 1.0 else 0
        if self._above >= HELD_ROWS or ratio > AT_ONCE:
            return self._begin(now_s, far > FAR_SIGMAS)
        if self._seen_s >= LOOKS_FROM_S and now_s - self._looked_s >= LOOK_S:
            self._looked_s = now_s
            before = self._memory.before(now_s - BACK_S + OLD_S)
            if before is not None and payload_evidence(self._recent.rows, before, self._noise, now_s) > SUSPECT:
                return self._begin(now_s, far >= min(FAR_SIGMAS, float(far.max())))
        if not self._above:
            self._learn(row)
        return []

    def _begin(self, noticed_s: float, joints: NDArray[np.bool_]) -> list[ForceEvent]:
        """Something acts."""
        self._base = self._memory.before(noticed_s - OVER_S) or self._memory.before(noticed_s)
        if self._base is None:
            return []
        self.state, self._above, self._last_mean, self._unlearnt = Force.ACTING, 0, None, []
        self._noticed_s = self._evident_s = noticed_s
        self._before_s = self._seen_s
        self._looks, self._joints = list(LOOKS_S), joints
        return [ForceEvent(ForceEventKind.ACTING, noticed_s, noticed_s, joints)]

    def _decide(self, base: RememberedState, now_s: float) -> Iterator[ForceEvent]:
        """Look at the event when it is time, and see whether a push is over."""
        if self.state is Force.PUSHED and self._evident_s - self._noticed_s > max(self._before_s, OUTLASTS_S):
            # What lasts longer than all before it is the rule: something acted before it, and what was learnt is wrong,
            # also the payload about which the rows are linearised.
            self._know_nothing(self._noise.coloured_nm2)
            yield ForceEvent(ForceEventKind.PAYLOAD, now_s, self._noticed_s, self._joints)
            return
        if self._looks and now_s - self._noticed_s >= self._looks[0]:
            due_s = self._looks.pop(0)
            found = assess(self._recent.rows, base, self._noise, self._chain, self._noticed_s)
            self._push_end_s = found.push_s[1]
            yield from self._judge(found, base, now_s, due_s, last=not self._looks)
        if self.state is Force.PUSHED and now_s - self._evident_s >= OVER_S:
            ended_s = min(self._push_end_s, self._evident_s)
            self._resume(base, payload=True, from_s=self._evident_s + OVER_S)
            yield ForceEvent(ForceEventKind.OVER, now_s, ended_s, self._joints)

    def _judge(
        self, found: Assessment, base: RememberedState, now_s: float, due_s: float, *, last: bool
    ) -> Iterator[ForceEvent]:
        """Decide, if it can be decided."""
        sure = due_s >= PAYLOAD_FROM_S and found.odds > SURE
        likely = sure or (last and self.state is Force.ACTING and found.odds > 0.0)
        if likely and found.evidence > EVIDENCE:
            self._resume(base, payload=False, from_s=found.payload_since_s + SETTLED_S)
            yield ForceEvent(ForceEventKind.PAYLOAD, now_s, found.payload_since_s, self._joints, found)
        elif last and self.state is Force.ACTING and found.push_evidence < EVIDENCE:
            self._resume(base, payload=True, from_s=base.time_s)
            yield ForceEvent(ForceEventKind.NOTHING, now_s, self._noticed_s, self._joints)
        elif self.state is Force.ACTING and (found.odds < -PUSH_SURE or last):
            self.state = Force.PUSHED
            yield ForceEvent(ForceEventKind.PUSH, now_s, found.push_s[0], self._joints, found)

    def _resume(self, base: RememberedState, *, payload: bool, from_s: float) -> None:
        """Go on with the same payload or another one, from what was known before it."""
        self._memory.begin_anew(base, payload=payload)
        self._recent.rows = self._recent.rows.since(from_s)
        self._memory.add(self._recent.rows, self._noise.density)
        self.state, self._base, self._above = Force.FREE, None, 0
