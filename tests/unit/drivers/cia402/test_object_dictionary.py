"""The objects of the standards: those that a drive with all of them has, and no two with the same place."""

import struct

import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.eds_parser import parse_description
from armload_drivers.cia402.object_dictionary import DataType, Entry, Mappable, PdoDirection
from tests.drive_descriptions import eds, maker_drive

pytestmark = pytest.mark.pure

ENTRIES = {name: value for name, value in vars(od).items() if isinstance(value, Entry)}
OPTIONAL = {
    "DEVICE_NAME", "SOFTWARE_VERSION", "EMERGENCY_COB_ID", "ERROR_COUNT", "REVISION", "SERIAL_NUMBER",
    "SYNC_COUNTER_OVERFLOW", "SDO_RX_COB_ID", "SDO_TX_COB_ID", "VELOCITY_ACTUAL", "POLARITY", "FOLLOWING_ERROR_ACTUAL",
    "GEAR_MOTOR_REVOLUTIONS", "GEAR_SHAFT_REVOLUTIONS", "FEED", "FEED_SHAFT_REVOLUTIONS", "TORQUE_OFFSET_32",
    "TORQUE_ACTUAL_32", "CURRENT_ACTUAL_32", "POSITION_OFFSET", "VELOCITY_OFFSET", "SECOND_CONTROLWORD",
    "SECOND_POSITION", "STORE_ALL", "HOME_OFFSET", "HOMING_METHOD",
    "PHYSICAL_OUTPUTS", "OUTPUT_MASK",
}  # fmt: skip
"""Not in the description of the tests."""
PLACES = """
1003:0 1003:1 1003:2 1003:3 1003:4 1008:0 100A:0 1010:1 1014:0 1018:3 1018:4 1019:0 1200:1 1200:2 6064:2 606C:0 6077:0
6078:0 607C:0 607E:0 6091:1 6091:2 6092:1 6092:2 6098:0 60B0:0 60B1:0 60B2:0 60F4:0 60FE:1 60FE:2 6840:0
"""
"""Where CiA 301 and CiA 402-2 have these, and the number of errors with what follows it."""


@pytest.mark.parametrize("name", sorted(ENTRIES.keys() - OPTIONAL))
def test_an_object_has_the_place_type_and_mapping_of_a_maker(name):
    entry = ENTRIES[name]
    found = parse_description(eds(maker_drive()).encode(), "maker.eds").find(entry)
    assert found is not None, f"{entry} is not in a description with all objects"
    assert found.type is entry.type
    if entry.mappable is Mappable.RPDO:
        assert found.mappable in {Mappable.RPDO, Mappable.BOTH}
    if entry.mappable is Mappable.TPDO and name != "ERROR_REGISTER":
        assert found.mappable in {Mappable.TPDO, Mappable.BOTH}


def test_an_object_outside_the_description_has_the_place_of_the_standard():
    named = [str(ENTRIES[name]).split()[0] for name in OPTIONAL]
    assert sorted({*named, *(str(entry).split()[0] for entry in od.ERROR_HISTORY)}) == PLACES.split()
    assert [str(entry) for entry in od.ERROR_HISTORY[:2]] == ["1003:1 error 1 ago", "1003:2 error 2 ago"]


@pytest.mark.parametrize(
    ("pair", "index"),
    [(("GEAR_MOTOR_REVOLUTIONS", "GEAR_SHAFT_REVOLUTIONS"), "6091"), (("FEED", "FEED_SHAFT_REVOLUTIONS"), "6092")],
)
def test_the_two_halves_of_a_ratio_follow_each_other(pair, index):
    numerator, denominator = (ENTRIES[name] for name in pair)
    assert f"{numerator.index:04X}" == f"{denominator.index:04X}" == index
    assert (numerator.subindex, denominator.subindex) == (1, 2)


def test_no_two_objects_share_a_place():
    keys = [entry.key for name, entry in ENTRIES.items() if not name.endswith("_32")]
    assert len(set(keys)) == len(keys)
    assert [entry.subindex for entry in od.ERROR_HISTORY] == [1, 2, 3, 4]


def test_a_mapping_word_is_index_subindex_and_bits():
    assert od.CONTROLWORD.mapping == 0x6040_0010
    assert od.INTERPOLATION_SETPOINT.mapping == 0x60C1_0120
    assert od.MODE.mapping == 0x6060_0008


def test_bounds_are_those_of_the_bits():
    assert DataType.I16.bounds == (-(2**15), 2**15 - 1)
    assert DataType.U8.bounds == (0, 255)
    assert DataType.U32.bounds == (0, 2**32 - 1)
    assert (DataType.I8.bits, DataType.I32.bits, DataType.U16.bits) == (8, 32, 16)
    assert DataType.STRING.bits == 0
    assert {kind for kind in DataType if kind.is_real} == {DataType.F32, DataType.F64}


@pytest.mark.parametrize("kind", [kind for kind in DataType if kind is not DataType.STRING])
def test_a_types_name_tells_its_bits_and_its_code_packs_as_many(kind):
    assert kind.bits == int(kind.name[1:]) == 8 * struct.calcsize("<" + kind.code)
    if not kind.is_real:
        assert [struct.pack("<" + kind.code, bound)[-1] for bound in kind.bounds] == (
            [0x80, 0x7F] if kind.name[0] == "I" else [0x00, 0xFF]
        )


