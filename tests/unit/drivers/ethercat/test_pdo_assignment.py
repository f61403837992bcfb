"""Mapping of one drive, whose objects are a dictionary; fixed mappings refuse writes."""

import pytest

from armload_drivers.bring_up.sdo_channel import SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.object_dictionary import PdoDirection
from armload_drivers.driver_errors import SdoRefused, ServoError
from armload_drivers.ethercat.pdo_assignment import assign_pdo

READ_ONLY = 0x0601_0002

WANTED = [od.CONTROLWORD, od.TARGET_POSITION]
MAX_TORQUE = 0x6072_0010
MODE = 0x6060_0008


class Drive(SdoChannel):
    """One PDO 1600 assigned to 1C12; `fixed` objects refuse writes."""

    def __init__(self, mapped, fixed=()):
        super().__init__(3, "joint_3", timeout_s=0.1)
        self.objects = {(0x1C12, 0): 1, (0x1C12, 1): 0x1600, (0x1600, 0): len(mapped)}
        self.objects |= {(0x1600, number): word for number, word in enumerate(mapped, start=1)}
        self.fixed, self.written = fixed, []

    def _transfer(self, entry, data):
        key = entry.index, entry.subindex
        if data is None:
            return self.objects[key].to_bytes(4, "little")
        if entry.index in self.fixed:
            raise self._refused("writing", entry, READ_ONLY, "read only")
        self.written.append(key)
        self.objects[key] = int.from_bytes(data, "little")
        return b""

    def ask(self, entry):
        raise NotImplementedError

    def _take(self):
        raise NotImplementedError

    def _wait(self, time_s):
        raise NotImplementedError


def mapping(*entries):
    return [entry.mapping for entry in entries]


def test_a_mapping_is_written_in_the_prescribed_order_and_read_back():
    drive = Drive(mapping(od.CONTROLWORD))
    part, held = assign_pdo(drive, PdoDirection.RECEIVE, WANTED)
    assert drive.written == [
        (0x1C12, 0), (0x1600, 0), (0x1600, 1), (0x1600, 2), (0x1600, 0), (0x1C12, 0), (0x1C12, 1), (0x1C12, 0),
    ]  # fmt: skip
    assert (part.length, part.offsets, part.others) == (6, {od.CONTROLWORD: 0, od.TARGET_POSITION: 2}, ())
    assert {(entry.index, entry.subindex): value for entry, value in held.items()} == {(0x1C12, 1): 0x1600}


def test_a_mapping_that_is_right_already_is_not_written():
    drive = Drive(mapping(*WANTED), fixed={0x1600, 0x1C12})
    part, _ = assign_pdo(drive, PdoDirection.RECEIVE, WANTED)
    assert part.length == 6
    data = part.packer(WANTED, bytes(6))(0x1F, -2)
    assert data == bytes([0x1F, 0, 0xFE, 0xFF, 0xFF, 0xFF])
    assert part.unpacker(WANTED)(data) == (0x1F, -2)


@pytest.mark.parametrize("fixed", [{0x1600}, {0x1600, 0x1C12}])
def test_a_fixed_mapping_is_used_if_it_contains_what_is_needed(fixed):
    """In another order, and with objects that nobody asked for."""
    drive = Drive([MAX_TORQUE, od.TARGET_POSITION.mapping, MODE, od.CONTROLWORD.mapping], fixed)
    part, _ = assign_pdo(drive, PdoDirection.RECEIVE, WANTED)
    assert part.length == 9
    assert part.offsets == {od.TARGET_POSITION: 2, od.CONTROLWORD: 7}
    assert [(other.mapping, offset) for other, offset in part.others] == [(MAX_TORQUE, 0), (MODE, 6)]
    constants = bytes([0xB8, 0x0B, 0, 0, 0, 0, 8, 0, 0])
    data = part.packer(WANTED, constants)(0x1F, -2)
    assert data == bytes([0xB8, 0x0B, 0xFE, 0xFF, 0xFF, 0xFF, 8, 0x1F, 0])
    assert part.unpacker(WANTED)(data) == (0x1F, -2)


def test_a_fixed_mapping_that_lacks_something_is_refused_by_name():
    drive = Drive([od.CONTROLWORD.mapping, MODE], {0x1600, 0x1C12})
    with pytest.raises(ServoError, match="lacks 607A") as raised:
        assign_pdo(drive, PdoDirection.RECEIVE, WANTED)
    assert "6040:0, 6060:0" in str(raised.value)
    assert "joint_3" in str(raised.value)


def test_an_object_that_does_not_begin_on_a_byte_is_not_used():
    drive = Drive([0x2000_0004, *mapping(*WANTED)], {0x1600, 0x1C12})
    with pytest.raises(ServoError, match="lacks 6040"):
        assign_pdo(drive, PdoDirection.RECEIVE, WANTED)


def test_an_assignment_that_cannot_be_restored_is_an_error():
    """The mapping is refused after the assignment was taken away, and does not come back."""
    drive = Drive([MODE], {0x1600})

    def refuse_after_first(entry, data, whole=drive._transfer):
        if data is not None and entry.index == 0x1C12 and drive.written:
            raise drive._refused("writing", entry, READ_ONLY, "read only")
        return whole(entry, data)

    drive._transfer = refuse_after_first
    with pytest.raises(SdoRefused):
        assign_pdo(drive, PdoDirection.RECEIVE, WANTED)


def test_inputs_are_assigned_by_1c13_with_every_object_at_its_size():
    """CiA 301, 7.5.2.36 and 38: numbers of entries have 8 bits, assignments 16 and mappings 32."""
    drive = Drive(mapping(od.CONTROLWORD))
    feedback = [od.STATUSWORD, od.POSITION_ACTUAL]
    drive.objects = {(0x1C13, 0): 1, (0x1C13, 1): 0x1A02, (0x1A02, 0): 1, (0x1A02, 1): MODE, (0x1A02, 2): 0}
    sizes = {}

    def transfer(entry, data, whole=drive._transfer):
        sizes[entry.index, entry.subindex] = entry.type.bits
        return whole(entry, data)

    drive._transfer = transfer
    part, held = assign_pdo(drive, PdoDirection.TRANSMIT, feedback)
    assert part.offsets == {od.STATUSWORD: 0, od.POSITION_ACTUAL: 2}
    assert [(entry.index, entry.subindex, value) for entry, value in held.items()] == [(0x1C13, 1, 0x1A02)]
    assert sizes == {(0x1C13, 0): 8, (0x1C13, 1): 16, (0x1A02, 0): 8, (0x1A02, 1): 32, (0x1A02, 2): 32}


def test_without_an_assigned_pdo_the_first_is_used():
    drive = Drive([])
    drive.objects[0x1C12, 0] = 0
    _, held = assign_pdo(drive, PdoDirection.RECEIVE, WANTED)
    assert list(held.values()) == [0x1600]


def test_several_assigned_pdos_are_one_mapping():
    drive = Drive(mapping(od.CONTROLWORD), {0x1600, 0x1601, 0x1C12})
    drive.objects |= {(0x1C12, 0): 2, (0x1C12, 2): 0x1601, (0x1601, 0): 1, (0x1601, 1): od.TARGET_POSITION.mapping}
    part, held = assign_pdo(drive, PdoDirection.RECEIVE, WANTED)
    assert part.offsets == {od.CONTROLWORD: 0, od.TARGET_POSITION: 2}
    assert {entry.subindex: value for entry, value in held.items()} == {1: 0x1600, 2: 0x1601}
