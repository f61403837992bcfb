"""Device descriptions: irregularities are reported with section and key, other files are refused, no other error."""

import os
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from armload_drivers.bring_up.description_file import read_description
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.eds_parser import parse_description
from armload_drivers.cia402.object_dictionary import DataType
from armload_drivers.driver_errors import DescriptionError

LARGEST_BYTES, MOST_WARNINGS = 8_000_000, 200

pytestmark = pytest.mark.pure

GOOD = """\
; a drive as it should be
[DeviceInfo]
VendorName=Somebody
VendorNumber=0x1AB
ProductName=Servo
ProductNumber=7
RevisionNumber=0x10002

[MandatoryObjects]
SupportedObjects=1
1=0x1000

[OptionalObjects]
SupportedObjects=3
1=0x1400
2=0x6040
3=0x6502

[1000]
ParameterName=Device type
ObjectType=0x7
DataType=0x0007
AccessType=ro
DefaultValue=0x00020192
PDOMapping=0

[1400]
ParameterName=RPDO 1
ObjectType=9
SubNumber=2

[1400sub0]
ParameterName=highest
DataType=0x5
AccessType=const
DefaultValue=1

[1400sub1]
ParameterName=COB-ID
DataType=0x7
AccessType=rw
DefaultValue=$NODEID+0x200

[6040]
ParameterName=Controlword
DataType=0x6
AccessType=rww
DefaultValue=0
PDOMapping=1

[6502]
ParameterName=Modes
DataType=0x7
AccessType=ro
DefaultValue=0x3A5
"""
COB_ID = od.PdoDirection.RECEIVE.cob_id_entry(0)


def load(text):
    return parse_description(text.encode() if isinstance(text, str) else text, "servo.eds")


def test_a_clean_file_is_read_without_a_word():
    description = load(GOOD)
    assert description.warnings == ()
    assert (description.vendor_id, description.product_code, description.revision) == (0x1AB, 7, 0x10002)
    assert description.vendor_name == "Somebody"
    assert description.value(od.SUPPORTED_MODES, 5) == 0x3A5
    assert description.value(COB_ID, 5) == 0x205
    controlword = description.find(od.CONTROLWORD)
    assert controlword.bits == 16
    assert controlword.access is od.Access.RW
    assert controlword.mappable is not od.Mappable.NO
    assert description.find(od.DEVICE_TYPE).access is od.Access.RO
    assert description.find(od.STATUSWORD) is None
    assert description.value(od.STATUSWORD, 5) is None


ODD = [
    ("DefaultValue=$NODEID+0x200", "DEFAULTVALUE = $NodeId + 512", None),
    ("DefaultValue=$NODEID+0x200", "DefaultValue=0x200+$nodeid", None),
    ("DefaultValue=$NODEID+0x200", "DefaultValue=", None),
    ("DefaultValue=$NODEID+0x200", "DefaultValue=$NODEID*2", "[1400sub1] DefaultValue: '$NODEID*2' is no number"),
    ("DefaultValue=$NODEID+0x200", "DefaultValue=512$NODEID", "[1400sub1] DefaultValue"),
    ("DefaultValue=$NODEID+0x200", "DefaultValue=0x123456789", "[1400sub1] DefaultValue: 4886718345 does not fit"),
    ("SubNumber=2", "SubNumber=9", "[1400] SubNumber: declares 9, the file has 2"),
    ("SupportedObjects=3", "SupportedObjects=7", "SupportedObjects: declares 7, the list has 3"),
    ("SupportedObjects=3", "", "SupportedObjects: declares None"),
    ("2=0x6040", "2=0x6041", "2: object '6041' is listed but not described"),
    ("2=0x6040", "2=0x6041", "[6040]: described but not listed"),
    ("AccessType=rww", "AccessType=maybe", "[6040] AccessType: 'maybe'"),
    ("DataType=0x6", "DataType=", "[6040] DataType: missing or unreadable"),
    ("VendorNumber=0x1AB", "VendorNumber=$NODEID", "[DeviceInfo] VendorNumber: depends on the node id"),
    ("VendorNumber=0x1AB", "VendorNumber=-4", "[DeviceInfo] VendorNumber: -4 does not fit"),
    ("[DeviceInfo]", "[DeviceInf]", "[DeviceInfo]: missing"),
    ("[DeviceInfo]", "[DeviceInfo", "[DeviceInfo] line 2: section without a closing bracket"),
    ("PDOMapping=1", "PDOMapping=1\nPDOMapping=1", "[6040] pdomapping: repeated key"),
    ("[6502]", "no key at all\n[6502]", "[6040] line"),
    ("[6502]", "[6502]\n[6502]", "[6502] line"),
    ("; a drive", "stray=1\n; a drive", "[] line 1: not understood"),
    ("ParameterName=Modes", "ParameterName=Mod\u00e9s", None),
    ("VendorName=Somebody", "[DeviceComissioning]\nNodeID=200\n[DeviceInfo]", "[DeviceComissioning] NodeID: 200"),
    ("ObjectType=9\nSubNumber=2", "ObjectType=9\nCompactSubObj=999", "[1400] CompactSubObj: 999 is not a valid number"),
]


