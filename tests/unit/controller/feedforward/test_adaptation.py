"""Feed-forward that follows the estimate: what is added, when, and every reason to remove it."""

from __future__ import annotations

from concurrent.futures import Future
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.cycle.plugins import CycleStep
from armload_controller.feedforward.adaptation import DecisionKind, Look, PayloadAdaptation
from armload_controller.feedforward.adaptation_rules import (
    AdaptationRefused,
    AdaptationRules,
    DeclaredMass,
    carried_body,
)
from armload_controller.feedforward.feedforward_plugin import FeedforwardPlugin
from armload_controller.feedforward.payload_feedforward import PayloadFeedforward
from armload_controller.motion.leg_interpolator import Reference
from armload_controller.motion.phase import PhaseState, Segment
from armload_drivers.servos import JointCommand, JointFeedback
from armload_identification.contact.force_watch import Force
from armload_identification.model.payload import REFERENCE_LENGTH_M
from armload_identification.pipeline.recursive_estimator import LivePayload
from armload_identification.recording.reading_options import Effort
from tests.live_estimates import live_estimate, sphere

BETTER, DROP_S, FEED_S, LOOK_S, STALE_S, TAKE_S, MOMENT_SHARE = 0.05, 0.2, 0.5, 1.0, 1.0, 0.1, 0.1

ROBOT = load_robot("prbt")
N, CYCLE_S, RATED_KG = ROBOT.n, 0.01, 6.0
STILL = np.zeros(N)
POSE = np.array([0.2, 0.7, 0.9, 0.1, 0.6, 0.0])
CALIBRATION = SimpleNamespace(drift=np.full((3, N), 0.5))
DECLARED = DeclaredMass(0.0, 3.0, RATED_KG)


def found(mass_kg=2.0, width_kg=0.1, center_m=(0.02, -0.03, 0.08), **changes):
    return live_estimate(N, mass_kg, width_kg, center_m, **changes)


def wide(width_m):
    return np.array([0.1, 0.005, width_m, 0.005])


def far_friction(joint, change_nm):
    friction = np.zeros((3, N))
    friction[0, joint] = change_nm
    return friction


MOMENT_M = MOMENT_SHARE * RATED_KG * REFERENCE_LENGTH_M / 2.0
"""Uncertainty of the centre of mass at which the moment of 2 kg has the largest allowed uncertainty."""

DOUBTS = {
    "a push": (found(contact=True), "external force on the arm"),
    "mass unsure": (found(width_kg=1.1), "the mass is not known"),
    "less than nothing": (found(mass_kg=-0.3), "the mass is not known"),
    "no number": (found(mass_kg=np.nan), "the mass is not known"),
    "centre unsure": (found(half_width_95=wide(1.1 * MOMENT_M)), "the centre of mass is not known"),
    "no centre": (found(half_width_95=wide(np.inf)), "the centre of mass is not known"),
    "too heavy": (found(mass_kg=2.95), "outside the declared 0..3 kg"),
    "far away": (found(center_m=(0.0, 0.0, 0.55)), "further than 0.5 m"),
    "another friction": (found(friction=far_friction(3, 2.6)), "friction of prbt_joint_4 is far"),
}


@pytest.mark.parametrize(("estimate", "reason"), DOUBTS.values(), ids=DOUBTS)
def test_every_doubt_has_its_reason(estimate, reason):
    rules = AdaptationRules(DECLARED, CALIBRATION, ROBOT.joint_names)
    assert rules.why_not(found()) is None
    assert reason in rules.why_not(estimate)


def test_a_light_payload_may_be_anywhere_near():
    rules = AdaptationRules(DECLARED, CALIBRATION, ROBOT.joint_names)
    assert rules.why_not(found(mass_kg=0.4, half_width_95=wide(3.0 * MOMENT_M))) is None


def test_lighter_than_declared():
    rules = AdaptationRules(DeclaredMass(1.0, 3.0, RATED_KG), CALIBRATION, ROBOT.joint_names)
    assert rules.why_not(found(mass_kg=1.2)) is None
    assert "outside the declared 1..3 kg" in rules.why_not(found(mass_kg=1.05))


@pytest.mark.parametrize(
    ("least_kg", "most_kg", "text"),
    [(-1.0, 2.0, "give a range"), (2.0, 1.0, "give a range"), (0.0, 0.0, "give a range"), (0.0, 4.9, "4.8 kg")],
)
def test_what_may_not_be_declared(least_kg, most_kg, text):
    with pytest.raises(AdaptationRefused, match=text):
        DeclaredMass(least_kg, most_kg, RATED_KG)


