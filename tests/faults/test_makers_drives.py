"""The arm with every device description: how each safety property is achieved, the consents needed, or the refusal.

In lockstep, and on vcan0. Every consent that a row names is needed: without it the drive is refused for that property
and no other.
"""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from armload_drivers.bring_up.description_file import read_description
from armload_drivers.cia402.arm_settings import EffortFeedback as Effort
from armload_drivers.cia402.arm_settings import Fieldbus, FixedPdo, Identity, OperationMode, VendorObject, VendorSetting
from armload_drivers.cia402.drive_safety import SAFETY_KEYS
from armload_drivers.cia402.eds_parser import parse_description
from armload_drivers.cia402.object_dictionary import DataType, Entry, PdoDirection
from armload_drivers.driver_errors import DescriptionError, MissingSafety, ServoError, WrongDevice
from armload_drivers.servos import JointCommand
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from tests.drive_descriptions import eds, maker_drive

NODES = (2, 3, 5)
IP, CSP = OperationMode.INTERPOLATED_POSITION, OperationMode.CYCLIC_SYNCHRONOUS_POSITION
CONSENT = "torque_limit_in_drive"
"""The consent that is not in `accept_missing`."""


def ways(**others):
    """Number of the way that provides each property: 1 unless given, 0 for none."""
    assert set(others) <= set(SAFETY_KEYS)
    return dict.fromkeys(SAFETY_KEYS, 1) | others


@dataclass(frozen=True)
class Row:
    """One description and the expected result.

    Attributes:
        maker: Name of a file next to the checkout, or a description written here.
        settings: The robot file's settings of the drives.
        expected: Number of the way to each property; None if the drive is refused.
        consents: Properties whose absence must be accepted.
        error: Type of the refusal.
        reason: Pattern of its message.
    """

    maker: object
    settings: dict = field(default_factory=dict)
    expected: dict | None = None
    consents: tuple = ()
    error: type = ServoError
    reason: str = ""


def own(settings=None, *, without=(), changes=None, **row):
    """A row with a description written here."""
    return Row(eds(maker_drive(without, changes)), settings or {}, **row)


def ro(value):
    """A read-only object."""
    return {"AccessType": "ro", "DefaultValue": str(value)}


def fixed_mapping(rpdo, tpdo):
    """The first RPDO and TPDO with read-only mapping."""
    changes = {}
    for index, words in (("1600", rpdo), ("1A00", tpdo)):
        changes[f"{index}sub0"] = ro(len(words))
        for position in range(1, 9):
            changes[f"{index}sub{position}"] = ro(f"0x{words[position - 1]:08X}" if position <= len(words) else 0)
    return changes


def cob_ids(access, node):
    """PDOs with the COB-IDs of one node, independent of the drive's node id."""
    bases = {"1400": 0x200, "1401": 0x300, "1800": 0x180, "1801": 0x280}
    return {f"{i}sub1": {"AccessType": access, "DefaultValue": node.format(base=base)} for i, base in bases.items()}


def fifth_rpdo(cob_id):
    """Three more RPDOs, the last one on an identifier."""
    sections = {}
    for index, word in (("1402", "0x80000402"), ("1403", "0x80000502"), ("1404", cob_id)):
        keys = {"ObjectType": "7", "DataType": "7", "AccessType": "rw", "DefaultValue": word, "PDOMapping": "0"}
        kind = {"DataType": "5", "DefaultValue": "1"}
        mapped = f"16{index[2:]}"
        sections |= {f"{index}sub1": keys, f"{index}sub2": keys | kind, f"{mapped}sub0": keys | kind}
        sections |= {f"{mapped}sub1": keys | {"DefaultValue": "0x607A0020"}}
    return sections


