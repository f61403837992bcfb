"""What every `JointServos` does: one suite over all implementations."""

import numpy as np
import pytest

from armload_drivers.arm import OperationMode
from armload_drivers.cia402 import State, decode
from armload_drivers.errors import CommandError, StateError
from armload_drivers.fake_servos import FakeServos
from armload_drivers.servos import JointCommand, JointServos
from armload_drivers.simulated_plant import IdealPlant

START_AXIS_RAD = np.array([0.1, -0.2, 0.3])
AXIS_TORQUE_NM = np.array([20.0, -40.0, 60.0])
ZERO = np.zeros(3)


class Rig:
    """Servos and the plant they move."""

    def __init__(self, servos, plant, arm):
        self.servos, self.plant, self.arm = servos, plant, arm
        self.start_rad = arm.coupling @ START_AXIS_RAD
        self.count_rad = 4e-6
        """A joint's position is known to a count or two."""

    def enable(self):
        self.servos.connect()
        return self.servos.enable()

    def hold(self, cycles=1, position_rad=None, torque_offset_nm=ZERO):
        position_rad = self.start_rad if position_rad is None else position_rad
        for _ in range(cycles):
            feedback = self.servos.exchange(JointCommand(position_rad, ZERO, torque_offset_nm))
        return feedback

    def move(self, cycles, speed_rad_s=0.5):
        for cycle in range(1, cycles + 1):
            position_rad = self.start_rad + cycle * self.arm.cycle_s * speed_rad_s
            feedback = self.hold(1, position_rad)
        return position_rad, feedback


@pytest.fixture(params=["fake", "canopen in CSP", "canopen in IP"])
def rig(request, virtual_arm, arm_settings):
    if request.param == "fake":
        arm = arm_settings()
        plant = IdealPlant(START_AXIS_RAD, AXIS_TORQUE_NM)
        return Rig(FakeServos(arm, plant), plant, arm)
    mode = OperationMode.CYCLIC_SYNCHRONOUS_POSITION
    if request.param.endswith("IP"):
        mode = OperationMode.INTERPOLATED_POSITION
    bench = virtual_arm(arm_settings(mode=mode))
    return Rig(bench.servos, bench.plant, bench.arm)


def test_it_is_a_joint_servos(rig):
    assert isinstance(rig.servos, JointServos)
    assert rig.servos.n == 3
    assert rig.servos.cycle_s == rig.arm.cycle_s


def test_connecting_energises_nothing(rig):
    rig.servos.connect()
    assert rig.servos.simulated
    assert not any(rig.plant.powered)
    assert rig.plant.position_rad == pytest.approx(START_AXIS_RAD)


def test_enabling_holds_the_measured_position(rig):
    feedback = rig.enable()
    assert all(rig.plant.powered)
    assert rig.plant.position_rad == pytest.approx(START_AXIS_RAD, abs=rig.count_rad)
    assert feedback.position_rad == pytest.approx(rig.start_rad, abs=rig.count_rad)
    assert not feedback.missing.any()
    assert [decode(int(word)) for word in feedback.statusword] == [State.OPERATION_ENABLED] * 3


def test_a_command_is_reached_one_cycle_after_the_sync_that_latched_it(rig):
    before = rig.enable().position_rad
    target = rig.start_rad + np.array([0.01, -0.02, 0.03])
    latched = rig.hold(1, target)
    assert latched.position_rad == pytest.approx(before, abs=rig.count_rad)
    assert rig.hold(1, target).position_rad == pytest.approx(target, abs=rig.count_rad)


def test_cycles_are_numbered_and_stamped(rig):
    first = rig.enable()
    feedback = [rig.hold() for _ in range(5)]
    assert [f.cycle for f in feedback] == [first.cycle + k for k in range(1, 6)]
    assert [f.time_s - first.time_s for f in feedback] == pytest.approx([k * rig.arm.cycle_s for k in range(1, 6)])
    assert all(f.skipped_cycles == 0 for f in feedback)


