"""Removal of torque that is interrupted, or of which a part fails: no drive stays powered without being named."""

import os
import signal
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import can
import numpy as np
import pytest

from armload_drivers.cia402.arm_settings import Identity
from armload_drivers.cia402.object_dictionary import NmtState
from armload_drivers.cia402.state_machine import State
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import AxisMoves, BusError, DriverError, LoopLost, ServoError, TorqueRemains
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.uninterrupted import uninterrupted
from tests.even_motion import enabled, move
from tests.ideal_plant import IdealPlant

QUICK = Timeouts(probe_s=0.05, scan_s=0.01, boot_s=0.3, sdo_s=0.1, mode_s=0.1, stop_s=1.0, disable_s=0.5)


def in_motion(virtual_arm, **options):
    arm = virtual_arm(timeouts=QUICK, **options)
    arm.here = move(arm, enabled(arm), 20)
    return arm


def all_the_way(arm):
    """Every step to the end of a program; the errors on the way."""
    errors = []
    for step in (arm.servos.stop, arm.servos.disable, arm.servos.close):
        try:
            step()
        except DriverError as error:
            errors.append(error)
    return errors


@pytest.mark.parametrize("frames", [5, 12, 19, 22, 25, 30, 39, 60])
def test_a_drive_that_is_heard_again_during_the_removal_keeps_no_torque(virtual_arm, frames):
    arm = in_motion(virtual_arm)
    arm.drives.drop_feedback(3, frames)
    with suppress(ServoError):
        move(arm, arm.here, 30)
    all_the_way(arm)
    assert not any(arm.plant.powered)


class Runaway(IdealPlant):
    """The second axis runs away whatever its drive asks."""

    away = False

    def slow_down(self, axis, over_s):
        if not (axis == 1 and self.away):
            super().slow_down(axis, over_s)

    def set_target(self, axis, position_rad, over_s):
        if not (axis == 1 and self.away):
            super().set_target(axis, position_rad, over_s)

    def run_away(self):
        self.away = True
        self._ramp(1, self.hold_position(1) + 30.0, 30.0)


class Falling(IdealPlant):
    """The second axis falls without torque."""

    def set_powered(self, axis, on):
        super().set_powered(axis, on)
        if axis == 1 and not on:
            self._ramp(1, self.hold_position(1) - 1.0, 1.0)


def test_an_axis_that_loses_its_loop_and_its_feedback_at_once_is_not_waited_for(virtual_arm):
    plant = Runaway(np.array([0.1, -0.2, 0.3]))
    arm = in_motion(virtual_arm, plant=plant)
    begun_s, begun_rad = arm.clock(), plant.position_rad[1]
    plant.run_away()
    arm.drives.drop_feedback(3, 10**9)
    with pytest.raises(ServoError):
        move(arm, arm.here, 30, 0.0)
    errors = all_the_way(arm)
    assert any(isinstance(error, LoopLost) for error in errors)
    assert not any(plant.powered)
    assert arm.clock() - begun_s < 1.0
    assert plant.position_rad[1] - begun_rad < 0.7


def refusing(arm, node_id, error):
    """Nothing can be sent to a node any more."""
    send = arm.servos._link.send

    def sends(message):
        if message.arbitration_id & 0x7F == node_id:
            raise error
        send(message)

    arm.servos._link.send = sends

    def writes(*args):
        raise error

    arm.servos.setups[1]._sdo.write = writes


@pytest.mark.parametrize("error", [RuntimeError("a defect"), MemoryError()])
def test_an_error_at_one_drive_keeps_the_torque_of_no_other(virtual_arm, error):
    arm = in_motion(virtual_arm)
    refusing(arm, 3, error)
    with pytest.raises(TorqueRemains, match=r"joint_3 \(node 3\)") as raised:
        arm.servos.close()
    assert "joint_5" not in str(raised.value)
    assert arm.plant.powered[0] is arm.plant.powered[2] is False


def test_an_end_of_sync_that_fails_does_not_hide_remaining_torque(virtual_arm):
    arm = in_motion(virtual_arm)
    arm.bus.shutdown()

    def fails(link):
        raise BusError("gone")

    arm.servos._sync.end = fails
    with pytest.raises(TorqueRemains) as raised:
        arm.servos.close()
    assert any("gone" in note for note in raised.value.__notes__)
    arm.servos.close()


def test_a_last_write_that_fails_does_not_hide_an_axis_that_falls(virtual_arm):
    arm = in_motion(virtual_arm)
    move(arm, arm.here, 10, 0.0)

    def falls():
        return AxisMoves(3, "joint_3", "removing torque", "it falls", "Support it")

    arm.servos._removal._moving = falls

    def silent(*, on):
        raise BusError("no answer")

    arm.servos.setups[0].watch_master = silent
    with pytest.raises(AxisMoves):
        arm.servos.disable()
    assert not any(arm.plant.powered)
    arm.servos.close()


