"""The torque offset asked at standstill, on the simulated arm: right ones pass, wrong ones never reach motion."""

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.config import load_robot
from armload_controller.control import MotionControl
from armload_controller.cycle import Cycle
from armload_controller.errors import MotionError
from armload_controller.monitor import FollowingMonitor
from armload_controller.offset_check import OffsetCheck, OffsetRefused, tried_torque
from armload_controller.torque_gate import TorqueGate
from armload_drivers.fake_servos import FakeServos
from armload_drivers.plant import ArmPlant
from armload_identification.signals import Transmission

ROBOT = load_robot("prbt")
POSITION = np.array([0.2, 0.7, 1.1, 0.3, 0.9, 0.4])
PATH = POSITION + np.linspace(-1.0, 1.0, 50)[:, None] * np.array([1.0, 0.8, 0.6, 0.5, 0.9, 0.4])
UNIT = Transmission(np.ones(2), np.eye(2))


class WrongOffset:
    """A plant whose drives make something else of their offset."""

    def __init__(self, plant, factor):
        self._plant, self._factor = plant, factor

    def __getattr__(self, name):
        return getattr(self._plant, name)

    def set_torque_offset(self, axis, torque_nm):
        self._plant.set_torque_offset(axis, torque_nm * self._factor[axis])


def check(factor):
    """Try the offset of a loaded arm at rest; the verdict, and how far the arm moved meanwhile."""
    spec = replace(ROBOT.plant_spec("gripper"), start_position_rad=POSITION)
    plant = ArmPlant(spec)
    servos = FakeServos(ROBOT.arm_settings(), WrongOffset(plant, factor))
    servos.connect()
    limits = ROBOT.motion_limits()
    tried = tried_torque(ROBOT.chain(), ROBOT.simulated_payload("gripper"), PATH)
    offset = OffsetCheck(ROBOT.joint_names, ROBOT.transmission(), tried, servos.cycle_s)
    gate = TorqueGate(ROBOT.torque_max_nm(), servos.cycle_s)
    cycle = Cycle(servos, limits, gate, MotionControl(), [FollowingMonitor(limits, 3), offset])
    with cycle.powered() as arm:
        arm.hold(offset.done)
        moved = np.abs(plant.sample(0.01).joint_position_rad - POSITION).max()
        offset.verdict().require()
    return offset.verdict(), moved


def test_a_right_offset_is_usable_wherever_the_payload_weighs():
    verdict, moved = check(np.ones(6))
    assert verdict.usable[[1, 2, 4]].all()
    assert not verdict.usable[0]
    assert np.abs(verdict.gain[[1, 2, 4]] - 1.0).max() < 0.2
    assert moved < 2e-3


@pytest.mark.parametrize(
    ("factor", "text"),
    [(-1.0, "the sign is wrong"), (2.0, "the scale is wrong"), (0.4, "the scale is wrong"), (0.0, "does not take it")],
)
def test_one_wrong_drive_is_named_and_stops(factor, text):
    factors = np.ones(6)
    factors[2] = factor
    with pytest.raises(MotionError, match=f"added torque does not.*prbt_joint_3 was given.*{text}") as caught:
        check(factors)
    assert isinstance(caught.value.__cause__, OffsetRefused)
    assert caught.value.__cause__.joints == ("prbt_joint_3",)


def test_an_arm_whose_answer_is_lost_in_noise_gets_no_torque(ideal_servos):
    rng = np.random.default_rng(5)
    check = OffsetCheck(("a", "b"), UNIT, np.array([0.01, 0.0]), 0.01)
    servos = ideal_servos(2, 0.01)
    servos.events = {k: lambda f: replace(f, current_a=rng.normal(size=2)) for k in range(10_000)}
    limits = replace(ROBOT.motion_limits(), joint_names=("a", "b"))
    limits = replace(limits, **{k: getattr(limits, k)[:2] for k in limits.__slots__ if k != "joint_names"})
    cycle = Cycle(servos, limits, TorqueGate(np.full(2, 50.0), 0.01), MotionControl(), [check])
    with cycle.powered() as arm:
        arm.hold(check.done)
    assert check.verdict().fits == 20
    with pytest.raises(OffsetRefused, match="no joint's answer can be told from the noise"):
        check.verdict().require()