NO_REACTIONS = ("master_lost", "setpoints_lost", "quick_stop", "fault_reaction")
MAXON = {
    "vendor_effort": VendorObject(0x30D1, 2, DataType.I32, 1e-3),
    "rated_torque_unit_nm": 1e-6,
    "vendor_settings": (VendorSetting(Entry(0x3001, 2, "vendor's setting", DataType.U32), 5000, "torque_limit"),),
}
REAL = {
    "pilz": Row(
        "pilz_prbt_0_1.dcf",
        {"mode": IP, "feedback": Effort.TORQUE},
        ways(torque_limit=2, disable_reaction=2, **dict.fromkeys(NO_REACTIONS, 0)),
        NO_REACTIONS,
    ),
    "pilz in CSP": Row(
        "pilz_prbt_0_1.dcf",
        {"feedback": Effort.TORQUE},
        error=WrongDevice,
        reason=r'mode 8 .* not offered, only 1 .*, 2 .*, 7 .*Set mode = "ip"',
    ),
    "maxon": Row("maxon_epos4_50_15.dcf", MAXON, ways(torque_limit=3, setpoints_lost=0), ("setpoints_lost",)),
    "maxon, its limit set in the drive": Row(
        "maxon_epos4_50_15.dcf",
        MAXON | {"vendor_settings": ()},
        ways(torque_limit=4, setpoints_lost=0),
        ("setpoints_lost", CONSENT),
    ),
    "maxon with 6078": Row(
        "maxon_epos4_50_15.dcf", error=WrongDevice, reason=r"no 6078:0 .* set feedback = \"torque\""
    ),
    "elmo gold": Row("elmo_cob4.dcf", {}, ways(setpoints_lost=2)),
    "elmo simpliq": Row("elmo_simpliq.dcf", {"mode": IP, "torque_offset": False}, ways(setpoints_lost=2)),
    "elmo simpliq with 60B2": Row(
        "elmo_simpliq.dcf", {"mode": IP}, error=WrongDevice, reason=r"no 60B2:0 .*\. Set torque_offset = false"
    ),
    "roboteq": Row(
        "roboteq_v80.eds",
        {"feedback": Effort.TORQUE, "pdo_objects_max": 2, "second_axis_unused": True},
        ways(torque_limit=4, disable_reaction=2, **dict.fromkeys(NO_REACTIONS, 0)),
        (*NO_REACTIONS, CONSENT),
    ),
    "roboteq with three objects in a PDO": Row(
        "roboteq_v80.eds",
        {"feedback": Effort.TORQUE, "second_axis_unused": True},
        reason="carries at most 2 objects, 3 are required. Set pdo_objects_max = 2",
    ),
    "ros2's fake": Row(
        "ros2_fake_cia402_slave.eds",
        {"torque_offset": False},
        error=WrongDevice,
        reason=r"no 6078:0 .* must report current \(6078\) or torque \(6077\).* effort_object",
    ),
    "roboteq with a second axis": Row(
        "roboteq_v80.eds",
        {"feedback": Effort.TORQUE, "pdo_objects_max": 2},
        error=WrongDevice,
        reason="several axes with one node id: it has 6840:0 .*second_axis_unused = true",
    ),
}

VENDORS_CURRENT = {
    "2100sub0": {"DataType": "5", "AccessType": "ro", "DefaultValue": "1", "PDOMapping": "0", "ParameterName": "n"},
    "2100sub1": {"DataType": "3", "AccessType": "ro", "DefaultValue": "0", "PDOMapping": "1", "ParameterName": "mA"},
}
VENDORS_REACTION = {
    "2200": {"DataType": "5", "AccessType": "rw", "DefaultValue": "0", "PDOMapping": "0", "ParameterName": "reaction"}
}
REACTS = VendorSetting(Entry(0x2200, 0, "vendor's setting", DataType.U8), 2, "master_lost")
WANTED = {"605A": ro(6), "605B": ro(1), "605C": ro(1), "605E": ro(2), "6007": ro(3)}
AFTER_RESET = {"605A": ro(2), "605B": ro(0), "605C": ro(1), "605E": ro(1), "6007": ro(1)}
NO_TIMER = ("1400sub5", "1401sub5")
RPDO, TPDO = (0x6040_0010, 0x607A_0020, 0x60B2_0010), (0x6041_0010, 0x6064_0020, 0x6078_0010)
OTHERS = (
    FixedPdo(PdoDirection.RECEIVE, 0, (0x607A_0020, 0x60B2_0010, 0x6040_0010)),
    FixedPdo(PdoDirection.TRANSMIT, 0, (0x6064_0020, 0x6078_0010, 0x6041_0010)),
)

