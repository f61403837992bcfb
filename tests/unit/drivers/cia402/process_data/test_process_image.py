"""The cyclic frames, byte by byte."""

from dataclasses import replace

import msgspec
import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import (
    DriveSettings,
    EffortFeedback,
    FixedPdo,
    Identity,
    OperationMode,
    VendorObject,
)
from armload_drivers.cia402.object_dictionary import DataType, PdoDirection
from armload_drivers.cia402.process_data.process_image import drive_image, effort_entry, target_entry

pytestmark = pytest.mark.pure

DRIVE = DriveSettings(
    joint="joint_5",
    node_id=5,
    mode=OperationMode.CYCLIC_SYNCHRONOUS_POSITION,
    feedback=EffortFeedback.CURRENT,
    counts_per_rad=1e5,
    rated_current_a=10.0,
    rated_torque_nm=100.0,
    max_torque_permille=3000,
    following_error_rad=0.1,
    position_min_rad=-3.0,
    position_max_rad=3.0,
    velocity_max_rad_s=2.0,
    acceleration_max_rad_s2=5.0,
    has_brake=True,
    identity=Identity(None, None),
)


def test_the_image_in_csp_with_current():
    image = drive_image(DRIVE)
    assert [image.rpdo.cob_id, image.tpdo.cob_id] == [0x205, 0x185]
    assert [entry.mapping for entry in image.rpdo.entries] == [0x60400010, 0x607A0020, 0x60B20010]
    assert [entry.mapping for entry in image.tpdo.entries] == [0x60410010, 0x60640020, 0x60780010]
    assert [image.rpdo.length, image.tpdo.length] == [8, 8]


def test_setpoints_as_they_are_on_the_wire():
    assert drive_image(DRIVE).rpdo.pack(0x000F, -2, -300) == bytes.fromhex("0f00 feffffff d4fe")


def test_feedback_as_it_is_on_the_wire():
    values = drive_image(DRIVE).tpdo.unpack(bytes.fromhex("3712 00000080 ff7f"))
    assert values == (0x1237, -(2**31), 32767)


def test_interpolated_position_with_torque():
    drive = replace(
        DRIVE, mode=OperationMode.INTERPOLATED_POSITION, feedback=EffortFeedback.TORQUE, rated_current_a=None
    )
    image = drive_image(drive)
    assert image.rpdo.entries[1] is od.INTERPOLATION_SETPOINT
    assert image.tpdo.entries[2] is od.TORQUE_ACTUAL


def test_a_drive_without_a_torque_offset_gets_six_bytes():
    image = drive_image(replace(DRIVE, torque_offset=False))
    assert image.rpdo.length == 6
    assert od.TORQUE_OFFSET not in image.rpdo.entries


@pytest.mark.parametrize("mode", list(OperationMode))
@pytest.mark.parametrize("feedback", list(EffortFeedback))
def test_everything_mapped_can_be_mapped_and_fits(mode, feedback):
    image = drive_image(replace(DRIVE, mode=mode, feedback=feedback))
    assert target_entry(mode) in image.rpdo.entries
    assert effort_entry(replace(DRIVE, feedback=feedback)) in image.tpdo.entries
    assert all(entry.mappable is od.Mappable.RPDO for entry in image.rpdo.entries)
    assert all(entry.mappable is od.Mappable.TPDO for entry in image.tpdo.entries)
    for layout in (image.rpdo, image.tpdo):
        assert layout.length == sum(entry.type.bits for entry in layout.entries) // 8 <= 8


def test_parameters_of_the_pre_defined_connection_set():
    receive, transmit = PdoDirection.RECEIVE, PdoDirection.TRANSMIT
    assert [receive.default_cob_id(n, 3) for n in range(4)] == [0x203, 0x303, 0x403, 0x503]
    assert [transmit.default_cob_id(n, 3) for n in range(4)] == [0x183, 0x283, 0x383, 0x483]
    assert str(receive.cob_id_entry(1)) == "1401:1 COB-ID of the PDO"
    assert transmit.map_entry(0, 3).key == 0x1A0003


@pytest.mark.parametrize(("kind", "frames"), [(DataType.I16, 1), (DataType.I32, 2)])
def test_a_vendors_effort_gets_a_frame_of_its_own_where_there_is_no_room(kind, frames):
    image = drive_image(replace(DRIVE, vendor_effort=VendorObject(0x30D1, 2, kind, 1e-3)))
    assert len(image.layouts) == 1 + frames
    last = image.layouts[-1]
    assert last.entries[-1].mapping == 0x30D1_0200 | kind.bits
    assert (last.number, last.cob_id) == ((1, 0x285) if frames == 2 else (0, 0x185))
    assert sum(layout.length for layout in image.layouts) == 8 + 6 + kind.bits // 8
    assert (image.effort is None) == (frames == 1)


