"""Strict TOML: an error in a file is one sentence with file, key, value and the nearest key."""

from typing import Annotated, Literal

import numpy as np
import pytest
from msgspec import Meta, field

from armload_identification.identification_errors import FileError
from armload_identification.storage.strict_toml import (
    BadValue,
    NumberList,
    NumberRows,
    SymmetricRows,
    Table,
    Text,
    parse_toml,
    read_text,
    read_toml,
    require_array_shapes,
    require_shape,
    validated,
    write_text,
)


class Drive(Table):
    node_id: Annotated[int, Meta(ge=1, le=127)]
    rated_current_a: float


class Joint(Table):
    name: Text
    velocity_max_rad_s: float
    jerk_max_rad_s3: float = 1.0
    drive: Drive | None = None

    def __post_init__(self):
        if self.velocity_max_rad_s > 100.0:
            raise BadValue("velocity_max_rad_s", self.velocity_max_rad_s, "expected rad/s, not degrees")


class Arm(Table):
    content = "an arm"

    joints: list[Joint]
    tools: dict[str, Drive] = field(default_factory=dict)
    offset: NumberList | None = None
    rows: NumberRows | None = None


GOOD = """
[[joints]]
name = "a"
velocity_max_rad_s = 2.0
[[joints]]
name = "b"
velocity_max_rad_s = 3
[joints.drive]
node_id = 2
rated_current_a = 1.0
"""


def refused(content: str) -> FileError:
    with pytest.raises(FileError) as caught:
        parse_toml(content, "arm.toml", Arm, FileError)
    return caught.value


def test_what_is_right_is_read():
    arm = parse_toml(GOOD + "[tools.saw]\nnode_id = 3\nrated_current_a = 2.0\n", "arm.toml", Arm, FileError)
    assert [joint.velocity_max_rad_s for joint in arm.joints] == [2.0, 3.0]
    assert arm.tools["saw"].node_id == 3


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "node_id = 2",
            "node_id = 200",
            "arm.toml: joints[2].drive.node_id is 200: expected at most 127",
        ),
        (
            "node_id = 2",
            "node_id = 2.0",
            "arm.toml: joints[2].drive.node_id is 2.0: expected a whole number",
        ),
        (
            "velocity_max_rad_s = 3",
            "velocity_max_rad_s = true",
            "arm.toml: joints[2].velocity_max_rad_s is True: expected a number",
        ),
        (
            "velocity_max_rad_s = 3",
            "velocity_max_rad_s = 300",
            "arm.toml: joints[2].velocity_max_rad_s is 300.0: expected rad/s, not degrees",
        ),
        ('name = "b"', 'name = ""', "arm.toml: joints[2].name is '': expected text that is not empty"),
        (
            'name = "b"',
            "name = 1979-05-27",
            "arm.toml: joints[2].name is datetime.date(1979, 5, 27): expected text in quotes",
        ),
        ("node_id = 2", "", "arm.toml: joints[2].drive.node_id is missing: it is required"),
        (
            "velocity_max_rad_s = 3",
            "velocity_max_rads = 3",
            "arm.toml: joints[2].velocity_max_rad_s is missing: it is required; velocity_max_rads is an unknown key: "
            "rename it",
        ),
        (
            'name = "b"',
            'name = "b"\njerk_max = 3.0',
            "arm.toml: joints[2].jerk_max is 3.0: unknown key: did you mean jerk_max_rad_s3?",
        ),
        (
            "[joints.drive]",
            "[joints.drives]",
            "arm.toml: joints[2].drives is refused: unknown key: did you mean drive?",
        ),
        (
            "rated_current_a = 1.0",
            "rated_current_a = 1.0\njerk_max_rad_s3 = 3.0",
            "arm.toml: joints[2].drive.jerk_max_rad_s3 is 3.0: unknown key here: it belongs to joints",
        ),
        (
            "rated_current_a = 1.0",
            "rated_current_a = 1.0\n[tools.name]\nnode_id = 3\nrated_current = 1.0",
            "arm.toml: tools.name.rated_current_a is missing: it is required; rated_current is an unknown key: rename "
            "it",
        ),
        (
            "rated_current_a = 1.0",
            "rated_current_a = 1.0\n[tools]\nsaw = 3",
            "arm.toml: tools.saw is 3: expected a table",
        ),
    ],
)
def test_one_sentence_names_file_key_value_and_fix(old, new, message):
    assert old in GOOD
    assert str(refused(GOOD.replace(old, new, 1))) == message


def test_the_other_problems_of_a_file_are_counted():
    wrong = GOOD.replace("velocity_max_rad_s = 2.0", "").replace("node_id = 2", "node_id = 0")
    assert str(refused(wrong)) == (
        "arm.toml: joints[1].velocity_max_rad_s is missing: it is required (and 1 more problem in this file)"
    )