WRITTEN = {
    "complete": own(expected=ways()),
    "6073 instead of 6072": own(without=[0x6072], expected=ways(torque_limit=2)),
    "6072 that is too small": own(
        changes={"6072": {"HighLimit": "1000", "LowLimit": "0"}}, expected=ways(torque_limit=2)
    ),
    "6073 of an unknown current": own(
        without=[0x6072, 0x6075], error=MissingSafety, reason="no 6072; 6075 reports no rated current"
    ),
    "no limit of torque": own(without=[0x6072, 0x6073], expected=ways(torque_limit=4), consents=(CONSENT,)),
    "no 6007": own(without=[0x6007], expected=ways(master_lost=2)),
    "no 6007, no 1029": own(without=[0x6007, 0x1029], expected=ways(master_lost=0), consents=("master_lost",)),
    "no 1016": own(without=[0x1016], expected=ways(master_lost=0), consents=("master_lost",)),
    "1016 that takes no node id": own(
        changes={"1016sub1": {"LowLimit": "0", "HighLimit": "0x10000"}},
        expected=ways(master_lost=0),
        consents=("master_lost",),
    ),
    "a maker's reaction to a lost master": own(
        {"vendor_settings": (REACTS,)},
        without=[0x6007, 0x1029],
        changes=VENDORS_REACTION,
        expected=ways(master_lost=3),
    ),
    "no event timer": own(without=NO_TIMER, expected=ways(setpoints_lost=2)),
    "no event timer, no 1006": own(
        without=[*NO_TIMER, 0x1006], expected=ways(setpoints_lost=0), consents=("setpoints_lost",)
    ),
    "option codes read-only, as wanted": own(changes=WANTED, expected=ways()),
    "option codes read-only, as after a reset": own(
        changes=AFTER_RESET, expected=ways(quick_stop=2, disable_reaction=2, fault_reaction=2, master_lost=2)
    ),
    "option codes read-only, without a ramp": own(
        changes={"605A": ro(0), "605E": ro(0)},
        expected=ways(quick_stop=0, fault_reaction=0),
        consents=("quick_stop", "fault_reaction"),
    ),
    "605A read-only, without a brake": own(
        {"has_brake": False}, changes={"605A": ro(2)}, error=MissingSafety, reason="the axis has no brake"
    ),
    "no 6065": own(without=[0x6065, 0x6066], expected=ways(following_error=0), consents=("following_error",)),
    "no 6066": own(without=[0x6066], expected=ways()),
    "no 607D": own(without=[0x607D], expected=ways(position_limits=0), consents=("position_limits",)),
    "no 1017": own(without=[0x1017], expected=ways(drive_lost=0), consents=("drive_lost",)),
    "60B2 absent": own({"torque_offset": False}, without=[0x60B2], expected=ways()),
    "60B2 absent and wanted": own(without=[0x60B2], error=WrongDevice, reason="Set torque_offset = false"),
    "60B2 of 32 bits": own({"torque_offset_bits": 32}, changes={"60B2": {"DataType": "4"}}, expected=ways()),
    "60B2 of 32 bits, 16 expected": own(
        changes={"60B2": {"DataType": "4"}},
        error=WrongDevice,
        reason="32 bits instead of 16. Set torque_offset_bits = 32",
    ),
    "60B2 not mappable": own(
        changes={"60B2": {"PDOMapping": "0"}}, reason=r"does not allow 60B2:0 .*0x06040041.* torque_offset = false"
    ),
    "6077 not mappable, 6078 is": own(
        {"feedback": Effort.TORQUE},
        changes={"6077": {"PDOMapping": "0"}},
        reason='does not allow 6077:0 .*It has 6078:0 .*feedback = "current"',
    ),
    "neither 6077 nor 6078 mappable": own(
        changes={"6077": {"PDOMapping": "0"}, "6078": {"PDOMapping": "0"}},
        reason=r"does not allow 6078:0 .*must report current \(6078\) or torque \(6077\).*effort_object",
    ),
    "nothing mappable by the file": own(
        changes={name: {"PDOMapping": "0"} for name in maker_drive() if name >= "6"}, expected=ways()
    ),
    "6078 of 32 bits": own({"effort_bits": 32}, changes={"6078": {"DataType": "4"}}, expected=ways()),
    "6078 of 32 bits, 16 expected": own(
        changes={"6078": {"DataType": "4"}}, error=WrongDevice, reason="32 bits instead of 16. Set effort_bits = 32"
    ),
    "objects of another size than the standard's": own(
        changes={
            "6065": {"DataType": "4"},
            "6066": {"DataType": "7"},
            "6072": {"DataType": "7"},
            "605A": {"DataType": "4"},
        },
        expected=ways(),
    ),
    "targets that cannot be read": own(
        changes={name: {"AccessType": "wo"} for name in ("6040", "607A", "60B2")}, expected=ways()
    ),
    "PP and PV only": own(
        changes={"6502": {"DefaultValue": "0x5"}},
        error=WrongDevice,
        reason=r"only 1 \(profile position\), 3 \(profile velocity\) \(6502\).*607A.* or 7 .*60C1.*another drive",
    ),
    "no value of 6502": own(changes={"6502": {"DefaultValue": "0"}}, expected=ways()),
    "no value of 6502, no object of a cyclic mode": own(
        {"torque_offset": False},
        without=[0x60B2, 0x60C1, 0x60C2],
        changes={"6502": {"DefaultValue": ""}},
        error=WrongDevice,
        reason=r"6060 refuses mode 8 .*with 0x06090030\. .*another drive",
    ),
    "6060 that takes another mode": own(
        changes={"6060": {"LowLimit": "0", "HighLimit": "7"}}, error=WrongDevice, reason='6060 refuses.* mode = "ip"'
    ),
    "no 6061": own(without=[0x6061], expected=ways()),
    "a second axis": own(
        changes={"6840": {"DataType": "6", "AccessType": "rww", "DefaultValue": "0", "PDOMapping": "1"}},
        error=WrongDevice,
        reason="several axes with one node id.*second_axis_unused = true",
    ),
    "two objects in a PDO": own(
        changes={f"{index}sub0": {"HighLimit": "2", "LowLimit": "0"} for index in ("1600", "1A00")},
        reason="carries at most 2 objects, 3 are required. Set pdo_objects_max = 2",
    ),
    "60C2 of a fixed exponent": own(changes={"60C2sub2": ro(-4)}, expected=ways()),
    "60C2 without an exponent": own(without=["60C2sub2"], expected=ways()),
    "60C2 that is 0": own(changes={"60C2sub1": ro(0)}, expected=ways()),
    "a period that no bus carries": own(
        changes={"60C2sub1": ro(10), "60C2sub2": ro(-4)},
        reason=r"interpolates over 0.001 s .*the drive accepts no such cycle.*on a second bus",
    ),
    "SYNC with bits that mean nothing": own(
        changes={"1005": {"DefaultValue": "0x80000080", "AccessType": "ro"}}, expected=ways()
    ),
    "1016 that cannot be 0 and no 6007": own(
        without=[0x6007, 0x1029],
        changes={"1016sub1": {"LowLimit": "1", "HighLimit": "0xFFFF"}},
        error=MissingSafety,
        reason="master_lost",
    ),
    "only 6077": own({"feedback": Effort.TORQUE}, without=[0x6078], expected=ways()),
    "only 6077, 6078 expected": own(without=[0x6078], error=WrongDevice, reason='set feedback = "torque"'),
    "only a maker's current": own(
        {"vendor_effort": VendorObject(0x2100, 1, DataType.I16, 1e-3)},
        without=[0x6077, 0x6078],
        changes=VENDORS_CURRENT,
        expected=ways(),
    ),
    "only a maker's current, 6078 expected": own(
        without=[0x6077, 0x6078], changes=VENDORS_CURRENT, error=WrongDevice, reason="effort_object"
    ),
    "a maker's current that it does not have": own(
        {"vendor_effort": VendorObject(0x2100, 2, DataType.I16, 1e-3)},
        changes=VENDORS_CURRENT,
        error=WrongDevice,
        reason=r'no 2100:2 .*Correct effort_object\. Or leave it out\. It has 6077:0 .*feedback = "torque"',
    ),
    "a maker's current of another size": own(
        {"vendor_effort": VendorObject(0x2100, 1, DataType.I32, 1e-3)},
        without=[0x6077, 0x6078],
        changes=VENDORS_CURRENT,
        error=WrongDevice,
        reason='16 bits instead of 32.*Correct the type in effort_object: "i16"',
    ),
    "a maker's current that cannot be mapped": own(
        {"vendor_effort": VendorObject(0x2100, 1, DataType.I16, 1e-3)},
        without=[0x6077, 0x6078],
        changes=VENDORS_CURRENT | {"2100sub1": VENDORS_CURRENT["2100sub1"] | {"PDOMapping": "0"}},
        reason=r"does not allow 2100:1 .*Correct effort_object\. A drive must report current",
    ),
    "IP only": own({"mode": IP}, without=[0x607A], changes={"6502": {"DefaultValue": "0x40"}}, expected=ways()),
    "IP only, CSP expected": own(
        changes={"6502": {"DefaultValue": "0x40"}}, error=WrongDevice, reason="mode 8 .* is not offered, only 7"
    ),
    "CSP without its target": own(
        without=[0x607A], error=WrongDevice, reason=r'no 607A:0 .*, which mode 8 .* requires\. Set mode = "ip"'
    ),
    "CSP only": own(without=[0x60C1], changes={"6502": {"DefaultValue": "0x80"}}, expected=ways()),
    "CSP only, IP expected": own(
        {"mode": IP}, changes={"6502": {"DefaultValue": "0x80"}}, error=WrongDevice, reason="mode 7 .* is not offered"
    ),
    "IP with a record of the maker's": own(
        without=[0x60C1],
        changes={"6502": {"DefaultValue": "0x41"}, "60C1": {"DataType": "9", "AccessType": "wo", "ObjectType": "7"}},
        error=WrongDevice,
        reason=r"mode 8 .* not offered, only 1 .*, 7 .*Of mode 7 .* the drive lacks 60C1:1",
    ),
    "mapping entries that the file leaves out": own(
        without=[f"{index}sub{n}" for index in ("1600", "1A00") for n in range(2, 9)],
        changes={f"{index}sub0": {"LowLimit": "0", "HighLimit": "64"} for index in ("1600", "1A00")},
        expected=ways(),
    ),
    "mapping entries that there are not": own(
        without=[f"{index}sub{n}" for index in ("1600", "1A00") for n in range(2, 9)],
        reason="a PDO of this drive carries at most 1 objects",
    ),
    "a fifth RPDO on the identifier of SDO": own(changes=fifth_rpdo("$NODEID+0x600"), expected=ways()),
    "mapping fixed as needed": own(changes=fixed_mapping(RPDO, TPDO), expected=ways()),
    "mapping fixed otherwise": own(
        changes=fixed_mapping(RPDO[:2], TPDO),
        reason=r"the mapping is fixed to 6040:0, 607A:0; required are 6040:0, 607A:0, 60B2:0\. "
        r"Set fixed_pdos = \{ rpdo1 = \[0x60400010, 0x607A0020\], tpdo1 = \[.*\] \}, torque_offset = false",
    ),
    "setpoints fixed, feedback free": own(
        changes={name: keys for name, keys in fixed_mapping(RPDO[:2], TPDO).items() if name.startswith("1600")},
        reason=r"Set fixed_pdos = \{ rpdo1 = \[0x60400010, 0x607A0020\] \}, torque_offset = false",
    ),
    "a torque offset that is read-only": own(
        changes={"60B2": ro(0)}, reason=r"does not allow 60B2:0 .*torque_offset = f"
    ),
    "a torque offset of 8 bits": own(
        changes={"60B2": {"DataType": "2"}}, error=WrongDevice, reason="8 bits instead of 16. Set torque_offset = false"
    ),
    "an effort of 64 bits": own(
        changes={"6078": {"DataType": "0x15"}}, error=WrongDevice, reason='64 bits instead of 16. It has 6077.*"torque"'
    ),
    "an effort of 32 bits and one TPDO": own(
        without=[0x1801, 0x1A01, 0x6077],
        changes={"6078": {"DataType": "4"}},
        error=WrongDevice,
        reason="no second transmit PDO, which 32 bits require. A drive must report current",
    ),
    "a torque offset of 32 bits and one RPDO": own(
        without=[0x1401, 0x1601],
        changes={"60B2": {"DataType": "4"}},
        error=WrongDevice,
        reason="no second receive PDO, which 32 bits require. Set torque_offset = false",
    ),
    "two objects in a PDO, and one RPDO": own(
        without=[0x1401, 0x1601],
        changes={f"{index}sub0": {"HighLimit": "2", "LowLimit": "0"} for index in ("1600", "1A00")},
        reason="Set pdo_objects_max = 2, and torque_offset = false, since there is no second RPDO",
    ),
    "two objects in a PDO, and one TPDO": own(
        without=[0x1801, 0x1A01],
        changes={f"{index}sub0": {"HighLimit": "2", "LowLimit": "0"} for index in ("1600", "1A00")},
        reason="no second TPDO .1801. for the effort: use firmware",
    ),
    "no RPDO for the torque offset": own(
        {"pdo_objects_max": 2}, without=[0x1401, 0x1601], reason="no 1401:1 .*2 are required. Set torque_offset = false"
    ),
    "RPDOs of one object": own(
        {"torque_offset": False},
        changes={"1600sub0": {"HighLimit": "1", "LowLimit": "0"}},
        reason="at most 1 objects, 2 are required. A drive must carry 2",
    ),
    "no statusword": own(without=[0x6041], reason="The drive has no 6041:0: use firmware that has it"),
    "no 6060": own(without=[0x6060], error=WrongDevice, reason="no 6060:0 .*mode 8 .*, but 0. Set this mode with"),
    "mapping fixed in another order": own(
        {"fixed_pdos": OTHERS},
        changes=fixed_mapping(OTHERS[0].mapping, OTHERS[1].mapping),
        expected=ways(),
    ),
    "mapping fixed without the effort": own(
        changes=fixed_mapping(RPDO, TPDO[:2]),
        reason=r"the mapping is fixed to .*can be used only if one PDO carries 6040",
    ),
    "mapping fixed with torque alone": own(
        changes=fixed_mapping(RPDO, (*TPDO[:2], 0x60770010)), reason=r'Set fixed_pdos = \{ .* \}, feedback = "torque"'
    ),
    "mapping fixed with torque of another size alone": own(
        changes=fixed_mapping(RPDO, (*TPDO[:2], 0x60770010)) | {"6077": {"DataType": "4"}},
        reason=r"the mapping is fixed to .*can be used only if one PDO carries 6040",
    ),
    "COB-IDs of node 1": own(changes=cob_ids("rw", "0x{base:X}+1"), expected=ways()),
    "COB-IDs fixed to node 1": own(
        changes=cob_ids("ro", "0x{base:X}+1"), reason=r"is 0x00000201, which is not this node's 0x00000202, and cannot"
    ),
    "COB-IDs fixed to the node": own(changes=cob_ids("ro", "$NODEID+0x{base:X}"), expected=ways()),
    "a transmission type that cannot be written": own(
        changes={"1800sub2": ro(255)}, reason="is 255 and cannot be written"
    ),
    "a PDO that cannot be switched off": own(
        changes={"1801sub1": ro("$NODEID+0x280"), "1A01sub0": ro(1), "1A01sub1": ro("0x60410010")},
        reason="is 0x00000282 and cannot be written, and its mapping is fixed",
    ),
    "a second RPDO that cannot be switched off": own(
        changes={"1401sub1": ro("$NODEID+0x300"), "1601sub0": ro(1), "1601sub1": ro("0x60400010")}, expected=ways()
    ),
    "an interpolation time that cannot be written": own(
        changes={"60C2sub1": ro(8), "60C2sub2": ro(-3)},
        reason=r"interpolates over 0.008 s .* Set cycle_hz = 125",
    ),
    "a device type with more bits": own(changes={"1000": {"DefaultValue": "0x00220192"}}, expected=ways()),
}

