"""The feed-forward plug-in: the torque for the right state and the right payload."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ExportError, MotionError, OffsetRefused
from armload_controller.cycle.control_cycle import Cycle
from armload_controller.cycle.torque_gate import TorqueGate
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.feedforward.feedforward_plugin import (
    CheckedFeedforward,
    FeedforwardPlugin,
    FollowingLag,
    PayloadRefused,
)
from armload_controller.feedforward.offset_check import OffsetCheck, OffsetVerdict
from armload_controller.feedforward.payload_feedforward import PayloadFeedforward
from armload_controller.motion.checked_path import check_path
from armload_controller.motion.motion_control import MotionControl
from armload_controller.motion.phase import Segment
from armload_controller.session.run_session import run_leg
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.model.payload import InertialParameters, PayloadResult, Provenance

ROBOT = load_robot("prbt")
CYCLE_S = 0.01
BODY = ROBOT.simulation.payload("gripper")
ALL = np.ones(6, bool)
TRAJECTORY = FourierTrajectory(
    0.25, np.array([0.0, 0.6, 1.2, 0.0, 0.5, 0.0]), np.full((6, 1), 0.2), np.full((6, 1), 0.1)
)
PATH = check_path(Excitation(TRAJECTORY, 1), ROBOT.motion_constraints, CYCLE_S, file=ROBOT.file, key="path")


def payload(body=BODY, determined=None, frame="flange", joints=6):
    known = np.ones(10, bool) if determined is None else determined
    values = np.stack([body.values, body.values], axis=1)
    noise = np.ones(joints)
    return PayloadResult(frame, body, known, values, noise, noise, Provenance("0", "0", {}))


def plugin(the_payload=None, joints=ALL):
    added = FeedforwardPlugin(ROBOT.chain, "prbt", the_payload or payload(), CYCLE_S)
    added.allow(joints)
    return added


class Lagging:
    """Delays a perfect arm's feedback: it is where it was commanded some cycles ago."""

    def __init__(self, servos, cycles):
        self.servos, self.cycles = servos, cycles

    def __call__(self, feedback):
        sent = self.servos.sent
        return feedback._replace(position_rad=sent[max(len(sent) - 1 - self.cycles, 0)].position_rad)


def run(servos, added, cycles=0, at=None):
    """Run the leg with the plug-in on an arm with lag; returns all references and the torques sent with them."""
    lagging = Lagging(servos, cycles)
    servos.events = dict.fromkeys(range(5000), lagging)
    references = []

    class Watch:
        name = "watch"

        def on_cycle(self, step):
            references.append(step.reference)
            for act in (at or {}).get(len(references), ()):
                act()

    gate = TorqueGate(ROBOT.limits.torque_max_nm, CYCLE_S)
    cycle = Cycle(servos, ROBOT.limits.motion, gate, MotionControl(), [Watch(), added])
    run_leg(cycle, PATH, PATH.measured, lambda done: None)
    return references, np.array([command.torque_offset_nm for command in servos.sent])