def test_a_file_of_another_kind_is_named_as_such_and_a_misspelt_table_is_not():
    assert str(refused("[payload]\nmass_kg = 1.0\n[residual]\nrms = 2.0")) == (
        "arm.toml: not an arm: contains payload, residual instead of joints"
    )
    assert str(refused("[[jiontes]]\nname = 1")).startswith("arm.toml: joints is missing: ")


@pytest.mark.parametrize("value", ["[]", "[1.0, nan]", "[true]", "3", "[[1.0]]", f"[0x{'f' * 300}]"])
def test_a_list_of_numbers_holds_finite_numbers(value):
    error = refused(f"offset = {value}\n{GOOD}")
    assert (error.key, error.expected) == ("offset", "expected a list of finite numbers")


@pytest.mark.parametrize("value", ["[]", "[[]]", "[[1.0], [1.0, 2.0]]", "[1.0]", "[[1.0], [inf]]", '"x"'])
def test_rows_of_numbers_are_of_one_length(value):
    error = refused(f"rows = {value}\n{GOOD}")
    assert (error.key, error.expected) == ("rows", "expected lists of finite numbers, all of the same length")


HOSTILE = {
    "lists nested": "a = " + "[" * 100_000 + "]" * 100_000,
    "lists nested to where Python can still read them": "offset = " + "[" * 300 + "]" * 300,
    "tables nested": "a = " + "{b = " * 10_000 + "1" + "}" * 10_000,
    "dotted keys": ".".join(["a"] * 3_000) + " = 1",
    "a known key, dotted": "joints." + ".".join(["a"] * 3_000) + " = 1",
    "an integer of a million digits": "joints = " + "9" * 1_000_000,
    "a hexadecimal integer of a million digits": "joints = 0x" + "f" * 1_000_000,
    "an integer that no float holds": f"[[joints]]\nname = 'a'\nvelocity_max_rad_s = {'9' * 4000}",
    "a float beyond all": "[[joints]]\nname = 'a'\nvelocity_max_rad_s = 1e999",
    "a key of a million letters": "a" * 1_000_000 + " = 1",
    "a text of a million letters": f"joints = '{'a' * 1_000_000}'",
    "a list of a hundred thousand numbers": f"[[joints]]\nname = [{'1,' * 100_000}]",
    "a zero byte": "joints = 1\x00",
    "a byte order mark": f"\ufeff{GOOD}",
    "nothing": "",
}


@pytest.mark.parametrize("content", HOSTILE.values(), ids=HOSTILE.keys())
def test_a_hostile_file_is_one_short_sentence(content):
    message = str(refused(content))
    assert message.startswith("arm.toml: ")
    assert len(message) < 600
    assert "\n" not in message


@pytest.mark.parametrize("data", [b"\xff\xfe", b'name = "\xc3\x28"', b"\x80" * 10_000])
def test_what_is_no_utf_8_is_one_sentence(tmp_path, data):
    path = tmp_path / "arm.toml"
    path.write_bytes(data)
    with pytest.raises(FileError, match=r"arm\.toml: cannot be read: not UTF-8, .* at byte \d+; save it as UTF-8$"):
        read_text(path, FileError)


def test_what_cannot_be_opened_is_one_sentence(tmp_path):
    with pytest.raises(FileError, match=r"cannot be read: Is a directory$"):
        read_text(tmp_path, FileError)


def test_values_from_elsewhere_are_checked_the_same_way():
    with pytest.raises(FileError, match=r"command line: drive\.node_id is 0: expected at least 1"):
        validated({"node_id": 0, "rated_current_a": 1.0}, "command line", Drive, FileError, within="drive")


class Matrix(Table):
    content = "a matrix"

    rows: SymmetricRows
    kind: Literal["a", "b"] = "a"
    count: int | float = 1
    sizes: Annotated[list[int], Meta(min_length=1, max_length=2)] = field(default_factory=lambda: [1])


@pytest.mark.parametrize(
    ("text", "rows"),
    [
        ("[[2.0], [0.5, 3.0]]", [[2.0, 0.5], [0.5, 3.0]]),
        ("[[2.0, 0.5], [0.25, 3.0]]", [[2.0, 0.5], [0.25, 3.0]]),
        ("[[1], [2, 4], [3, 5, 6]]", [[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]]),
        ("[[7]]", [[7.0]]),
    ],
)
def test_a_symmetric_matrix_may_end_at_its_diagonal(text, rows):
    assert parse_toml(f"rows = {text}", "a.toml", Matrix, FileError).rows.tolist() == rows


@pytest.mark.parametrize("text", ["[[1, 2], [3]]", "[]", "5", "[1, 2]", '[["a"]]', "[[nan]]"])
def test_any_other_shape_is_no_matrix(text):
    with pytest.raises(FileError, match=r"a\.toml: rows"):
        parse_toml(f"rows = {text}", "a.toml", Matrix, FileError)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('kind = "c"', "expected 'a' or 'b'"),
        ("kind = 5", "expected 'a' or 'b'"),
        ('count = "x"', "expected a whole number or a number"),
        ("sizes = []", "1 item"),
        ("sizes = [1, 2, 3]", "2 items"),
    ],
)
def test_what_was_expected_is_in_the_terms_of_toml(line, words):
    with pytest.raises(FileError) as caught:
        parse_toml(f"rows = [[1]]\n{line}", "a.toml", Matrix, FileError)
    assert words in str(caught.value)


