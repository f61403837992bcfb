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

from armload_identification.calibration.calibration_result import ArmCalibration
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
from armload_identification.contact.force_rows import PAYLOAD, ForceRows, RowMaker
from armload_identification.contact.load_or_push import Assessment, assess, payload_evidence
from armload_identification.contact.something_acts import ResidualNoise, Test, acting
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.pipeline.estimator_constants import estimator_constants
from armload_identification.signals.joint_torque import Transmission


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
        chain: The configured arm.
        transmission: Nominal gains, and coupling.

    Attributes:
        state: The present state.

    Raises:
        ModelError: the calibration belongs to another arm.
    """

    def __init__(self, calibration: ArmCalibration, chain: Chain, transmission: Transmission) -> None:
        self._maker = RowMaker(calibration, chain, estimator_constants(calibration, chain, transmission).from_effort)
        self._know_nothing(calibration.known_arm.noise_nm**2)
        self._rows = ForceRows.none(chain.n)
        self._noticed_s = self._evident_s = self._before_s = 0.0
        self._push_end_s = np.inf
        self._looks = list(LOOKS_S)
        self._looked_s = -np.inf
        self._joints = np.zeros(chain.n, dtype=np.bool_)

    def _know_nothing(self, coloured_nm2: FloatArray) -> None:
        """Begin, with (n,) variances of the calibration's residual."""
        self.state = Force.FREE
        self._memory = ArmMemory(PAYLOAD + 3 * self._maker.chain.n)
        self._unlearnt = ForceRows.none(self._maker.chain.n)
        self._noise = ResidualNoise(coloured_nm2, coloured_nm2)
        self._seen_s, self._above = 0.0, 0
        self._last_mean: FloatArray | None = None
        self._base: RememberedState | None = None

    def take(self, time_s: FloatArray, position: FloatArray, effort: FloatArray) -> list[ForceEvent]:
        """Process samples.

        Args:
            time_s: (N,) stamps, increasing.
            position: (N, n) joint positions in rad.
            effort: (N, n) as calibrated.
        """
        known = self._base or self._memory.before(np.inf)
        theta = np.zeros(PAYLOAD) if known is None else known.value[:PAYLOAD] * self._maker.scale
        rows = self._maker.take(time_s, position, effort, theta)
        if not rows.size:
            return []
        remembered_s = rows.time_s[-1] - REMEMBERED_S
        rows = rows.since(remembered_s)  # a pause may lie between them
        self._rows = self._rows.since(remembered_s).and_then(rows)
        self._seen_s += min(float(rows.time_s[-1] - rows.time_s[0]) + 0.02, 0.02 * rows.size)
        predicted = self._base or self._memory.before(float(rows.time_s[0]))
        if predicted is None or self._seen_s < KNOWN_S:
            self._learn(rows)
            return []
        inertia = self._maker.inertia_kg_m2(rows.position_rad[-1])
        test = acting(self._rows, self._rows.size - rows.size, predicted, self._noise, inertia)
        if self._base is None:
            return self._notice(rows, test, predicted)
        if (test.ratio > EVIDENT).any():
            self._evident_s = float(rows.time_s[np.flatnonzero(test.ratio > EVIDENT)[-1]])
        return list(self._decide(self._base, float(rows.time_s[-1])))

    def suspect(self) -> list[ForceEvent]:
        """Something else says, while nothing acts, that the payload has changed: look at it as after a notice."""
        return self._begin(float(self._rows.time_s[-1]), np.zeros_like(self._joints)) if self._rows.size else []

    def _learn(self, rows: ForceRows) -> None:
        """Use rows in which nothing acts, some together."""
        rows = self._unlearnt = self._unlearnt.and_then(rows)
        if rows.size < PART_ROWS:
            return
        self._unlearnt = rows.part(slice(0))
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

    def _notice(self, rows: ForceRows, test: Test, predicted: RememberedState) -> list[ForceEvent]:
        """Begin where the test has been above its bound for long enough, or a payload over some seconds is evident."""
        for k, ratio in enumerate(test.ratio):
            self._above = self._above + 1 if ratio > 1.0 else 0
            if self._above >= HELD_ROWS or ratio > AT_ONCE:
                return self._begin(float(rows.time_s[k]), np.abs(test.joints[k]) > FAR_SIGMAS)
        now_s = float(rows.time_s[-1])
        if self._seen_s >= LOOKS_FROM_S and now_s - self._looked_s >= LOOK_S:
            self._looked_s = now_s
            before = self._memory.before(now_s - BACK_S + OLD_S)
            if before is not None and payload_evidence(self._rows, before, self._noise, now_s) > SUSPECT:
                far = np.abs(test.joints[-1])
                return self._begin(now_s, far >= min(FAR_SIGMAS, float(far.max())))
        if not self._above:
            self._learn(rows)
        return []

    def _begin(self, noticed_s: float, joints: NDArray[np.bool_]) -> list[ForceEvent]:
        """Something acts."""
        self._base = self._memory.before(noticed_s - OVER_S) or self._memory.before(noticed_s)
        if self._base is None:
            return []
        self.state, self._above, self._last_mean = Force.ACTING, 0, None
        self._unlearnt = self._unlearnt.part(slice(0))
        self._noticed_s = self._evident_s = noticed_s
        self._before_s = self._seen_s
        self._looks, self._joints = list(LOOKS_S), joints
        return [ForceEvent(ForceEventKind.ACTING, noticed_s, noticed_s, joints)]

    def _decide(self, base: RememberedState, now_s: float) -> Iterator[ForceEvent]:
        """Look at the event when it is time, and see whether a push is over."""
        if self.state is Force.PUSHED and self._evident_s - self._noticed_s > max(self._before_s, OUTLASTS_S):
            # What lasts longer than all before it is the rule: something acted before it, and what was learnt is wrong.
            self._know_nothing(self._noise.coloured_nm2)
            self._rows = self._rows.part(slice(0))  # they were linearised about the wrong payload
            yield ForceEvent(ForceEventKind.PAYLOAD, now_s, self._noticed_s, self._joints)
            return
        if self._looks and now_s - self._noticed_s >= self._looks[0]:
            due_s = self._looks.pop(0)
            found = assess(self._rows, base, self._noise, self._maker.chain, self._noticed_s)
            self._push_end_s = found.push_s[1]
            yield from self._judge(found, base, now_s, due_s, last=not self._looks)
        if self.state is Force.PUSHED and now_s - self._evident_s >= OVER_S:
            ended_s = min(self._push_end_s, self._evident_s)
            self._resume(payload=True, from_s=self._evident_s + OVER_S)
            yield ForceEvent(ForceEventKind.OVER, now_s, ended_s, self._joints)

    def _judge(
        self, found: Assessment, base: RememberedState, now_s: float, due_s: float, *, last: bool
    ) -> Iterator[ForceEvent]:
        """Decide, if it can be decided."""
        sure = due_s >= PAYLOAD_FROM_S and found.odds > SURE
        likely = sure or (last and self.state is Force.ACTING and found.odds > 0.0)
        if likely and found.evidence > EVIDENCE:
            self._resume(payload=False, from_s=found.payload_since_s + SETTLED_S)
            yield ForceEvent(ForceEventKind.PAYLOAD, now_s, found.payload_since_s, self._joints, found)
        elif last and self.state is Force.ACTING and found.push_evidence < EVIDENCE:
            self._resume(payload=True, from_s=base.time_s)
            yield ForceEvent(ForceEventKind.NOTHING, now_s, self._noticed_s, self._joints)
        elif self.state is Force.ACTING and (found.odds < -PUSH_SURE or last):
            self.state = Force.PUSHED
            yield ForceEvent(ForceEventKind.PUSH, now_s, found.push_s[0], self._joints, found)

    def _resume(self, *, payload: bool, from_s: float) -> None:
        """Go on with the same payload or another one."""
        if self._base is not None:
            self._memory.begin_anew(self._base, payload=payload)
        self._rows = self._rows.since(from_s)
        if self._rows.size:
            self._memory.add(self._rows, self._noise.density)
        self.state, self._base, self._above = Force.FREE, None, 0
