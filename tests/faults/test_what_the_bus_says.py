"""What another program or tool does to the drives of an arm in motion: noticed from the bus, or by reading again."""

import struct
from contextlib import ExitStack
from dataclasses import replace

import can
import numpy as np
import pytest

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.bus_scan import require_no_strangers
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.driver_errors import ForeignMaster, LoopLost, ServoError, SettingChanged, WrongDevice
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drive_dictionary import SILENCE, DriveTraits
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import LockstepBus
from armload_drivers.simulation.plant_interface import FROZEN
from tests.even_motion import enabled, move
from tests.ideal_plant import IdealPlant

ZERO = np.zeros(3)
READ_AGAIN_S = 2.0
CHANGES = {
    "6065": (od.FOLLOWING_ERROR_WINDOW, 7),
    "1016:1": (od.HEARTBEAT_CONSUMER, 0),
    "607E": (od.POLARITY, od.POLARITY_POSITION),
    "6061": (od.MODE_DISPLAY, 1),
    "6072": (od.MAX_TORQUE, 1),
    "60C2:1": (od.INTERPOLATION_TIME, 100),
    "605A": (od.QUICK_STOP_OPTION, 2),
    "1400:5": (od.PdoDirection.RECEIVE.timer_entry(0), 0),
}


def hold(arm, seconds):
    """Hold the position; the number of cycles."""
    cycles = round(seconds / arm.arm.cycle_s)
    for _ in range(cycles):
        arm.servos.exchange(JointCommand(arm.target_rad, ZERO, ZERO))
    return cycles


@pytest.mark.parametrize("name", CHANGES)
def test_a_setting_changed_over_another_cable_is_found_within_two_seconds(fault_arm, name):
    arm = fault_arm()
    arm.enable()
    entry, value = CHANGES[name]
    before = arm.servos.setups[1].objects.held[entry]
    arm.drives.set_object(3, entry, value)
    # A sign that changes in motion is a jump of the position; it is noticed before it is read.
    with pytest.raises(LoopLost if name == "607E" else SettingChanged) as raised:
        hold(arm, READ_AGAIN_S)
    assert raised.value.node_id == 3
    if name != "607E":
        assert f"{entry} is {value}, and was {before} when the drive was configured" in str(raised.value)
    arm.servos.stop()
    arm.servos.close()
    arm.has_no_torque()


