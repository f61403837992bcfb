"""Feed-forward that adapts to the estimated payload: a plug-in of the cycle around estimator and injection.

The cycle only keeps the feedback. Estimator and the watch for forces process it outside the cycle, every `TAKE_S`; an
estimate, and the nearest physically possible body, which take tens of milliseconds, are computed every `LOOK_S`. The
body is what is fed forward, and therefore what is checked, compared and recorded. It is fed once two in succession
agree and satisfy all rules; the first violation removes all torque. When something acts on the moving arm, what is fed
is frozen until it is decided what it is: another payload removes the torque, and after a push nothing has changed. If
a look takes longer than `STALE_S`, nobody watches, and all torque is removed.

The injection (`FeedforwardPlugin`) adds the torque, with its transition, on the joints found usable, and through the
gate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import asdict, dataclass
from enum import StrEnum
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from armload_controller.cycle.plugins import CycleStep
from armload_controller.feedforward.adaptation_rules import AdaptationRules, carried_body, mass_and_center
from armload_controller.feedforward.feedforward_plugin import FeedforwardPlugin
from armload_identification.contact.force_watch import Force
from armload_identification.contact.watched_payload import WatchedPayload
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError
from armload_identification.model.payload import FLANGE, InertialParameters, PayloadResult, Provenance
from armload_identification.pipeline.recursive_estimator import LivePayload
from armload_identification.recording.reading_options import Effort

LOOK_S: Final = 1.0
"""Time between two estimates."""
TAKE_S: Final = 0.1
"""Time between two looks at the feedback for a force."""
STALE_S: Final = 1.0
"""Longest time of a look; one takes some tens of milliseconds."""
FEED_S: Final = 0.5
"""Time in which a payload, or a refined estimate of it, is faded in."""
DROP_S: Final = 0.2
"""Time in which its torque is removed."""
BETTER: Final = 0.05
BETTER_M: Final = 0.01
"""A body replaces the one being fed if it differs by this share of the mass, or by this length."""
_MASS_AND_CENTER: Final = np.arange(10) < 4


@dataclass(frozen=True, eq=False)
class Look:
    """An estimate computed outside the cycle.

    Attributes:
        found: The estimate; None if its equations could not be solved.
        body: The body to feed; None if it must not be fed.
        doubt: The reason why not; empty if it may be fed.
        changes: Number of changes of the payload so far.
        force: Whether something acts.
        estimated: Whether there is an estimate in this look.
    """

    found: LivePayload | None
    body: InertialParameters | None
    doubt: str = ""
    changes: int = 0
    force: Force = Force.FREE
    estimated: bool = True


@dataclass(frozen=True, eq=False)
class Candidate:
    """A body that may be fed.

    Attributes:
        found: The estimate.
        body: The body to feed.
    """

    found: LivePayload
    body: InertialParameters

    def agrees(self, before: Candidate) -> bool:
        """Whether the bodies of two estimates can be the same payload."""
        apart = np.abs(mass_and_center(self.body) - mass_and_center(before.body))
        return bool(np.all(apart <= np.maximum(self.found.half_width_95, before.found.half_width_95)))

    def is_worth(self, fed: InertialParameters) -> bool:
        """Whether the body differs enough to replace the one being fed."""
        apart = np.abs(mass_and_center(self.body) - mass_and_center(fed))
        return bool(apart[0] > BETTER * fed.mass_kg or apart[1:].max() > BETTER_M)


Beside = Callable[[Callable[[], Look]], "Future[Look]"]
"""Computes a look outside the cycle."""


class DecisionKind(StrEnum):
    """Kind of a decision."""

    FED = "fed"
    """A payload's torque is faded in."""
    REFINED = "refined"
    """A refined estimate replaces it."""
    FROZEN = "frozen"
    """Something acts: what is fed stays as it is until it is decided what acts."""
    DROPPED = "dropped"
    """All torque is removed."""
    REFUSED = "refused"
    """Nothing is fed, and an estimate was rejected."""