@pytest.mark.parametrize(("old", "new", "warning"), ODD, ids=[f"{new or 'nothing'}"[:40] for _, new, _ in ODD])
def test_what_is_odd_is_a_warning_with_section_and_key(old, new, warning):
    assert old in GOOD
    description = load(GOOD.replace(old, new, 1))
    assert od.CONTROLWORD.key in description.objects
    if warning is None:
        assert description.warnings == ()
    else:
        assert any(warning in text for text in description.warnings), description.warnings
    assert all(text.startswith("servo.eds: [") for text in description.warnings)


def test_expressions_in_any_order_and_case():
    for text in ("$NODEID+0x200", "0x200 + $NodeID", "+512+$nodeid", "0x1FF+$NODEID+1"):
        value = load(GOOD.replace("$NODEID+0x200", text)).value(COB_ID, 3)
        assert value == 0x203, text


def test_a_dcf_sets_values_and_names_its_node():
    text = GOOD.replace("DefaultValue=0x3A5", "DefaultValue=0x3A5\nParameterValue=0x40")
    text += "\n[DeviceComissioning]\nNodeID=4\n"
    description = load(text)
    assert description.node_id == 4
    assert description.value(od.SUPPORTED_MODES, 4) == 0x40


def test_limits_are_read():
    text = GOOD + "\n[6072]\nParameterName=a\nDataType=6\nAccessType=rw\nLowLimit=1\nHighLimit=0x10\n"
    found = load(text).find(od.MAX_TORQUE)
    assert (found.least.constant, found.greatest.constant) == (1, 16)
    signed = load(text.replace("DataType=6", "DataType=3").replace("LowLimit=1", "LowLimit=0x8000"))
    assert signed.find(od.MAX_TORQUE).least.constant == -(2**15)


@pytest.mark.parametrize(
    ("code", "expected"),
    [
        (0x01, DataType.U8), (0x02, DataType.I8), (0x03, DataType.I16), (0x04, DataType.I32), (0x05, DataType.U8),
        (0x06, DataType.U16), (0x07, DataType.U32), (0x08, DataType.F32), (0x09, DataType.STRING),
        (0x11, DataType.F64), (0x15, DataType.I64), (0x1B, DataType.U64), (0x0A, None), (0x10, None), (0x16, None),
    ],
)  # fmt: skip
def test_the_codes_of_data_types_are_those_of_the_standard(code, expected):
    """CiA 301, table 44: BOOLEAN 1 to VISIBLE_STRING 9, REAL64 11h, INTEGER64 15h, UNSIGNED64 1Bh."""
    description = load(GOOD + f"\n[2000]\nParameterName=a\nDataType=0x{code:X}\nAccessType=ro\n")
    assert description.objects[0x200000].type is expected


def test_a_limit_of_1016_that_allows_no_node_id_is_ignored():
    """A manufacturer's file has the limit of a 16-bit time there; the drive accepts the node id nevertheless."""
    text = GOOD + "\n[1016sub1]\nParameterName=a\nDataType=7\nAccessType=rw\nHighLimit=65535\n"
    description = load(text)
    assert description.find(od.HEARTBEAT_CONSUMER).greatest is None
    assert any("[1016sub1] HighLimit: 65535 is too large" in warning for warning in description.warnings)


def test_comments_behind_values_and_utf_16_are_read():
    noted = GOOD.replace("PDOMapping=1\n", "PDOMapping=1 ; can be mapped\n").replace(
        "AccessType=rw\n", "AccessType=rw\t; both\n"
    )
    assert noted != GOOD
    for data in (noted.encode(), GOOD.encode("utf-16")):
        assert parse_description(data, "x.eds").objects == parse_description(GOOD.encode(), "x.eds").objects


def test_a_compact_array_is_expanded():
    text = GOOD + "\n[1010]\nParameterName=Store\nCompactSubObj=3\nDataType=7\nAccessType=rw\nDefaultValue=1\n"
    description = load(text)
    assert [key for key in description.objects if key >> 8 == 0x1010] == [0x101000, 0x101001, 0x101002, 0x101003]


