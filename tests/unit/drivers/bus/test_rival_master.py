"""Frames of another master on the bus: which of them accuse it, and in which words."""

import struct

import pytest

from armload_drivers.bus.rival_master import ForeignTraffic
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.process_data.process_image import drive_image

MASTER = 127


class Wire:
    """A link that delivers what a test lets the bus say."""

    def __init__(self):
        self.listeners = {}

    def subscribe(self, cob_id, take):
        self.listeners[cob_id] = take

    def says(self, cob_id, data=b""):
        if cob_id in self.listeners:
            self.listeners[cob_id](bytearray(data))


@pytest.fixture
def watched(arm_settings):
    def watched(sync_is_ours=False):
        wire = Wire()
        return wire, ForeignTraffic(arm_settings(), wire, sync_is_ours=sync_is_ours)

    return watched


def test_silence_accuses_nobody(watched):
    _, traffic = watched()
    assert traffic.commands == traffic.requests == ""


def test_the_masters_own_node_id_setpoints_and_offsets_are_its_own(watched, arm_settings):
    image = drive_image(arm_settings().drives[1])
    for cob_id, said in (
        (od.HEARTBEAT_BASE + MASTER, "node id 127"),
        (image.rpdo.cob_id, "sends setpoints to joint_3"),
        (image.offset.cob_id, "sends torque offsets to joint_3") if image.offset else (image.rpdo.cob_id, "joint_3"),
    ):
        wire, traffic = watched()
        wire.says(cob_id)
        assert said in traffic.commands
        assert f"0x{cob_id:03X}" in traffic.commands
        traffic.forget()
        assert traffic.commands == ""


def test_sync_of_another_accuses_unless_our_own_is_received_back(watched):
    for ours in (False, True):
        wire, traffic = watched(ours)
        wire.says(od.SYNC_DEFAULT_COB_ID)
        assert bool(traffic.commands) is not ours


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (bytes([1, 0]), "to all nodes"),
        (bytes([129, 3]), r"to joint_3 (node 3)"),
        (bytes([77, 3]), "command 77"),
        (bytes([129, 4]), ""),
        (bytes([129]), ""),
        (bytes([129, 3, 0]), ""),
    ],
)
def test_nmt_commands_count_if_they_concern_the_arm(watched, data, said):
    wire, traffic = watched()
    wire.says(od.NMT_COB_ID, data)
    assert said in traffic.commands
    assert bool(traffic.commands) is bool(said)


def test_a_write_is_a_command_and_a_read_a_request(watched):
    wire, traffic = watched()
    wire.says(od.SDO_RX_BASE + 5, struct.pack("<BHB4x", 0x40, 0x6041, 2))
    assert "joint_5 (node 5), object 6041:2" in traffic.requests
    assert traffic.commands == ""
    traffic.forget()
    assert traffic.requests == ""
    wire.says(od.SDO_RX_BASE + 5, struct.pack("<BHB4x", 0x23, 0x6040, 0))
    assert "writes to joint_5 (node 5), object 6040:0" in traffic.commands
    assert traffic.requests == ""


def test_frames_that_are_no_sdo_are_none(watched):
    wire, traffic = watched()
    wire.says(od.SDO_RX_BASE + 5, bytes(7))
    assert traffic.commands == traffic.requests == ""
