"""Scripted failures of simulated drives in motion, in lockstep: the master's error and the arm's reaction."""

import math
from contextlib import nullcontext

import can
import numpy as np
import pytest

from armload_drivers.bring_up.drive_check import reset
from armload_drivers.canopen.canopen_bring_up import CanopenBringUp
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.eds_parser import parse_description
from armload_drivers.cia402.object_dictionary import NmtState
from armload_drivers.cia402.state_machine import State, state_in
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import (
    BusError,
    DriverError,
    LoopLost,
    ServoError,
    ServoFault,
    ServoTimeout,
    SimulationError,
    TorqueRemains,
)
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drive_dictionary import QUICK_STOP_DECELERATION_RAD_S2, DriveTraits
from armload_drivers.simulation.lockstep_sync import LockstepSync
from tests.bounded import MOST_FRAMES, overheard
from tests.drive_descriptions import eds, maker_drive
from tests.even_motion import ZERO, enabled, move, move_until_error
from tests.ideal_plant import IdealPlant

QUICK = Timeouts(probe_s=0.02, scan_s=0.01, boot_s=0.05, sdo_s=0.05, mode_s=0.05)
"""For tests in which a node does not answer."""

QUICK_STOP = 0x02
"""Controlword."""

# Faults in motion --------------------------------------------------------------------------------------------


