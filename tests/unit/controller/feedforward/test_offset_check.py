"""The check of the torque offset at standstill, on the simulated arm: wrong offsets are refused before motion."""

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import MotionError, OffsetRefused
from armload_controller.cycle.control_cycle import Cycle
from armload_controller.cycle.following_monitor import FollowingMonitor
from armload_controller.cycle.torque_gate import TorqueGate
from armload_controller.feedforward.offset_check import OffsetCheck, OffsetVerdict, positions_along, tried_torque
from armload_controller.motion.motion_control import MotionControl
from armload_drivers.servos import JointCommand, JointFeedback
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_identification.model.regressor import payload_torque
from armload_identification.signals.joint_torque import Transmission
from tests.fake_servos import FakeServos

ROBOT = load_robot("prbt")
POSITION = np.array([0.2, 0.7, 1.1, 0.3, 0.9, 0.4])
PATH = POSITION + np.linspace(-1.0, 1.0, 50)[:, None] * np.array([1.0, 0.8, 0.6, 0.5, 0.9, 0.4])
UNIT = Transmission(np.ones(2), np.eye(2))


class WrongOffset:
    """A plant whose drives scale their torque offset wrongly."""

    def __init__(self, plant, factor):
        self._plant, self._factor = plant, factor

    def __getattr__(self, name):
        return getattr(self._plant, name)

    def set_torque_offset(self, axis, torque_nm):
        self._plant.set_torque_offset(axis, torque_nm * self._factor[axis])


def check(factor):
    """Check the offset of a loaded arm at rest; returns the verdict and the arm's motion meanwhile."""
    spec = replace(ROBOT.simulation.plant_spec("gripper"), start_position_rad=POSITION)
    plant = ArmPlant(spec)
    servos = FakeServos(ROBOT.drives.settings, WrongOffset(plant, factor))
    servos.connect()
    limits = ROBOT.limits.motion
    tried = tried_torque(ROBOT.chain, ROBOT.simulation.payload("gripper"), PATH)
    offset = OffsetCheck(ROBOT.joint_names, ROBOT.drives.transmission, tried, servos.cycle_s)
    gate = TorqueGate(ROBOT.limits.torque_max_nm, servos.cycle_s)
    cycle = Cycle(servos, limits, gate, MotionControl(), [FollowingMonitor(limits, 3), offset])
    with cycle.powered() as arm:
        arm.hold(offset.done)
        moved = np.abs(plant.sample(0.01).joint_position_rad - POSITION).max()
        offset.verdict().require()
    return offset.verdict(), moved


@pytest.mark.long
def test_a_right_offset_is_usable_wherever_the_payload_weighs():
    verdict, moved = check(np.ones(6))
    assert verdict.usable[[1, 2, 4]].all()
    assert not verdict.usable[0]
    assert np.abs(verdict.gain[[1, 2, 4]] - 1.0).max() < 0.2
    assert moved < 2e-3


@pytest.mark.parametrize(
    ("factor", "text"),
    [
        (-1.0, "the sign is wrong"),
        (2.0, "the scale is wrong"),
        (0.4, "the scale is wrong"),
        (0.0, "the drive ignores it"),
    ],
)
def test_one_wrong_drive_is_named_and_stops(factor, text):
    factors = np.ones(6)
    factors[2] = factor
    with pytest.raises(MotionError, match=f"added torque does not.*prbt_joint_3 was commanded.*{text}") as caught:
        check(factors)
    assert isinstance(caught.value.__cause__, OffsetRefused)
    assert caught.value.__cause__.joints == ("prbt_joint_3",)


def test_an_arm_whose_answer_is_lost_in_noise_gets_no_torque(connected_servos):
    rng = np.random.default_rng(5)
    check = OffsetCheck(("a", "b"), UNIT, np.array([0.01, 0.0]), 0.01)
    servos = connected_servos(2, 0.01)
    servos.events = {k: lambda f: f._replace(current_a=rng.normal(size=2)) for k in range(10_000)}
    limits = replace(ROBOT.limits.motion, joint_names=("a", "b"))
    limits = replace(
        limits, **{f.name: getattr(limits, f.name)[:2] for f in fields(limits) if f.init and f.name != "joint_names"}
    )
    cycle = Cycle(servos, limits, TorqueGate(np.full(2, 50.0), 0.01), MotionControl(), [check])
    with cycle.powered() as arm:
        arm.hold(check.done)
    assert check.verdict().fits == 20
    with pytest.raises(OffsetRefused, match="no joint's response exceeds the noise"):
        check.verdict().require()


class Bench:
    """Drives with a given response to an offset, without an arm."""

    def __init__(self, answer, tried_nm=(10.0, 40.0), cycle_s=0.01):
        self.check = OffsetCheck(("a", "b"), UNIT, np.array(tried_nm), cycle_s)
        self.cycle_s, zero = cycle_s, np.zeros(2)
        reported = sent = None
        before = zero
        cycle = 0
        while not self.check.done():
            assert cycle < 100_000, "the check does not end"
            offset = self.check.on_cycle(SimpleNamespace(sent=sent, feedback=reported, command=None))
            offset = zero if offset is None else offset
            # As in the cycle: the command sent now is the `sent` of the feedback that answers it.
            sent = JointCommand(zero, zero, offset)
            torque = answer(cycle * cycle_s, offset, before)
            reported = JointFeedback(cycle, cycle * cycle_s, zero, None, None, torque, np.zeros(2), np.zeros(2, bool))
            before, cycle = offset, cycle + 1
        self.verdict = self.check.verdict()