def test_an_axis_that_falls_is_told_beside_one_that_was_lost(virtual_arm):
    arm = in_motion(virtual_arm)
    move(arm, arm.here, 10, 0.0)
    lost = LoopLost(2, "joint_2", "quick stop", "it turned", "Look")

    def stops():
        raise lost

    arm.servos._nodes[0]._still_cycles = 0
    arm.servos.stop = stops
    arm.servos._removal._moving = lambda: AxisMoves(3, "joint_3", "removing torque", "it falls", "Support it")
    with pytest.raises(LoopLost) as raised:
        arm.servos.disable()
    assert any("it falls" in note for note in raised.value.__notes__)
    del arm.servos.stop
    arm.servos.close()


def test_an_axis_that_falls_and_falls_silent_is_reported(virtual_arm):
    arm = in_motion(virtual_arm, plant=Falling(np.array([0.1, -0.2, 0.3])))
    move(arm, arm.here, 10, 0.0)
    since = []

    def silenced(message):
        if message.arbitration_id == 0x080 and not any(arm.plant.powered):
            since.append(message)
            if len(since) == 12:
                arm.drives.drop_feedback(3, 10**9)

    arm.monitor.listen(silenced)
    with pytest.raises(AxisMoves, match="joint_3"):
        arm.servos.disable()


def stubborn(virtual_arm):
    """An arm of which one drive obeys nothing, and reboots only its communication."""
    arm = in_motion(virtual_arm, traits={3: DriveTraits(stuck_in=State.OPERATION_ENABLED)})
    drive = arm.drives._drives[3]

    def boot():
        drive._send(0x703, bytes([NmtState.BOOT_UP.value]))
        drive.state = NmtState.PRE_OPERATIONAL

    drive._boot = boot
    return arm


def test_a_drive_that_boots_and_keeps_its_torque_is_named(virtual_arm):
    arm = stubborn(virtual_arm)
    errors = all_the_way(arm)
    assert arm.plant.powered == [False, True, False]
    assert isinstance(errors[-1], TorqueRemains)
    assert "joint_3 (node 3)" in str(errors[-1])


def test_torque_that_remains_is_named_again_and_its_boot_not_awaited_again(virtual_arm):
    arm = stubborn(virtual_arm)
    arm.drives._drives[3]._boot = lambda: None
    with pytest.raises(ServoError):
        arm.servos.stop()
    with pytest.raises(TorqueRemains):
        arm.servos.disable()
    waits, pump = [], arm.servos._link.pump_until

    def pumped(done, limit_s):
        waits.append(limit_s)
        return pump(done, limit_s)

    arm.servos._link.pump_until = pumped
    cycles = arm.servos._cycle.number
    with pytest.raises(TorqueRemains, match=r"joint_3 \(node 3\)"):
        arm.servos.close()
    assert arm.servos._cycle.number == cycles
    assert QUICK.boot_s not in waits


# Interruptions ---------------------------------------------------------------------------------------------------


@pytest.fixture
def interruptible():
    """SIGINT is an exception, also in a background job, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.usefixtures("interruptible")
def test_a_signal_waits_until_the_torque_is_off(virtual_arm):
    """As in a program without handlers of its own, where Ctrl-C is an exception anywhere."""
    arm = in_motion(virtual_arm)
    asked = []

    def interrupts(message):
        if message.arbitration_id == 0x203 and any(arm.plant.powered):
            asked.append(message.data[0])
            os.kill(os.getpid(), signal.SIGINT)

    arm.monitor.listen(interrupts)
    with pytest.raises(KeyboardInterrupt):
        arm.servos.close()
    assert not any(arm.plant.powered)
    assert 0x02 in asked, "a quick stop first"


@pytest.fixture
def noted():
    """Numbers of the signals that a program's own handlers have received."""
    seen = []
    numbers = signal.SIGUSR1, signal.SIGUSR2
    before = [signal.signal(number, lambda number, frame: seen.append(number)) for number in numbers]
    yield seen
    for number, handler in zip(numbers, before, strict=True):
        signal.signal(number, handler)


def test_signals_are_handled_after_the_block_in_their_order(noted):
    with uninterrupted():
        with uninterrupted():
            os.kill(os.getpid(), signal.SIGUSR2)
        os.kill(os.getpid(), signal.SIGUSR1)
        assert noted == []
    assert noted == [signal.SIGUSR2, signal.SIGUSR1]


def test_in_another_thread_signals_stay_as_they_are():
    def work():
        with uninterrupted():
            return signal.getsignal(signal.SIGINT)

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(work).result() is signal.getsignal(signal.SIGINT)


@pytest.mark.parametrize("error", [KeyboardInterrupt(), MemoryError()])
def test_enabling_that_is_interrupted_leaves_no_torque(virtual_arm, error):
    arm = virtual_arm(timeouts=QUICK)
    arm.servos.connect()
    cycle = arm.servos._cycle
    checked = cycle.run_checked

    def interrupted(step, *, must_follow):
        feedback = checked(step, must_follow=must_follow)
        if any(arm.plant.powered):
            raise error
        return feedback

    cycle.run_checked = interrupted
    with pytest.raises(type(error)):
        arm.servos.enable()
    assert not any(arm.plant.powered)
    arm.servos.close()


