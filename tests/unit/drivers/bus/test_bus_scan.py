"""The scan of the bus, with nodes of which a test writes every answer."""

import struct

import pytest

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.bus_scan import require_no_strangers, scan
from armload_drivers.driver_errors import WrongDevice
from tests.scripted_drives import ScriptedBus

SERVO, OUTPUTS = 0x0002_0192, 0x0002_0191


class Answering(ScriptedBus):
    """Nodes that answer the query for their device type.

    Args:
        answers: Device types by node id, None for an abort; bytes are answered as they are.
    """

    def __init__(self, answers):
        super().__init__()
        self.answers = answers

    def send(self, message):
        super().send(message)
        node_id = message.arbitration_id - 0x600
        for answer in self.answers.get(node_id, ()):
            data = answer
            if not isinstance(answer, bytes):
                data = struct.pack("<BHBI", 0x80 if answer is None else 0x43, 0x1000, 0, answer or 0x0602_0000)
            self.add(0x580 + node_id, data)


def test_what_is_no_answer_to_the_query_is_ignored():
    short, another = b"\x43\x00\x10", struct.pack("<BHBI", 0x43, 0x1018, 0, 7)
    bus = Answering({3: [short, SERVO], 5: [another], 7: [None], 9: [SERVO, SERVO]})
    assert scan(BusLink(bus), range(1, 128), 0.01) == {3: [SERVO], 7: [None], 9: [SERVO, SERVO]}


def test_if_another_client_asks_as_well_only_the_first_answer_counts():
    bus = Answering({3: [SERVO, SERVO]})
    bus.add(0x603, bytes.fromhex("4000100000000000"))
    assert scan(BusLink(bus), [3], 0.01) == {3: [SERVO]}


@pytest.mark.parametrize("device_type", [None, OUTPUTS])
def test_a_node_that_is_no_drive_is_no_stranger(arm_settings, device_type):
    require_no_strangers(BusLink(Answering({9: [device_type]})), arm_settings(), 0.01)


@pytest.mark.parametrize("answers", [[SERVO], [OUTPUTS, SERVO]], ids=["alone", "with the id of another node"])
def test_a_drive_that_nobody_named_is_a_stranger(arm_settings, answers):
    with pytest.raises(WrongDevice, match=r"node 9\).*a CiA 402 drive that the configuration does not name"):
        require_no_strangers(BusLink(Answering({9: answers})), arm_settings(), 0.01)


def test_a_node_id_of_the_arm_belongs_to_one_drive(arm_settings):
    arm = arm_settings()
    node_id = arm.drives[0].node_id
    require_no_strangers(BusLink(Answering({node_id: [SERVO]})), arm, 0.01)
    with pytest.raises(WrongDevice, match=f"two drives have node id {node_id}"):
        require_no_strangers(BusLink(Answering({node_id: [SERVO, SERVO]})), arm, 0.01)