def test_pdos_have_the_identifiers_of_the_predefined_set():
    receive = [PdoDirection.RECEIVE.default_cob_id(number, 5) for number in range(4)]
    transmit = [PdoDirection.TRANSMIT.default_cob_id(number, 5) for number in range(4)]
    assert receive == [0x205, 0x305, 0x405, 0x505]
    assert transmit == [0x185, 0x285, 0x385, 0x485]
    assert not PdoDirection.RECEIVE.carries(Mappable.TPDO)
    assert PdoDirection.TRANSMIT.carries(Mappable.BOTH)


@pytest.mark.parametrize(
    ("direction", "parameters", "mapping"),
    [(PdoDirection.RECEIVE, 0x1402, 0x1602), (PdoDirection.TRANSMIT, 0x1802, 0x1A02)],
)
def test_parameters_of_the_third_pdo_are_at_the_standards_places_with_its_types(direction, parameters, mapping):
    """CiA 301, 7.5.2.35 to 38: as index, sub-index and bits in one number."""
    assert direction.cob_id_entry(2).mapping == parameters << 16 | 0x0120
    assert direction.type_entry(2).mapping == parameters << 16 | 0x0208
    assert direction.timer_entry(2).mapping == parameters << 16 | 0x0510
    assert direction.count_entry(2).mapping == mapping << 16 | 0x0008
    assert direction.map_entry(2, 6).mapping == mapping << 16 | 0x0620


def test_nmt_numbers_are_those_of_another_library():
    from canopen.nmt import NMT_COMMANDS, NMT_STATES

    commands = {name.replace("-", "_").replace(" ", "_"): code for name, code in NMT_COMMANDS.items()}
    ours = {
        "START": "OPERATIONAL",
        "STOP": "STOPPED",
        "RESET_NODE": "RESET",
        "RESET_COMMUNICATION": "RESET_COMMUNICATION",
    }
    for command in od.NmtCommand:
        assert command.value == commands[ours.get(command.name, command.name)]
    states = {state.value: NMT_STATES[state.value] for state in od.NmtState}
    assert states == {0: "INITIALISING", 4: "STOPPED", 5: "OPERATIONAL", 127: "PRE-OPERATIONAL"}


@pytest.mark.parametrize("device_type", [0x0002_0192, 0xFFFF_0192, 0x192])
def test_the_low_half_of_the_device_type_makes_a_drive(device_type):
    assert od.is_drive(device_type)
    assert not od.is_drive(device_type ^ 0x001)
    assert not od.is_drive(device_type ^ 0x8000)


def test_what_is_no_drive_is_named_where_its_profile_is_known():
    assert "encoders" in od.no_drive(0x0022_0196)
    assert "profile 400;" in od.no_drive(0x190)


@pytest.mark.parametrize(
    ("profile", "name"),
    [
        (0, "no standardised profile"), (401, "inputs and outputs"), (404, "controllers"), (405, "programmable"),
        (406, "encoders"), (408, "hydraulic"), (410, "inclinometers"), (418, "batteries"), (419, "battery chargers"),
    ],
)  # fmt: skip
def test_a_profile_of_the_low_16_bits_is_named(profile, name):
    """CiA 301, 7.5.2.1, whatever the upper half."""
    text = od.no_drive(0x7001_0000 | profile)
    assert f"(1000) is 0x{0x7001_0000 + profile:08X}" in text
    assert f"0x{profile:04X}, mean device profile {profile}, " in text
    assert name in text


def test_numbers_of_the_communication_profile_are_the_standards():
    """CiA 301: transmission types, bits of a PDO's COB-ID, and the predefined connection set."""
    assert (od.PDO_SYNCHRONOUS, od.PDO_SYNCHRONOUS_LAST, od.PDO_EVENT_DRIVEN) == (1, 240, 254)
    assert (od.PDO_DISABLED, od.PDO_NO_RTR) == (1 << 31, 1 << 30)
    assert (od.PDO_MAX_ENTRIES, od.PDO_COUNT) == (8, 4), "of a frame of eight bytes, and with identifiers of their own"
    assert (od.NMT_COB_ID, od.SYNC_DEFAULT_COB_ID, od.EMERGENCY_BASE) == (0x000, 0x080, 0x080)
    assert (od.SDO_TX_BASE, od.SDO_RX_BASE, od.HEARTBEAT_BASE) == (0x580, 0x600, 0x700)
    assert od.SYNC_MEANING == 0x4000_0000 | 0x7FF, "that it produces SYNC, and the identifier"
    assert (od.POLARITY_POSITION, od.POLARITY_TORQUE) == (1 << 7, 1 << 5)
    assert od.DEVICE_TYPE_SERVO & 0xFFFF == 402
    assert od.SET_BRAKE == 1


def test_modes_are_named_by_number_and_name():
    assert od.named_modes(0) == ""
    assert od.named_modes(1 << 0 | 1 << 7) == "1 (profile position), 8 (cyclic synchronous position)"
    assert od.named_modes(0b11_1010_1110) == (
        "2 (velocity), 3 (profile velocity), 4 (profile torque), 6 (homing), 8 (cyclic synchronous position), "
        "9 (cyclic synchronous velocity), 10 (cyclic synchronous torque)"
    )
    assert od.named_modes(0b100_0000) == "7 (interpolated position)"
    assert od.named_modes(1 << 16 | 1 << 31) == "17 (manufacturer-specific), 32 (manufacturer-specific)"