# A drive that is slow ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("heard", ["heartbeat", "setpoints"])
def test_a_silent_drive_that_is_at_work_is_sent_nothing(virtual_arm, arm_settings, heard):
    """It is slow in SDO; PRE-OPERATIONAL would stop its axis."""
    identity = Identity(0x1AB, 0xC0DE)
    arm = virtual_arm(
        arm_settings(identity=identity),
        timeouts=QUICK,
        traits={node: DriveTraits(identity=identity) for node in (2, 3, 5)},
    )
    frame = {"heartbeat": (0x703, [NmtState.OPERATIONAL.value]), "setpoints": (0x203, [0x1F, 0, 0, 0, 0, 0])}[heard]
    pump = arm.servos._link.pump_for

    def pumped(seconds):
        arm.monitor.send(can.Message(arbitration_id=frame[0], data=frame[1], is_extended_id=False))
        pump(seconds)

    arm.servos._link.pump_for = pumped
    arm.drives.switch_off(3)
    with pytest.raises(ServoError, match=r"joint_3 \(node 3\).*it does not answer, and"):
        arm.servos.connect()
    assert arm.frames(0) == []


# After a second hostile reading ----------------------------------------------------------------------------------


class HalfStuck(Runaway):
    """Besides, the third axis is slow to stop."""

    def slow_down(self, axis, over_s):
        super().slow_down(axis, 2.0 if axis == 2 else over_s)


def test_a_silent_runaway_does_not_wait_for_an_axis_that_stops_slowly(virtual_arm):
    plant = HalfStuck(np.array([0.1, -0.2, 0.3]))
    arm = in_motion(virtual_arm, plant=plant)
    begun_s, off_s = arm.clock(), []
    plant.run_away()
    arm.drives.drop_feedback(3, 10**9)
    arm.monitor.listen(lambda message: off_s.append(arm.clock()) if not plant.powered[1] else None)
    with pytest.raises(ServoError):
        move(arm, arm.here, 30, 0.0)
    all_the_way(arm)
    assert not any(plant.powered)
    assert off_s[0] - begun_s < 0.6


def test_an_axis_that_falls_is_reported_whichever_frame_is_lost(virtual_arm):
    for frame in range(8):
        arm = in_motion(virtual_arm, plant=Falling(np.array([0.1, -0.2, 0.3])))
        move(arm, arm.here, 10, 0.0)
        since = []

        def silenced(message, arm=arm, since=since, frame=frame):
            if message.arbitration_id == 0x080:
                since.append(message)
                if len(since) == frame + 1:
                    arm.drives.drop_feedback(3, 1)

        arm.monitor.listen(silenced)
        with pytest.raises(AxisMoves, match="joint_3"):
            arm.servos.disable()


def test_a_drive_that_never_had_torque_has_not_left_its_course(virtual_arm):
    arm = virtual_arm(timeouts=QUICK)
    arm.servos.connect()
    arm.drives.drop_feedback(3, 10**9)
    with pytest.raises(ServoError) as raised:
        arm.servos.enable()
    assert not any("course" in note for note in getattr(raised.value, "__notes__", ()))
    assert not any(arm.plant.powered)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interruption_does_not_replace_the_error_that_matters(number):
    before = signal.signal(number, signal.default_int_handler if number == signal.SIGINT else signal.SIG_DFL)

    @uninterrupted()
    def fails():
        os.kill(os.getpid(), number)
        raise TorqueRemains(3, "joint_3", "removing torque", "it remains", "Press the emergency stop")

    try:
        with pytest.raises(TorqueRemains) as raised:
            fails()
    finally:
        signal.signal(number, before)
    assert getattr(raised.value, "__notes__", []) == ["Interrupted: KeyboardInterrupt"] * (number == signal.SIGINT)


def test_nothing_is_sent_if_a_drive_that_was_slow_turns_out_to_be_enabled(virtual_arm, arm_settings):
    identity = Identity(0x1AB, 0xC0DE)
    arm = virtual_arm(
        arm_settings(identity=identity),
        timeouts=QUICK,
        traits={node: DriveTraits(identity=identity) for node in (2, 3, 5)},
    )
    setup, asked = arm.servos.setups[0], []
    identify = setup.identify_before_reset
    setup.identify_before_reset = lambda: bool(asked.append(None) or len(asked) > 1) and identify()
    setup.read_powered_state = lambda: State.OPERATION_ENABLED
    arm.drives.switch_off(3)
    with pytest.raises(ServoError, match=r"joint_2 \(node 2\).*the drive carries torque in OPERATION ENABLED"):
        arm.servos.connect()
    assert arm.frames(0) == []