ROWS = {f"real: {name}": row for name, row in REAL.items()} | WRITTEN


@pytest.fixture
def drives_of(fault_arm, arm_settings, request):
    """Makes an arm with drives of a row's description, configured by a robot file with some consents."""

    def make(row, consents):
        if row.maker.endswith((".eds", ".dcf")):
            described = read_description(request.getfixturevalue("shared_data") / "eds" / row.maker)
        else:
            described = parse_description(row.maker.encode(), "written.eds")
        vcan = request.node.callspec.params["fault_arm"] == "vcan"
        settings = {"identity": Identity(None, None), "accept_missing": frozenset(consents) - {CONSENT}} | row.settings
        arm = arm_settings(cycle_s=0.02 if vcan else 0.01, torque_limit_in_drive=CONSENT in consents, **settings)
        # A virtual machine on a busy host pauses at times; that is not tested here.
        patient = replace(arm, max_missing_cycles=25 if vcan else arm.max_missing_cycles)
        return fault_arm(patient, traits=dict.fromkeys(NODES, DriveTraits(description=described)))

    return make


def numbers(setup):
    """Number of the way found for each property; 0 for none."""
    return {f.of.key: 0 if f.way is None else 1 + f.of.ways_on(Fieldbus.CANOPEN).index(f.way) for f in setup.safety}


