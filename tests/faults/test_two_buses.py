"""An arm on two buses: what happens on one of them stops both."""

from dataclasses import replace

import can
import numpy as np
import pytest

from armload_drivers.bus.joined_bus import BusRole
from armload_drivers.cia402.bus_budget import forecast, require_room
from armload_drivers.driver_errors import BusError, BusOverload, ForeignMaster, ServoFault, TorqueRemains, WrongDevice
from armload_drivers.listening.overheard_arm import OverheardArm
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus, lockstep_bus
from tests.ideal_plant import IdealPlant

ZERO = np.zeros(3)


def on_two(arm):
    """Every second drive on the second bus."""
    return replace(arm, drives=tuple(replace(drive, bus=axis % 2) for axis, drive in enumerate(arm.drives)))


@pytest.fixture
def two(virtual_arm, arm_settings):
    """An enabled arm: nodes 2 and 5 on the first bus, 3 on the second."""
    arm = virtual_arm(on_two(arm_settings()))
    arm.servos.connect()
    arm.start_rad = arm.servos.enable().position_rad
    return arm


def move(arm, cycles=40):
    for cycle in range(1, cycles + 1):
        arm.servos.exchange(JointCommand(arm.start_rad + 0.004 * cycle, ZERO, ZERO))


def test_the_frames_of_a_drive_are_on_its_bus_alone(two):
    move(two)
    for monitor, nodes in zip(two.monitors, ({2, 5}, {3}), strict=True):
        heard = {message.arbitration_id for message in monitor.received}
        assert {cob_id & 0x7F for cob_id in heard if cob_id & ~0x7F in {0x180, 0x200, 0x580}} == nodes
        assert {0x80, 0x700 + two.arm.master_node_id} <= heard, "SYNC and heartbeat are on both"
    counts = [sum(message.arbitration_id == 0x80 for message in monitor.received) for monitor in two.monitors]
    assert counts[0] == counts[1] > 40


@pytest.mark.parametrize("node_id", [2, 3])
def test_a_fault_on_either_bus_stops_both(two, node_id):
    move(two, 5)
    two.drives.fail(node_id, 0x2310)
    with pytest.raises(ServoFault, match=f"node {node_id}"):
        move(two)
    two.servos.stop()
    assert two.plant.velocity_rad_s == pytest.approx(ZERO, abs=1e-3)
    two.servos.disable()
    assert not any(two.plant.powered)


@pytest.mark.parametrize(("broken", "left"), [(0, {"joint_2", "joint_5"}), (1, {"joint_3"})])
def test_without_one_bus_the_drives_on_the_other_lose_their_torque(two, broken, left):
    def refuse(msg, timeout=None):
        raise can.CanOperationError("interface down")

    move(two, 5)
    two.bus.parts[broken].send = refuse
    with pytest.raises(BusError, match="interface down"):
        move(two)
    with pytest.raises(TorqueRemains) as raised:
        two.servos.close()
    assert {joint for joint in ("joint_2", "joint_3", "joint_5") if joint in str(raised.value)} == left
    buses = [drive.bus for drive in two.arm.drives]
    assert [on for on, bus in zip(two.plant.powered, buses, strict=True) if bus != broken] == [False] * (3 - len(left))


@pytest.mark.parametrize("bus", [0, 1])
def test_another_producer_of_sync_on_either_bus_is_noticed(two, bus):
    two.monitors[bus].send(can.Message(arbitration_id=0x80, is_extended_id=False))
    with pytest.raises(ForeignMaster, match="also produces SYNC"):
        move(two)


def test_a_drive_of_the_same_id_on_the_other_bus_is_refused(virtual_arm, arm_settings):
    arm = virtual_arm(on_two(arm_settings()))
    stranger = replace(arm.arm, drives=(replace(arm.arm.drives[0], bus=0),), coupling=np.eye(1))
    with (
        LockstepBus(arm.wires[1]) as bus,
        SimulatedDrives(stranger, IdealPlant(np.zeros(1)), bus, arm.clock),
        pytest.raises(WrongDevice, match="two drives have node id 2"),
    ):
        arm.servos.connect()


def test_an_arm_on_two_buses_can_be_listened_to(two):
    """One SYNC begins a cycle, and it is complete with the feedback from both buses."""
    heard, cycles = OverheardArm(two.arm), []
    with lockstep_bus(two.arm, two.wires, BusRole.LISTENER) as ear:
        for cycle in range(1, 31):
            two.servos.exchange(JointCommand(two.start_rad + 0.004 * cycle, ZERO, ZERO))
            while (message := ear.recv(0.0)) is not None:
                cycles.append(heard.take(message.arbitration_id, bytes(message.data), 0.01 * cycle))
    found = [cycle for cycle in cycles if cycle is not None]
    assert (heard.syncs, len(found)) == (30, 30)
    assert not any(cycle.feedback.missing.any() for cycle in found)
    assert found[-1].feedback.position_rad == pytest.approx(two.start_rad + 0.004 * 30, abs=0.01)


def test_twelve_drives_at_250_hz_are_too_much_for_one_bus_and_not_for_two(virtual_arm, arm_settings):
    one = arm_settings(cycle_s=0.004)
    drives = tuple(replace(one.drives[0], joint=f"joint_{n}", node_id=n) for n in range(1, 13))
    many = replace(one, drives=drives, coupling=np.eye(12))
    with pytest.raises(BusOverload, match=r"12 drives at 250 Hz .*put some of the joints on a second bus"):
        require_room(many)
    assert forecast(many).cycle_share == pytest.approx(0.82, abs=0.01)
    assert require_room(on_two(many)).share < 0.45
    arm = virtual_arm(on_two(many), plant=IdealPlant(np.zeros(12)))
    arm.servos.connect()
    arm.servos.enable()
    link = arm.servos._link
    before = link.busiest_bits, link.bits
    for cycle in range(1, 251):
        feedback = arm.servos.exchange(JointCommand(np.full(12, 0.001 * cycle), np.zeros(12), np.zeros(12)))
        assert not feedback.missing.any()
    busiest, all_of_them = link.busiest_bits - before[0], link.bits - before[1]
    assert busiest < 0.45e6
    assert all_of_them == pytest.approx(2 * busiest, rel=0.02), "each bus carries half"
    assert arm.plant.position_rad == pytest.approx(np.full(12, 0.25), abs=0.002)
