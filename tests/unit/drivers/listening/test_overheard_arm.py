"""Data of an arm under another master, received by listening, compared with that master's own data."""

from __future__ import annotations

from itertools import count, islice

import can
import numpy as np
import pytest

from armload_drivers.cia402.arm_settings import EffortFeedback, FixedPdo, OperationMode
from armload_drivers.cia402.object_dictionary import PdoDirection
from armload_drivers.driver_errors import BusError, CommandError
from armload_drivers.listening.bus_listener import overheard
from armload_drivers.listening.overheard_arm import OverheardArm
from armload_drivers.servos import JointCommand
from tests.bounded import overheard as frames_on

SYNC = 0x80
OFFSET_NM = np.array([6.0, -4.0, 2.0])


class Ear:
    """A bus that fails the test on any call but receiving."""

    def __init__(self, messages):
        self._messages = iter(messages)

    def recv(self, timeout=None):
        return next(self._messages, None)

    def __getattr__(self, name):
        raise AssertionError(f"the listener asked for bus.{name}")


def driven(virtual_arm, arm, steps=5, during=lambda rig, step: None):
    """Drive an arm with this project's master; returns the frames, its feedback and its commands."""
    rig = virtual_arm(arm)
    rig.servos.connect()
    rig.servos.enable()
    frames_on(rig.monitor)
    seen, sent = [], []
    start = arm.coupling @ rig.plant.position_rad
    offset = OFFSET_NM if arm.drives[0].torque_offset else 0.0 * OFFSET_NM
    for step in range(1, steps + 1):
        during(rig, step)
        sent.append(JointCommand(start + 1e-3 * step, np.zeros(3), offset * (step > 2)))
        seen.append(rig.servos.exchange(sent[-1]))
    return frames_on(rig.monitor), seen, sent


def heard_of(arm, frames):
    """Cycles from frames that arrive one second apart."""
    listener = OverheardArm(arm)
    taken = (listener.take(m.arbitration_id, bytes(m.data), float(k)) for k, m in enumerate(frames))
    return [cycle for cycle in taken if cycle is not None], listener


VARIANTS = {
    "current in one PDO": {},
    "IP": {"mode": OperationMode.INTERPOLATED_POSITION},
    "two objects a PDO": {"pdo_objects_max": 2},
    "a fixed mapping in another order": {
        "fixed_pdos": (
            FixedPdo(PdoDirection.RECEIVE, 0, (0x607A0020, 0x60600008, 0x60400010)),
            FixedPdo(PdoDirection.RECEIVE, 2, (0x60B20010,)),
            FixedPdo(PdoDirection.TRANSMIT, 0, (0x60640020, 0x60780010, 0x60410010)),
        )
    },
    "no torque offset": {"torque_offset": False},
    "60B2 of 32 bits": {"torque_offset_bits": 32},
    "torque": {"feedback": EffortFeedback.TORQUE, "rated_current_a": None},
}


@pytest.mark.parametrize("changes", VARIANTS.values(), ids=VARIANTS)
def test_the_listener_hears_what_the_master_commanded_and_got(virtual_arm, arm_settings, changes):
    arm = arm_settings(**changes)
    frames, seen, sent = driven(virtual_arm, arm)
    cycles, _ = heard_of(arm, frames)
    assert len(cycles) == len(seen)
    for heard, own, command in zip(cycles, seen, sent, strict=True):
        np.testing.assert_array_equal(heard.feedback.position_rad, own.position_rad)
        for of_heard, of_own in ((heard.feedback.current_a, own.current_a), (heard.feedback.torque_nm, own.torque_nm)):
            assert (of_heard is None) == (of_own is None)
            if of_own is not None:
                np.testing.assert_array_equal(of_heard, of_own)
        np.testing.assert_array_equal(heard.feedback.statusword, own.statusword)
        np.testing.assert_allclose(heard.command.position_rad, command.position_rad, atol=1e-5)
        np.testing.assert_allclose(heard.command.torque_offset_nm, command.torque_offset_nm, atol=0.2)
        assert heard.enabled
        assert not heard.feedback.missing.any()


def test_a_joint_that_does_not_answer_is_missing_and_repeats_its_last_values(virtual_arm, arm_settings):
    arm = arm_settings()

    def lose(rig, step):
        if step == 3:
            rig.drives.drop_feedback(arm.drives[1].node_id, 1)

    frames, seen, _ = driven(virtual_arm, arm, during=lose)
    cycles, _ = heard_of(arm, frames)
    assert [cycle.feedback.missing.tolist() for cycle in cycles][2] == [False, True, False]
    assert sum(cycle.feedback.missing.any() for cycle in cycles) == 1
    np.testing.assert_array_equal(cycles[2].feedback.position_rad, seen[2].position_rad)