@pytest.mark.parametrize("name", [name for name, row in ROWS.items() if row.expected is not None])
def test_a_drive_that_is_used(drives_of, name):
    """From power-on through motion to rest without torque."""
    row = ROWS[name]
    arm = drives_of(row, row.consents)
    arm.enable()
    assert [numbers(setup) for setup in arm.servos.setups] == [row.expected] * len(NODES)
    assert {key for key, number in row.expected.items() if not number} == set(row.consents) - {CONSENT}
    start_rad = arm.start_rad
    feedback = arm.move(15)
    assert (feedback.position_rad > start_rad).all()
    arm.comes_to_rest()


NEEDED = [(name, consent) for name, row in ROWS.items() for consent in row.consents]


@pytest.mark.parametrize(("name", "consent"), NEEDED, ids=[f"{name}-{consent}" for name, consent in NEEDED])
def test_every_consent_is_needed(drives_of, name, consent):
    row = ROWS[name]
    arm = drives_of(row, set(row.consents) - {consent})
    with pytest.raises(MissingSafety) as raised:
        arm.servos.connect()
    wanting = "torque_limit" if consent == CONSENT else consent
    assert f"required safety properties: {wanting}: " in str(raised.value)
    kept = sorted({*row.consents, wanting} - {CONSENT})
    assert str(raised.value).endswith("accept_missing = [" + ", ".join(f'"{key}"' for key in kept) + "]")
    arm.has_no_torque()


