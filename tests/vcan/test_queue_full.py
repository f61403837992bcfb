"""A transmit queue that is full: ENOBUFS from the kernel on a real SocketCAN socket.

vcan has no queue. A queue discipline of length zero gives it one that is always full, like that of a controller whose
frames no node acknowledges; its removal drains the queue.
"""

import shutil
import subprocess
import threading
import time
from contextlib import contextmanager

import can
import numpy as np
import pytest

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.kernel_sync import BcmSync, BroadcastManager
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.driver_errors import BusError
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from tests.bounded import await_that, overheard
from tests.ideal_plant import IdealPlant

pytestmark = pytest.mark.vcan

CHANNEL = "vcan0"
CYCLE_S = 0.05
FULL, DRAINED = (f"qdisc {verb} dev {CHANNEL} root {kind}\n" for verb, kind in (("add", "pfifo limit 0"), ("del", "")))
ZERO = np.zeros(3)


class Queue:
    """The interface's queue, filled and drained within one or two milliseconds by a running `tc` process."""

    def __init__(self, process):
        self._process = process
        self._full = False

    def set_full(self, full):
        if full is not self._full:
            self._process.stdin.write(FULL if full else DRAINED)
            self._process.stdin.flush()
            self._full = full


@pytest.fixture
def queue():
    if shutil.which("tc") is None:
        pytest.skip("needs tc (iproute2)")
    process = subprocess.Popen(["tc", "-batch", "-"], stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    made = Queue(process)
    # It is fast after its first answer.
    with can.Bus(interface="socketcan", channel=CHANNEL) as bus:
        made.set_full(True)
        await_full(bus)
        made.set_full(False)
        await_drained(bus)
    yield made
    made.set_full(False)
    _, complaints = process.communicate(timeout=20)
    assert process.returncode == 0, complaints


def refusal(bus):
    """The kernel's error for a frame; None if it is accepted."""
    try:
        bus.send(can.Message(arbitration_id=0x7FF, is_extended_id=False))
    except can.CanOperationError as error:
        return error
    return None


def await_full(bus):
    """Wait until the kernel refuses a frame; returns the error."""
    return await_that(lambda: refusal(bus), "the queue is full")


def await_drained(bus):
    """Wait until the kernel accepts a frame again."""
    await_that(lambda: refusal(bus) is None, "the queue has drained")


@contextmanager
def drained_after(queue, seconds):
    """The queue drains after a given time, in parallel with the test."""
    timer = threading.Timer(seconds, queue.set_full, [False])
    timer.start()
    yield
    timer.join()


def test_a_queue_that_drains_in_time_is_waited_for(queue):
    with (
        can.Bus(interface="socketcan", channel=CHANNEL) as bus,
        can.Bus(interface="socketcan", channel=CHANNEL) as other,
    ):
        link, sent = BusLink(bus), []
        while not link.queue_full:
            queue.set_full(True)
            assert "No buffer space" in str(await_full(other))
            with drained_after(queue, 0.01):
                link.send_frame(0x123, bytes([len(sent)]))
            sent.append(bytes([len(sent)]))
            assert len(sent) < 20, "the link never met the full queue"
        heard = overheard(other, 0.1)
        assert [m.data for m in heard if m.arbitration_id == 0x123] == sent, "each once, after the queue had drained"


def test_a_queue_that_stays_full_is_named(queue):
    with can.Bus(interface="socketcan", channel=CHANNEL) as bus:
        queue.set_full(True)
        await_full(bus)
        with pytest.raises(BusError, match="txqueuelen"):
            BusLink(bus).send_frame(0x123, b"")


@pytest.fixture
def bench(arm_settings):
    arm = arm_settings(cycle_s=CYCLE_S)
    plant = IdealPlant([0.1, -0.2, 0.3])
    with (
        can.Bus(interface="socketcan", channel=CHANNEL) as drives_bus,
        can.Bus(interface="socketcan", channel=CHANNEL) as bus,
        SimulatedDrives(arm, plant, drives_bus, time.monotonic) as drives,
    ):
        yield CanopenServos(arm, bus, BcmSync(BroadcastManager(CHANNEL))), drives, plant


def move(servos, hold, cycles):
    for cycle in range(1, cycles + 1):
        servos.exchange(JointCommand(hold + 0.5 * CYCLE_S * cycle, ZERO, ZERO))


def test_an_arm_goes_on_after_a_queue_that_was_full_for_a_moment(queue, bench):
    servos, drives, plant = bench
    servos.connect()
    hold = servos.enable().position_rad
    refused = 0
    for _ in range(10):
        queue.set_full(True)
        with drained_after(queue, 0.01):
            servos.exchange(JointCommand(hold, ZERO, ZERO))
        refused = servos._link.queue_full + drives.frames_lost
        if refused:
            break
    assert refused, "a sender met the full queue"
    for _ in range(10):
        feedback = servos.exchange(JointCommand(hold, ZERO, ZERO))
    assert not feedback.missing.any()
    servos.close()
    assert not any(plant.powered)


def test_an_arm_whose_queue_stays_full_stops_by_itself(queue, bench):
    servos, _, plant = bench
    servos.connect()
    hold = servos.enable().position_rad
    move(servos, hold, 10)
    queue.set_full(True)
    with pytest.raises(BusError, match="queue"):
        move(servos, hold + 0.5 * CYCLE_S * 10, 20)
    time.sleep(1.0)
    assert plant.velocity_rad_s == pytest.approx(ZERO)
    assert all(plant.powered), "a quick stop that holds (6007)"
    queue.set_full(False)
    time.sleep(0.05)
    servos.close()
    assert not any(plant.powered)
