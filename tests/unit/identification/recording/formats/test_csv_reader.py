"""Logs in CSV: separators and headers, rows that are left out and counted, refused tables and their messages."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.formats.csv_reader import _Layout
from armload_identification.recording.reading_options import ReadingOptions
from tests.recording_files import csv_rows, table_columns, write_csv

pytestmark = pytest.mark.pure

COLUMNS = ReadingOptions(table_columns(time=0, position=[1, 2], velocity=[3, 4], current=[5, 6]))


def test_csv_with_and_without_a_header_line(tmp_path):
    plain = read_recording_file(write_csv(tmp_path / "a.csv", csv_rows()), COLUMNS)
    names = ReadingOptions(table_columns("t", ["q1", "q2"], current=["i1", "i2"]))
    headed = read_recording_file(write_csv(tmp_path / "b.csv", ["t,q1,q2,v1,v2,i1,i2", *csv_rows()]), names)
    np.testing.assert_array_equal(plain.current_a, headed.current_a)
    np.testing.assert_allclose(plain.position_rad[:, 0], np.sin(0.03 * np.arange(60)), atol=1e-5)
    assert headed.velocity_rad_s is None
    assert plain.n == 2
    assert plain.phase_s is None
    assert plain.excitation is None


@pytest.mark.parametrize("header", ["", "t,q1,q2,dq1,dq2,i1,i2\n"])
@pytest.mark.parametrize(("separator", "point"), [(";", ","), (";", "."), ("\t", "."), ("\t", ",")])
def test_columns_may_be_separated_as_spreadsheets_write_them(tmp_path, header, separator, point):
    """A table with semicolons had "0 usable rows", or a header without a time column."""
    plain, other = tmp_path / "plain.csv", tmp_path / "other.csv"
    text = header + "\n".join(f"{0.01 * k},{0.1 * k},-1.5,0.0,0.0,{k}.25,1e-3" for k in range(30)) + "\n"
    plain.write_text(text)
    other.write_text(text.replace(",", separator).replace(".", point))
    read = [read_recording_file(path, COLUMNS) for path in (plain, other)]
    assert read[1].source.rows_dropped == 0
    for name in ("time_s", "position_rad", "velocity_rad_s", "current_a"):
        np.testing.assert_array_equal(getattr(read[1], name), getattr(read[0], name))


def test_garbage_rows_are_dropped_and_counted_by_reason(tmp_path):
    rows = csv_rows(100)
    good = list(rows)
    huge = "1" + "0" * 127
    rows[10] = f"900.1,{huge},0,0,0,0,0"
    rows[11] = "900.11,nan,0,0,0,0,0"
    rows[12] = "900.12,0.1,0.9"
    rows[13] = "900.13,what,0,0,0,0,0"
    rows[14] = "27.0625,1.9,6.3,7.1,1.3,1.3,0.9"
    rows[20] = rows[19]
    rows[30] = "899.5" + rows[30][8:]
    rows[40] = rows[40].split(",")[0] + ",30.0,30.0,0.1,0.1,0.1,0.1"
    rows.append("901.0,0.1,0.2")
    recording = read_recording_file(write_csv(tmp_path / "a.csv", rows), COLUMNS)
    assert recording.source.rows_read == 101
    assert dict(recording.source.reasons) == {
        "impossible value": 1,
        "not finite": 1,
        "wrong number of columns": 1,
        "not a number": 1,
        "time out of range": 1,
        "same as the row before": 1,
        "time not increasing": 1,
        "position jumps": 1,
        "truncated last row": 1,
    }
    assert recording.source.rows_dropped == 9
    left = [float(good[k].split(",")[0]) for k in range(100) if k not in (10, 11, 12, 13, 14, 20, 30, 40)]
    np.testing.assert_allclose(recording.time_s, left)


def test_one_wild_time_stamp_does_not_cost_the_rest(tmp_path):
    rows = csv_rows(100)
    rows[3] = "905.0" + rows[3][8:]
    recording = read_recording_file(write_csv(tmp_path / "a.csv", rows), COLUMNS)
    assert dict(recording.source.reasons) == {"time not increasing": 1}


@pytest.mark.parametrize(
    ("rows", "columns", "said"),
    [
        ([""], COLUMNS, "is empty"),
        (csv_rows(), ReadingOptions(table_columns(0, [1, 2])), "neither motor current nor joint torque"),
        (
            csv_rows(),
            ReadingOptions(table_columns(0, [1, 2], current=[6, 7])),
            "no column 7 for current_a; there are 0, 1, 2, 3, 4, 5, 6",
        ),
        (csv_rows(), ReadingOptions(table_columns("t", [1, 2], current=[5, 6])), "no column 't' .* 0, 1, 2"),
        (["1.0", "2.0"], COLUMNS, "no column 1 for position_rad; the table has one column, as no separator"),
        (
            ["a,b,c,d,e,f,g", *csv_rows()],
            ReadingOptions(table_columns("t", [1, 2], current=[5, 6])),
            "no column 't' .* a, b, c",
        ),
        (["nan,nan,nan,nan,nan,nan,nan"] * 50, COLUMNS, "0 usable rows of 50 .50 not finite"),
        (csv_rows(12), COLUMNS, "12 usable rows"),
        (csv_rows(scale=57.29578), COLUMNS, "look like degrees"),
        (csv_rows(scale=57.29578 / 20), COLUMNS, None),
        (csv_rows(velocity_scale=57.29578), COLUMNS, "velocities look like degrees"),
    ],
)
def test_what_cannot_be_used_is_refused_with_the_reason(tmp_path, rows, columns, said):
    path = write_csv(tmp_path / "log.csv", rows)
    if said is None:
        assert len(read_recording_file(path, columns).time_s) == 60
        return
    with pytest.raises(RecordingError, match=said) as caught:
        read_recording_file(path, columns)
    assert str(path) in str(caught.value)


def test_small_angles_in_degrees_betray_themselves_by_the_velocity(tmp_path):
    rows = csv_rows()
    table = np.array([[float(x) for x in row.split(",")] for row in rows])
    table[:, 1:3] *= 0.1 * 57.29578
    table[:, 3:5] *= 0.1
    path = write_csv(tmp_path / "log.csv", [",".join(f"{x:.6f}" for x in row) for row in table])
    with pytest.raises(RecordingError, match="positions look like degrees"):
        read_recording_file(path, COLUMNS)


def test_the_levels_of_pandas_names_are_joined_and_the_index_is_the_time(tmp_path):
    """DataFrame.to_csv with columns of two levels and a named index: three lines, the last one with its name only."""
    head = ",position,position,effort,effort\n,shoulder,elbow,shoulder,elbow\ntime,,,,\n"
    (tmp_path / "log.csv").write_text(head + "\n".join(f"{0.01 * k},{0.01 * k},{0.02 * k},2,3" for k in range(90)))
    read = read_recording_file(tmp_path / "log.csv", ReadingOptions(joint_names=("shoulder", "elbow")))
    np.testing.assert_allclose(read.position_rad[:, 1], 0.02 * np.arange(90))
    np.testing.assert_allclose(read.torque_nm, np.tile([2.0, 3.0], (90, 1)))


def test_an_advised_option_tells_columns_of_one_name_apart(tmp_path):
    """It took the positions once more as torques."""
    rows = "\n".join(f"{0.01 * k},{0.01 * k},{0.02 * k},2,3" for k in range(90))
    (tmp_path / "log.csv").write_text("time,shoulder,elbow,shoulder,elbow\n" + rows)
    with pytest.raises(RecordingError, match=r'--columns "time=0 position=1-2 torque=3-4"'):
        read_recording_file(tmp_path / "log.csv", ReadingOptions(joint_names=("shoulder", "elbow")))


def test_a_table_without_a_header_needs_its_columns(tmp_path):
    path = write_csv(tmp_path / "a.csv", csv_rows())
    with pytest.raises(RecordingError, match=r"the table has no header line, so its 7 columns are unknown\. Specify"):
        read_recording_file(path)


def test_a_header_that_does_not_fit_the_rows_is_refused_with_the_numbers_of_its_columns(tmp_path):
    path = write_csv(tmp_path / "a.csv", ["t,q1,q2,tau1,tau2,more", *(f"{0.01 * k},1,2,{k},4" for k in range(40))])
    with pytest.raises(
        RecordingError, match=r'the header has 6 columns, the rows have 5\. .* "time=0 position=1-2 torque=3-4"'
    ):
        read_recording_file(path)
    given = ReadingOptions(table_columns("t", ["q1", "q2"], torque=["tau1", "tau2"]))
    assert read_recording_file(path, given).size == 40


@pytest.mark.parametrize("broken", [(), (7,)])
def test_times_of_a_clock_are_read_also_beside_a_row_that_is_no_number(tmp_path, broken):
    rows = [f"10:00:0{k // 10}.{k % 10},{0.01 * k},0.5,{k},1" for k in range(60)]
    for k in broken:
        rows[k] = rows[k].replace("0.5", "half")
    read = read_recording_file(write_csv(tmp_path / "a.csv", ["time,q1,q2,tau1,tau2", *rows]))
    kept = [k for k in range(60) if k not in broken]
    np.testing.assert_allclose(read.time_s, 36000.0 + 0.1 * np.array(kept))
    np.testing.assert_allclose(read.torque_nm[:, 0], kept)
    assert dict(read.source.reasons) == ({"not a number": 1} if broken else {})


def test_blocks_of_lines_are_read_one_after_the_other_and_blank_lines_are_none(tmp_path):
    """Several blocks of 4096 lines; only the last row of the last one can be truncated."""
    rows = [f"{0.01 * k:.2f},{np.sin(0.01 * k):.6f},0.5,{k % 17},1" for k in range(9000)]
    rows[4095] = rows[4095].rpartition(",")[0]
    rows.insert(100, "   ")
    read = read_recording_file(write_csv(tmp_path / "a.csv", ["t,q1,q2,tau1,tau2", *rows, "90.0,0.1"]))
    assert read.source.rows_read == 9001
    assert dict(read.source.reasons) == {"wrong number of columns": 1, "truncated last row": 1}
    np.testing.assert_allclose(read.time_s, [0.01 * k for k in range(9000) if k != 4095])
    longer = write_csv(tmp_path / "b.csv", ["t,q1,q2,tau1,tau2", *rows[:60], "90.0,0.1,1,1,1,1"])
    assert dict(read_recording_file(longer).source.reasons) == {"wrong number of columns": 1}


def test_text_may_begin_with_a_mark_and_be_in_the_encoding_of_windows(tmp_path):
    rows = "\r\n".join(f"{0.01 * k},{0.01 * k},0.5,{k},1,0" for k in range(60))
    for encoding in ("cp1252", "utf-8-sig"):
        path = tmp_path / f"{encoding}.csv"
        path.write_bytes(f"t,q1,q2,tau1,tau2,Größe\r\n{rows}".encode(encoding))
        read = read_recording_file(path)
        assert read.source.rows_read == read.size == 60


def test_a_line_without_an_end_is_no_table(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b"1," * 2**19 + b"1\n")
    with pytest.raises(RecordingError, match="a line of more than 1048576 bytes, so it is no table"):
        read_recording_file(path, COLUMNS)


@pytest.mark.parametrize("rows", [1, 3])
def test_rows_without_text_are_read_at_once(rows):
    """Field by field takes four times as long."""

    class Line(str):
        def split(self, *_):
            raise AssertionError(f"{self!r} is read field by field")

    lines = [f"{i},{i}.5,2" for i in range(rows)]
    layout = _Layout(Path("x.csv"), ReadingOptions(table_columns(0, [1])), None, lines)
    table, unreadable = layout.numbers(list(map(Line, lines)))
    assert table.tolist() == [[i, i + 0.5] for i in range(rows)]
    assert unreadable == 0