@dataclass(frozen=True)
class AdaptationDecision:
    """One decision.

    Attributes:
        time_s: Time stamp of the feedback that it followed.
        kind: Kind of the decision.
        reason: The reason, for the operator; empty if a payload is fed.
        mass_kg: Estimated mass; None, as the next two, if the equations could not be solved.
        half_width_95_kg: Half width of its 95 % interval.
        center_of_mass_m: Estimated centre of mass, in the flange frame.
        fed_mass_kg: Mass of the body fed from then on, the possible one nearest to the estimate; None if nothing is
            fed.
        fed_center_of_mass_m: Its centre of mass, in the flange frame.
    """

    time_s: float
    kind: DecisionKind
    reason: str
    mass_kg: float | None
    half_width_95_kg: float | None
    center_of_mass_m: tuple[float, ...] | None
    fed_mass_kg: float | None
    fed_center_of_mass_m: tuple[float, ...] | None

    @classmethod
    def of(
        cls, time_s: float, kind: DecisionKind, reason: str, found: LivePayload | None, body: InertialParameters | None
    ) -> AdaptationDecision:
        """A decision with the figures of its estimate.

        Args:
            time_s: Time stamp of the feedback that it followed.
            kind: Kind of the decision.
            reason: The reason, for the operator.
            found: The estimate, if any.
            body: The body fed from then on; None if nothing is fed.
        """
        nothing = None, None, None
        estimate = found and (found.mass_kg, float(found.half_width_95[0]), tuple(found.values[1:].tolist()))
        fed = body and (body.mass_kg, tuple(body.center_of_mass_m.tolist()))
        return cls(time_s, kind, reason, *(estimate or nothing), *(fed or nothing[:2]))

    def __str__(self) -> str:
        """One line of text."""
        what = f"{self.time_s:8.2f} s  {self.kind}"
        if self.mass_kg is not None:
            what += f": {self.mass_kg:.2f} +- {self.half_width_95_kg:.2f} kg"
        if self.fed_mass_kg is not None and self.fed_center_of_mass_m is not None:
            center = ", ".join(f"{1e3 * value:.0f}" for value in self.fed_center_of_mass_m)
            what += f", as {self.fed_mass_kg:.2f} kg at ({center}) mm"
        return what + (f", {self.reason}" if self.reason else "")

    def to_dict(self) -> dict[str, Any]:
        """For a JSON document."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}


def at_once(look: Callable[[], Look]) -> Future[Look]:
    """Compute the look in the cycle itself: for simulations in virtual time, which must be reproducible."""
    made: Future[Look] = Future()
    made.set_result(look())
    return made


class PayloadAdaptation:
    """Estimator, rules and injection as one plug-in.

    Args:
        watched: Payload and forces of the calibrated arm.
        effort: The effort that it was calibrated with.
        rules: Check the estimates.
        feedforward: Adds the torque once allowed; starts without payload.
        beside: Computes estimates outside the cycle.
        report: Called with every decision.

    Attributes:
        decisions: All decisions so far.
    """

    name = "adaptation"

    def __init__(
        self,
        watched: WatchedPayload,
        effort: Effort,
        rules: AdaptationRules,
        feedforward: FeedforwardPlugin,
        *,
        beside: Beside = at_once,
        report: Callable[[AdaptationDecision], None] = lambda decision: None,
    ) -> None:
        self.decisions: list[AdaptationDecision] = []
        self._watched, self._rules, self._feedforward = watched, rules, feedforward
        self._with_torque = effort is Effort.TORQUE
        self._kept: list[tuple[float, FloatArray, FloatArray]] = []
        self._run_beside, self._report = beside, report
        self._pending: Future[Look] | None = None
        self._last_look_s = self._last_take_s = -np.inf
        self._frozen = False
        self._change_count = 0
        self._fed: Candidate | None = None
        self._candidate: Candidate | None = None
        self._last_refusal = ""

    @property
    def fade_in_cycles(self) -> int:
        """Number of cycles from `allow` until the full torque is added."""
        return self._feedforward.fade_in_cycles

    def allow(self, joints: NDArray[np.bool_]) -> None:
        """Start adding torque, for decisions already made and for later ones.

        Args:
            joints: (n,) joints on which torque may be added, from `OffsetCheck`.
        """
        self._feedforward.allow(joints)

    def on_cycle(self, step: CycleStep) -> FloatArray:
        """Process the feedback, decide on a new estimate if there is one, and add the torque."""
        feedback, time_s = step.feedback, step.feedback.time_s
        effort = feedback.torque_nm if self._with_torque else feedback.current_a
        if effort is not None and not feedback.missing.any():
            self._kept.append((time_s, feedback.position_rad.copy(), effort.copy()))
        if self._pending is not None and self._pending.done():
            look, self._pending = self._pending.result(), None
            self._follow(time_s, look)
        elif self._pending is not None and self._fed is not None and time_s - self._last_take_s > STALE_S:
            self._candidate = None
            self._remove_torque(time_s, self._fed.found, f"no estimate has been made for {STALE_S:g} s")
        if self._pending is None and time_s - self._last_take_s >= TAKE_S - 1e-9:
            self._last_take_s = time_s
            estimated = time_s - self._last_look_s >= LOOK_S
            self._last_look_s = time_s if estimated else self._last_look_s
            kept, self._kept = self._kept, []
            self._pending = self._run_beside(partial(self._processed, kept, estimated=estimated))
        return self._feedforward.on_cycle(step)

    def _follow(self, time_s: float, look: Look) -> None:
        """Freeze, drop or decide after a look."""
        if look.force is not Force.FREE:
            self._candidate = None
            if not self._frozen and self._fed is not None:
                self._report_decision(time_s, DecisionKind.FROZEN, self._fed.found, f"{look.force}")
            self._frozen = True
            return
        self._frozen = False
        if look.changes != self._change_count:
            self._change_count = look.changes
            self._candidate = None
            if self._fed is not None:
                self._remove_torque(time_s, self._fed.found, "the payload has changed")
        if look.estimated:
            self._decide(time_s, look)

    def _processed(self, kept: Sequence[tuple[float, FloatArray, FloatArray]], *, estimated: bool) -> Look:
        """Process feedback, and compute an estimate and the body that would be fed; runs outside the cycle."""
        watched = self._watched
        if kept:
            time_s, position, effort = (np.array(values) for values in zip(*kept, strict=True))
            watched.take(time_s, position, effort)
        seen = partial(Look, changes=watched.changes, force=watched.force, estimated=estimated)
        if not estimated or watched.force is not Force.FREE:
            return seen(None, None)
        try:
            found = watched.estimate()
        except np.linalg.LinAlgError:
            return seen(None, None, "the equations of the estimate cannot be solved")
        doubt = self._rules.why_not(found)
        if doubt is not None:
            return seen(found, None, doubt)
        try:
            body = carried_body(found)
        except EstimationError:
            body = None
        if body is None:
            return seen(found, None, "no possible body is near the estimate")
        doubt = self._rules.why_not_fed(found, body)
        return seen(found, body) if doubt is None else seen(found, None, doubt)

    def _decide(self, time_s: float, look: Look) -> None:
        """Decide what to do with an estimate."""
        if look.found is None or look.body is None:
            self._candidate = None
            if self._fed is not None:
                self._remove_torque(time_s, look.found, look.doubt)
            elif look.doubt != self._last_refusal:
                self._last_refusal = look.doubt
                self._report_decision(time_s, DecisionKind.REFUSED, look.found, look.doubt)
            return
        before, self._candidate = self._candidate, Candidate(look.found, look.body)
        if before is None or not self._candidate.agrees(before):
            return
        if self._fed is None:
            self._feed(time_s, DecisionKind.FED, self._candidate)
        elif self._candidate.is_worth(self._fed.body):
            self._feed(time_s, DecisionKind.REFINED, self._candidate)

    def _feed(self, time_s: float, kind: DecisionKind, candidate: Candidate) -> None:
        """Pass a body to the injection, which checks it like any payload."""
        self._feedforward.set_payload(_result(candidate.body, self._feedforward), FEED_S)
        self._fed, self._last_refusal = candidate, ""
        self._report_decision(time_s, kind, candidate.found, "")

    def _remove_torque(self, time_s: float, found: LivePayload | None, why: str) -> None:
        """Remove all torque."""
        self._feedforward.drop_payload(DROP_S)
        self._fed, self._last_refusal = None, why
        self._report_decision(time_s, DecisionKind.DROPPED, found, why)

    def _report_decision(self, time_s: float, kind: DecisionKind, found: LivePayload | None, why: str) -> None:
        """Record a decision."""
        decision = AdaptationDecision.of(time_s, kind, why, found, None if self._fed is None else self._fed.body)
        self.decisions.append(decision)
        self._report(decision)


def _result(body: InertialParameters, feedforward: FeedforwardPlugin) -> PayloadResult:
    """A body as a payload for the injection; only mass and centre of mass count as determined."""
    values = np.stack([body.values, body.values], axis=1)
    nothing = np.zeros(feedforward.chain.n)
    provenance = Provenance("", "", {}, robot=feedforward.robot)
    return PayloadResult(FLANGE, body, _MASS_AND_CENTER, values, nothing, nothing, provenance)
