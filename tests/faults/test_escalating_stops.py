"""An axis whose loop has failed loses its torque at once, and whatever ends a stop, no drive stays powered."""

import re

import numpy as np
import pytest

from armload_drivers.cia402.object_dictionary import NmtState
from armload_drivers.cia402.state_machine import State
from armload_drivers.driver_errors import CommandError, DriverError, LoopLost, TorqueRemains
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.plant_interface import FROZEN, REVERSED, EncoderFault
from tests.even_motion import enabled, move
from tests.ideal_plant import IdealPlant

ZERO = np.zeros(3)
RPDO_3, SDO_3 = 0x203, 0x603
BROKEN = {"reversed": REVERSED, "frozen": FROZEN, "jump": EncoderFault(jump_rad=0.05)}


class Runaway(IdealPlant):
    """An axis that does not slow down when its drive does."""

    runs = ()

    def slow_down(self, axis, over_s):
        if axis in self.runs:
            self._ramp(axis, self.hold_position(axis) + 100.0 * self.velocity_rad_s[axis], 100.0)
        else:
            super().slow_down(axis, over_s)


def frames(arm, cob_id):
    return [bytes(message.data) for message in arm.heard() if message.arbitration_id == cob_id]


def broken(arm, *node_ids, fault=REVERSED):
    """Let encoders fail in motion; the error with which the motion ends."""
    arm.enable()
    arm.move(30)
    arm.heard()
    for node_id in node_ids:
        arm.drives.fail_encoder(node_id, fault)
    return arm.failure(LoopLost)


@pytest.mark.parametrize("fault", BROKEN)
def test_an_axis_whose_loop_is_lost_has_no_torque_in_the_next_cycle(fault_arm, fault):
    arm = fault_arm()
    error = broken(arm, 3, fault=BROKEN[fault])
    assert (error.node_id, error.joint) == (3, "joint_3")
    assert "left its predicted course" in str(error)
    arm.heard()
    arm.servos.stop()
    words = [int.from_bytes(data[:2], "little") for data in frames(arm, RPDO_3)]
    assert set(words) == {0}, "disable voltage, from the first frame on"
    assert arm.plant.powered == [True, False, True], "the others hold with torque"
    assert arm.plant.velocity_rad_s[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-3)
    arm.servos.disable()
    arm.has_no_torque()


def test_if_two_axes_are_lost_all_lose_their_torque(fault_arm):
    arm = fault_arm()
    broken(arm, 2, 3)
    arm.servos.stop()
    arm.has_no_torque()
    arm.servos.disable()


def test_an_axis_that_goes_the_wrong_way_during_a_stop(fault_arm):
    arm = fault_arm(plant=Runaway(np.linspace(0.1, 0.3, 3)))
    arm.plant.runs = (1,)
    arm.enable()
    arm.move(30)
    arm.drives.fail_encoder(3, EncoderFault(scale=-1.5))
    with pytest.raises(LoopLost, match=r"joint_3.*quick stop"):
        arm.servos.stop()
    assert arm.plant.powered == [True, False, True]
    arm.servos.disable()
    arm.has_no_torque()


def test_an_axis_that_does_not_slow_down(fault_arm):
    arm = fault_arm(plant=Runaway(np.linspace(0.1, 0.3, 3)))
    arm.plant.runs = (1,)
    arm.enable()
    arm.move(30, 1.0)
    with pytest.raises(LoopLost, match=r"joint_3.*are commanded"):
        arm.servos.stop()
    assert arm.plant.powered == [True, False, True]
    arm.servos.disable()
    arm.has_no_torque()


class Falling(Runaway):
    """And falls without torque."""

    def set_powered(self, axis, on):
        falls = axis in self.runs and self.powered[axis] and not on
        super().set_powered(axis, on)
        if falls:
            self._ramp(axis, self.position_rad[axis] - 1.0, 10.0)


def test_the_error_that_comes_first_is_the_one_that_is_raised(virtual_arm):
    plant = Falling(np.array([0.1, -0.2, 0.3]))
    arm = virtual_arm(plant=plant)
    plant.runs = (1,)
    move(arm, enabled(arm), 30, 1.0)
    with pytest.raises(LoopLost, match="joint_3"):
        arm.servos.disable()
    assert not any(plant.powered)


@pytest.mark.parametrize("phase", ["stop", "disable"])
def test_an_axis_that_never_comes_to_rest_keeps_its_torque_no_longer_than_the_wait(virtual_arm, phase):
    """Slower than what counts as leaving its course."""
    plant = Runaway(np.array([0.1, -0.2, 0.3]))
    arm = virtual_arm(plant=plant)
    plant.runs = (1,)
    move(arm, enabled(arm), 30, 0.1)
    with pytest.raises(LoopLost, match=r"joint_3.*did not come to rest within \d.0 s"):
        getattr(arm.servos, phase)()
    assert not any(plant.powered)
    arm.servos.disable()


def test_a_drive_that_ignores_its_controlword_is_reset(fault_arm):
    """Neither by RPDO nor by SDO; only this node is reset."""
    arm = fault_arm(traits={3: DriveTraits(stuck_in=State.OPERATION_ENABLED)})
    broken(arm, 3)
    arm.heard()
    arm.servos.stop()
    heard = arm.heard()
    assert [bytes(m.data) for m in heard if m.arbitration_id == 0x000 and m.data[0] == 0x81] == [b"\x81\x03"]
    asked = next(bytes(message.data) for message in heard if message.arbitration_id == SDO_3)
    assert asked[:3] == b"\x2b\x40\x60"
    assert arm.plant.powered == [True, False, True]
    arm.servos.disable()
    arm.has_no_torque()