@pytest.mark.parametrize("name", [name for name, row in ROWS.items() if row.expected is None])
def test_a_drive_that_is_refused(drives_of, name):
    row = ROWS[name]
    arm = drives_of(row, row.consents)
    with pytest.raises(row.error, match=row.reason):
        arm.servos.connect()
    arm.has_no_torque()


def test_a_rated_current_that_is_not_the_configured_one_limits_nothing(fault_arm, arm_settings):
    """6073 is relative to 6075: with another rated current the limit would be wrong."""
    settings = arm_settings(feedback=Effort.TORQUE, rated_current_a=20.0)
    drives = parse_description(eds(maker_drive([0x6072])).encode(), "written.eds")
    traits = dict.fromkeys(NODES, DriveTraits(description=drives))
    arm = fault_arm(arm_settings(feedback=Effort.TORQUE), traits=traits, drives_arm=settings)
    with pytest.raises(MissingSafety, match="6075 reports 20 A, the configuration 10 A"):
        arm.servos.connect()


def test_the_watch_over_the_master_is_verified_and_begins_with_the_cycle(fault_arm):
    arm = fault_arm()
    arm.servos.connect()
    watch = [drive.dictionary.values[0x1016 << 8 | 1] for drive in arm.drives._drives.values()]
    assert watch == [0, 0, 0]