@pytest.mark.parametrize("cycles", [0, 5])
def test_the_torque_is_the_payloads_where_the_arm_is(connected_servos, cycles):
    added = plugin()
    references, torque = run(connected_servos(6, CYCLE_S), added, cycles)
    assert added.lag_s == pytest.approx(cycles * CYCLE_S, rel=0.02)
    feedforward = PayloadFeedforward(ROBOT.chain, BODY)
    rows = [i for i, reference in enumerate(references) if reference.segment is Segment.PERIODS][50:]
    delay_s = max(cycles - 0.5, 0.0) * CYCLE_S

    def error_nm(delay_s):
        """Error of the added torque relative to the torque `delay_s` before."""
        found = []
        for row in rows[::20]:
            state = TRAJECTORY.evaluate(references[row].state.phase_s - delay_s)
            expected = feedforward.torque_nm(state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
            found.append(np.abs(torque[row] - expected).max())
        return max(found)

    assert error_nm(delay_s) < 0.02
    assert error_nm(delay_s) < 0.2 * min(error_nm(delay_s + half) for half in (-0.5 * CYCLE_S, 0.5 * CYCLE_S))


def test_drives_whose_gains_are_off_are_given_what_becomes_the_torque(connected_servos):
    scale = np.diag([1.0, 0.9, 1.0, 1.0, 1.1, 1.0])
    scaled = FeedforwardPlugin(ROBOT.chain, "prbt", payload(), CYCLE_S, commanded=scale)
    scaled.allow(ALL)
    _, plain = run(connected_servos(6, CYCLE_S), plugin())
    _, torque = run(connected_servos(6, CYCLE_S), scaled)
    assert (np.abs(plain).max(axis=0)[[1, 4]] > 1.0).all()
    np.testing.assert_allclose(torque, plain @ scale, atol=1e-9)


def test_joints_that_were_not_found_usable_get_nothing(connected_servos):
    usable = np.array([False, True, True, False, True, False])
    _, torque = run(connected_servos(6, CYCLE_S), plugin(joints=usable))
    assert not torque[:, ~usable].any()
    assert (np.abs(torque[:, usable]).max(axis=0) > 1.0).all()


def faded_in(servos, verdict):
    """Fade a payload's torque in at standstill after a trial with a verdict; returns the torques sent."""
    added = FeedforwardPlugin(ROBOT.chain, "prbt", payload(), CYCLE_S)
    check = OffsetCheck(ROBOT.joint_names, ROBOT.drives.transmission, np.ones(6), CYCLE_S)
    checked = CheckedFeedforward(added, check)
    gate = TorqueGate(ROBOT.limits.torque_max_nm, CYCLE_S)
    cycle = Cycle(servos, ROBOT.limits.motion, gate, MotionControl(), [checked])
    with cycle.powered() as arm:
        checked.fade_in(arm.hold, verdict)
    return np.array([command.torque_offset_nm for command in servos.sent])


def test_torque_is_added_only_where_the_trial_found_the_offset_usable(connected_servos):
    """The third joint's gain is uncertain: it gets nothing, although the payload weighs on it."""
    sigma = 0.01 + (np.arange(6) == 2)
    for sigmas, expected in ((np.full(6, 0.01), ALL), (sigma, sigma < 1.0)):
        verdict = OffsetVerdict(ROBOT.joint_names, np.ones(6), np.ones(6), sigmas, 8)
        greatest = np.abs(faded_in(connected_servos(6, CYCLE_S), verdict)).max(axis=0)
        assert (greatest[[1, 2, 4]] > 0.1).tolist() == expected[[1, 2, 4]].tolist()
        assert not greatest[~expected].any()


@pytest.mark.parametrize(
    ("gain", "sigma", "text"), [(-1.0, 0.01, "the sign is wrong"), (1.0, 1.0, "no joint's response exceeds the noise")]
)
def test_no_torque_is_added_after_a_trial_that_failed(connected_servos, gain, sigma, text):
    gains = np.where(np.arange(6) == 2, gain, 1.0)
    verdict = OffsetVerdict(ROBOT.joint_names, np.ones(6), gains, np.full(6, sigma), 8)
    servos = connected_servos(6, CYCLE_S)
    with pytest.raises(MotionError, match=text) as caught:
        faded_in(servos, verdict)
    assert isinstance(caught.value.__cause__, OffsetRefused)
    assert not any(command.torque_offset_nm.any() for command in servos.sent)


def test_nothing_is_added_until_it_is_allowed(connected_servos):
    _, torque = run(connected_servos(6, CYCLE_S), FeedforwardPlugin(ROBOT.chain, "prbt", payload(), CYCLE_S))
    assert not torque.any()


def test_the_payload_is_changed_in_motion_without_a_step(connected_servos):
    added = plugin()
    heavier = payload(InertialParameters(1.5 * BODY.theta))
    acts = {500: [lambda: added.set_payload(heavier, 0.3)], 600: [lambda: added.drop_payload(0.3)]}
    _, torque = run(connected_servos(6, CYCLE_S), added, at=acts)
    _, undisturbed = run(connected_servos(6, CYCLE_S), plugin())
    np.testing.assert_array_equal(torque[:499], undisturbed[:499])
    np.testing.assert_allclose(torque[535:598], 1.5 * undisturbed[535:598], atol=1e-9)
    np.testing.assert_allclose(torque[635:], 0.0, atol=1e-12)
    assert np.abs(np.diff(torque, axis=0)).max() < 2.0


def test_torque_that_is_allowed_again_is_the_present_payloads(connected_servos):
    """After a grasp or a release the offset check is repeated: the previous payload's torque is not added."""
    heavier = payload(InertialParameters(1.5 * BODY.theta))
    _, first = run(connected_servos(6, CYCLE_S), plugin())
    for change, share in ((lambda p: p.set_payload(heavier, 0.0), 1.5), (lambda p: p.drop_payload(0.0), 0.0)):
        allowed = plugin()
        _, torque = run(
            connected_servos(6, CYCLE_S),
            allowed,
            at={500: [lambda p=allowed, do=change: do(p)], 600: [lambda p=allowed: p.allow(ALL)]},
        )
        np.testing.assert_allclose(torque[700:800], share * first[700:800], atol=1e-9)


def test_a_payload_set_before_torque_is_allowed_is_faded_in_with_it(connected_servos):
    added = FeedforwardPlugin(ROBOT.chain, "prbt", payload(InertialParameters(0.2 * BODY.theta)), CYCLE_S)
    added.set_payload(payload(), 0.0)
    _, torque = run(connected_servos(6, CYCLE_S), added, at={500: [lambda: added.allow(ALL)]})
    _, allowed_at_once = run(connected_servos(6, CYCLE_S), plugin())
    assert not torque[:499].any()
    assert 0.0 < np.abs(torque[505]).max() < 0.1 * np.abs(allowed_at_once[505]).max()
    np.testing.assert_allclose(torque[600:700], allowed_at_once[600:700], atol=1e-9)


@pytest.mark.parametrize("missing", [0, 1, 3])
def test_a_payload_without_mass_or_centre_is_refused_in_the_words_of_export(missing):
    known = np.ones(10, bool)
    known[missing] = False
    with pytest.raises(PayloadRefused) as fed:
        plugin(payload(determined=known))
    with pytest.raises(ExportError) as exported:
        ExportSubject.of(ROBOT, payload(determined=known), "payload", "0")
    assert str(fed.value).replace("fed forward", "exported") == str(exported.value)


@pytest.mark.parametrize(
    ("changes", "text"), [({"frame": "base"}, "frame 'base'"), ({"joints": 7}, "7 joints, but prbt has 6")]
)
def test_a_payload_of_something_else_is_refused_also_while_running(changes, text):
    added = plugin()
    with pytest.raises(PayloadRefused, match=text):
        added.set_payload(payload(**changes), 0.1)


def test_the_lag_is_not_found_on_an_arm_that_stands():
    lag = FollowingLag(2, CYCLE_S)
    lag.add(np.full(2, 0.1), np.zeros(2))
    assert lag.lag_s == 0.0


def test_the_lag_of_one_joint_that_is_held_back_does_not_count():
    lag = FollowingLag(3, CYCLE_S)
    for _ in range(100):
        lag.add(np.array([0.04, 0.04, 0.19]), np.ones(3))
    assert lag.lag_s == pytest.approx(0.04)


@pytest.mark.parametrize(("error_rad", "lag_s"), [(0.3, 0.2), (0.19, 0.19), (-0.1, 0.0)])
def test_the_lag_is_between_nothing_and_a_fifth_of_a_second(error_rad, lag_s):
    lag = FollowingLag(1, CYCLE_S)
    lag.add(np.array([error_rad]), np.ones(1))
    assert lag.lag_s == pytest.approx(lag_s)


@pytest.mark.parametrize(("speed_rad_s", "lag_s"), [(0.101, 0.05), (0.099, 0.0)])
def test_a_joint_counts_once_it_has_moved(speed_rad_s, lag_s):
    """The squared speed over one cycle of 10 ms reaches 1e-4 rad2/s at 0.1 rad/s."""
    lag = FollowingLag(1, CYCLE_S)
    lag.add(np.array([0.05 * speed_rad_s]), np.array([speed_rad_s]))
    assert lag.lag_s == pytest.approx(lag_s)


def test_the_lag_is_that_of_the_last_five_seconds():
    """Five seconds at 0.1 s, five without: (1 - 1/e) / e of 1 - 1/e2, which is 1 / (e + 1)."""
    lag = FollowingLag(1, CYCLE_S)
    for error_rad in (0.1, 0.0):
        for _ in range(500):
            lag.add(np.array([error_rad]), np.ones(1))
    assert lag.lag_s == pytest.approx(0.1 / (np.e + 1.0), rel=1e-6)


class Term:
    """An arm's own torque, and what it was asked with."""

    def __init__(self, n):
        self.n, self.asked = n, []

    def torque_nm(self, q, dq, ddq, torque):
        self.asked.append((q, dq, ddq, torque))
        return np.full(self.n, 4.0)


def stepped(speed_rad_s=0.0, error_rad=None):
    """Steps of a cycle; the first joint's reference moves at a speed, and the feedback lags it by an error."""
    for number in range(10_000):
        position, velocity = np.zeros(6), np.zeros(6)
        position[0], velocity[0] = number * CYCLE_S * speed_rad_s, speed_rad_s
        reference = SimpleNamespace(position_rad=position, velocity_rad_s=velocity, acceleration_rad_s2=np.zeros(6))
        sent = None if error_rad is None else SimpleNamespace(position_rad=position)
        feedback = SimpleNamespace(position_rad=position - (error_rad or 0.0) * np.eye(6)[0])
        yield SimpleNamespace(reference=reference, sent=sent, sent_reference=reference, feedback=feedback)


def test_the_arms_own_torque_is_faded_in_over_half_a_second_on_the_allowed_joints():
    term = Term(6)
    added = FeedforwardPlugin(ROBOT.chain, "prbt", None, CYCLE_S, beside=term)
    steps = stepped()
    assert not added.on_cycle(next(steps)).any()
    assert (term.asked, added.fade_in_cycles) == ([], 51)
    added.allow(np.arange(6) < 2)
    found = np.array([added.on_cycle(next(steps)) for _ in range(60)])
    np.testing.assert_allclose(found[:, 0], 4.0 * np.minimum(1.0, np.arange(1, 61) / 50.0))
    np.testing.assert_array_equal(found[:, 0], found[:, 1])
    assert not found[:, 2:].any()


@pytest.mark.parametrize(("lag_s", "delay_cycles"), [(0.0, 0.0), (0.004, 0.0), (0.0325, 2.75), (0.2, 19.5)])
def test_the_torque_is_that_of_one_lag_ago_and_half_a_cycle_later(lag_s, delay_cycles):
    term = Term(6)
    added = FeedforwardPlugin(ROBOT.chain, "prbt", None, CYCLE_S, beside=term)
    added.allow(ALL)
    steps = stepped(0.5, 0.5 * lag_s)
    for _ in range(40):
        added.on_cycle(next(steps))
    q, dq, ddq, _ = term.asked[-1]
    assert q[0] == pytest.approx(0.5 * CYCLE_S * (39 - delay_cycles))
    assert (dq[0], ddq[0]) == (0.5, 0.0)
