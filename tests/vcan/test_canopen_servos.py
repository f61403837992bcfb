"""Master and simulated drives on a real SocketCAN interface, in real time. No timing is asserted."""

import time

import can
import numpy as np
import pytest

from armload_drivers.bring_up.drive_check import reset
from armload_drivers.bus.sync_sources import TimerSync
from armload_drivers.canopen.canopen_bring_up import CanopenBringUp
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.driver_errors import ServoFault
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from tests.ideal_plant import IdealPlant

pytestmark = pytest.mark.vcan

ZERO = np.zeros(3)


@pytest.fixture
def bench(arm_settings):
    """Two sockets on vcan0, three drives at 50 Hz, and their plant."""
    arm = arm_settings(cycle_s=0.02)
    plant = IdealPlant([0.1, -0.2, 0.3])
    with (
        can.Bus(interface="socketcan", channel="vcan0") as drives_bus,
        can.Bus(interface="socketcan", channel="vcan0") as bus,
        SimulatedDrives(arm, plant, drives_bus, time.monotonic) as drives,
    ):
        servos = CanopenServos(arm, bus, TimerSync())
        yield servos, drives, plant, bus, arm
        servos.close()
        assert not any(plant.powered)


def test_an_arm_is_brought_up_moved_and_brought_to_rest(bench):
    servos, _, plant, _, _ = bench
    servos.connect()
    assert servos.simulated
    first = servos.enable()
    start = first.position_rad
    skipped = 0
    for cycle in range(1, 101):
        target = start + 0.2 * np.sin(0.02 * cycle)
        feedback = servos.exchange(JointCommand(target, ZERO, ZERO))
        skipped += feedback.skipped_cycles
    assert feedback.cycle == first.cycle + 100
    assert feedback.time_s - first.time_s == pytest.approx(0.02 * (100 + skipped), abs=0.02)
    servos.stop()
    assert all(plant.powered)
    servos.disable()
    assert not any(plant.powered)


def move(servos, start):
    for cycle in range(1, 51):
        servos.exchange(JointCommand(start + 0.005 * cycle, ZERO, ZERO))


def test_a_drive_fault_in_motion(bench):
    servos, drives, plant, bus, arm = bench
    servos.connect()
    start = servos.enable().position_rad
    drives.fail(3, 0x2310)
    with pytest.raises(ServoFault, match="joint_3"):
        move(servos, start)
    servos.stop()
    servos.disable()
    reset(CanopenBringUp(arm, bus), "joint_3", lambda question: False)
    servos.enable()
    assert all(plant.powered)
