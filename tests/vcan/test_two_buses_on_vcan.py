"""An arm on two real SocketCAN interfaces, paced by one kernel timer. No timing is asserted."""

import time
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import can
import numpy as np
import pytest

from armload_drivers.bus.joined_bus import BusRole, JoinedBus
from armload_drivers.bus.kernel_sync import BcmSync, BroadcastManager
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.driver_errors import ServoFault
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from tests.ideal_plant import IdealPlant

pytestmark = [
    pytest.mark.vcan,
    pytest.mark.skipif(not Path("/sys/class/net/vcan1").exists(), reason="there is no second interface, vcan1"),
]

CHANNELS = ("vcan0", "vcan1")
ZERO = np.zeros(3)
HEARD = [{"can_id": 0x080, "can_mask": 0x7FF}, {"can_id": 0x180, "can_mask": 0x780}]
"""SYNC and feedback: a socket holds only some hundred frames."""


@pytest.fixture
def two(arm_settings):
    """Servos and drives of an arm with node 3 on vcan1, and what is heard there."""
    made = arm_settings(cycle_s=0.02)
    # A virtual machine on a busy host pauses at times; that is not tested here.
    drives = tuple(replace(drive, bus=int(drive.node_id == 3)) for drive in made.drives)
    arm = replace(made, drives=drives, heartbeat_s=0.3, max_missing_cycles=25)
    members = [frozenset(drive.node_id for drive in part.drives) for part in arm.by_bus()]
    plant = IdealPlant(np.array([0.1, -0.2, 0.3]))
    with ExitStack() as stack:

        def joined(role):
            buses = [can.Bus(interface="socketcan", channel=channel) for channel in CHANNELS]
            return stack.enter_context(JoinedBus(buses, members, role, arm.cycle_s))

        simulated = SimulatedDrives(arm, plant, joined(BusRole.DRIVES), time.monotonic)
        drives = stack.enter_context(simulated)
        ears = [stack.enter_context(can.Bus(interface="socketcan", channel=c, can_filters=HEARD)) for c in CHANNELS]
        servos = CanopenServos(arm, joined(BusRole.PACED_BY_KERNEL), BcmSync(BroadcastManager(CHANNELS[0])))
        yield servos, drives, plant, ears
        servos.close()
        assert not any(plant.powered)


def all_received(ear):
    """COB-IDs of all frames that are waiting."""
    frames = []
    while (message := ear.recv(0.0)) is not None:
        frames.append(message.arbitration_id)
    return frames


def move(servos, start, cycles=60):
    for cycle in range(1, cycles + 1):
        servos.exchange(JointCommand(start + 0.002 * cycle, ZERO, ZERO))


def test_one_kernel_timer_paces_both_buses(two):
    servos, _, plant, ears = two
    servos.connect()
    start = servos.enable().position_rad
    move(servos, start)
    heard = [all_received(ear) for ear in ears]
    assert [{frame & 0x7F for frame in frames if frame & ~0x7F == 0x180} for frames in heard] == [{2, 5}, {3}]
    syncs = [frames.count(0x080) for frames in heard]
    assert syncs[1] > 50
    assert syncs[1] <= syncs[0] + 1, "a stale SYNC is not sent on, and none is made up for"
    servos.stop()
    servos.disable()
    assert plant.position_rad == pytest.approx(np.array([0.1, -0.2, 0.3]) + 0.12, abs=0.05)
    assert [text for text in servos.take_remarks() if "SYNC reached the last bus" in text]


def test_a_fault_on_the_second_bus_stops_both(two):
    servos, drives, plant, _ = two
    servos.connect()
    start = servos.enable().position_rad
    move(servos, start, 10)
    drives.fail(3, 0x2310)
    with pytest.raises(ServoFault, match="joint_3"):
        move(servos, start, 60)
    servos.stop()
    servos.disable()
    assert not any(plant.powered)