def test_reactions_that_a_drive_has_otherwise_after_a_reset_are_set(drives_of):
    """The standard's defaults equal the wanted values, so a drive with them would hide a missing setting."""
    others = {"1029sub1": "1", "605B": "0", "605C": "0", "605D": "2", "6066": "50"}
    changes = {section: {"DefaultValue": value} for section, value in others.items()}
    arm = drives_of(own(changes=changes, expected=ways()), ())
    arm.servos.connect()
    for drive in arm.drives._drives.values():
        keys = (0x1029 << 8 | 1, 0x605B << 8, 0x605C << 8, 0x605D << 8, 0x6066 << 8)
        assert [drive.dictionary.values[key] for key in keys] == [0, 1, 1, 1, 20]


def test_a_device_type_is_reported_as_a_whole(drives_of):
    arm = drives_of(ROWS["a device type with more bits"], ())
    arm.servos.connect()
    assert [setup.device_type for setup in arm.servos.setups] == [0x0022_0192] * 3


def test_a_device_type_that_is_no_drives_is_refused(fault_arm):
    """The low 16 bits decide. The number is one that a real servo reports; it belongs to no standard profile."""
    said = r"device type \(1000\) is 0x00220811: its low 16 bits, 0x0811, mean device profile 2065; a CiA 402 drive has"
    with pytest.raises(DescriptionError, match=said + ".*drives scan.*correct the file"):
        parse_description(eds(maker_drive(changes={"1000": {"DefaultValue": "0x00220811"}})).encode(), "written.eds")
    arm = fault_arm(traits={3: DriveTraits(device_type=0x0022_0811)})
    with pytest.raises(WrongDevice, match=said + ".*drives scan.*ask its manufacturer"):
        arm.servos.connect()