def test_the_body_that_is_fed_is_possible_and_no_coordinate_is_a_guess():
    body = carried_body(found(center_m=(0.003, -0.03, 0.08)))
    assert body.is_physical
    assert body.mass_kg == 2.0
    np.testing.assert_allclose(body.center_of_mass_m, [0.0, -0.03, 0.08])


def test_an_estimate_that_no_body_can_have_has_a_nearest_possible_one_and_is_not_fed_if_that_is_far():
    """A mass on a lever without the corresponding inertia: the nearest body has its mass closer to the flange."""
    estimate = found(center_m=(0.0, -0.15, 0.2))
    impossible = estimate.theta.copy()
    impossible[4:] = 0.0
    estimate = replace(estimate, theta=impossible)
    possible = estimate.possible_body()
    body = carried_body(estimate)
    assert possible.is_physical
    assert body.mass_kg == possible.mass_kg
    np.testing.assert_allclose(body.center_of_mass_m[1:], possible.center_of_mass_m[1:])
    assert np.linalg.norm(body.center_of_mass_m) < 0.9 * np.linalg.norm(estimate.values[1:])
    rules = AdaptationRules(DECLARED, CALIBRATION, ROBOT.joint_names)
    assert "within the intervals" in rules.why_not_fed(estimate, body)


def moved(body, **estimate):
    """An estimate whose nearest possible body is this one."""

    class Moved(LivePayload):
        def possible_body(self):
            return body

    return Moved(**vars(found(**estimate)))


CENTER_M = (0.02, -0.03, 0.08)
MOVED = {
    "mass beyond the interval": (moved(sphere(1.8, CENTER_M)), "within the intervals"),
    "centre beyond the interval": (moved(sphere(2.0, (0.02, -0.03, 0.086))), "within the intervals"),
    "mass less sure": (moved(sphere(1.9, CENTER_M), width_kg=0.99), "the mass is not known"),
    "moment less sure": (
        moved(sphere(2.05, CENTER_M), half_width_95=wide(0.99 * MOMENT_M)),
        "the centre of mass is not known",
    ),
    "heavier than declared": (moved(sphere(2.95, CENTER_M), mass_kg=2.88), "outside the declared 0..3 kg"),
    "further than the reach": (
        moved(sphere(2.0, (0.0, 0.0, 0.502)), center_m=(0.0, 0.0, 0.498)),
        "further than 0.5 m",
    ),
    "none": (moved(None), "no possible body is near"),
    "equations without a solution": (found(covariance=np.zeros((10, 10))), "no possible body is near"),
    "covariance of no estimate": (found(covariance=-np.eye(10)), "no possible body is near"),
}


@pytest.mark.parametrize(("estimate", "reason"), MOVED.values(), ids=MOVED)
def test_the_body_that_is_fed_is_the_one_that_is_checked(estimate, reason):
    """These estimates violate no rule, but the body that would be used does."""
    assert AdaptationRules(DECLARED, CALIBRATION, ROBOT.joint_names).why_not(estimate) is None
    dropped_for(estimate, reason)


def test_a_body_is_fed_that_is_within_the_intervals_and_recorded():
    arm = Arm()
    arm.estimator.says = estimate = moved(sphere(1.93, (0.022, -0.028, 0.083)))
    np.testing.assert_allclose(arm.run(CONFIRMED_S), torque_of(estimate), atol=1e-9)
    (fed,) = arm.adaptation.decisions
    assert (fed.mass_kg, fed.center_of_mass_m) == (2.0, CENTER_M)
    assert fed.fed_mass_kg == 1.93
    np.testing.assert_allclose(fed.fed_center_of_mass_m, [0.022, -0.028, 0.083])
    arm.estimator.says = found(contact=True)
    arm.run(LOOK_S)
    dropped = arm.adaptation.decisions[-1]
    assert (dropped.fed_mass_kg, dropped.fed_center_of_mass_m) == (None, None)


def test_bodies_are_compared_and_not_estimates():
    """One estimate throughout: the torque does not jump with its body, and follows a body that stays."""
    arm = Arm()
    for number in range(6):
        arm.estimator.says = moved(sphere(1.93 + 0.14 * (number % 2), CENTER_M))
        assert not arm.run(LOOK_S).any()
    arm.estimator.says = moved(sphere(2.0, CENTER_M), width_kg=0.15)
    arm.run(CONFIRMED_S)
    arm.estimator.says = other = moved(sphere(2.0 * (1.0 - 1.1 * BETTER), CENTER_M), width_kg=0.15)
    np.testing.assert_allclose(arm.run(CONFIRMED_S), torque_of(other), atol=1e-9)
    assert arm.kinds == [DecisionKind.FED, DecisionKind.REFINED]


