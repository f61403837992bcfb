"""PDO parameters as written by the master, with the drive's side."""

import can
import pytest
from msgspec.structs import replace

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.canopen.canopen_sdo import CanopenSdo
from armload_drivers.canopen.pdo_setup import map_pdo, switch_others_off
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.object_dictionary import Access, PdoDirection
from armload_drivers.cia402.process_data.process_image import PdoLayout
from armload_drivers.driver_errors import ServoError
from armload_drivers.simulation.drives.drive_pdos import Pdo
from armload_drivers.simulation.drives.sdo_server import Dictionary, SdoServer

TRANSMIT = PdoDirection.TRANSMIT
LAYOUT = PdoLayout(TRANSMIT, 0, 0x185, (od.STATUSWORD, od.POSITION_ACTUAL, od.TORQUE_ACTUAL))


class Advice:
    """Repeats what it is asked about."""

    def instead_of(self, entry, can_be_used):
        return f"instead of {entry.index:04X}: {can_be_used(od.POSITION_ACTUAL)} {can_be_used(od.CURRENT_ACTUAL)}"

    def fewer_objects(self, most):
        return f"at most {most}"

    def fixed_mapping(self, found):
        return " ".join(f"{pdo.key}: {len(pdo.mapping)}" for pdo in found)


ADVICE = Advice()


class Drive:
    """A bus with one drive's SDO server."""

    def __init__(self, pdos=4):
        self.dictionary = Dictionary()
        for entry in LAYOUT.entries:
            self.dictionary.add(entry, 0)
        self.pdos = [Pdo(TRANSMIT, n, 5, self.dictionary, (od.STATUSWORD,)) for n in range(pdos)]
        self.server = SdoServer(self.dictionary)
        self.queue = []

    def send(self, message, timeout=None):
        answer = self.server.receive(bytes(message.data))
        if answer is not None:
            self.queue.append(can.Message(arbitration_id=0x585, data=answer, is_extended_id=False))

    def recv(self, timeout=None):
        return self.queue.pop(0) if self.queue else None

    @property
    def sdo(self):
        channel = CanopenSdo(5, "joint_2", BusLink(self), timeout_s=0.01)
        channel.step = "mapping the transmit PDO"
        return channel


def test_a_mapping_is_written_in_an_order_that_the_standard_allows():
    drive = Drive()
    map_pdo(drive.sdo, LAYOUT, ADVICE)
    pdo = drive.pdos[0]
    assert (pdo.cob_id, pdo.type, pdo.length) == (0x185, od.PDO_SYNCHRONOUS, LAYOUT.length)
    assert all(pdo.carries(entry) for entry in LAYOUT.entries)
    assert drive.dictionary.values[TRANSMIT.cob_id_entry(0).key] & od.PDO_NO_RTR


def test_a_mapping_can_be_written_again():
    drive = Drive()
    map_pdo(drive.sdo, LAYOUT, ADVICE)
    map_pdo(drive.sdo, LAYOUT, ADVICE)
    assert drive.pdos[0].length == LAYOUT.length


def test_a_drive_that_keeps_something_else_is_found_out():
    drive = Drive()
    kind = TRANSMIT.type_entry(0)

    def stubborn():
        drive.dictionary.values[kind.key] = 255

    drive.dictionary.reactions[kind.key] = stubborn
    with pytest.raises(ServoError, match="transmission type reads 0xFF after 0x1") as raised:
        map_pdo(drive.sdo, LAYOUT, ADVICE)
    assert raised.value.step == "mapping the transmit PDO"


def test_a_drive_that_cannot_map_an_object_says_so():
    drive = Drive()
    drive.dictionary.remove([od.TORQUE_ACTUAL.index])
    # Position can be mapped there instead, and current, which this drive does not have, cannot.
    with pytest.raises(ServoError, match=r"does not allow 6077:0 .*from 1A00:3.*instead of 6077: True False"):
        map_pdo(drive.sdo, LAYOUT, ADVICE)


def test_a_drive_whose_pdos_carry_less_says_how_much():
    drive = Drive()
    drive.dictionary.allowed[TRANSMIT.count_entry(0).key] = range(3)
    with pytest.raises(ServoError, match=r"carries at most 2 objects, 3 are required\. at most 2"):
        map_pdo(drive.sdo, LAYOUT, ADVICE)
    few = Drive()
    few.dictionary.entries = {key: e for key, e in few.dictionary.entries.items() if key not in (0x1A0002, 0x1A0003)}
    with pytest.raises(ServoError, match=r"carries at most 1 objects, 3 are required\. A drive must carry 2"):
        map_pdo(few.sdo, LAYOUT, ADVICE)


