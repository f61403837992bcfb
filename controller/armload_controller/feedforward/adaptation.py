"""Feed-forward that follows what the arm is found to carry: a plug-in of the cycle around estimator and injection.

Every cycle the estimator takes the feedback, which costs microseconds. Its estimate, and the possible body nearest to
it, take tens of milliseconds and are made beside the cycle, every `LOOK_S`. The body is what is fed, and so what is
checked, compared and recorded: it is fed once two in a row agree and no rule speaks against them; the first doubt takes
all torque away. A payload that changes is noticed in the cycle itself.

How the torque gets there is the injection's (`FeedforwardPlugin`): its transition, the joints that were found usable,
and the gate behind it.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from armload_controller.cycle.plugins import CycleStep
from armload_controller.feedforward.adaptation_rules import AdaptationRules, carried_body, mass_and_center
from armload_controller.feedforward.injection import FeedforwardPlugin
from armload_core.arrays import FloatArray
from armload_identification.identification_errors import EstimationError
from armload_identification.model.payload import InertialParameters, PayloadResult, Provenance
from armload_identification.pipeline.payload_estimator import LivePayload, PayloadEstimator
from armload_identification.pipeline.payload_identification import FLANGE
from armload_identification.recording.reading_options import Effort

LOOK_S: Final = 1.0
"""Time between two estimates."""
FEED_S: Final = 0.5
"""Time in which a payload, or a better estimate of it, is faded in."""
DROP_S: Final = 0.2
"""Time in which it is taken away."""
BETTER: Final = 0.05
BETTER_M: Final = 0.01
"""A body replaces the one that is fed when it differs by this share of the mass, or by this length."""
_MASS_AND_CENTER: Final = np.arange(10) < 4


@dataclass(frozen=True, eq=False)
class Look:
    """What is made beside the cycle.

    Attributes:
        found: The estimate; None where its equations could not be solved.
        body: What is fed of it; None where it must not be.
        doubt: Why it must not be; empty where it may.
    """

    found: LivePayload | None
    body: InertialParameters | None
    doubt: str = ""


@dataclass(frozen=True, eq=False)
class Candidate:
    """What may be fed.

    Attributes:
        found: The estimate.
        body: What is fed of it.
    """

    found: LivePayload
    body: InertialParameters

    def agrees(self, before: Candidate) -> bool:
        """Whether the bodies of two estimates can be one payload.

        Args:
            before: The candidate before.
        """
        apart = np.abs(mass_and_center(self.body) - mass_and_center(before.body))
        return bool(np.all(apart <= np.maximum(self.found.half_width_95, before.found.half_width_95)))

    def is_worth(self, fed: InertialParameters) -> bool:
        """Whether the body is worth a change of what is fed.

        Args:
            fed: The body that is fed.
        """
        apart = np.abs(mass_and_center(self.body) - mass_and_center(fed))
        return bool(apart[0] > BETTER * fed.mass_kg or apart[1:].max() > BETTER_M)


Beside = Callable[[Callable[[], Look]], "Future[Look]"]
"""Has a look made beside the cycle."""


class DecisionKind(StrEnum):
    """What was decided."""

    FED = "fed"
    """A payload's torque is faded in."""
    REFINED = "refined"
    """A better estimate takes its place."""
    DROPPED = "dropped"
    """All torque is taken away."""
    REFUSED = "refused"
    """Nothing is fed, and an estimate is not to be."""


@dataclass(frozen=True)
class Decision:
    """One decision.

    Attributes:
        time_s: Time stamp of the feedback that it followed.
        kind: What was decided.
        reason: Why, in words; empty where a payload is fed.
        mass_kg: The estimate then; None, as the next two, where its equations could not be solved.
        half_width_95_kg: Half width of its interval.
        center_of_mass_m: The estimate, in the flange frame.
        fed_mass_kg: Mass of the body that is fed from then on, the possible one nearest to the estimate; None where
            nothing is fed.
        fed_center_of_mass_m: Likewise, in the flange frame.
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
    ) -> Decision:
        """A decision by an estimate.

        Args:
            time_s: Time stamp of the feedback that it followed.
            kind: What was decided.
            reason: Why, in words.
            found: The estimate, where there is one.
            body: What is fed from then on; None where nothing is.
        """
        return cls(
            time_s,
            kind,
            reason,
            None if found is None else found.mass_kg,
            None if found is None else float(found.half_width_95[0]),
            None if found is None else tuple(found.values[1:].tolist()),
            None if body is None else body.mass_kg,
            None if body is None else tuple(body.center_of_mass_m.tolist()),
        )

    def __str__(self) -> str:
        """In a line."""
        what = f"{self.time_s:8.2f} s  {self.kind}"
        if self.mass_kg is not None:
            what += f": {self.mass_kg:.2f} +- {self.half_width_95_kg:.2f} kg"
        if self.fed_mass_kg is not None and self.fed_center_of_mass_m is not None:
            center = ", ".join(f"{1e3 * value:.0f}" for value in self.fed_center_of_mass_m)
            what += f", as {self.fed_mass_kg:.2f} kg at ({center}) mm"
        return what + (f", {self.reason}" if self.reason else "")

    def to_dict(self) -> dict[str, Any]:
        """As a document has it."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}


def at_once(look: Callable[[], Look]) -> Future[Look]:
    """Look in the cycle: for simulations in virtual time, which are alike in every run."""
    made: Future[Look] = Future()
    made.set_result(look())
    return made


