"""A second master connects to an arm that another one moves, holds or has connected to."""

from dataclasses import replace
from itertools import count

import can
import pytest

from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402.state_machine import State
from armload_drivers.driver_errors import ServoError
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.lockstep_bus import LockstepBus
from armload_drivers.simulation.lockstep_sync import LockstepSync
from tests.bounded import overheard
from tests.even_motion import enabled, move

READS_POSITION = bytes.fromhex("40646000")


@pytest.fixture
def rival(virtual_arm):
    """Makes a second master of an arm, on its own end of the bus."""
    buses = []

    def make(arm, settings=None):
        buses.append(LockstepBus(arm.bus.wire))
        return CanopenServos(settings or arm.arm, buses[-1], LockstepSync(arm.clock))

    yield make
    for bus in buses:
        bus.shutdown()


def refused(arm, servos):
    """The error with which the second master does not connect, having changed nothing."""
    arm.frames(0)
    with pytest.raises(ServoError) as raised:
        servos.connect()
    requests = [m for m in overheard(arm.monitor) if m.arbitration_id == 0 or 0x600 < m.arbitration_id < 0x680]
    assert requests
    assert not [m for m in requests if m.arbitration_id == 0], "no NMT command"
    assert not [m for m in requests if m.data[0] >> 5 == 1], "nothing is written"
    assert all(arm.plant.powered)
    return str(raised.value)


def test_an_arm_in_motion_is_not_reset_even_if_nobody_is_heard(virtual_arm, rival):
    arm = virtual_arm()
    start = enabled(arm)
    move(arm, start, 20)
    text = refused(arm, rival(arm))
    assert "joint_2 (node 2), looking for torque: the drive carries torque in OPERATION ENABLED" in text
    assert "emergency stop" in text
    move(arm, start, 20, done=20)


class Hook:
    """Does something when the position of node 3 is read."""

    def __init__(self):
        self.act = lambda: None

    def __call__(self, request):
        if request[:4] == READS_POSITION:
            self.act()


def stopped(make, **changes):
    """An arm in QUICK STOP ACTIVE, and what happens when the position of its node 3 is read."""
    hook = Hook()
    arm = make(traits={3: DriveTraits(on_request=hook)}, **changes)
    enabled(arm)
    arm.servos.stop()
    assert [node.state for node in arm.servos._nodes] == [State.QUICK_STOP_ACTIVE] * 3
    return arm, hook


@pytest.mark.parametrize(
    ("cob_id", "data", "words"),
    [
        (0x080, b"", "another node also produces SYNC"),
        (0x77F, b"\x05", "another node uses this master's node id 127"),
        (0x202, bytes(8), "another node sends setpoints to joint_2"),
        (0x000, b"\x01\x00", "another node sends NMT commands"),
    ],
    ids=["SYNC", "heartbeat", "setpoints", "NMT"],
)
def test_an_arm_that_its_living_master_has_stopped_is_not_reset(virtual_arm, rival, cob_id, data, words):
    arm, hook = stopped(virtual_arm)
    frame = can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)
    with LockstepBus(arm.bus.wire) as living:
        hook.act = lambda: living.send(frame)
        arm.frames(0)
        with pytest.raises(ServoError, match=f"QUICK STOP ACTIVE, and {words}"):
            rival(arm).connect()
    assert all(arm.plant.powered)


def test_an_axis_that_still_moves_is_not_reset(virtual_arm, rival):
    arm, hook = stopped(virtual_arm)
    counts = count(step=round(0.006 * 0.25 * arm.arm.drives[1].counts_per_rad))

    def turn():
        """6 mrad/s during the 0.25 s of listening."""
        arm.drives._drives[3].dictionary.values[0x6064_00] += next(counts)

    hook.act = turn
    text = refused(arm, rival(arm))
    assert "joint_3 (node 3)" in text
    assert "QUICK STOP ACTIVE and moves at 0.006 rad/s" in text


def test_an_axis_without_a_brake_is_not_dropped(virtual_arm, rival, arm_settings):
    arm, _ = stopped(virtual_arm, arm=arm_settings(has_brake=False))
    text = refused(arm, rival(arm))
    assert "its master has ended. Its axis has no brake and falls without torque. Support the arm" in text


def test_after_another_program_has_reset_the_drives_they_are_not_enabled(virtual_arm, rival):
    """Both are connected, and the first waits for its operator's consent when the second connects."""
    arm = virtual_arm()
    arm.servos.connect()
    arm.servos.enable()
    arm.servos.disable()
    second = rival(arm, replace(arm.arm, cycle_s=0.02))
    second.connect()
    for _ in range(2):
        with pytest.raises(ServoError, match=r"joint_2 \(node 2\), enabling: the drive has rebooted since"):
            arm.servos.enable()
        assert not any(arm.plant.powered)
    second.enable()
    second.close()


def test_the_position_of_a_drive_that_another_program_has_reset_is_not_reported(virtual_arm):
    """Its scale and its zero may have changed, and an approach would be checked from the wrong place."""
    arm = virtual_arm()
    arm.servos.connect()
    arm.servos.standing_rad()
    arm.monitor.send(can.Message(arbitration_id=0x000, data=[0x81, 3], is_extended_id=False))
    with pytest.raises(ServoError, match=r"joint_3 \(node 3\), .*the drive has rebooted since it was configured"):
        arm.servos.standing_rad()


SILENT = dict.fromkeys((2, 3, 5), DriveTraits(boot_message=False))
"""Drives whose boot-up is not noticed, as after a long wait in which the interface's queue overflowed."""


def test_drives_that_another_program_has_enabled_are_not_written_to(virtual_arm, rival):
    arm = virtual_arm(traits=SILENT)
    second = rival(arm)
    second.connect()
    start = enabled(arm)
    move(arm, start, 20)
    arm.frames(0)
    with pytest.raises(ServoError, match=r"joint_2 .*carries torque in OPERATION ENABLED, which this program has not"):
        second.enable()
    requests = [m for m in overheard(arm.monitor) if m.arbitration_id == 0 or 0x600 < m.arbitration_id < 0x680]
    assert requests
    assert all(m.arbitration_id and m.data[0] >> 5 != 1 for m in requests), "only reads"
    move(arm, start, 20, done=20)


def test_drives_that_another_program_has_configured_are_not_enabled(virtual_arm, rival):
    arm = virtual_arm(traits=SILENT)
    arm.servos.connect()
    rival(arm, replace(arm.arm, cycle_s=0.02)).connect()
    with pytest.raises(ServoError, match=r"joint_2 .*1006:0 .* is 20000, and was 10000 when the drive was configured"):
        arm.servos.enable()
    assert not any(arm.plant.powered)


@pytest.mark.parametrize(
    ("request_data", "words"),
    [
        ("2b726000e8030000", "6072:0 .* is 1000, and was 3000"),
        ("2f60600007000000", "6061:0 .* is 7, and was 8"),
        ("2300180183010080", f"1800:1 .* is {0x8000_0183}, and was {0x4000_0183}"),
    ],
    ids=["greatest torque", "mode", "PDO"],
)
def test_a_drive_whose_settings_were_changed_after_connecting_is_not_enabled(virtual_arm, request_data, words):
    arm = virtual_arm(traits={3: DriveTraits(modes=frozenset({7, 8}))})
    arm.servos.connect()
    arm.monitor.send(can.Message(arbitration_id=0x603, data=bytes.fromhex(request_data), is_extended_id=False))
    with pytest.raises(ServoError, match=rf"joint_3 \(node 3\), comparing the settings: {words}"):
        arm.servos.enable()
    assert not any(arm.plant.powered)