@pytest.mark.parametrize("part", [TRANSMIT.cob_id_entry(0), TRANSMIT.count_entry(0), TRANSMIT.type_entry(0)])
def test_a_pdo_without_a_parameter_is_named(part):
    drive = Drive()
    del drive.dictionary.entries[part.key]
    with pytest.raises(ServoError, match=f"the drive has no {part.index:04X}:{part.subindex}.*another drive"):
        map_pdo(drive.sdo, LAYOUT, ADVICE)


@pytest.mark.parametrize("transmission", [0, 240])
def test_every_synchronous_type_of_an_rpdo_is_the_same(transmission):
    drive, receive = Drive(), PdoDirection.RECEIVE
    drive.dictionary.add(od.CONTROLWORD, 0)
    pdo = Pdo(receive, 0, 5, drive.dictionary, (od.CONTROLWORD,))
    kind = receive.type_entry(0)
    drive.dictionary.entries[kind.key] = replace(kind, access=Access.RO)
    drive.dictionary.values[kind.key] = transmission
    map_pdo(drive.sdo, PdoLayout(receive, 0, 0x205, (od.CONTROLWORD,)), ADVICE)
    assert (pdo.type, pdo.synchronous) == (transmission, True)


def test_a_cob_id_that_cannot_be_switched_off_is_sufficient():
    drive = Drive()
    drive.dictionary.allowed[TRANSMIT.cob_id_entry(0).key] = range(1, 0x8000_0000)
    map_pdo(drive.sdo, LAYOUT, ADVICE)
    assert drive.pdos[0].length == LAYOUT.length
    switch_others_off(drive.sdo, TRANSMIT, {0})


def test_other_pdos_are_switched_off_where_there_are_any():
    drive = Drive(pdos=3)
    switch_others_off(drive.sdo, TRANSMIT, {0})
    assert [pdo.cob_id for pdo in drive.pdos] == [0x185, None, None]


# Parameters that cannot be written -------------------------------------------------------------------------------

OURS, ANOTHERS = 0x185 | od.PDO_NO_RTR, 0x285 | od.PDO_NO_RTR


def fixed(drive, entry, value):
    """Make an object read-only, with a value."""
    found = drive.dictionary.entries[entry.key]
    drive.dictionary.entries[entry.key] = replace(found, access=Access.RO)
    drive.dictionary.values[entry.key] = value
    drive.pdos[0].refresh()


@pytest.mark.parametrize("disabled", [0, od.PDO_DISABLED])
def test_another_nodes_cob_id_is_replaced(disabled):
    drive = Drive()
    drive.dictionary.values[TRANSMIT.cob_id_entry(0).key] = ANOTHERS | disabled
    map_pdo(drive.sdo, LAYOUT, ADVICE)
    assert drive.pdos[0].cob_id == 0x185


def test_a_cob_id_that_is_right_need_not_be_writable():
    drive = Drive()
    fixed(drive, TRANSMIT.cob_id_entry(0), OURS)
    map_pdo(drive.sdo, LAYOUT, ADVICE)
    assert drive.pdos[0].carries(od.TORQUE_ACTUAL)
    fixed(drive, TRANSMIT.cob_id_entry(0), ANOTHERS)
    with pytest.raises(ServoError, match="is 0x40000285, which is not this node's 0x40000185, and cannot be written"):
        map_pdo(drive.sdo, LAYOUT, ADVICE)


def test_a_transmission_type_that_is_right_need_not_be_writable():
    drive = Drive()
    fixed(drive, TRANSMIT.type_entry(0), od.PDO_SYNCHRONOUS)
    map_pdo(drive.sdo, LAYOUT, ADVICE)
    fixed(drive, TRANSMIT.type_entry(0), 255)
    with pytest.raises(ServoError, match="is 255 and cannot be written; 1 is required"):
        map_pdo(drive.sdo, LAYOUT, ADVICE)


@pytest.mark.parametrize("part", [TRANSMIT.count_entry(0), TRANSMIT.map_entry(0, 2)], ids=["count", "entry"])
def test_a_mapping_that_is_right_need_not_be_writable_and_another_is_named(part):
    drive = Drive()
    map_pdo(drive.sdo, LAYOUT, ADVICE)
    fixed(drive, part, drive.dictionary.values[part.key])
    map_pdo(drive.sdo, LAYOUT, ADVICE)
    other = replace(LAYOUT, entries=(od.STATUSWORD, od.TORQUE_ACTUAL))
    with pytest.raises(ServoError, match=r"the mapping is fixed to .*; required are 6041:0, 6077:0") as raised:
        map_pdo(drive.sdo, other, ADVICE)
    assert "tpdo2: " in str(raised.value), "the advice is given the PDOs of this direction"


