"""What a master has to put on the bus, whatever its own bookkeeping says."""

import struct

import numpy as np
import pytest

from armload_drivers.arm import OperationMode
from armload_drivers.servos import JointCommand

TARGET_POSITION = (0x607A, 0)
INTERPOLATION_DATA = (0x60C1, 1)
FIRST_RPDO = 0x200
HEARTBEAT = 0x700
DOWNLOAD_OF_FOUR_BYTES = 0x23


def frames_of(arm):
    """Everything on the bus since the last call, in order."""
    found = []
    while (message := arm.monitor.recv(0.0)) is not None:
        found.append((message.arbitration_id, bytes(message.data)))
    return found


@pytest.mark.parametrize(
    ("mode", "target"),
    [
        (OperationMode.CYCLIC_SYNCHRONOUS_POSITION, TARGET_POSITION),
        (OperationMode.INTERPOLATED_POSITION, INTERPOLATION_DATA),
    ],
)
def test_the_target_is_the_present_position_before_the_first_setpoint(virtual_arm, arm_settings, mode, target):
    """The most frequent accident with other masters: the arm jumps, or drives to zero, on enable."""
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


def test_no_setpoint_on_the_wire_differs_from_what_was_computed(virtual_arm):
    arm = virtual_arm()
    arm.servos.connect()
    held = arm.servos.enable().position_rad
    first = [data for cob_id, data in frames_of(arm) if cob_id == FIRST_RPDO + arm.arm.drives[0].node_id]
    counts = {struct.unpack("<Hih", data)[1] for data in first}
    assert counts == {round(held[0] * arm.arm.drives[0].counts_per_rad)}


def test_the_cycle_sends_the_masters_heartbeat(virtual_arm):
    """Without a first heartbeat no consumer starts, and no drive would ever notice a lost master."""
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