@pytest.mark.parametrize("fed", [True, False])
def test_an_estimate_whose_equations_cannot_be_solved_is_a_doubt(fed):
    def unsolved():
        raise np.linalg.LinAlgError("Singular matrix")

    arm = Arm()
    if fed:
        arm.run(CONFIRMED_S)
    arm.estimator.estimate = unsolved
    assert not arm.run(CONFIRMED_S).any()
    assert arm.kinds == ([DecisionKind.FED, DecisionKind.DROPPED] if fed else [DecisionKind.REFUSED])
    last = arm.adaptation.decisions[-1]
    assert str(last).endswith(f"{last.kind}, the equations of the estimate cannot be solved")
    assert last.to_dict()["mass_kg"] is None


class Estimated:
    """Payload and forces set by the test."""

    def __init__(self):
        self.says, self.changes, self.force, self.updates = found(), 0, Force.FREE, []

    def take(self, time_s, position_rad, effort):
        self.updates += zip(time_s, position_rad, effort, strict=True)

    def estimate(self):
        return replace(self.says, changes=self.changes)


class Arm:
    """Cycles of a standing arm with the adaptation."""

    def __init__(self, beside=None, allow=True):
        self.estimator, self.cycles, self.said = Estimated(), 0, []
        self.plugin = FeedforwardPlugin(ROBOT.chain, ROBOT.name, None, CYCLE_S)
        more = {} if beside is None else {"beside": beside}
        self.adaptation = PayloadAdaptation(
            self.estimator,
            Effort.TORQUE,
            AdaptationRules(DECLARED, CALIBRATION, ROBOT.joint_names),
            self.plugin,
            report=self.said.append,
            **more,
        )
        if allow:
            self.adaptation.allow(np.ones(N, dtype=bool))

    def run(self, seconds, missing=False):
        """Run cycles; returns the torque of the last."""
        for _ in range(round(seconds / CYCLE_S)):
            self.cycles += 1
            feedback = JointFeedback(
                cycle=self.cycles,
                time_s=self.cycles * CYCLE_S,
                position_rad=POSE,
                velocity_rad_s=None,
                current_a=None,
                torque_nm=np.full(N, 3.0),
                statusword=np.zeros(N, np.uint16),
                missing=np.full(N, missing),
            )
            reference = Reference(POSE, STILL, STILL, Segment.SLOW, PhaseState(0.0, 1.0, 0.0))
            command = JointCommand(POSE, STILL, STILL)
            torque = self.adaptation.on_cycle(CycleStep(feedback, None, None, command, reference, lambda reason: None))
        return torque.copy()

    @property
    def kinds(self):
        return [decision.kind for decision in self.adaptation.decisions]


def torque_of(estimate):
    return PayloadFeedforward(ROBOT.chain, carried_body(estimate)).torque_nm(POSE, STILL, STILL)


CONFIRMED_S = 3.0 * LOOK_S + FEED_S


def dropped_for(estimate, reason):
    """An arm whose payload torque was removed for that reason when the estimate became this one."""
    arm = Arm()
    assert arm.run(CONFIRMED_S).any()
    arm.estimator.says = estimate
    assert not arm.run(2.0 * LOOK_S + DROP_S).any()
    assert arm.kinds == [DecisionKind.FED, DecisionKind.DROPPED]
    assert reason in arm.adaptation.decisions[-1].reason
    return arm


def test_two_estimates_that_agree_are_fed_and_no_single_one():
    arm = Arm()
    assert not arm.run(LOOK_S).any()
    np.testing.assert_allclose(arm.run(CONFIRMED_S), torque_of(found()), atol=1e-9)
    assert arm.kinds == [DecisionKind.FED]
    assert arm.said == arm.adaptation.decisions
    jumping = Arm()
    for number in range(6):
        jumping.estimator.says = found(mass_kg=1.0 + number % 2)
        assert not jumping.run(LOOK_S).any()


def test_nothing_is_added_before_it_is_allowed():
    arm = Arm(allow=False)
    assert not arm.run(CONFIRMED_S).any()
    assert arm.kinds == [DecisionKind.FED]
    arm.adaptation.allow(np.ones(N, dtype=bool))
    np.testing.assert_allclose(arm.run(CONFIRMED_S), torque_of(found()), atol=1e-9)