def test_the_gain_is_distinguished_from_drift_and_delay():
    def answer(time_s, offset, before):
        return 3.0 + 2.0 * time_s - 80.0 * time_s**2 + np.array([1.0, 0.6]) * offset + 0.5 * (offset - before)

    verdict = Bench(answer).verdict
    np.testing.assert_allclose(verdict.gain, [1.0, 0.6], atol=0.02)
    assert verdict.usable.tolist() == [True, False]
    assert verdict.wrong.tolist() == [False, True]
    exact = Bench(lambda time_s, offset, before: offset).verdict
    np.testing.assert_allclose(exact.gain, 1.0, atol=1e-9)


def test_a_slip_spoils_one_fit_and_not_the_verdict():
    """A joint slips once: the torque steps by more than the tested offset, in the middle of a fade."""

    def answer(time_s, offset, before):
        return offset + 60.0 * (3.1 < time_s < 3.5)

    verdict = Bench(answer).verdict
    np.testing.assert_allclose(verdict.gain, 1.0, atol=1e-6)


@pytest.mark.long
def test_the_standard_error_is_how_far_the_gain_is_off():
    gains, sigmas = [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        verdict = Bench(lambda time_s, offset, before, rng=rng: offset + rng.normal(size=2) * [2.0, 8.0]).verdict
        gains.append(verdict.gain)
        sigmas.append(verdict.sigma)
    np.testing.assert_allclose(np.mean(sigmas, axis=0) / np.std(gains, axis=0), 1.0, atol=0.35)


def test_what_is_usable_and_what_is_wrong():
    """No torque is added in case of doubt, and no drive is blamed without sufficient evidence."""
    gain = np.array([1.0, 1.0, 1.34, 1.36, 0.64, 0.64, 0.64])
    sigma = np.array([0.11, 0.13, 0.01, 0.01, 0.05, 0.07, 0.5])
    verdict = OffsetVerdict(tuple("abcdefg"), np.ones(7), gain, sigma, 8)
    assert verdict.usable.tolist() == [True, False, True, False, False, False, False]
    assert verdict.wrong.tolist() == [False, False, False, True, True, False, False]
    with pytest.raises(OffsetRefused) as refused:
        verdict.require()
    assert refused.value.joints == ("d", "e")
    unsure = OffsetVerdict(("a", "f"), np.ones(2), gain[[0, 5]], sigma[[0, 5]], 8)
    assert unsure.require().tolist() == [True, False]


def test_a_fifth_of_what_the_payloads_weight_takes_is_tried():
    chain, body = ROBOT.chain, ROBOT.simulation.payload("gripper")
    weight = [payload_torque(chain, body.theta, q, np.zeros(6), np.zeros(6)) for q in PATH]
    np.testing.assert_allclose(tried_torque(chain, body, PATH), 0.2 * np.abs(weight).max(axis=0), rtol=1e-9)


@pytest.mark.parametrize(("cycle_s", "fade_cycles"), [(0.01, 25), (0.1, 8), (0.004, 62)])
def test_a_fade_takes_a_quarter_of_a_second_or_eight_cycles(cycle_s, fade_cycles):
    check = OffsetCheck(("a", "b"), UNIT, np.array([10.0, 40.0]), cycle_s)
    found = np.array([check.on_cycle(SimpleNamespace(sent=None, feedback=None)) for _ in range(2 * fade_cycles)])
    turn = 2.0 * np.pi * np.arange(1, 2 * fade_cycles + 1) / fade_cycles
    np.testing.assert_allclose(found, np.outer(0.5 - 0.5 * np.cos(turn), [10.0, 40.0]), atol=1e-12)


def test_eight_fits_of_four_fades_follow_the_four_in_which_the_gate_opens():
    """Of 25 cycles each: the 101st feedback is the first that counts, the 900th the last."""
    bench = Bench(lambda time_s, offset, before: offset)
    assert bench.verdict.fits == 8
    assert bench.check._cycle == 900


def test_a_joint_that_never_gets_certain_ends_it_after_twenty_fits():
    rng = np.random.default_rng(3)
    bench = Bench(lambda time_s, offset, before: offset + rng.normal(size=2) * [300.0, 0.0])
    assert bench.verdict.fits == 20
    assert bench.check._cycle == 2100
    assert bench.verdict.usable.tolist() == [False, True]


@pytest.mark.parametrize(("second_nm", "tried"), [(0.0101, True), (0.0099, False)])
def test_a_joint_with_a_thousandth_of_the_greatest_torque_is_not_tried(second_nm, tried):
    check = OffsetCheck(("a", "b"), UNIT, np.array([10.0, second_nm]), 0.01)
    assert check._tried_joints.tolist() == [True, tried]
    check._gains = [np.ones(2)] * 4
    assert np.isinf(check.verdict().sigma).tolist() == [False, not tried]


def test_the_standard_error_is_that_of_a_median():
    """1.2533 = sqrt(pi / 2) of the spread over the root of the number, by the greater of two measures of spread."""
    check = OffsetCheck(("a",), Transmission(np.ones(1), np.eye(1)), np.array([10.0]), 0.01)
    check._gains = [np.array([gain]) for gain in (0.9, 1.1, 0.9, 1.1)]
    spread = max(0.1, 1.4826 * 0.1)
    assert check.verdict().gain == pytest.approx([1.0])
    assert check.verdict().sigma == pytest.approx([np.sqrt(np.pi / 2.0) * spread / 2.0], rel=1e-3)


def test_the_greatest_weight_is_looked_for_at_512_places_of_a_period():
    asked = []
    trajectory = SimpleNamespace(
        period_s=4.0, evaluate=lambda t_s: asked.append(t_s) or SimpleNamespace(position_rad="positions")
    )
    path = SimpleNamespace(excitation=SimpleNamespace(trajectory=trajectory))
    assert positions_along(path) == "positions"
    assert (len(asked[0]), asked[0][0], asked[0][-1]) == (512, 0.0, 4.0)