def test_a_torque_offset_of_32_bits_reaches_the_axis(drives_of):
    row = ROWS["60B2 of 32 bits"]
    arm = drives_of(row, ())
    arm.servos.connect()
    arm.heard()
    start_rad, offset_nm = arm.servos.enable().position_rad, np.array([0.0, 20.0, 0.0])
    for _ in range(3):
        arm.servos.exchange(JointCommand(start_rad, np.zeros(3), offset_nm))
    assert arm.arm.coupling.T @ offset_nm == pytest.approx(arm.plant.torque_offset_nm, abs=0.2)
    assert {m.arbitration_id for m in arm.heard()} >= {0x300 + node for node in NODES}
    arm.comes_to_rest()
    assert arm.plant.torque_offset_nm == pytest.approx(np.zeros(3)), "a stop takes it to zero"


def test_a_second_master_that_sends_torque_offsets_is_noticed(drives_of):
    arm = drives_of(ROWS["60B2 of 32 bits"], ())
    arm.enable()
    arm.send(0x303, b"\0\0\0\0")
    assert "torque offsets" in str(arm.failure(Exception, 5))


def test_drives_of_two_makers_on_one_arm(fault_arm, arm_settings):
    """One description per node, and settings per joint."""
    plain, without = (ROWS[name].maker for name in ("complete", "no 6007"))
    traits = {
        node: DriveTraits(description=parse_description(text.encode(), "written.eds"))
        for node, text in zip(NODES, (plain, without, plain), strict=True)
    }
    settings = arm_settings(identity=Identity(None, None))
    arm = fault_arm(replace(settings, cycle_s=0.02), traits=traits)
    arm.enable()
    assert [numbers(setup)["master_lost"] for setup in arm.servos.setups] == [1, 2, 1]
    arm.move()
    arm.comes_to_rest()