def test_it_takes_half_a_second_to_be_added():
    assert Arm(allow=False).adaptation.fade_in_cycles == round(0.5 / CYCLE_S) + 1


def test_a_better_estimate_takes_its_place_and_a_like_one_does_not():
    arm = Arm()
    arm.run(CONFIRMED_S)
    arm.estimator.says = found(mass_kg=2.0 * (1.0 + 0.9 * BETTER))
    arm.run(CONFIRMED_S)
    assert arm.kinds == [DecisionKind.FED]
    arm.estimator.says = better = found(mass_kg=2.0 * (1.0 + 1.1 * BETTER), width_kg=0.15)
    np.testing.assert_allclose(arm.run(CONFIRMED_S), torque_of(better), atol=1e-9)
    assert arm.kinds == [DecisionKind.FED, DecisionKind.REFINED]


@pytest.mark.parametrize(("estimate", "reason"), DOUBTS.values(), ids=DOUBTS)
def test_any_doubt_takes_the_torque_away(estimate, reason):
    arm = dropped_for(estimate, reason)
    arm.run(CONFIRMED_S)
    assert len(arm.kinds) == 2, "a doubt is said once"


def test_a_change_is_followed_at_once_and_not_at_the_next_estimate():
    arm = Arm()
    arm.run(CONFIRMED_S)
    arm.run(LOOK_S / 5.0)
    arm.estimator.changes = 1
    arm.run(TAKE_S + CYCLE_S)
    assert arm.kinds == [DecisionKind.FED, DecisionKind.DROPPED]
    assert arm.adaptation.decisions[-1].reason == "the payload has changed"
    assert not arm.run(DROP_S).any()


def test_an_estimate_from_before_a_change_does_not_count_after_it():
    made = []

    def later(estimate):
        made.append(Future())
        return made[-1]

    arm = Arm(beside=later)
    one = Look(found(), carried_body(found()))
    other = Look(replace(found(), changes=1), carried_body(found()), changes=1)
    for look, kinds in (
        (one, []),
        (one, [DecisionKind.FED]),
        (other, [DecisionKind.FED, DecisionKind.DROPPED]),
        (other, [DecisionKind.FED, DecisionKind.DROPPED, DecisionKind.FED]),
    ):
        arm.run(2.0 * TAKE_S)
        made[-1].set_result(look)
        arm.run(CYCLE_S)
        assert arm.kinds == kinds, "two estimates of one payload are needed"


def test_what_is_fed_is_frozen_while_something_acts():
    arm = Arm()
    fed = arm.run(CONFIRMED_S)
    for arm.estimator.force in (Force.ACTING, Force.PUSHED):
        arm.estimator.says = found(mass_kg=1.0)
        np.testing.assert_array_equal(arm.run(2.0 * LOOK_S), fed)
    assert arm.kinds == [DecisionKind.FED, DecisionKind.FROZEN], "said once"
    assert str(arm.adaptation.decisions[-1]).endswith("something acts")
    arm.estimator.force, arm.estimator.says = Force.FREE, found()
    np.testing.assert_array_equal(arm.run(2.0 * LOOK_S), fed)
    assert arm.kinds == [DecisionKind.FED, DecisionKind.FROZEN], "a push has changed nothing"


def test_without_a_look_all_torque_is_removed():
    made = []

    def stuck(look):
        made.append(Future())
        if len(made) < 40:
            made[-1].set_result(look())
        return made[-1]

    arm = Arm(beside=stuck)
    assert arm.run(CONFIRMED_S).any()
    assert not arm.run(STALE_S + DROP_S + CONFIRMED_S).any()
    assert arm.kinds == [DecisionKind.FED, DecisionKind.DROPPED]
    assert "no estimate has been made for 1 s" in arm.adaptation.decisions[-1].reason


def test_nothing_is_fed_for_the_first_time_while_something_acts():
    arm = Arm()
    arm.run(LOOK_S)
    arm.estimator.force = Force.ACTING
    assert not arm.run(CONFIRMED_S).any()
    assert not arm.kinds


def test_another_payload_after_the_freeze_takes_the_torque_away():
    arm = Arm()
    arm.run(CONFIRMED_S)
    arm.estimator.force = Force.ACTING
    arm.run(LOOK_S)
    arm.estimator.force, arm.estimator.changes = Force.FREE, 1
    assert not arm.run(TAKE_S + CYCLE_S + DROP_S).any()
    assert arm.kinds == [DecisionKind.FED, DecisionKind.FROZEN, DecisionKind.DROPPED]