def test_currents_are_the_motors_and_positions_the_joints(rig):
    rig.enable()
    feedback = rig.hold(2)
    assert feedback.torque_nm is None
    assert feedback.current_a == pytest.approx(AXIS_TORQUE_NM * 10.0 / 200.0, abs=0.01)


def test_a_joint_torque_offset_reaches_the_axes(rig):
    rig.enable()
    offset_nm = np.array([10.0, -20.0, 30.0])
    rig.hold(1, torque_offset_nm=offset_nm)
    expected = rig.arm.coupling.T @ offset_nm
    assert rig.plant.torque_offset_nm == pytest.approx(expected, abs=0.1)


def test_a_setpoint_that_is_no_number_is_refused_and_moves_nothing(rig):
    rig.enable()
    rig.hold(2)
    with pytest.raises(CommandError, match="joint_3"):
        rig.hold(1, np.array([0.1, np.nan, 0.3]))
    rig.hold(2)
    assert rig.plant.position_rad == pytest.approx(START_AXIS_RAD, abs=rig.count_rad)


def test_stop_brings_a_moving_arm_to_rest_with_torque_on(rig):
    rig.enable()
    last, _ = rig.move(50)
    rig.servos.stop()
    assert all(rig.plant.powered)
    assert rig.plant.velocity_rad_s == pytest.approx(ZERO)
    joints = rig.arm.coupling @ rig.plant.position_rad
    # It goes on in its direction and no further than its ramp takes it.
    assert np.all(joints >= last - 0.5 * rig.arm.cycle_s - rig.count_rad)
    assert np.all(joints <= last + 0.1)


def test_after_a_stop_nothing_is_taken_until_disabled_and_enabled_again(rig):
    rig.enable()
    rig.servos.stop()
    with pytest.raises(StateError):
        rig.hold()
    with pytest.raises(StateError):
        rig.servos.enable()
    rig.servos.disable()
    rig.servos.enable()
    rig.hold(2)


def test_disable_removes_torque_where_the_arm_stands(rig):
    rig.enable()
    rig.move(10)
    rig.servos.disable()
    assert not any(rig.plant.powered)
    assert rig.plant.velocity_rad_s == pytest.approx(ZERO)
    stood = rig.plant.position_rad
    feedback = rig.servos.enable()
    assert feedback.position_rad == pytest.approx(rig.arm.coupling @ stood, abs=rig.count_rad)
    assert rig.plant.position_rad == pytest.approx(stood, abs=rig.count_rad)


def test_torque_offsets_do_not_outlive_the_torque(rig):
    rig.enable()
    rig.hold(1, torque_offset_nm=np.array([10.0, 10.0, 10.0]))
    rig.servos.disable()
    rig.servos.enable()
    assert rig.plant.torque_offset_nm == pytest.approx(ZERO)


def test_stop_and_disable_without_torque_do_nothing(rig):
    rig.servos.connect()
    rig.servos.stop()
    rig.servos.disable()
    assert rig.plant.position_rad == pytest.approx(START_AXIS_RAD)


@pytest.mark.parametrize("moving", [False, True])
def test_close_leaves_no_torque_and_may_be_repeated(rig, moving):
    rig.enable()
    if moving:
        rig.move(10)
    rig.servos.close()
    rig.servos.close()
    assert not any(rig.plant.powered)
    assert rig.plant.velocity_rad_s == pytest.approx(ZERO)
    with pytest.raises(StateError):
        rig.hold()


def test_closing_what_was_never_opened_is_allowed(rig):
    rig.servos.close()


@pytest.mark.parametrize("call", ["enable", "exchange", "stop", "disable"])
def test_nothing_works_before_connecting(rig, call):
    with pytest.raises(StateError):
        rig.hold() if call == "exchange" else getattr(rig.servos, call)()


def test_nothing_is_exchanged_before_enabling_and_nothing_is_done_twice(rig):
    rig.servos.connect()
    with pytest.raises(StateError):
        rig.servos.connect()
    with pytest.raises(StateError):
        rig.hold()
    rig.servos.enable()
    with pytest.raises(StateError):
        rig.servos.enable()
