"""A simulated drive with exactly the objects of a manufacturer's description, as described."""

import struct
from contextlib import suppress

import can
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY
from armload_drivers.cia402.eds_parser import parse_description
from armload_drivers.driver_errors import DescriptionError, DriverError
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.eds_objects import adopt_description, pdo_count
from armload_drivers.simulation.drives.sdo_server import Dictionary
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


# The dictionary itself -------------------------------------------------------------------------------------------

PDO_OFF = 0x8000_0000
NODE = 9


def described_dictionary(known=(), **options):
    """The dictionary of a description, on top of what the simulation's own drives have."""
    dictionary = Dictionary()
    for entry, value in known:
        dictionary.add(entry, value)
    adopt_description(dictionary, parse_description(eds(maker_drive(**options)).encode(), "maker.eds"), NODE)
    return dictionary


def test_what_the_simulation_measures_and_the_scale_of_the_arm_are_kept():
    known = [(od.POSITION_ACTUAL, 77), (od.RATED_TORQUE_MNM, 5000), (od.RATED_CURRENT_MA, 0), (od.MAX_TORQUE, 3)]
    changes = {name: {"DefaultValue": "8"} for name in ("6064", "6076", "6075", "6072")}
    dictionary = described_dictionary(known, changes=changes)
    found = [dictionary.values[entry.key] for entry, _ in known]
    assert found == [77, 5000, 8, 8], "the maker's where the arm does not say"
    assert described_dictionary(known).values[od.RATED_CURRENT_MA.key] == 1000
    named = [*known[:2], (od.RATED_CURRENT_MA, 42)]
    assert described_dictionary(named, changes=changes).values[od.RATED_CURRENT_MA.key] == 42


def test_a_drive_without_an_object_behaves_as_the_standard_says_for_one_without_it():
    without = {"6007": 0, "6065": 0xFFFF_FFFF, "6066": 0}
    entries = (od.ABORT_CONNECTION_OPTION, od.FOLLOWING_ERROR_WINDOW, od.FOLLOWING_ERROR_TIMEOUT_MS)
    known = [(entry, 5) for entry in entries]
    dictionary = described_dictionary(known, without=list(without))
    assert [dictionary.values[entry.key] for entry in entries] == list(without.values())
    assert not {entry.key for entry in entries} & set(dictionary.entries)
    kept = described_dictionary(known)
    assert kept.values[od.ABORT_CONNECTION_OPTION.key] == 1


def test_a_pdo_parameter_is_a_number_and_another_object_may_be_a_text():
    text = {"DataType": "9", "DefaultValue": "a"}
    with pytest.raises(DescriptionError, match=r"\[1A00sub1\] DataType: expected an integer: "):
        described_dictionary(changes={"1A00sub1": text})
    described_dictionary(changes={"6076": text})


@pytest.mark.parametrize(("modes", "allowed"), [("0xC0", {0, 7, 8}), ("0x80", {0, 8}), ("0x80000001", {0, 1, 32})])
def test_modes_are_those_of_the_file(modes, allowed):
    dictionary = described_dictionary(changes={"6502": {"DefaultValue": modes}})
    assert dictionary.allowed[od.MODE.key] == allowed
    assert dictionary.values[od.SUPPORTED_MODES.key] == int(modes, 16)


@pytest.mark.parametrize(("value", "type_"), [("0", 0x0002_0192), ("0x40192", 0x40192)])
def test_a_device_type_of_nothing_is_that_of_a_servo_drive(value, type_):
    assert described_dictionary(changes={"1000": {"DefaultValue": value}}).values[od.DEVICE_TYPE.key] == type_


def test_a_value_that_the_node_id_makes_too_large_is_cut_to_its_type():
    values = described_dictionary(changes={"1029sub1": {"DefaultValue": "$NODEID+0xFB"}}).values
    assert values[od.COMMUNICATION_ERROR_BEHAVIOUR.key] == 0xFF


def test_values_with_the_node_id_are_those_of_this_node():
    dictionary = described_dictionary(changes={"1400sub1": {"DefaultValue": "$NODEID+0x200"}})
    assert dictionary.values[od.PdoDirection.RECEIVE.cob_id_entry(0).key] == 0x209


@pytest.mark.parametrize(
    ("cob_id", "kept"),
    [
        ("0x580", True),
        ("0x581", False),
        ("0x67F", False),
        ("0x680", True),
        ("0x701", False),
        ("0x77F", False),
        ("", False),
    ],
)
def test_a_pdo_on_an_identifier_of_sdo_or_heartbeats_is_off(cob_id, kept):
    dictionary = described_dictionary(changes={"1400sub1": {"DefaultValue": cob_id}})
    assert dictionary.values[od.PdoDirection.RECEIVE.cob_id_entry(0).key] == (int(cob_id, 16) if kept else PDO_OFF)


def test_a_count_and_the_heartbeat_consumer_can_be_0_whatever_the_limits():
    limits = {"LowLimit": "2", "HighLimit": "6"}
    dictionary = described_dictionary(changes={"1600sub0": limits, "1016sub1": limits, "6085": limits})
    counts = dictionary.allowed[od.PdoDirection.RECEIVE.count_entry(0).key]
    assert (min(counts), max(counts)) == (0, 6)
    assert 0 in dictionary.allowed[od.HEARTBEAT_CONSUMER.key]
    assert 0 not in dictionary.allowed[od.QUICK_STOP_DECELERATION.key]


def test_limits_that_the_drive_already_has_are_narrowed_and_senseless_ones_set_none():
    known = [(od.QUICK_STOP_OPTION, 2)]
    dictionary = Dictionary()
    dictionary.add(*known[0])
    dictionary.allowed[od.QUICK_STOP_OPTION.key] = {0, 2, 6, 7}
    changes = {"605A": {"LowLimit": "1", "HighLimit": "6"}, "6085": {"LowLimit": "9", "HighLimit": "9"}}
    adopt_description(dictionary, parse_description(eds(maker_drive(changes=changes)).encode(), "maker.eds"), NODE)
    assert dictionary.allowed[od.QUICK_STOP_OPTION.key] == {2, 6}
    assert od.QUICK_STOP_DECELERATION.key not in dictionary.allowed


def test_only_one_limit_is_completed_by_the_type():
    changes = {"6072": {"LowLimit": "10"}, "605A": {"HighLimit": "3"}}
    allowed = described_dictionary(changes=changes).allowed
    assert (allowed[od.MAX_TORQUE.key][0], allowed[od.MAX_TORQUE.key][-1]) == (10, 0xFFFF)
    assert (allowed[od.QUICK_STOP_OPTION.key][0], allowed[od.QUICK_STOP_OPTION.key][-1]) == (-0x8000, 3)


def test_pdos_are_counted_up_to_the_first_that_is_missing():
    def count(**options):
        return pdo_count(parse_description(eds(maker_drive(**options)).encode(), "m.eds"), od.PdoDirection.RECEIVE)

    whole = count()
    assert whole >= 1
    assert count(without=["1400"]) == 0


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


def test_as_many_pdos_are_counted_as_the_standard_has_room_for():
    """CiA 301, 7.5.2.35: 1400 to 15FF."""
    sub = {"ParameterName": "a", "ObjectType": "7", "DataType": "0x7", "AccessType": "rw", "DefaultValue": "0"}
    more = {f"{0x1400 + number:04X}sub1": sub for number in range(512)}
    described = parse_description(eds(maker_drive(changes=more)).encode(), "maker.eds")
    assert pdo_count(described, od.PdoDirection.RECEIVE) == 512