@pytest.mark.parametrize("kind", [8, 9], ids=["array", "record"])
def test_an_array_without_elements_has_no_value(kind):
    description = load(GOOD + f"\n[1003]\nParameterName=Errors\nObjectType={kind}\nDataType=7\nAccessType=ro\n")
    assert not any(key >> 8 == 0x1003 for key in description.objects)


def test_a_sub_index_is_hexadecimal():
    description = load(GOOD + "\n[1400sub1A]\nParameterName=a\nDataType=7\nAccessType=rw\n")
    assert 0x14001A in description.objects


@pytest.mark.parametrize(("kind", "value", "text"), [(8, "0.5", ""), (9, "Somebody's servo", "Somebody's servo")])
def test_reals_and_texts_are_no_integers(kind, value, text):
    description = load(GOOD + f"\n[2000]\nParameterName=a\nDataType={kind}\nAccessType=ro\nDefaultValue={value}\n")
    assert not any("DefaultValue" in warning for warning in description.warnings)
    assert description.objects[0x200000].value is None
    assert description.objects[0x200000].text == text


def test_bytes_that_are_no_utf8_are_reported():
    description = load(GOOD.replace("Somebody", "Schm\u00fcller").encode("latin-1"))
    assert description.vendor_name == "Schm\u00fcller"
    assert any("not UTF-8" in text and "line 3" in text for text in description.warnings)


@pytest.mark.parametrize("written", ["0", "0xFFFFFFFF", ""])
def test_an_identity_that_is_not_given_is_none(written):
    assert load(GOOD.replace("ProductNumber=7", f"ProductNumber={written}")).product_code is None


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "no section describes an object"),
        (b"hello", "no section describes an object"),
        (b"\x7fELF\x00\x00", "zero bytes"),
        (GOOD.replace("[6040]", "[6050]").encode(), "no controlword"),
        (
            GOOD.replace("0x00020192", "0x00030191").encode(),
            r"\[1000\] DefaultValue: .* 0x00030191: its low 16 bits, 0x0191, mean device profile 401, inputs",
        ),
        (
            (GOOD + "[6064sub2]\nDataType=4\nAccessType=ro\n").encode(),
            r"\[6064sub2\]: a drive with several axes as sub-indices .* cannot be used: use a drive for each axis",
        ),
        (b";" * (LARGEST_BYTES + 1), "larger than"),
    ],
    ids=["empty", "text", "binary", "no drive", "another profile", "axes as sub-indices", "huge"],
)
def test_what_is_no_description_of_a_drive_is_refused(data, words):
    with pytest.raises(DescriptionError, match=words) as raised:
        load(data)
    assert str(raised.value).startswith("servo.eds: ")


def test_a_file_that_cannot_be_read_is_refused(tmp_path):
    with pytest.raises(DescriptionError, match="cannot be read"):
        read_description(tmp_path / "missing.eds")
    huge = tmp_path / "huge.eds"
    with huge.open("wb") as file:
        file.truncate(LARGEST_BYTES + 1)
    with pytest.raises(DescriptionError, match="larger than"):
        read_description(huge)
    with huge.open("wb") as file:
        file.truncate(2**40)
    with pytest.raises(DescriptionError, match="larger than"):
        read_description(huge)  # it would not fit into memory
    pipe = tmp_path / "pipe.eds"
    os.mkfifo(pipe)
    for endless in (pipe, Path("/dev/zero"), tmp_path):
        with pytest.raises(DescriptionError, match="not a regular file; give an EDS or DCF file"):
            read_description(endless)


def test_a_flood_of_warnings_is_counted():
    description = load(GOOD + "nonsense\n" * 1000)
    assert len(description.warnings) == MOST_WARNINGS + 1
    assert "800 more" in description.warnings[-1]


def survives(data):
    try:
        description = parse_description(data, "fuzz.eds")
    except DescriptionError:
        return
    for entry in description.objects.values():
        assert entry.value is None or isinstance(entry.value.of(127), int)
    assert len(description.warnings) <= MOST_WARNINGS + 1


@given(st.binary(max_size=400))
def test_random_bytes_raise_nothing_else(data):
    survives(data)


WEIRD = st.sampled_from(["\u0663", "$NODEID", "0x", "--1", "1e3", "\uffff", "[", "]", "=", "999999999999999999999"])
NAMES = sorted({line.partition("=")[0] for line in GOOD.splitlines() if "=" in line})
LINES = (
    st.sampled_from(GOOD.splitlines())
    | st.tuples(st.sampled_from(NAMES), WEIRD).map("=".join)
    | st.text("0123456789abcdefxX[]=$;# \t\u0661\uffff", max_size=40)
    | st.text(max_size=60).map(lambda text: text.replace("\n", ""))
)


