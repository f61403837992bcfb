"""Bus faults, other masters and signals, in lockstep and on vcan0: the error, its message, the final state."""

import gc
import os
import signal
import threading
import time

import can
import numpy as np
import pytest

from armload_drivers.driver_errors import (
    BusError,
    DriverError,
    ForeignMaster,
)
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits

ZERO = np.zeros(3)


# The bus -----------------------------------------------------------------------------------------------------


GARBAGE = [(0x183, length) for length in (0, 1, 7)] + [
    (cob_id, length) for cob_id in (0x083, 0x583, 0x703, 0x000, 0x080 + 3) for length in (0, 1, 3)
]


def test_garbage_and_wrong_lengths_on_our_cob_ids(fault_arm):
    arm = fault_arm()
    arm.enable()
    rng = np.random.default_rng(1)
    for cob_id, length in GARBAGE:
        data = rng.integers(0x10, 0x60, length).astype(np.uint8).tobytes()
        if cob_id == 0x083 and length > 1:
            data = bytes(length)
        if cob_id == 0x703 and length:
            data = b"\x05" + data[1:]
        arm.send(cob_id, data)
        assert not arm.move(1).missing.any()
    arm.send(0x183, b"", is_remote_frame=True)
    arm.other.send(can.Message(arbitration_id=0x183, data=bytes(8), is_extended_id=True))
    feedback = arm.move(2)
    assert feedback.position_rad == pytest.approx(arm.target_rad, abs=0.02)
    # In real time the kernel's periods may be remarked upon, too.
    (remark,) = (each for each in arm.servos.take_remarks() if "wrong length" in each)
    assert remark.startswith("warning: bus: 3 frames of joint_3 had a wrong length. Check cable, termination")
    arm.comes_to_rest()


@pytest.mark.parametrize(
    ("cob_id", "data", "words"),
    [
        (0x000, b"\x02\x00", "stop to all nodes"),
        (0x000, b"\x80\x03", r"pre operational to joint_3 \(node 3\)"),
        (0x203, bytes(8), "sends setpoints to joint_3"),
        (0x77F, b"\x05", "uses this master's node id 127"),
    ],
    ids=["nmt to all", "nmt to one", "setpoints", "heartbeat"],
)
def test_a_second_master(fault_arm, cob_id, data, words):
    arm = fault_arm()
    arm.enable()
    arm.move(5)
    arm.send(cob_id, data)
    # Depending on the intruder's command, the drive's own error comes first and a note names the cause.
    error = arm.failure(DriverError)
    text = str(error) + " ".join(getattr(error, "__notes__", []))
    with pytest.raises(AssertionError, match=words):
        raise AssertionError(text)
    arm.servos.close()
    arm.has_no_torque()


def test_a_second_sync_producer(fault_arm):
    arm = fault_arm()
    arm.enable()
    if arm.vcan:
        pytest.skip("detected by the rhythm of SYNC there: tests/vcan/test_master_lost.py")
    arm.send(0x080)
    assert "also produces SYNC" in str(arm.failure(ForeignMaster))
    arm.comes_to_rest()


def test_bus_off(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.move(5)
    arm.send(0x40, bytes(8), is_error_frame=True)
    error = arm.failure(BusError)
    assert "bus-off" in str(error)
    assert "termination" in str(error)
    arm.servos.close()
    arm.has_no_torque()


def test_error_passive_is_survived_and_remarked_upon_once(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.send(0x04, bytes([0, 0x20, 0, 0, 0, 0, 0, 0]), is_error_frame=True)
    arm.move(2)
    assert arm.servos._link.error_passive
    assert arm.servos._link.error_frames == 1
    arm.send(0x04, bytes([0, 0x40, 0, 0, 0, 0, 0, 0]), is_error_frame=True)
    arm.move(2)
    assert not arm.servos._link.error_passive
    (remark,) = (each for each in arm.servos.take_remarks() if "error frames" in each)
    assert remark.startswith("warning: bus: 2 error frames, the controller was error passive 1 time. Check")
    assert not any("error frames" in each for each in arm.servos.take_remarks())
    arm.comes_to_rest()


def test_the_load_of_the_bus_is_measured(fault_arm):
    arm = fault_arm()
    arm.enable()
    before = arm.servos._link.busiest_bits
    arm.move(240)
    frames = 55 + 6 * 135
    assert arm.servos._link.busiest_bits - before == pytest.approx(240 * frames, rel=0.25)


# Ctrl-C and SIGTERM ------------------------------------------------------------------------------------------


INTERRUPTS = (signal.SIGINT, signal.SIGTERM)


@pytest.fixture
def interrupted():
    """Both signals raise an exception in the main thread, as in a program.

    A background job of a shell without job control inherits SIGINT as ignored; Python then installs no handler. The
    garbage collector is off meanwhile, because an exception within a `__del__` is lost.
    """

    def handler(number, frame):
        raise KeyboardInterrupt(signal.Signals(number).name)

    before = {number: signal.signal(number, handler) for number in INTERRUPTS}
    gc.disable()
    yield
    gc.enable()
    for number, earlier in before.items():
        signal.signal(number, earlier)


@pytest.mark.parametrize("number", INTERRUPTS)
@pytest.mark.parametrize("phase", ["connect", "enable", "exchange", "stop", "disable"])
def test_an_interrupt_in_every_phase(fault_arm, interrupted, phase, number):
    """The drive side sends the signal in the middle of the phase; after `close` no torque is left."""
    seen = []
    steps = {"connect": b"\x2b\x17\x10", "enable": b"\x40\x41\x60"}

    def on_request(request):
        if seen and request[:3] == steps.get(seen[0]):
            seen.clear()
            os.kill(os.getpid(), number)

    arm = fault_arm(traits={5: DriveTraits(on_request=on_request)})
    if phase == "connect":
        seen.append(phase)
        with pytest.raises(KeyboardInterrupt):
            arm.servos.connect()
    else:
        arm.servos.connect()
        if phase == "enable":
            seen.append(phase)
            with pytest.raises(KeyboardInterrupt):
                arm.servos.enable()
        else:
            arm.target_rad = arm.servos.enable().position_rad
            arm.move(10)
            timer = threading.Timer(0.01, os.kill, (os.getpid(), number))
            with pytest.raises(KeyboardInterrupt):
                run_until_interrupted(arm, phase, timer)
            timer.join()
    arm.servos.close()
    arm.has_no_torque()


def run_until_interrupted(arm, phase, timer):
    timer.start()
    if phase != "exchange":
        getattr(arm.servos, phase)()
    end_s = time.monotonic() + 10.0
    while time.monotonic() < end_s:
        if phase == "exchange":
            arm.servos.exchange(JointCommand(arm.target_rad, ZERO, ZERO))
        else:
            time.sleep(0.001)
    pytest.fail("no interrupt came")
