"""The frames that the master sends, checked on the bus and not by its internal state."""

import struct

import numpy as np
import pytest

from armload_drivers.cia402.arm_settings import OperationMode
from armload_drivers.servos import JointCommand
from tests.bounded import overheard

TARGET_POSITION = (0x607A, 0)
INTERPOLATION_DATA = (0x60C1, 1)
FIRST_RPDO = 0x200
HEARTBEAT = 0x700
DOWNLOAD_OF_FOUR_BYTES = 0x23


def frames_of(arm):
    """Everything on the bus since the last call, in order."""
    return [(message.arbitration_id, bytes(message.data)) for message in overheard(arm.monitor)]


@pytest.mark.parametrize(
    ("mode", "target"),
    [
        (OperationMode.CYCLIC_SYNCHRONOUS_POSITION, TARGET_POSITION),
        (OperationMode.INTERPOLATED_POSITION, INTERPOLATION_DATA),
    ],
)
def test_the_target_is_the_present_position_before_the_first_setpoint(virtual_arm, arm_settings, mode, target):
    """The most frequent accident with other masters: on enabling, the arm jumps or moves to zero."""
    arm = virtual_arm(arm_settings(mode=mode))
    arm.servos.connect()
    arm.servos.enable()
    frames = frames_of(arm)
    nodes = [drive.node_id for drive in arm.arm.drives]
    setpoints = [i for i, (cob_id, _) in enumerate(frames) if cob_id - FIRST_RPDO in nodes]
    for axis, node in enumerate(nodes):
        writes = [
            (i, struct.unpack("<i", data[4:])[0])
            for i, (cob_id, data) in enumerate(frames)
            if cob_id == 0x600 + node and data[:4] == struct.pack("<BHB", DOWNLOAD_OF_FOUR_BYTES, *target)
        ]
        assert writes, f"node {node}: the target was never preset"
        position, counts = writes[-1]
        assert position < setpoints[0]
        here = arm.plant.sample(0.01).axis_position_rad[axis] * arm.arm.drives[axis].counts_per_rad
        assert counts == pytest.approx(here, abs=2)


def test_an_axis_that_sinks_is_taken_where_it_is_and_not_where_it_was(virtual_arm):
    """Several cycles pass between the preset and the enabled drive; an axis without a brake moves meanwhile."""
    arm = virtual_arm()
    arm.servos.connect()
    speed_rad_s = 2.0
    arm.plant._ramp(1, arm.plant.position_rad[1] - 1.0, 1.0 / speed_rad_s)
    enabled = []

    class WatchedPower(list):
        """Records the position of the axis when it is powered."""

        def __setitem__(self, axis, on):
            super().__setitem__(axis, on)
            enabled.append((axis, on, float(arm.plant.position_rad[1])))

    arm.plant.powered = WatchedPower(arm.plant.powered)
    arm.servos.enable()
    begun = next(position for axis, on, position in enabled if axis == 1 and on)
    assert begun < -0.2 - 2 * speed_rad_s * arm.arm.cycle_s, "it sank"
    drive = arm.arm.drives[1]
    sent = [data for cob_id, data in frames_of(arm) if cob_id == FIRST_RPDO + drive.node_id]
    targets = [struct.unpack("<Hih", data)[1] / drive.counts_per_rad for data in sent]
    enabling = [target for data, target in zip(sent, targets, strict=True) if data[0] & 0x0F == 0x0F]
    # Age of the last feedback, and the delay of the target until the SYNC that latches it.
    assert abs(enabling[0] - begun) <= 2.5 * speed_rad_s * arm.arm.cycle_s


def test_what_drives_are_to_do_without_their_master_and_after_a_fault(virtual_arm):
    """As in `drive_objects`: loss of the master causes a quick stop, which ends with torque on."""
    arm = virtual_arm()
    arm.servos.connect()
    arm.servos.enable()
    frames = frames_of(arm)
    wanted = {0x6007: 3, 0x605A: 6, 0x605E: 2, 0x605B: 1, 0x605C: 1, 0x605D: 1, 0x1029: 0}
    for drive in arm.arm.drives:
        written = {}
        for cob_id, data in frames:
            if cob_id == 0x600 + drive.node_id and data[0] & 0xE3 == 0x23:
                size = 4 - (data[0] >> 2 & 3)
                index, subindex = struct.unpack_from("<HB", data, 1)
                written[index, subindex] = int.from_bytes(data[4 : 4 + size], "little")
        configured = {index: written[index, 1 if index == 0x1029 else 0] for index in wanted}
        assert configured == wanted
        watched = written[0x1016, 1]
        beats = {cob_id - HEARTBEAT for cob_id, _ in frames if HEARTBEAT < cob_id <= HEARTBEAT + 127}
        masters = beats - {other.node_id for other in arm.arm.drives}
        assert {watched >> 16} == masters
        assert watched & 0xFFFF == pytest.approx(2.5e3 * arm.arm.heartbeat_s)


def test_no_setpoint_on_the_wire_differs_from_what_was_computed(virtual_arm):
    arm = virtual_arm()
    arm.servos.connect()
    held = arm.servos.enable().position_rad
    first = [data for cob_id, data in frames_of(arm) if cob_id == FIRST_RPDO + arm.arm.drives[0].node_id]
    counts = {struct.unpack("<Hih", data)[1] for data in first}
    assert counts == {round(held[0] * arm.arm.drives[0].counts_per_rad)}


def test_the_cycle_sends_the_masters_heartbeat(virtual_arm):
    """A heartbeat consumer starts with the first heartbeat; without it no drive would detect loss of the master."""
    arm = virtual_arm()
    arm.servos.connect()
    hold = arm.servos.enable().position_rad
    nodes = {drive.node_id for drive in arm.arm.drives}
    frames_of(arm)
    seconds = 1.0
    for _ in range(round(seconds / arm.arm.cycle_s)):
        arm.servos.exchange(JointCommand(hold, np.zeros(3), np.zeros(3)))
    beats = [
        cob_id
        for cob_id, _ in frames_of(arm)
        if HEARTBEAT < cob_id <= HEARTBEAT + 127 and cob_id - HEARTBEAT not in nodes
    ]
    assert len(set(beats)) == 1
    assert len(beats) == pytest.approx(seconds / arm.arm.heartbeat_s, abs=1)