def test_a_drive_fault_in_motion_names_the_drive_and_the_cause(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    move(arm, start, 20)
    arm.drives.fail(3, 0x2310)
    error = move_until_error(arm, start + 0.1, ServoFault)
    assert (error.node_id, error.joint) == (3, "joint_3")
    assert "0x2310" in str(error)
    assert "overcurrent" in str(error)
    assert "reset" in str(error)

    arm.servos.stop()
    assert arm.plant.powered == [True, False, True], "the others hold with torque on"
    assert arm.plant.velocity_rad_s == pytest.approx(ZERO)
    arm.servos.disable()
    assert not any(arm.plant.powered)


def test_a_faulty_drive_decelerates_before_its_torque_goes(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    move(arm, start, 20)
    arm.drives.fail(3, 0x2310)
    move_until_error(arm, start + 0.1, ServoFault)
    assert arm.plant.powered[1], "the first answer comes from FAULT REACTION ACTIVE, on the ramp"
    assert arm.plant.velocity_rad_s[1] > 0.0


def test_nothing_re_enables_by_itself_after_a_fault(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    arm.drives.fail(3, 0x4310)
    move_until_error(arm, start, ServoFault)
    for _ in range(20):
        with pytest.raises(ServoFault):
            arm.servos.exchange(JointCommand(start, ZERO, ZERO))
    assert not arm.plant.powered[1]
    arm.servos.disable()
    with pytest.raises(ServoFault, match="0x4310"):
        arm.servos.enable()
    assert not any(arm.plant.powered)


def test_a_fault_is_reset_by_name_and_the_arm_enabled_again(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    arm.drives.fail(3, 0x4310)
    move_until_error(arm, start, ServoFault)
    arm.servos.disable()
    reset(CanopenBringUp(arm.arm, arm.bus), "joint_3", lambda question: False)
    assert not any(arm.plant.powered)
    feedback = arm.servos.enable()
    assert [state_in(int(word)) for word in feedback.statusword] == [State.OPERATION_ENABLED] * 3
    move(arm, feedback.position_rad, 5)


def test_a_following_error_is_a_fault(virtual_arm, arm_settings):
    """The settings allow 0.5 rad; an axis that falls behind slowly does not leave its course before."""
    arm = virtual_arm()
    start = enabled(arm)
    for cycle in range(250):
        arm.plant.lag_rad = np.array([0.0, 0.002 * cycle, 0.0])
        arm.servos.exchange(JointCommand(start, ZERO, ZERO))
    arm.plant.lag_rad = np.array([0.0, 0.501, 0.0])
    with pytest.raises(ServoFault) as raised:
        move(arm, start, 10, 0.0)
    error = raised.value
    assert error.node_id == 3
    assert "following error" in str(error)


# Missing feedback --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("cycles", [1, 3])
def test_missing_feedback_is_counted_and_survived(virtual_arm, cycles):
    arm = virtual_arm()
    start = enabled(arm)
    move(arm, start, 3)
    arm.drives.drop_feedback(5, cycles)
    seen = [arm.servos.exchange(JointCommand(start, ZERO, ZERO)) for _ in range(cycles + 1)]
    assert [feedback.missing.tolist() for feedback in seen] == [[False, False, True]] * cycles + [[False] * 3]
    assert all(np.isfinite(feedback.position_rad).all() for feedback in seen)


def test_feedback_missing_for_longer_than_allowed_is_an_error(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    arm.drives.drop_feedback(5, 4)
    error = move_until_error(arm, start, ServoTimeout)
    assert (error.node_id, error.joint) == (5, "joint_5")
    assert "4 cycles" in str(error)
    assert arm.servos._cycle.number == 8, "raised in the fourth cycle, not later"


def test_a_drive_that_loses_its_supply_in_motion(virtual_arm):
    arm = virtual_arm(timeouts=QUICK)
    start = enabled(arm)
    move(arm, start, 10)
    arm.drives.switch_off(2)
    error = move_until_error(arm, start + 0.05, ServoTimeout)
    assert error.node_id == 2
    arm.servos.stop()
    assert arm.plant.powered == [False, True, True]
    with pytest.raises(TorqueRemains, match=r"joint_2 \(node 2\).*could not be read back. Press the emergency stop"):
        arm.servos.disable()
    assert not any(arm.plant.powered)


def test_a_drive_that_reboots_in_motion(virtual_arm):
    arm = virtual_arm(timeouts=QUICK)
    start = enabled(arm)
    arm.drives.switch_off(2)
    arm.drives.switch_on(2)
    error = move_until_error(arm, start, ServoError)
    assert error.node_id == 2
    assert "rebooted" in str(error)
    arm.servos.stop()
    arm.servos.disable()
    assert not any(arm.plant.powered)


def test_a_lost_heartbeat_is_noticed_although_feedback_comes(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    move(arm, start, 5)
    arm.drives.set_object(3, od.HEARTBEAT_PRODUCER_MS, 0)
    error = move_until_error(arm, start, ServoTimeout)
    assert error.node_id == 3
    assert "heartbeat" in str(error)


def test_another_master_taking_a_drive_out_of_operational(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    move(arm, start, 5)
    arm.monitor.send(can.Message(arbitration_id=0x000, data=[0x80, 3], is_extended_id=False))
    error = move_until_error(arm, start, ServoError)
    assert error.node_id == 3
    arm.servos.stop()
    arm.servos.disable()
    assert not any(arm.plant.powered)


@pytest.mark.parametrize("data", [b"", b"\x37\x12", b"\x37\x12\x00\x00\x00\x00\x00"])
def test_feedback_of_the_wrong_length_is_not_feedback(virtual_arm, data):
    arm = virtual_arm()
    start = enabled(arm)
    arm.monitor.send(can.Message(arbitration_id=0x183, data=data, is_extended_id=False))
    feedback = arm.servos.exchange(JointCommand(start, ZERO, ZERO))
    assert not feedback.missing.any()
    assert feedback.position_rad == pytest.approx(start, abs=1e-5)


class Doomed(IdealPlant):
    """A plant that raises an error at a given time."""

    end_s = math.inf

    def advance(self, time_s):
        if time_s > self.end_s:
            raise RuntimeError("the floor gave way")
        super().advance(time_s)


def test_drives_that_have_ended_early_are_named_with_the_reason(virtual_arm):
    plant = Doomed(np.array([0.1, -0.2, 0.3]))
    arm = virtual_arm(plant=plant)
    start = enabled(arm)
    plant.end_s = plant.time_s + 0.1
    error = move_until_error(arm, start, SimulationError)
    assert "they ended early: RuntimeError('the floor gave way')" in str(error)
    with pytest.raises(DriverError):
        arm.servos.close()
    with pytest.raises(SimulationError, match="the floor gave way"):
        arm.drives.stop()


class SlowSync(LockstepSync):
    """The kernel's timer on a busy machine: every period is too long."""

    def begin(self, link, cycle_s, counter):
        super().begin(link, 1.1 * cycle_s, counter)


def test_simulated_drives_lock_onto_the_period_that_sync_has(virtual_arm):
    """Otherwise every cycle would end with a stop, just when the torque is measured."""
    arm = virtual_arm()
    servos = CanopenServos(arm.arm, arm.bus, SlowSync(arm.clock))
    servos.connect()
    start = servos.enable().position_rad
    speeds = []
    for cycle in range(1, 101):
        servos.exchange(JointCommand(start + 0.005 * cycle, ZERO, ZERO))
        speeds.append((arm.arm.coupling @ arm.plant.velocity_rad_s).min())
    assert min(speeds[60:]) == pytest.approx(0.005 / (1.1 * arm.arm.cycle_s), rel=0.02), "never at rest in between"
    servos.close()


# The master lost ---------------------------------------------------------------------------------------------


def run_without_master(arm, cycles):
    """Let simulated time pass with SYNC from another source and a silent master."""
    for _ in range(cycles):
        arm.clock.advance(arm.arm.cycle_s)
        arm.monitor.send(can.Message(arbitration_id=0x080, is_extended_id=False))
    # An SDO answer proves that the drives have processed all frames.
    arm.frames(0)
    arm.monitor.send(can.Message(arbitration_id=0x602, data=bytes.fromhex("4000100000000000"), is_extended_id=False))
    for _ in range(MOST_FRAMES):
        message = arm.monitor.recv(1.0)
        if message is None or message.arbitration_id == 0x582:
            return
    pytest.fail("no answer among very many frames")


def test_drives_stop_by_themselves_without_setpoints_and_stay_stopped(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    move(arm, start, 20)
    run_without_master(arm, 30)
    assert arm.plant.velocity_rad_s == pytest.approx(ZERO)
    assert all(arm.plant.powered), "a quick stop that holds"
    stood = arm.plant.position_rad
    error = move_until_error(arm, start + 20 * arm.arm.cycle_s * 0.5, ServoError)
    assert "0x8" in str(error)
    assert arm.plant.position_rad == pytest.approx(stood, abs=1e-5), "setpoints that come back move nothing"


def test_a_lost_heartbeat_of_the_master_ends_pdo_communication(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    arm.frames(0)
    run_without_master(arm, 30)
    assert arm.plant.velocity_rad_s == pytest.approx(ZERO)
    with pytest.raises(ServoError):
        move(arm, start, 5)
    assert arm.plant.position_rad == pytest.approx([0.1, -0.2, 0.3], abs=1e-5)


# Stopping ----------------------------------------------------------------------------------------------------


def test_disabling_a_moving_arm_decelerates_it_on_the_drives_ramps(virtual_arm):
    """Setpoints that merely end would stop it within one cycle, with a jerk."""
    arm = virtual_arm()
    last = move(arm, enabled(arm), 20, 0.5)
    arm.servos.disable()
    assert not any(arm.plant.powered)
    ramp_rad = 0.5**2 / (2 * QUICK_STOP_DECELERATION_RAD_S2)
    assert np.all(arm.arm.coupling @ arm.plant.position_rad - last > 0.8 * ramp_rad)


@pytest.mark.parametrize("moving", [False, True])
def test_only_an_arm_that_moves_is_stopped_before_it_is_disabled(virtual_arm, moving):
    arm = virtual_arm()
    move(arm, enabled(arm), 20, 0.5 * moving)
    arm.frames(0)
    arm.servos.disable()
    assert any(data[0] == QUICK_STOP for data in arm.frames(0x203)) is moving


@pytest.mark.parametrize("lost", [None, 3])
def test_drives_watch_their_master_only_while_it_sends_heartbeats(virtual_arm, lost):
    """Otherwise a disabled drive would report its master as lost; a drive that is lost already is not asked."""
    arm = virtual_arm(timeouts=QUICK)
    start = enabled(arm)
    if lost is not None:
        arm.drives.drop_feedback(lost, 1000)
        move_until_error(arm, start, ServoTimeout)
    arm.frames(0)
    arm.servos.disable()
    watch = b"\x23\x16\x10\x01" + bytes(4)
    written = {message.arbitration_id for message in overheard(arm.monitor) if bytes(message.data) == watch}
    assert written == {0x600 + node_id for node_id in (2, 3, 5) if node_id != lost}


def test_a_drive_that_vanishes_after_its_torque_was_removed_is_no_error_of_the_removal(virtual_arm):
    arm = virtual_arm(timeouts=QUICK)
    move(arm, enabled(arm), 5)
    syncs = []

    def vanish(message):
        if message.arbitration_id == 0x080 and not any(arm.plant.powered):
            syncs.append(message)
            if len(syncs) == 5:
                arm.drives.switch_off(3)

    arm.monitor.listen(vanish)
    arm.servos.disable()
    assert len(syncs) > 5
    assert not any(arm.plant.powered)


def test_a_drive_that_cannot_be_disabled_is_reset(virtual_arm):
    """It no longer receives setpoints and refuses the controlword; nothing else removes its torque."""

    def no_controlword(request):
        return 0x0800_0022 if request[:3] == b"\x2b\x40\x60" else None

    arm = virtual_arm(traits={3: DriveTraits(on_request=no_controlword)}, timeouts=QUICK)
    move(arm, enabled(arm), 5)
    # A tool on another cable disables RPDO1.
    arm.drives.set_object(3, od.PdoDirection.RECEIVE.cob_id_entry(0), 0x80000203)
    arm.servos.close()
    drive = arm.drives._drives[3]
    assert drive.state is NmtState.PRE_OPERATIONAL
    assert drive.power.machine.state is State.SWITCH_ON_DISABLED
    assert not any(arm.plant.powered)


# The bus -----------------------------------------------------------------------------------------------------


def test_a_closed_bus_is_a_bus_error(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    arm.bus.shutdown()
    with pytest.raises(BusError):
        arm.servos.exchange(JointCommand(start, ZERO, ZERO))
    with pytest.raises(TorqueRemains, match="emergency stop") as raised:
        arm.servos.close()
    assert all(f"(node {node})" in str(raised.value) for node in (2, 3, 5))
    assert any("sending failed" in note for note in raised.value.__notes__)
    arm.servos.close()


def test_silence_while_this_process_did_not_run_is_not_held_against_a_drive(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    move(arm, start, 3)
    node = arm.servos._nodes[0]
    late_s = arm.clock() + 0.3
    assert "heartbeat" in str(node.problem("waiting", late_s, must_follow=True))
    node.excuse_silence(0.3)
    assert node.problem("waiting", late_s, must_follow=True) is None


class StalledSync(LockstepSync):
    """This process is suspended right after the answers to a SYNC; frames received meanwhile are in its queue."""

    meanwhile = None

    def await_feedback(self, link, complete):
        super().await_feedback(link, complete)
        if self.meanwhile is not None:
            meanwhile, self.meanwhile = self.meanwhile, None
            self._clock.advance(0.5)
            meanwhile()


@pytest.fixture
def stalled(virtual_arm):
    """An enabled arm whose master can be suspended, and a setpoint that holds the arm."""
    arm = virtual_arm()
    sync = StalledSync(arm.clock)
    servos = CanopenServos(arm.arm, arm.bus, sync, QUICK)
    servos.connect()
    hold = JointCommand(servos.enable().position_rad, ZERO, ZERO)
    servos.exchange(hold)
    yield arm, servos, sync, hold
    servos.close()


def test_what_came_while_this_process_did_not_run_is_heard_before_drives_are_judged(stalled):
    arm, servos, sync, hold = stalled
    sync.meanwhile = lambda: arm.monitor.send(
        can.Message(arbitration_id=0x083, data=bytes.fromhex("1023010000000000"), is_extended_id=False)
    )
    with pytest.raises(ServoFault, match="0x2310") as raised:
        servos.exchange(hold)
    assert raised.value.node_id == 3


def test_nobody_is_lost_because_this_process_did_not_run(stalled):
    _, servos, sync, hold = stalled
    sync.meanwhile = lambda: None
    servos.exchange(hold)
    with pytest.raises(ServoFault, match="0x8"):
        servos.exchange(hold)


def test_a_drive_that_was_silent_for_longer_is_lost_all_the_same(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    arm.drives.set_object(3, od.HEARTBEAT_PRODUCER_MS, 0)
    arm.clock.advance(0.05)
    error = move_until_error(arm, start, ServoTimeout)
    assert "heartbeat" in str(error)


# Feedback that has frozen ------------------------------------------------------------------------------------


@pytest.mark.parametrize("in_motion", [True, False], ids=["in motion", "at standstill"])
def test_feedback_that_has_frozen_leaves_no_torque_on(virtual_arm, in_motion):
    """The drive keeps sending its TPDO with old content; it obeys, but its feedback does not show it."""
    arm = virtual_arm()
    start = enabled(arm)
    move(arm, start, 20)
    receive, frozen = arm.bus.recv, []

    def recv(timeout=None):
        message = receive(timeout)
        if message is not None and message.arbitration_id == 0x183:
            frozen.append(bytes(message.data))
            message.data = bytearray(frozen[0])
        return message

    arm.bus.recv = recv
    here = start + 20 * arm.arm.cycle_s * 0.5
    if in_motion:
        with pytest.raises(LoopLost, match=r"joint_3.*moves at 0.00 rad/s, between 0.4\d and 0.49 rad/s are commanded"):
            move(arm, here, 20)
        arm.servos.stop()
        assert arm.plant.powered == [True, False, True]
    else:
        move(arm, here, 20, 0.0)
        with pytest.raises(ServoTimeout, match="joint_3"):
            arm.servos.stop()
    assert arm.plant.velocity_rad_s == pytest.approx(ZERO, abs=1e-3)
    with nullcontext() if in_motion else pytest.raises(ServoTimeout, match=r"joint_3.*SWITCH ON DISABLED"):
        arm.servos.disable()
    assert not any(arm.plant.powered)


def test_a_described_drive_that_has_no_reaction_to_a_lost_master_shows_none(virtual_arm, arm_settings):
    """The standard defines no reaction for a drive without 6007, so the simulated drive must have none."""
    description = parse_description(eds(maker_drive([0x6007, "1400sub5", "1401sub5"])).encode(), "maker.eds")
    arm = virtual_arm(arm_settings(), traits={3: DriveTraits(description=description)})
    start = enabled(arm)
    move(arm, start, 20)
    states = {node: drive.power.machine for node, drive in arm.drives._drives.items()}
    run_without_master(arm, 60)
    assert states[2].state is State.QUICK_STOP_ACTIVE
    assert states[3].state is State.OPERATION_ENABLED
    assert arm.drives._drives[3].state is NmtState.PRE_OPERATIONAL, "1029 = 0 all the same"
