"""How a text table is written: separators, headers, quotation marks, and times in words."""

import math
from datetime import UTC, datetime

import pytest

from armload_identification.recording.text_table import TextTable, echoed_columns, is_number, seconds_of_stamp

pytestmark = pytest.mark.pure


@pytest.mark.parametrize("separator", [";", "\t", ",", " "])
def test_separators_are_recognised_from_the_first_row_of_numbers(separator):
    lines = [separator.join(row) for row in (["t", "q1", "q2"], ["0.0", "1.5", "-2e-3"], ["0.1", "1.6", "0"])]
    table = TextTable.of(lines)
    assert (table.separator, table.quoted, table.header, table.first_row) == (separator, False, ["t", "q1", "q2"], 1)
    assert table.with_commas(lines[1:2]) == ["0.0,1.5,-2e-3"]
    assert (table.with_commas(lines) is lines) is (separator == ",")


def test_a_comma_that_does_not_separate_is_a_decimal_comma():
    table = TextTable.of(["t;q", "0,5;1,25"])
    assert table.separator == ";"
    assert table.with_commas(["0,5;1,25"]) == ["0.5,1.25"]
    spaced = TextTable.of(["0,5   1,25 0,1 0,2 0,3"])
    assert (spaced.separator, spaced.header, spaced.first_row) == (" ", None, 0)
    assert spaced.with_commas(["  0,5 \t 1,25 "]) == ["0.5,1.25"]


def test_quoted_fields_lose_their_marks_and_keep_what_separates_inside():
    table = TextTable.of(['"t","q, 1"', '"0.0","1.5"'])
    assert (table.quoted, table.header, table.first_row) == (True, ["t", "q, 1"], 1)
    assert table.with_commas(['"0.0","x"']) == ["0.0,x"]


@pytest.mark.parametrize("comment", ["", "# ", "#"])
def test_units_and_levels_above_the_numbers_are_joined_and_titles_are_not(comment):
    lines = [f"{comment}{line}" for line in ("A run of today", "q,q,tau", "1,2,1", "rad,rad,Nm", "0.1,0.2,3")]
    table = TextTable.of(lines)
    assert table.first_row == 2, "a line of numbers is a row"
    lines = [f"{comment}{line}" for line in ("A run of today", "t,q,tau", "s,rad,Nm", "0.1,0.2,3")]
    table = TextTable.of(lines)
    assert (table.header, table.first_row) == (["t s", "q rad", "tau Nm"], 3)


def test_several_titles_above_the_names_are_none_of_them():
    table = TextTable.of(["A run", "of today", "t,q,tau", "0.1,0.2,3"])
    assert (table.header, table.first_row) == (["t", "q", "tau"], 3)


def test_only_three_lines_are_a_header():
    table = TextTable.of(["w,w", "a,b", "c,d", "e,f", "1,2"])
    assert table.header == ["a c e", "b d f"]


def test_a_title_alone_is_what_there_is():
    table = TextTable.of(["title", "0.1,0.2"])
    assert (table.header, table.first_row) == (["title"], 1)


def test_a_first_column_of_dates_without_a_name_is_the_time():
    assert TextTable.of([",q1,q2", "2026-03-01T10:00:00,0.5,0.25"]).header == ["time", "q1", "q2"]
    assert TextTable.of([",q1,q2", "0,0.5,0.25"]).header == ["", "q1", "q2"], "a number may be an index"


def test_a_row_has_more_than_one_number_and_at_least_half():
    assert TextTable.of(["run,5", "1,2"]).first_row == 1
    assert TextTable.of(["a,b,1,2", "1,2,3,4"]).first_row == 0, "half are numbers"
    assert TextTable.of(["a,b,c,1,2", "1,2,3,4,5"]).first_row == 1
    assert TextTable.of(["a,b", "c,d"]).first_row == 2


def test_a_table_is_recognised_by_its_opening():
    lines = ["x,y"] * 64 + ["1,2"]
    assert TextTable.of(lines).first_row == 64
    assert TextTable.of(lines[1:]).first_row == 63


# ros2 topic echo --csv -------------------------------------------------------------------------------------------


def echoed(n=2, values=3, names=None):
    names = names or [f"joint_{k}" for k in range(n)]
    return ",".join(["12", "500", "base", *names, *(["0.5"] * (values * n))])


def test_joint_states_as_they_are_printed():
    columns = echoed_columns([echoed(3)])
    assert columns.joint_names == ("joint_0", "joint_1", "joint_2")
    assert columns.groups == {
        "time_s": [0, 1],
        "position_rad": [6, 7, 8],
        "velocity_rad_s": [9, 10, 11],
        "torque_nm": [12, 13, 14],
    }


@pytest.mark.parametrize(
    "lines",
    [
        [],
        [""],
        ["t,q1,q2"],
        ["0.1,0.2,0.3,0.4"],
        [echoed(1)],
        [echoed(2, values=2)],
        [echoed(2) + ",1"],
        [echoed(names=["a", "a"])],
        ["x" + echoed()],
        [echoed().replace("500", "x", 1)],
    ],
    ids=range(10),
)
def test_other_tables_are_no_joint_states(lines):
    assert echoed_columns(lines) is None


# Times -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("0.002 sec", 0.002),
        (" 12ms ", 0.012),
        ("-1.5e3us", -0.0015),
        ("7 nsecs", 7e-9),
        ("00:01:02.5", 62.5),
        ("2:03", 123.0),
        ("01:00:00", 3600.0),
        ("2026-03-01T10:00:00+01:00", datetime(2026, 3, 1, 9, tzinfo=UTC).timestamp()),
        ("2026-03-01 10:00:00", datetime(2026, 3, 1, 10, tzinfo=UTC).timestamp()),
    ],
)
def test_times_with_a_unit_of_a_clock_or_a_calendar(text, seconds):
    assert seconds_of_stamp(text) == pytest.approx(seconds, rel=1e-12)


@pytest.mark.parametrize("text", ["", "soon", "5 rad", "1:2:3:4", "12"])
def test_what_is_no_time_is_an_error(text):
    with pytest.raises(ValueError, match=r"."):
        seconds_of_stamp(text)


def test_numbers_have_a_decimal_point():
    assert all(map(is_number, ("1", "-2.5e-3", " 4 ", "nan", "inf")))
    assert not any(map(is_number, ("", "1,5", "x", "1 2")))
    assert math.isnan(float("nan"))
