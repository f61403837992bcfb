"""A drive's description compared with its configuration."""

from dataclasses import replace

import pytest

from armload_drivers.bring_up.description_check import description_gaps
from armload_drivers.bring_up.description_file import read_description
from armload_drivers.cia402.arm_settings import EffortFeedback, OperationMode, VendorObject
from armload_drivers.cia402.drive_safety import Safety
from armload_drivers.cia402.eds_parser import DescribedObject, DeviceDescription
from armload_drivers.cia402.object_dictionary import Access, DataType, Mappable

MAPPED = {0x6040: 16, 0x607A: 32, 0x60B2: 16, 0x6041: 16, 0x6064: 32, 0x6078: 16}


def description(changes=()):
    """A drive with all required objects, changed object by object; None removes one."""
    types = {16: DataType.I16, 32: DataType.I32}
    objects = {
        index << 8: DescribedObject(index, 0, "", types[bits], Access.RW, Mappable.BOTH)
        for index, bits in MAPPED.items()
    }
    settings = [setting.entry for of in Safety for way in of.ways for setting in way.settings]
    objects |= {
        entry.key: DescribedObject(entry.index, entry.subindex, "", DataType.I16, Access.RW, Mappable.NO)
        for entry in settings
    }
    for index, change in dict(changes).items():
        found = objects.pop(index << 8)
        if change is not None:
            objects[index << 8] = replace(found, **change)
    return DeviceDescription("servo.eds", "", None, None, None, None, objects, ())


@pytest.fixture
def drive(arm_settings):
    return lambda **changes: arm_settings(**changes).drives[0]


def test_without_a_description_nothing_is_said(drive):
    assert description_gaps(drive()) == ()


def test_a_drive_that_offers_all_has_no_gaps(drive):
    assert description_gaps(drive(description=description())) == ()


@pytest.mark.parametrize(
    ("index", "change", "words"),
    [
        (0x60B2, None, "has no 60B2:0 torque offset, which a PDO must carry"),
        (0x60B2, {"mappable": Mappable.TPDO}, "does not allow 60B2:0"),
        (0x6064, {"type": DataType.I16}, "gives 6064:0 position actual value 16 bits instead of 32"),
        (
            0x605A,
            None,
            "has no object for quick_stop: the drive's quick stop behaviour is unknown; see accept_missing",
        ),
    ],
)
def test_what_it_does_not_offer_is_named(drive, index, change, words):
    gaps = description_gaps(drive(description=description({index: change})))
    assert len(gaps) == 1
    assert gaps[0].startswith("servo.eds ")
    assert words in gaps[0]


def test_an_object_whose_type_the_description_does_not_state_is_no_gap(drive):
    assert description_gaps(drive(description=description({0x6064: {"type": None}}))) == ()


def test_what_the_configuration_does_without_is_no_gap(drive):
    lacking = description({0x60B2: None, 0x605A: None})
    accepting = drive(description=lacking, torque_offset=False, accept_missing=frozenset({"quick_stop"}))
    assert description_gaps(accepting) == ()


def test_real_descriptions(drive, shared_data):
    """Pilz has IP without 607A in a PDO; maxon has 6077 and a vendor-specific current, but no 6078."""
    maxon = read_description(shared_data / "eds" / "maxon_epos4_50_15.dcf")
    assert any("6078:0" in gap for gap in description_gaps(drive(description=maxon)))
    vendor = VendorObject(0x30D1, 2, DataType.I32, 1e-3)
    gaps = description_gaps(drive(description=maxon, vendor_effort=vendor))
    assert not any("PDO" in gap for gap in gaps), gaps
    pilz = read_description(shared_data / "eds" / "pilz_prbt_0_1.dcf")
    ip = drive(
        description=pilz,
        mode=OperationMode.INTERPOLATED_POSITION,
        feedback=EffortFeedback.TORQUE,
        torque_offset=False,
    )
    assert not any("PDO" in gap for gap in description_gaps(ip)), description_gaps(ip)