class Bounds(Table):
    content = "bounds"

    above: Annotated[float, Meta(gt=0.0)] = 1.0
    below: Annotated[float, Meta(lt=0.5)] = 0.1
    least: Annotated[float, Meta(ge=0.25)] = 1.0
    most: Annotated[int, Meta(le=3)] = 1
    one: Annotated[list[float], Meta(min_length=1)] = field(default_factory=lambda: [1.0])
    few: Annotated[list[float], Meta(max_length=1)] = field(default_factory=list)
    described: Annotated[str, Meta(pattern="^a", description="expected a word with a")] = "a"
    own: Annotated[float, Meta(gt=0.0, extra={"expected": lambda value: f"expected more than {value:g}"})] = 1.0
    any: dict[str, int] = field(default_factory=dict)


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("above = 0.0", "expected a number greater than 0"),
        ("below = 0.5", "expected a number less than 0.5"),
        ("least = 0.2", "expected at least 0.25"),
        ("most = 4", "expected at most 3"),
        ("one = []", "expected at least 1 item"),
        ("few = [1.0, 2.0]", "expected at most 1 item"),
        ('described = "b"', "expected a word with a"),
        ("described = 3", "expected a word with a"),
        ("own = -2.0", "expected more than -2"),
        ('own = "x"', "expected a number"),
        ("any = {a = 1, b = 2.5}", "expected a whole number"),
        ("any = 3", "expected a table"),
        ("above = inf", "expected a finite number"),
    ],
)
def test_a_bound_is_said_with_its_number_or_as_its_key_says(line, expected):
    with pytest.raises(FileError) as caught:
        parse_toml(line, "a.toml", Bounds, FileError)
    assert caught.value.expected == expected
    assert caught.value.key == ("any.b" if "b = 2.5" in line else line.split()[0])


@pytest.mark.parametrize(
    ("values", "other"),
    [
        ({"a": 1, "b": 2}, True),
        ({"a": 1}, False),
        ({"a": 1, "b": 2, "tools": {}, "offset": [1.0]}, True),
        ({"a": 1, "b": 2, "tools": {}, "offset": [1.0], "rows": [[1.0]]}, False),
        ({"a": 1, "b": 2, "joints": []}, False),
    ],
)
def test_a_file_of_another_kind_has_two_unknown_keys_and_at_least_half_of_all(values, other):
    with pytest.raises(FileError) as caught:
        validated(values, "arm.toml", Arm, FileError)
    assert ("not an arm: contains a, b instead of joints" in str(caught.value)) is other


def test_a_key_is_a_misspelling_from_six_tenths_of_similarity_on():
    """Of 9 letters each, 5 or 6 in common."""
    for key, close in (("describxxx", True), ("descrxxxxx", False)):
        with pytest.raises(FileError) as caught:
            parse_toml(f"{key} = 3", "a.toml", Bounds, FileError)
        assert ("did you mean described?" in str(caught.value)) is close


def test_problems_are_counted():
    with pytest.raises(FileError, match=r"\(and 2 more problems in this file\)"):
        parse_toml("above = 0\nmost = 4\nleast = 0", "a.toml", Bounds, FileError)


def test_an_array_has_the_shape_that_is_required():
    require_shape("rows", np.zeros((2, 3)), (2, 3))
    with pytest.raises(BadValue, match=r"rows: expected 2 lists of 3 finite numbers"):
        require_shape("rows", np.zeros((2, 2)), (2, 3))
    table = Arm(joints=[], offset=np.zeros(4))
    require_array_shapes("arm", table, {"offset": (4,)})
    with pytest.raises(BadValue, match=r"arm\.offset: expected 3 finite numbers"):
        require_array_shapes("arm", table, {"offset": (3,)})


def test_a_recording_is_no_file_in_toml_and_a_text_is_written(tmp_path):
    path = tmp_path / "run.MCAP"
    with pytest.raises(FileError, match="cannot be read: No such file"):
        read_toml(path, FileError)
    path.write_bytes(b"x")
    with pytest.raises(FileError, match="a recording or a table, where a file in TOML is expected"):
        read_toml(path, FileError)
    write_text(tmp_path / "a.toml", "a = 1", FileError)
    assert read_toml(str(tmp_path / "a.toml"), FileError) == "a = 1"
    with pytest.raises(FileError, match="cannot be written"):
        write_text(tmp_path / "none" / "a.toml", "a = 1", FileError)
    with pytest.raises(TypeError):
        read_toml(3, FileError)
    with pytest.raises(FileError, match="cannot be read"):
        read_text(tmp_path / "a.toml", FileError, 4)
