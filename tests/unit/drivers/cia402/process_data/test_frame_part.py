"""Where mapped objects stand among the bytes of a frame, and how their values are packed and unpacked."""

import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.object_dictionary import DataType, Entry
from armload_drivers.cia402.process_data.frame_part import FramePart, frame_part

pytestmark = pytest.mark.pure

STATUS, POSITION, TORQUE = od.STATUSWORD, od.POSITION_ACTUAL, od.TORQUE_ACTUAL
GAP_OF_ONE_BYTE, FOUR_BITS, ONE_BIT = 8, 4, 1
"""Words of a mapping without an object: only their number of bits counts."""
PART = FramePart(12, {STATUS: 1, POSITION: 4, TORQUE: 8}, ())
FRAME = bytes.fromhex("aa 3412 bb feffffff 0080 cc dd")


@pytest.mark.parametrize(
    ("mapped", "wanted", "length", "offsets", "others"),
    [
        ([], [STATUS], 0, {}, []),
        ([STATUS.mapping, POSITION.mapping], [STATUS, POSITION], 6, {STATUS: 0, POSITION: 2}, []),
        ([GAP_OF_ONE_BYTE, POSITION.mapping, GAP_OF_ONE_BYTE], [POSITION], 6, {POSITION: 1}, []),
        ([FOUR_BITS, POSITION.mapping, FOUR_BITS, STATUS.mapping], [POSITION, STATUS], 7, {STATUS: 5}, []),
        ([POSITION.mapping, ONE_BIT], [POSITION], 5, {POSITION: 0}, []),
        ([STATUS.mapping, STATUS.mapping], [STATUS], 4, {STATUS: 0}, [(0x6041, 0, DataType.U16, 2)]),
        ([STATUS.mapping, 0x2003_1220, 0x2003_0140], [STATUS], 14, {STATUS: 0}, [(0x2003, 0x12, DataType.U32, 2)]),
        ([0x2001_0108, 0x2001_0210], [], 3, {}, [(0x2001, 1, DataType.U8, 0), (0x2001, 2, DataType.U16, 1)]),
    ],
)
def test_objects_stand_where_the_mapping_places_them(mapped, wanted, length, offsets, others):
    part = frame_part(mapped, wanted)
    assert (part.length, part.offsets) == (length, offsets)
    assert [(entry.index, entry.subindex, entry.type, offset) for entry, offset in part.others] == others
    assert {entry.name for entry, _ in part.others} <= {"also mapped"}


@pytest.mark.parametrize(
    ("entries", "values"),
    [
        ([STATUS, POSITION, TORQUE], (0x1234, -2, -0x8000)),
        ([TORQUE, STATUS, POSITION], (-0x8000, 0x1234, -2)),
        ([POSITION], (-2,)),
    ],
)
def test_values_are_little_endian_in_the_order_asked_for(entries, values):
    assert PART.unpacker(entries)(FRAME) == PART.unpacker(entries)(bytearray(FRAME)) == values
    packed = PART.packer(entries, FRAME)(*values)
    assert packed == FRAME, "what is not packed is that of the constants"
    cleared = bytearray(12)
    for entry in entries:
        at = PART.offsets[entry]
        cleared[at : at + entry.type.bits // 8] = FRAME[at : at + entry.type.bits // 8]
    assert PART.packer(entries, bytes(12))(*values) == cleared


def test_two_packers_of_the_same_constants_do_not_share_bytes():
    first, second = (PART.packer([TORQUE, STATUS], FRAME) for _ in range(2))
    first(1, 2)
    assert second(-0x8000, 0x1234) == FRAME
    with pytest.raises(ValueError, match="shorter"):
        first(1)


def test_an_object_of_the_same_index_and_another_size_is_another_object():
    wide = Entry(STATUS.index, 0, "wide", DataType.U32)
    part = frame_part([wide.mapping], [STATUS])
    assert part.offsets == {}
    assert [entry.type for entry, _ in part.others] == [DataType.U32]