def test_an_estimate_that_fails_is_an_error_of_the_plugin():
    arm = Arm()

    def broken():
        raise FloatingPointError("no estimate")

    arm.estimator.estimate = broken
    with pytest.raises(FloatingPointError):
        arm.run(LOOK_S)


def test_feedback_that_is_missing_is_not_estimated_with():
    arm = Arm()
    arm.run(0.1, missing=True)
    assert not arm.estimator.updates
    arm.run(0.1 + CYCLE_S)
    assert 10 <= len(arm.estimator.updates) <= 11
    np.testing.assert_array_equal(arm.estimator.updates[0][2], np.full(N, 3.0))


def test_a_decision_is_a_line_and_a_document():
    arm = Arm()
    arm.run(CONFIRMED_S)
    (decision,) = arm.adaptation.decisions
    assert str(decision).endswith("fed: 2.00 +- 0.10 kg, as 2.00 kg at (20, -30, 80) mm")
    assert decision.to_dict()["center_of_mass_m"] == [0.02, -0.03, 0.08]
    assert decision.to_dict()["fed_mass_kg"] == 2.0


@pytest.mark.parametrize(
    ("least_kg", "most_kg", "said"),
    [
        (0.0, 4.8, None), (0.0, 4.81, r"up to 4\.81 kg: .* limited to 80 % of the rated 6 kg, 4\.8 kg"),
        (2.0, 2.0, "the smaller value first"), (-0.1, 2.0, "the smaller value first"), (1.9, 2.0, None),
    ],
)  # fmt: skip
def test_a_declared_range_begins_at_nothing_and_ends_at_four_fifths_of_the_rated_payload(least_kg, most_kg, said):
    with pytest.raises(AdaptationRefused, match=said) if said else nullcontext():
        assert DeclaredMass(least_kg, most_kg, RATED_KG).greatest_kg == pytest.approx(4.8)


@pytest.mark.parametrize(
    ("values", "half_width_95", "why"),
    [
        ((2.0, 0, 0, 0.1), (1.0, 0, 0, 0), None),
        ((2.0, 0, 0, 0.1), (1.01, 0, 0, 0), "the mass is not known well enough"),
        ((2.0, 0, 0, 0.1), (0.1, 0.03, 0.03, 0.03), None),
        ((2.0, 0, 0, 0.1), (0.1, 0, 0, 0.0301), "the centre of mass is not known well enough"),
        ((2.0, 0, 0, 0.1), (0.1, 0.0301, 0, 0), "the centre of mass is not known well enough"),
        ((0.5, 0, 0, 0.1), (0.01, 0, 0, 0), "the mass may lie outside the declared 0.5..3 kg"),
        ((0.52, 0, 0, 0.1), (0.01, 0, 0, 0), None),
        ((2.95, 0, 0, 0.1), (0.06, 0, 0, 0), "the mass may lie outside the declared 0.5..3 kg"),
        ((2.0, 0.3, 0, 0.401), (0.1, 0, 0, 0), "the centre of mass is further than 0.5 m from the flange"),
        ((2.0, 0.3, 0, 0.399), (0.1, 0, 0, 0), None),
        ((np.nan, 0, 0, 0), (0.1, 0, 0, 0), "the mass is not known well enough"),
    ],
)
def test_each_rule_has_its_limit(values, half_width_95, why):
    """Half the mass; 10 % of 6 kg at 0.1 m, which is 30 mm of 2 kg; the declared range; half a metre."""
    rules = AdaptationRules(DeclaredMass(0.5, 3.0, RATED_KG), CALIBRATION, ROBOT.joint_names)
    assert rules._why_not(np.array(values, dtype=float), np.array(half_width_95)) == why


def test_what_is_fed_has_the_sure_coordinates_and_the_inertia_of_a_sphere():
    """2 kg of 50 mm radius: 0.4 m r^2 = 2e-3 kg m2; y, whose interval contains zero, is left out."""
    body = carried_body(found(center_m=(0.02, -0.004, 0.08)))
    assert body.mass_kg == pytest.approx(2.0, rel=0.05)
    assert body.center_of_mass_m[1] == 0.0
    assert (np.abs(body.center_of_mass_m[[0, 2]]) > 0.01).all()
    np.testing.assert_allclose(body.inertia_about_com, 0.4 * body.mass_kg * 0.05**2 * np.eye(3), atol=1e-12)