def test_drives_that_carry_no_torque_are_known_as_such(virtual_arm, arm_settings):
    arm = arm_settings()
    rig = virtual_arm(arm)
    rig.servos.connect()
    rig.servos.enable()
    frames_on(rig.monitor)
    rig.servos.disable()
    cycles, _ = heard_of(arm, frames_on(rig.monitor))
    assert not cycles[-1].enabled


def test_what_is_heard_before_everything_is_known_is_no_cycle(virtual_arm, arm_settings):
    arm = arm_settings()
    frames, seen, _ = driven(virtual_arm, arm, steps=2)
    answers = [m for m in frames if m.arbitration_id & ~0x7F == 0x180]
    cycles, listener = heard_of(arm, answers)
    assert not cycles
    assert not listener.silent
    no_setpoints = [m for m in frames if m.arbitration_id & ~0x7F != 0x200]
    cycles, _ = heard_of(arm, no_setpoints)
    assert [cycle.command for cycle in cycles] == [None, None]
    without_one = [m for m in frames if m.arbitration_id != 0x180 + arm.drives[2].node_id]
    assert not heard_of(arm, without_one)[0]
    np.testing.assert_array_equal(cycles[1].feedback.position_rad, seen[1].position_rad)


def test_a_drive_without_a_scale_is_refused(arm_settings):
    with pytest.raises(CommandError, match="joint_2: the drive's scale is unknown"):
        OverheardArm(arm_settings(counts_per_rad=None))


def stamped(frames):
    """Frames with time stamps of an interface, ten milliseconds apart, with remote and error frames among them."""
    for k, frame in enumerate(frames):
        yield can.Message(arbitration_id=0x182, is_remote_frame=True, is_extended_id=False)
        yield can.Message(arbitration_id=0x40, is_error_frame=True)
        yield can.Message(arbitration_id=SYNC, is_error_frame=True, is_extended_id=False)
        yield can.Message(arbitration_id=SYNC, is_extended_id=True)
        yield can.Message(
            arbitration_id=frame.arbitration_id, data=frame.data, is_extended_id=False, timestamp=1.7e9 + 0.01 * k
        )


def ticking(step_s):
    """A clock that advances by a step on every reading."""
    return map(step_s.__mul__, count()).__next__


def test_on_a_bus_nothing_but_receiving_is_asked_for(virtual_arm, arm_settings):
    arm = arm_settings()
    frames, seen, _ = driven(virtual_arm, arm)
    cycles = []
    for cycle in overheard(Ear(stamped(frames)), OverheardArm(arm), clock=ticking(1e-4)):
        if cycle is None:
            break
        cycles.append(cycle)
    assert len(cycles) == len(seen)
    first_sync = next(k for k, frame in enumerate(frames) if frame.arbitration_id == SYNC)
    assert cycles[0].feedback.time_s == pytest.approx(0.01 * first_sync, abs=1e-6)


def test_an_arm_that_falls_silent_later_is_waited_for(virtual_arm, arm_settings):
    arm = arm_settings()
    frames, seen, _ = driven(virtual_arm, arm)
    heard = list(islice(overheard(Ear(stamped(frames)), OverheardArm(arm), 1.0, ticking(1e-3)), len(seen) + 20))
    assert [cycle is None for cycle in heard[len(seen) :]] == [True] * 20, "a look every so often, for much longer"


@pytest.mark.parametrize(
    ("keep", "text"),
    [
        (lambda m: False, "the bus is silent"),
        (lambda m: m.arbitration_id & ~0x7F != 0x180, "no feedback as configured from joint_2, joint_3, joint_5"),
        (lambda m: m.arbitration_id != 0x183, "no feedback as configured from joint_3"),
        (lambda m: m.arbitration_id != SYNC, "no SYNC"),
    ],
)
def test_what_is_missing_is_named(virtual_arm, arm_settings, keep, text):
    arm = arm_settings()
    frames, *_ = driven(virtual_arm, arm)
    kept = [m for m in frames if keep(m)]
    with pytest.raises(BusError, match=text):
        all(cycle is None for cycle in overheard(Ear(stamped(kept)), OverheardArm(arm), 1.0, ticking(1e-3)))


def test_a_mapping_that_is_not_the_configured_one_is_named(virtual_arm, arm_settings):
    frames, *_ = driven(virtual_arm, arm_settings(pdo_objects_max=2))
    ear = Ear(stamped(frames))
    with pytest.raises(BusError, match=r"joint_2 \(5 feedback frames of another length\)"):
        all(cycle is None for cycle in overheard(ear, OverheardArm(arm_settings()), 1.0, ticking(1e-3)))


def test_a_bus_that_fails_is_an_error_of_the_bus(arm_settings):
    class Broken:
        def recv(self, timeout=None):
            raise can.CanOperationError("gone")

    with pytest.raises(BusError, match="receiving failed: gone"):
        next(overheard(Broken(), OverheardArm(arm_settings())))