def test_pdos_beyond_the_usual_ones_and_behind_a_hole_are_switched_off_too():
    drive = Drive(pdos=7)
    for index in (0x1801, 0x1A01):
        drive.dictionary.remove([index])
    switch_others_off(drive.sdo, TRANSMIT, {0})
    assert [pdo.cob_id is None for pdo in drive.pdos[2:]] == [True] * 5
    assert drive.pdos[0].cob_id == 0x185


def test_behind_the_last_pdo_no_more_are_looked_for():
    drive = Drive(pdos=2)
    requests, send = [], drive.send
    drive.send = lambda message, timeout=None: (requests.append(message), send(message))
    switch_others_off(drive.sdo, TRANSMIT, {0})
    assert len(requests) < 10


def test_a_pdo_that_is_off_need_not_be_writable():
    drive = Drive(pdos=2)
    cob_id, count = TRANSMIT.cob_id_entry(1), TRANSMIT.count_entry(1)
    fixed(drive, count, 1)
    fixed(drive, cob_id, ANOTHERS | od.PDO_DISABLED)
    switch_others_off(drive.sdo, TRANSMIT, {0})
    fixed(drive, cob_id, ANOTHERS)
    with pytest.raises(ServoError, match="This PDO would load the bus"):
        switch_others_off(drive.sdo, TRANSMIT, {0})


def test_an_rpdo_that_does_not_take_type_1_may_take_type_0():
    """Both are synchronous; in a TPDO 0 is sent only after an event."""
    for direction, cob_id, entry in ((PdoDirection.RECEIVE, 0x205, od.CONTROLWORD), (TRANSMIT, 0x185, od.STATUSWORD)):
        drive = Drive(pdos=0)
        drive.dictionary.add(od.CONTROLWORD, 0)
        pdo = Pdo(direction, 0, 5, drive.dictionary, (entry,))
        drive.dictionary.allowed[direction.type_entry(0).key] = {0, 255}
        layout = PdoLayout(direction, 0, cob_id, (entry,))
        if direction is TRANSMIT:
            with pytest.raises(ServoError, match="is 255 and cannot be written; 1 is required"):
                map_pdo(drive.sdo, layout, ADVICE)
        else:
            map_pdo(drive.sdo, layout, ADVICE)
            assert pdo.type == 0


def test_an_object_of_a_fixed_pdo_that_is_not_taken_is_the_configurations_mistake():
    drive = Drive()
    stated = (od.STATUSWORD.mapping, 0x2001_0010)
    layout = PdoLayout(TRANSMIT, 0, 0x185, (od.STATUSWORD,), fixed=stated)
    with pytest.raises(ServoError, match=r"2001:0 in this PDO \(0x06020000 from 1A00:2 .*\)\. Correct fixed_pdos"):
        map_pdo(drive.sdo, layout, ADVICE)


def test_a_pdo_that_the_drive_does_not_have_is_named_with_what_can_be_left_out():
    receive = PdoLayout(PdoDirection.RECEIVE, 1, 0x305, (od.TORQUE_ACTUAL,))
    with pytest.raises(
        ServoError, match=r"no 1401:1 .*it has 1 PDOs in this direction, 2 are required.*instead of 6077"
    ):
        map_pdo(Drive(pdos=1).sdo, receive, ADVICE)
    second = replace(LAYOUT, number=1, cob_id=0x285)
    with pytest.raises(ServoError, match=r"has no 1801:1 .*2 are required.*Use firmware that has this PDO"):
        map_pdo(Drive(pdos=1).sdo, second, ADVICE)


def test_all_of_512_pdos_are_looked_at_and_no_more():
    """CiA 301, 7.5.2.37: 1800 to 19FF."""

    class Many:
        def __init__(self):
            self.written = []

        def read_if_there(self, entry):
            assert entry.index < 0x1A00
            return 0x180

        def write(self, entry, value):
            self.written.append((entry.index, value))

    sdo = Many()
    switch_others_off(sdo, TRANSMIT, {0, 3})
    assert sdo.written == [(index, 0x8000_0180) for index in range(0x1801, 0x1A00) if index != 0x1803]
