"""A simulated drive with exactly the objects of a manufacturer's description, as described."""

import struct
from contextlib import suppress

import can
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY
from armload_drivers.cia402.eds_parser import parse_description
from armload_drivers.driver_errors import DescriptionError, DriverError
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from tests.drive_descriptions import eds, maker_drive

NO_OBJECT, NO_SUBINDEX, READ_ONLY, WRITE_ONLY = 0x0602_0000, 0x0609_0011, 0x0601_0002, 0x0601_0001
VALUE_RANGE, NOT_MAPPABLE = 0x0609_0030, 0x0604_0041


@pytest.fixture
def ask(virtual_arm):
    """Makes a drive from a description, and a function that reads or writes its objects by SDO."""

    def make(text):
        described = parse_description(text.encode(), "maker.eds")
        arm = virtual_arm(traits={3: DriveTraits(description=described)})

        def transfer(index, subindex=0, data=None):
            if data is None:
                request = struct.pack("<BHB4x", 0x40, index, subindex)
            else:
                request = struct.pack("<BHB", 0x23 | (4 - len(data)) << 2, index, subindex) + data.ljust(4, b"\0")
            arm.frames(0)
            arm.monitor.send(can_message(0x603, request))
            (answer,) = arm.frames(0x583)
            if answer[0] == 0x80:
                return "abort", struct.unpack_from("<I", answer, 4)[0]
            return "data", answer[4 : 8 - (answer[0] >> 2 & 3)] if data is None else b""

        return transfer

    return make


def can_message(cob_id, data):
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)


def test_what_the_description_lacks_is_not_there(ask):
    transfer = ask(eds(maker_drive(without=[0x6072, "1018sub2"])))
    assert transfer(0x6072) == ("abort", NO_OBJECT)
    assert transfer(0x6072, 0, b"\x01\0") == ("abort", NO_OBJECT)
    assert transfer(0x1018, 2) == ("abort", NO_SUBINDEX)
    assert transfer(0x1019) == ("abort", NO_OBJECT), "the simulation's own drives have it"


def test_access_is_as_described(ask):
    transfer = ask(eds(maker_drive(changes={"605A": {"AccessType": "ro"}, "6085": {"AccessType": "wo"}})))
    assert transfer(0x605A, 0, struct.pack("<h", 6)) == ("abort", READ_ONLY)
    assert transfer(0x605A) == ("data", struct.pack("<h", 2))
    assert transfer(0x6085) == ("abort", WRITE_ONLY)
    assert transfer(0x6085, 0, struct.pack("<I", 9)) == ("data", b"")


def test_limits_are_as_described(ask):
    transfer = ask(eds(maker_drive(changes={"6072": {"LowLimit": "10", "HighLimit": "0x100"}})))
    for value, done in ((9, VALUE_RANGE), (10, None), (256, None), (257, VALUE_RANGE)):
        assert transfer(0x6072, 0, struct.pack("<H", value)) == (("abort", done) if done else ("data", b"")), value


def test_types_and_values_are_as_described(ask):
    changes = {
        "6073": {"DataType": "0x7", "DefaultValue": "0x10000"},
        "607Dsub1": {"DefaultValue": "0x80000000"},
        "2000": {"DataType": "0x1B", "DefaultValue": "5", "AccessType": "ro", "PDOMapping": "0", "ParameterName": "a"},
    }
    transfer = ask(eds(maker_drive(changes=changes)))
    assert transfer(0x6073) == ("data", struct.pack("<I", 0x10000))
    assert transfer(0x607D, 1) == ("data", struct.pack("<i", -(2**31)))
    assert transfer(0x2000)[1][:4] == struct.pack("<I", 8), "announced in segments: 8 bytes"


def test_mapping_rights_are_as_described(ask):
    transfer = ask(eds(maker_drive(changes={"60B2": {"PDOMapping": "0"}, "6064": {"AccessType": "ro"}})))
    transfer(0x1400, 1, struct.pack("<I", 0x8000_0203))
    transfer(0x1600, 0, b"\0")
    assert transfer(0x1600, 1, struct.pack("<I", 0x60B2_0010)) == ("abort", NOT_MAPPABLE)
    assert transfer(0x1600, 1, struct.pack("<I", 0x6064_0020)) == ("abort", NOT_MAPPABLE), "only a TPDO may carry it"
    assert transfer(0x1600, 1, struct.pack("<I", 0x607A_0020)) == ("data", b"")


def test_identity_is_the_makers_and_the_simulations_where_it_is_left_open(ask):
    named = ask(eds(maker_drive(), vendor=0x1AB, product=7))
    assert (named(0x1018, 1), named(0x1018, 2)) == (("data", struct.pack("<I", 0x1AB)), ("data", struct.pack("<I", 7)))
    nameless = ask(eds(maker_drive()))
    assert nameless(0x1018, 1) == ("data", struct.pack("<I", SIMULATION_IDENTITY.vendor_id))


def test_a_heartbeat_that_the_maker_has_set_is_sent_from_power_on(virtual_arm):
    described = parse_description(eds(maker_drive(changes={"1017": {"DefaultValue": "10"}})).encode(), "maker.eds")
    arm = virtual_arm(traits={3: DriveTraits(description=described)})
    arm.clock.advance(0.1)
    arm.frames(0)
    arm.monitor.send(can_message(0x80, b""))
    assert arm.frames(0x703) == [b"\x7f"]


def test_a_pdo_that_maps_what_the_drive_lacks_is_none(virtual_arm):
    changes = {"1A00sub1": {"DefaultValue": "0x21000110"}, "1A00sub0": {"DefaultValue": "1"}}
    described = parse_description(eds(maker_drive(changes=changes)).encode(), "maker.eds")
    arm = virtual_arm(traits={3: DriveTraits(description=described)})
    arm.servos.connect()


def test_an_object_that_cannot_hold_what_a_drive_measures_is_refused(virtual_arm):
    described = parse_description(eds(maker_drive(changes={"6064": {"DataType": "3"}})).encode(), "maker.eds")
    with pytest.raises(
        DescriptionError, match=r"maker.eds: \[6064\] DataType: expected an integer of at least 32 bits"
    ):
        virtual_arm(traits={3: DriveTraits(description=described)})


CHANGE = st.fixed_dictionaries(
    {},
    optional={
        "DataType": st.sampled_from(["1", "2", "3", "5", "6", "7", "8", "9", "0xF", "0x11", "0x1B"]),
        "AccessType": st.sampled_from(["ro", "rw", "wo", "const", "rwr", "rww", "x"]),
        "DefaultValue": st.sampled_from(["", "0", "1", "-1", "0xFFFFFFFF", "$NODEID+0x200", "9", "nothing"]),
        "PDOMapping": st.sampled_from(["0", "1"]),
        "LowLimit": st.sampled_from(["", "0", "0x80000000", "7"]),
        "HighLimit": st.sampled_from(["", "0", "0x7FFFFFFF", "3"]),
    },
)


@settings(max_examples=30, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(changes=st.dictionaries(st.sampled_from(sorted(maker_drive())), CHANGE, max_size=12))
def test_a_drive_of_any_description_is_brought_up_or_refused(virtual_arm, changes):
    try:
        described = parse_description(eds(maker_drive(changes=changes)).encode(), "maker.eds")
        arm = virtual_arm(traits={3: DriveTraits(description=described)})
    except DescriptionError:
        return
    with suppress(DriverError):
        arm.servos.connect()
        arm.servos.enable()
    arm.drives.raise_failure()