class EstimatorPlugin:
    """The estimator as a plug-in of the cycle: it takes the feedback, and adds no torque.

    Args:
        estimator: Of a calibrated arm.
        effort: What it was calibrated with.
    """

    name = "payload estimator"

    def __init__(self, estimator: PayloadEstimator, effort: Effort) -> None:
        self.estimator = estimator
        self._with_torque = effort is Effort.TORQUE

    def on_cycle(self, step: CycleStep) -> None:
        """Take one cycle's feedback; a cycle in which a joint's is missing is left out."""
        feedback = step.feedback
        effort = feedback.torque_nm if self._with_torque else feedback.current_a
        if effort is not None and not feedback.missing.any():
            self.estimator.update(feedback.time_s, feedback.position_rad, effort)


class PayloadAdaptation:
    """Estimator, rules and injection as one plug-in.

    Args:
        estimated: Takes the feedback.
        rules: Judge the estimates.
        feedforward: Adds the torque, once it is allowed to; it begins with no payload.
        robot: Name of the robot.
        n: Number of joints.
        beside: Has estimates made beside the cycle.
        report: Called with every decision.

    Attributes:
        decisions: All so far.
    """

    name = "adaptation"

    def __init__(
        self,
        estimated: EstimatorPlugin,
        rules: AdaptationRules,
        feedforward: FeedforwardPlugin,
        *,
        robot: str,
        n: int,
        beside: Beside = at_once,
        report: Callable[[Decision], None] = lambda decision: None,
    ) -> None:
        self.decisions: list[Decision] = []
        self._estimated, self._rules, self._feedforward = estimated, rules, feedforward
        self._robot, self._n, self._beside, self._report = robot, n, beside, report
        self._pending: Future[Look] | None = None
        self._looked_s = -np.inf
        self._changes = 0
        self._fed: Candidate | None = None
        self._agreed: Candidate | None = None
        self._refused = ""

    @property
    def fade_in_cycles(self) -> int:
        """Cycles from `allow` until the whole torque is added."""
        return self._feedforward.fade_in_cycles

    def allow(self, joints: NDArray[np.bool_]) -> None:
        """Begin to add torque: what has been decided by then, and what is decided later.

        Args:
            joints: (n,) True where torque may be added, as `OffsetCheck` found.
        """
        self._feedforward.allow(joints)

    def on_cycle(self, step: CycleStep) -> FloatArray:
        """Take the feedback, decide where there is something to decide, and add the torque."""
        self._estimated.on_cycle(step)
        time_s = step.feedback.time_s
        if self._pending is not None and self._pending.done():
            look, self._pending = self._pending.result(), None
            # An estimate from before a change is of another payload.
            if look.found is None or look.found.changes == self._changes:
                self._decide(time_s, look)
        changes = self._estimated.estimator.changes
        if changes != self._changes:
            self._changes = changes
            self._agreed = None
            if self._fed is not None:
                self._drop(time_s, self._fed.found, "the payload has changed")
        if self._pending is None and time_s - self._looked_s >= LOOK_S:
            self._looked_s = time_s
            self._pending = self._beside(self._look)
        return self._feedforward.on_cycle(step)

    def _look(self) -> Look:
        """An estimate, and the possible body that would be fed; beside the cycle."""
        try:
            found = self._estimated.estimator.estimate()
        except np.linalg.LinAlgError:
            return Look(None, None, "the equations of the estimate cannot be solved")
        doubt = self._rules.why_not(found)
        if doubt is not None:
            return Look(found, None, doubt)
        try:
            body = carried_body(found)
        except EstimationError:
            body = None
        if body is None:
            return Look(found, None, "no possible body is near the estimate")
        doubt = self._rules.why_not_fed(found, body)
        return Look(found, body) if doubt is None else Look(found, None, doubt)

    def _decide(self, time_s: float, look: Look) -> None:
        """What becomes of an estimate."""
        if look.found is None or look.body is None:
            self._agreed = None
            if self._fed is not None:
                self._drop(time_s, look.found, look.doubt)
            elif look.doubt != self._refused:
                self._refused = look.doubt
                self._note(time_s, DecisionKind.REFUSED, look.found, look.doubt)
            return
        before, self._agreed = self._agreed, Candidate(look.found, look.body)
        if before is None or not self._agreed.agrees(before):
            return
        if self._fed is None:
            self._feed(time_s, DecisionKind.FED, self._agreed)
        elif self._agreed.is_worth(self._fed.body):
            self._feed(time_s, DecisionKind.REFINED, self._agreed)

    def _feed(self, time_s: float, kind: DecisionKind, candidate: Candidate) -> None:
        """Hand a body to the injection, which judges it as any payload."""
        self._feedforward.set_payload(_result(candidate.body, self._robot, self._n), FEED_S)
        self._fed, self._refused = candidate, ""
        self._note(time_s, kind, candidate.found, "")

    def _drop(self, time_s: float, found: LivePayload | None, why: str) -> None:
        """Take all torque away."""
        self._feedforward.drop_payload(DROP_S)
        self._fed, self._refused = None, why
        self._note(time_s, DecisionKind.DROPPED, found, why)

    def _note(self, time_s: float, kind: DecisionKind, found: LivePayload | None, why: str) -> None:
        """Record a decision."""
        decision = Decision.of(time_s, kind, why, found, None if self._fed is None else self._fed.body)
        self.decisions.append(decision)
        self._report(decision)


def _result(body: InertialParameters, robot: str, n: int) -> PayloadResult:
    """A body as the injection takes it: mass and centre of mass are determined, nothing else is."""
    values = np.stack([body.values, body.values], axis=1)
    nothing = np.zeros(n)
    provenance = Provenance("", "", {}, robot=robot)
    return PayloadResult(FLANGE, body, _MASS_AND_CENTER, values, nothing, nothing, provenance)