@pytest.mark.parametrize(
    ("changes", "rpdo", "tpdo"),
    [
        ({}, [3], [3]),
        ({"torque_offset_bits": 32}, [2, 1], [3]),
        ({"pdo_objects_max": 2}, [2, 1], [2, 1]),
        ({"pdo_objects_max": 2, "torque_offset": False}, [2], [2, 1]),
        ({"pdo_objects_max": 3}, [3], [3]),
    ],
)
def test_what_does_not_fit_into_one_frame_has_a_second(changes, rpdo, tpdo):
    image = drive_image(replace(DRIVE, **changes))
    for direction, expected in ((PdoDirection.RECEIVE, rpdo), (PdoDirection.TRANSMIT, tpdo)):
        assert [len(layout.entries) for layout in image.layouts if layout.direction is direction] == expected
    assert all(layout.length <= 8 for layout in image.layouts)


RECEIVE, TRANSMIT = PdoDirection.RECEIVE, PdoDirection.TRANSMIT
FIXED = (
    FixedPdo(RECEIVE, 2, (0x607A0020, 0x60600008, 0x00050008, 0x60400010)),
    FixedPdo(RECEIVE, 1, (0x60FF0020, 0x60B20010)),
    FixedPdo(TRANSMIT, 0, (0x606C0020,)),
    FixedPdo(TRANSMIT, 3, (0x60610008, 0x60640020, 0x60410010)),
    FixedPdo(TRANSMIT, 1, (0x60770010, 0x60780010)),
)


def test_a_fixed_mapping_is_used_in_its_order_and_with_what_else_it_carries():
    image = drive_image(replace(DRIVE, fixed_pdos=FIXED))
    assert [layout.number for layout in image.layouts] == [2, 1, 3, 1]
    assert [layout.cob_id for layout in image.layouts] == [0x405, 0x305, 0x485, 0x285]
    assert [layout.length for layout in image.layouts] == [8, 6, 7, 4]
    setpoint, offset = image.rpdo.pack(0x000F, -2), image.offset.pack(-300)
    assert setpoint == bytes.fromhex("feffffff 08 00 0f00"), "6060 gets the mode, padding 0"
    assert offset == bytes.fromhex("00000000 d4fe"), "the target of another mode is 0"
    assert image.tpdo.unpack(bytes.fromhex("08 00000080 3712")) == (0x1237, -(2**31))
    assert image.effort.unpack(bytes.fromhex("0100 ff7f")) == (32767,)
    assert image.rpdo.unpack(setpoint) == (0x000F, -2)


@pytest.mark.parametrize(
    ("change", "what"),
    [
        ({0: (0x607A0020,)}, "none of rpdo3, rpdo2 carries 6040:0 and 607A:0"),
        ({1: (0x60400010, 0x60B20010)}, "rpdo2 carries 6040:0, whose value is not known"),
        ({0: (0x60400010, 0x607A0020, 0x60720010)}, "rpdo3 carries 6072:0, whose value is not known"),
        ({0: (0x60400010, 0x607A0020, 0x60FE0110)}, "rpdo3 carries 60FE:1, whose value is not known"),
        ({4: (0x60770010,)}, "none of tpdo1, tpdo4, tpdo2 carries 6078:0"),
        ({4: (0x60780010, 0x60640020, 0x606C0020)}, "tpdo2 has 80 bits"),
        ({4: (0x60780010, 0x20000001)}, "tpdo2 has 17 bits: expected whole bytes"),
    ],
)
def test_a_fixed_mapping_that_cannot_be_used_is_named(change, what):
    fixed = tuple(msgspec.structs.replace(pdo, mapping=change.get(n, pdo.mapping)) for n, pdo in enumerate(FIXED))
    with pytest.raises(ValueError, match=what):
        drive_image(replace(DRIVE, fixed_pdos=fixed))


@pytest.mark.parametrize("word", [0x60420010, 0x60710010, 0x60B10020, 0x60FF0020])
def test_a_setpoint_of_another_mode_or_an_offset_is_sent_as_0(word):
    """6042 is the target of the velocity mode, 60FF of the profile velocity mode, 6071 of the torque modes."""
    fixed = (FIXED[0], msgspec.structs.replace(FIXED[1], mapping=(word, 0x60B20010)), *FIXED[2:])
    image = drive_image(replace(DRIVE, fixed_pdos=fixed))
    assert image.offset.pack(-300) == bytes((word & 0xFF) // 8) + bytes.fromhex("d4fe")


def test_a_temperature_is_read_by_sdo_and_no_pdo_carries_it():
    drive = replace(DRIVE, temperature=VendorObject(0x3201, 1, DataType.I16, 0.1))
    entry = drive.temperature.entry("temperature")
    assert (entry.index, entry.subindex, entry.type, entry.mappable) == (0x3201, 1, DataType.I16, od.Mappable.NO)
    assert drive_image(drive) == drive_image(DRIVE)