@example([(GOOD.splitlines().index("SupportedObjects=3") + 1, "1=none")], 0)
@given(st.lists(st.tuples(st.integers(0, 60), LINES | WEIRD), max_size=12), st.integers(0, len(GOOD)))
@pytest.mark.long
def test_mutated_and_truncated_files_raise_nothing_else(changes, end):
    lines = GOOD.splitlines()
    for at, line in changes:
        lines[at % len(lines)] = line
    survives("\n".join(lines)[: end or None].encode("utf-8", errors="replace"))


KEYS = st.sampled_from(["DefaultValue", "DataType", "SubNumber", "CompactSubObj", "ObjectType", "PDOMapping", "NodeID"])
VALUES = st.text("0123456789abcdefxX$NODEID+-* \u0661", max_size=45)


@settings(max_examples=200)
@given(st.dictionaries(KEYS, VALUES), st.sampled_from(["6040", "1400", "6040sub0", "1400subFF", "DeviceComissioning"]))
def test_hostile_values_raise_nothing_else(values, section):
    text = GOOD + f"\n[{section}]\n" + "".join(f"{key}={value}\n" for key, value in values.items())
    survives(text.encode())


@settings(max_examples=30, deadline=None)
@given(data=st.data())
def test_vendors_files_cut_and_damaged_raise_nothing_else(vendors_files, data):
    content = bytearray(data.draw(st.sampled_from(vendors_files)).read_bytes())
    for at in data.draw(st.lists(st.integers(0, len(content) - 1), max_size=20)):
        content[at] = data.draw(st.integers(0, 255))
    survives(bytes(content[: data.draw(st.integers(0, len(content)))]))


@pytest.fixture(scope="module")
def vendors_files():
    folder = Path(__file__).resolve().parents[5] / "shared" / "data" / "eds"
    if not folder.is_dir():
        pytest.skip("the vendors' descriptions are not beside this checkout")
    return sorted(path for path in folder.iterdir() if path.suffix in {".eds", ".dcf"})


def test_every_vendors_file_is_read(vendors_files):
    assert len(vendors_files) == 6
    descriptions = {path.name: read_description(path) for path in vendors_files}
    modes = {name: d.value(od.SUPPORTED_MODES, 3) for name, d in descriptions.items()}
    assert modes == {
        "elmo_cob4.dcf": None,
        "elmo_simpliq.dcf": 0x6D,
        "maxon_epos4_50_15.dcf": 0x3A5,
        "pilz_prbt_0_1.dcf": 0x43,
        "roboteq_v80.eds": 0x38F,
        "ros2_fake_cia402_slave.eds": 0xA5,
    }
    for name, description in descriptions.items():
        assert od.PdoDirection.RECEIVE.carries(description.find(od.CONTROLWORD).mappable), name
        assert description.find(od.POSITION_ACTUAL).bits == 32, name
        assert all(text.startswith(f"{name}: [") for text in description.warnings)
    # The EPOS4's COB-IDs are those of node 1 for any node id; Pilz's and Roboteq's depend on it.
    cob_ids = {name: d.value(COB_ID, 3) & 0x7FF for name, d in descriptions.items()}
    assert cob_ids["maxon_epos4_50_15.dcf"] == 0x201
    assert cob_ids["pilz_prbt_0_1.dcf"] == 0x203


@pytest.mark.parametrize(
    ("objects", "modes"),
    [
        ("", 0),
        ("607A", 0),  # profile position has it too
        ("60B2", 0),
        ("607A 60C2sub1", 1 << 7),
        ("607A 60B2", 1 << 7),
        ("60C1sub1", 1 << 6),
        ("607A 60B2 60C1sub1", 1 << 7 | 1 << 6),
        ("607A 60B2 6502=1", 1),
        ("607A 60B2 6502=0", 1 << 7),
    ],
)
def test_a_drive_has_the_modes_that_it_states_or_else_has_all_objects_for(objects, modes):
    types = {"6040": 6, "607A": 4, "60B2": 3, "60C1sub1": 4, "60C2sub1": 5, "6502": 7}
    sections = (each.partition("=") for each in f"6040 {objects}".split())
    lines = [f"[{key}]\nDataType={types[key]}\nDefaultValue={value}\n" for key, _, value in sections]
    described = f"[DeviceInfo]\nVendorNumber=1\n{''.join(lines)}"
    assert parse_description(described.encode(), "drive.eds").modes == modes