def test_every_setting_of_every_drive_is_read_within_two_seconds(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    held = [(0x600 + setup.settings.node_id, entry) for setup in arm.servos.setups for entry in setup.objects.held]
    wanted = {(cob_id, e.index, e.subindex) for cob_id, e in held if e.index not in range(0x1600, 0x1C00)}
    assert len(wanted) > 60
    arm.frames(0)
    asked = set()
    cycles = round(READ_AGAIN_S / arm.arm.cycle_s)
    for _ in range(cycles // 10):
        move(arm, start, 10, 0.0)
        for message in iter(lambda: arm.monitor.recv(0.0), None):
            if message.arbitration_id in {0x602, 0x603, 0x605}:
                index, subindex = struct.unpack_from("<HB", message.data, 1)
                asked.add((message.arbitration_id, index, subindex))
    assert asked == wanted


def test_reading_again_never_makes_the_cycle_wait(virtual_arm):
    """A drive that answers no SDO in motion is not waited for, and the others' settings are still compared."""
    silent = []
    arm = virtual_arm(traits={3: DriveTraits(on_request=lambda request: SILENCE if silent else None)})
    start = enabled(arm)
    silent.append(True)
    begun_s = arm.clock()
    move(arm, start, 300, 0.0)
    assert arm.clock() - begun_s == pytest.approx(300 * arm.arm.cycle_s)
    arm.drives.set_object(5, od.MAX_TORQUE, 1)
    with pytest.raises(SettingChanged, match="node 5"):
        move(arm, start, 800, 0.0)


def test_an_answer_that_comes_late_does_not_disturb_the_removal_of_torque(virtual_arm):
    """The request sent last in motion is answered while torque is removed by SDO."""
    arm = virtual_arm()
    move(arm, enabled(arm), 40)
    sdo = arm.servos.setups[1].objects.sdo
    sdo.ask(od.MAX_TORQUE)
    arm.servos._link.drain()
    late = sdo._client._answers.popleft()
    arm.drives.fail_encoder(3, FROZEN)
    receive, added = arm.bus.recv, []

    def recv(timeout=None):
        if not added and arm.servos._phase.name == "STOPPED":
            added.append(True)
            return can.Message(arbitration_id=0x583, data=late, is_extended_id=False)
        return receive(timeout)

    arm.bus.recv = recv
    with pytest.raises(ServoError):
        move(arm, arm.servos._cycle.units.joint_position_rad([n.target_counts for n in arm.servos._nodes]), 20)
    arm.servos.stop()
    arm.servos.disable()
    assert not any(arm.plant.powered)


@pytest.mark.parametrize(
    "data", ["2365600000000000", "2316100100000000", "2f60600001000000", "2f7e600080000000", "2b72600064000000"]
)
def test_a_download_that_is_heard_stops_the_arm_like_a_second_master(fault_arm, data):
    arm = fault_arm()
    arm.enable()
    arm.move(20)
    arm.send(0x603, bytes.fromhex(data))
    before = arm.target_rad.copy()
    error = arm.failure(ForeignMaster)
    assert "another node writes to joint_3 (node 3), object" in str(error)
    assert (arm.target_rad - before).max() <= (10 if arm.vcan else 2) * arm.arm.cycle_s * 0.5 + 1e-9
    arm.servos.stop()
    arm.servos.disable()
    arm.has_no_torque()


def test_an_upload_that_is_heard_stops_nothing(fault_arm):
    arm = fault_arm()
    arm.enable()
    arm.send(0x603, bytes.fromhex("4041600000000000"))
    arm.move(20)
    arm.comes_to_rest()


# Two nodes with one id ---------------------------------------------------------------------------------------


def twin(arm, stack):
    """A second drive with node id 3, on the same bus."""
    plant = IdealPlant(np.zeros(1))
    alone = replace(arm.arm, drives=(arm.arm.drives[1],), coupling=np.eye(1))
    bus = stack.enter_context(LockstepBus(arm.bus.wire))
    return stack.enter_context(SimulatedDrives(alone, plant, bus, arm.clock))


def test_a_twin_is_named_when_the_arm_is_connected(virtual_arm):
    arm = virtual_arm()
    with ExitStack() as stack:
        twin(arm, stack)
        with pytest.raises(ServoError, match=r"joint_3 \(node 3\).*two drives have node id 3"):
            arm.servos.connect()
        while arm.bus.recv(0.0):
            pass
        with pytest.raises(WrongDevice, match="two drives have node id 3: one request was answered 2 times"):
            require_no_strangers(BusLink(arm.bus), arm.arm, 0.01)


def test_a_twin_in_motion_is_found_within_two_cycles(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    move(arm, start, 10)
    exchange, sent = arm.servos.exchange, []

    def doubled(message):
        """The drive's feedback arrives twice from now on."""
        if message.arbitration_id == 0x183 and len(sent) >= 5:
            arm.monitor.send(message)

    def counted(command):
        sent.append(command)
        return exchange(command)

    arm.monitor.listen(doubled)
    arm.servos.exchange = counted
    with pytest.raises(ServoError, match=r"joint_3 \(node 3\).*two drives have node id 3"):
        move(arm, start, 20, done=10)
    assert len(sent) <= 5 + 3


def test_a_frame_that_is_late_or_sent_once_too_often_is_no_twin(virtual_arm):
    arm = virtual_arm()
    start = enabled(arm)
    kept, cycles = [], []
    receive = arm.bus.recv

    def recv(timeout=None):
        """Every tenth frame of node 3 arrives with the next one."""
        message = receive(timeout)
        if message is None or message.arbitration_id != 0x183:
            return message
        cycles.append(message)
        if len(cycles) % 10 == 4:
            kept.append(message)
            return receive(timeout)
        if kept:
            arm.servos._link._backlog.append(message)
            return kept.pop()
        return message

    arm.bus.recv = recv
    move(arm, start, 100)


def test_answers_to_a_sync_that_no_cycle_used_are_no_twins(virtual_arm):
    """A process that is late in every cycle: the kernel sends two SYNCs, and every drive answers both."""
    arm = virtual_arm()
    start = enabled(arm)
    following = arm.servos._sync.next

    def late(link, on_sync):
        following(link, lambda: None)
        tick = following(link, on_sync)
        return tick._replace(skipped=1)

    arm.servos._sync.next = late
    move(arm, start, 20)


def test_feedback_of_the_next_sync_in_a_late_cycle_is_no_departure(virtual_arm):
    """A process that was stopped for a cycle reads the feedback of two SYNCs: twice the way, in twice the time."""
    arm = virtual_arm()
    start = enabled(arm)
    positions = []

    def late(message):
        if message.arbitration_id == 0x183:
            (counts,) = struct.unpack_from("<i", message.data, 2)
            positions.append(counts)
            if len(positions) == 20:
                data = bytearray(message.data)
                struct.pack_into("<i", data, 2, 2 * counts - positions[-2])
                arm.monitor.send(can.Message(arbitration_id=0x183, data=data, is_extended_id=False))

    arm.monitor.listen(late)
    move(arm, start, 40)
    assert len(positions) == 40