def test_a_drive_in_its_fault_reaction_that_runs_away_is_reset(fault_arm):
    """Disable voltage has no effect in FAULT REACTION ACTIVE."""
    arm = fault_arm(plant=Runaway(np.linspace(0.1, 0.3, 3)))
    arm.plant.runs = (1,)
    arm.enable()
    arm.move(30, 1.0)
    # With a slow ramp the drive would stay in its fault reaction for seconds.
    arm.send(SDO_3, b"\x23\x85\x60\x00" + (10**4).to_bytes(4, "little"))
    arm.drives.fail(3, 0x2310)
    arm.failure(DriverError)
    with pytest.raises(LoopLost, match="joint_3"):
        arm.servos.stop()
    assert arm.plant.powered == [True, False, True]
    assert arm.drives._drives[3].state is NmtState.PRE_OPERATIONAL
    arm.servos.disable()
    arm.has_no_torque()


def test_an_axis_that_is_lost_while_it_is_enabled(fault_arm):
    """The encoder counts backwards from the first: the drive's loop accelerates as soon as it is closed."""

    class Bolting(IdealPlant):
        def set_powered(self, axis, on):
            super().set_powered(axis, on)
            if on and axis == 1:
                self._ramp(axis, self.position_rad[axis] + 10.0, 1.0)

        def set_target(self, axis, position_rad, over_s):
            if axis != 1:
                super().set_target(axis, position_rad, over_s)

    arm = fault_arm(plant=Bolting(np.linspace(0.1, 0.3, 3)))
    arm.enable()
    with pytest.raises(LoopLost, match=r"joint_3"):
        arm.move(5, 0.0)
    arm.servos.stop()
    assert arm.plant.powered == [True, False, True]
    assert arm.plant.position_rad[1] < 1.0, "five times as fast as the joint may be, but not for long"


@pytest.mark.parametrize("suspect", [None, 0, 1])
def test_an_axis_that_stands_while_its_torque_is_unexpected_loses_it(virtual_arm, suspect):
    """The second axis stands; so far its setpoints have moved by less than proves it without a suspicion."""
    arm = virtual_arm()
    here = move(arm, enabled(arm), 20, 0.0)
    arm.drives.fail_encoder(3, FROZEN)
    move(arm, here, 5, 0.05)
    arm.servos.stop(suspect)
    assert arm.plant.powered == [True, suspect != 1, True]
    arm.servos.disable()
    assert not any(arm.plant.powered)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_setpoint_that_no_axis_could_follow_is_not_sent(fault_arm, direction):
    arm = fault_arm()
    arm.enable()
    arm.move(5)
    arm.heard()
    step_rad = 1.1 * arm.arm.cycle_s * arm.arm.drives[1].velocity_max_rad_s
    far = arm.target_rad + np.array([0.0, direction * step_rad, 0.0])
    with pytest.raises(CommandError, match=r"joint_3.*velocity_max_rad_s.*nothing was sent"):
        arm.servos.exchange(JointCommand(far, ZERO, ZERO))
    assert not frames(arm, RPDO_3)
    arm.move(5)


# Whatever ends the program -----------------------------------------------------------------------------------


class Interrupting:
    """Raises at the n-th frame from a moment on, and at every `again`-th after it."""

    def __init__(self, arm, after, error, again=10**9):
        self._send, self._left, self._error, self._again = arm.bus.send, after, error, again
        arm.bus.send = self.send

    def send(self, message, timeout=None):
        self._left -= 1
        if self._left == 0:
            self._left = self._again
            raise self._error
        self._send(message, timeout)


@pytest.mark.parametrize("again", [10**9, 7], ids=["once", "again and again"])
@pytest.mark.parametrize("phase", ["in motion", "stopped"])
def test_an_operator_who_is_impatient_at_any_moment_leaves_no_torque(virtual_arm, phase, again):
    for frame in (1, 2, 3, 5, 8, 13, 21, 34, 55, 89, 144):
        arm = virtual_arm()
        move(arm, enabled(arm), 20)
        if phase == "stopped":
            arm.servos.stop()
        Interrupting(arm, frame, KeyboardInterrupt(), again)
        notes = []
        try:
            arm.servos.close()
        except KeyboardInterrupt as stop:
            notes = getattr(stop, "__notes__", ())
        assert not any("may still carry torque" in note for note in notes), f"at frame {frame}"
        assert not any(arm.plant.powered), f"at frame {frame}"


def test_a_program_that_fails_while_it_stops_leaves_no_torque(virtual_arm):
    for error in (MemoryError("full"), RuntimeError("a defect"), SystemExit(1)):
        arm = virtual_arm()
        move(arm, enabled(arm), 20)
        Interrupting(arm, 9, error)
        with pytest.raises(type(error)):
            arm.servos.close()
        assert not any(arm.plant.powered)


def test_if_nothing_can_be_read_back_the_error_names_every_node(virtual_arm):
    arm = virtual_arm()
    move(arm, enabled(arm), 20)
    arm.drives.stop()  # all supplies at once
    with pytest.raises(TorqueRemains, match="Press the emergency stop") as raised:
        arm.servos.close()
    assert re.findall(r"\(node (\d)\)", str(raised.value)) == ["2", "3", "5"]
