"""Parquet tables and LeRobot data sets: columns, times, episodes, and damage."""

from __future__ import annotations

import json
from contextlib import nullcontext

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.formats.parquet_reader import ParquetReader, _numbered, _numbers
from armload_identification.recording.reader import ReadingAccount
from armload_identification.recording.reading_options import ReadingOptions
from tests.recording_files import table_columns
from tests.three_joints import NAMES, POSITION, TIME, TORQUE, assert_read


def columns(position="q{}", torque="tau{}"):
    return {
        "t": TIME,
        **{position.format(j + 1): POSITION[:, j] for j in range(3)},
        **{torque.format(j + 1): TORQUE[:, j] for j in range(3)},
    }


def test_a_parquet_table_with_a_column_for_each_joint(tmp_path):
    path = tmp_path / "run.parquet"
    pq.write_table(pa.table(columns()), path)
    assert_read(read_recording_file(path))
    assert_read(read_recording_file(path, ReadingOptions(table_columns(0, [1, 2, 3], torque=["tau1", "tau2", "tau3"]))))
    with pytest.raises(RecordingError, match="no column 'tau9' for torque_nm; there are t, q1"):
        read_recording_file(path, ReadingOptions(table_columns(0, [1, 2, 3], torque=["tau1", "tau2", "tau9"])))
    pq.write_table(pa.table({"a": TIME}), path)
    with pytest.raises(RecordingError, match="no time column"):
        read_recording_file(path)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
@pytest.mark.parametrize("kind", [pa.duration, lambda unit: pa.timestamp(unit, "UTC")], ids=["duration", "timestamp"])
def test_times_of_a_parquet_table_may_be_dates_and_durations(tmp_path, kind, unit):
    """As pandas and polars write them; they were refused as damaged."""
    ticks = np.round(TIME * {"ms": 1e3, "us": 1e6, "ns": 1e9}[unit]).astype(np.int64)
    path, since_1970 = tmp_path / "run.parquet", 1_700_000_000 * {"ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    pq.write_table(pa.table({**columns(), "t": pa.array(ticks).cast(kind(unit))}), path)
    assert_read(read_recording_file(path))
    found = columns()
    del found["t"]
    pq.write_table(pa.table({**found, "__index_level_0__": pa.array(ticks + since_1970).cast(kind(unit))}), path)
    np.testing.assert_allclose(np.diff(read_recording_file(path).time_s), np.diff(TIME), atol=1e-6)


def lerobot(folder, episodes=1, names=tuple(f"{name}.pos" for name in NAMES), position=POSITION):
    (folder / "meta").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    info = {"codebase_version": "v3.0", "features": {"observation.state": {"names": names}}}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    table = {
        "observation.state": pa.FixedSizeListArray.from_arrays(position.ravel(), 3),
        "observation.effort": pa.array(TORQUE.tolist()),
        "action": pa.FixedSizeListArray.from_arrays(POSITION.ravel(), 3),
        "timestamp": TIME.astype(np.float32),
        "episode_index": np.arange(TIME.size) * episodes // TIME.size,
    }
    half = TIME.size // 2
    for number, rows in enumerate((slice(0, half), slice(half, None))):
        part = {name: values[rows] for name, values in table.items()}
        pq.write_table(pa.table(part), folder / "data" / "chunk-000" / f"file-{number:03d}.parquet")
    return folder


def test_a_lerobot_data_set(tmp_path):
    assert_read(read_recording_file(lerobot(tmp_path / "set")), NAMES)
    (tmp_path / "set" / "meta" / "info.json").write_text("[" * 100_000)
    with pytest.raises(RecordingError, match=r"info\.json: cannot be read"):
        read_recording_file(tmp_path / "set")


@pytest.mark.parametrize(
    ("names", "found"),
    [
        ({"motors": ["a.pos", "b", "c.pos.x"]}, ("a", "b", "c.pos.x")),
        ({}, ()),
        (None, ()),
        (5, ()),
        ([1, 2, 3], ("1", "2", "3")),
    ],
)
def test_joints_are_named_as_far_as_the_description_names_them(tmp_path, names, found):
    assert read_recording_file(lerobot(tmp_path / "set", names=names)).joint_names == found


@pytest.mark.parametrize("emptied", ["info.json", "file-000.parquet"])
def test_a_folder_without_description_or_tables_is_no_data_set(tmp_path, emptied):
    folder = lerobot(tmp_path / "set")
    for path in folder.rglob("*.parquet" if emptied.startswith("file") else emptied):
        path.unlink()
    text = "cannot be read: .* Copy the data set again" if emptied == "info.json" else r"no data/chunk-\*/file-\*"
    with pytest.raises(RecordingError, match=text):
        ParquetReader(folder, ReadingOptions())


LIMITS_RAD = np.array([[-1.5, 1.5], [-1.5, 1.5], [-1.5, 1.5]])
"""The positions reach 0.78, 1 and 0.445 rad."""


def in_unit(tmp_path, position, limits_rad=LIMITS_RAD, joints=tuple(NAMES)):
    reader = ParquetReader(
        lerobot(tmp_path / "set", position=position), ReadingOptions(joint_names=joints, position_limits_rad=limits_rad)
    )
    account = ReadingAccount()
    return np.vstack([block.position_rad for block in reader.blocks(account)]), account.remarks


@pytest.mark.parametrize(
    ("scale", "limits_rad", "degrees"),
    [
        (1.0, LIMITS_RAD, False),
        (1.59, LIMITS_RAD, False),
        (1.61, LIMITS_RAD, True),
        (50.0, LIMITS_RAD, True),
        (50.0, None, False),
        (50.0, 100.0 * LIMITS_RAD, True),
        (-50.0, 100.0 * LIMITS_RAD, True),
        (91.0, LIMITS_RAD, True),
        (92.0, LIMITS_RAD, False),
        (-92.0, LIMITS_RAD, False),
    ],
)
def test_positions_are_in_degrees_if_they_can_only_be_degrees(tmp_path, scale, limits_rad, degrees):
    """No joint reaches more than two turns, whatever its limits are; a tenth of a radian beyond them is forgiven."""
    position = scale * POSITION
    found, remarks = in_unit(tmp_path, position, limits_rad)
    np.testing.assert_allclose(found, np.radians(position) if degrees else position)
    assert bool(remarks) is degrees
    if degrees:
        assert remarks[0].startswith(f"observation.state reaches {np.abs(position).max():.4g}, beyond the arm's limits")


def test_limits_are_those_of_the_joints_by_name(tmp_path):
    wide = np.array([[-0.6, 0.6], [-1.5, 1.5], [-1.5, 1.5]])
    assert not in_unit(tmp_path / "same", POSITION, wide, ("wrist", "shoulder", "elbow"))[1]
    assert in_unit(tmp_path / "other", POSITION, wide, ("shoulder", "wrist", "elbow"))[1]


@pytest.mark.parametrize(
    ("ends", "refused"), [((100.0, -100.0), True), ((100.0, 99.0), False), ((-100.0, -100.0), True)]
)
def test_what_ends_at_a_hundred_in_two_joints_may_be_percent(tmp_path, ends, refused):
    position = 50.0 * POSITION
    position[7, :2] = ends
    limits_rad = 10.0 * LIMITS_RAD
    with pytest.raises(RecordingError, match="so it may be in percent") if refused else nullcontext():
        assert in_unit(tmp_path, position, limits_rad)[1]


@pytest.mark.parametrize(
    ("lists", "text"),
    [
        ([[1.0], None, [1.0]], "a list without a number for each joint"),
        ([[1.0], [1.0, 2.0], []], "lists of different lengths"),
        ([[1.0, 2.0], [1.0]], "a list without a number for each joint"),
        ([], "a list without a number for each joint"),
    ],
)
def test_every_row_of_lists_has_a_number_for_each_joint(lists, text):
    with pytest.raises(ValueError, match=text):
        _numbers(pa.array(lists, pa.list_(pa.float64())))


def test_missing_numbers_are_nan():
    np.testing.assert_array_equal(_numbers(pa.array([1, None, 3])), [[1.0], [np.nan], [3.0]])
    np.testing.assert_array_equal(_numbers(pa.array([[1, None], [3, 4]])), [[1.0, np.nan], [3.0, 4.0]])


def test_of_a_data_set_of_several_episodes_one_is_chosen(tmp_path):
    """Each episode is a separate recording with its own rows, name and hash."""
    folder = lerobot(tmp_path / "three", episodes=3)
    with pytest.raises(RecordingError, match=r"3 episodes \(0 to 2\).*`episode=`, such as 3"):
        read_recording_file(folder)
    with pytest.raises(RecordingError, match=r"no episode 3, there are 0 to 2\. Correct `episode=`"):
        read_recording_file(folder, ReadingOptions(episode=3))
    parts = [read_recording_file(folder, ReadingOptions(episode=number)) for number in range(3)]
    np.testing.assert_array_equal(np.vstack([part.position_rad for part in parts]), POSITION)
    assert [part.source.path for part in parts] == [tmp_path / f"three episode {number}" for number in range(3)]
    assert len({part.source.sha256 for part in parts}) == 3
    one = lerobot(tmp_path / "one")
    assert_read(read_recording_file(one, ReadingOptions(episode=0)), NAMES)
    with pytest.raises(RecordingError, match=r"no episode 1, there are 0 to 0"):
        read_recording_file(one, ReadingOptions(episode=1))


def test_a_file_without_episodes_has_none_to_choose(tmp_path):
    path = tmp_path / "run.parquet"
    pq.write_table(pa.table(columns()), path)
    with pytest.raises(RecordingError, match=r"no episode 0, no column episode_index"):
        read_recording_file(path, ReadingOptions(episode=0))
    log = tmp_path / "run.csv"
    log.write_text("t,q1\n0,0\n")
    with pytest.raises(RecordingError, match=r"run\.csv: has no episodes.*Omit `episode=`"):
        read_recording_file(log, ReadingOptions(episode=0))


def test_damaged_tables_are_named(tmp_path):
    path = tmp_path / "run.parquet"
    pq.write_table(pa.table(columns()), path)
    whole = path.read_bytes()
    for damaged in (whole[:500], whole[:200] + b"\xff" * 300 + whole[500:], whole[:-30] + b"\xff" * 30):
        path.write_bytes(damaged)
        with pytest.raises(RecordingError, match=r"run\.parquet: damaged, "):
            read_recording_file(path)
    uneven = pa.table({"t": TIME, "position": pa.array([[1.0] * (1 + k % 2) for k in range(TIME.size)])})
    pq.write_table(uneven, path)
    with pytest.raises(RecordingError, match="damaged, "):
        read_recording_file(path)


@pytest.mark.parametrize(
    ("episodes", "text"), [({3}, "3 to 3"), ({1, 2, 3}, "1 to 3"), ({1, 3}, "1, 3"), ({0, 1, 3, 4}, "0, 1, 3, 4")]
)
def test_episodes_are_a_range_if_none_is_missing(episodes, text):
    assert _numbered(episodes) == text


@pytest.mark.parametrize(
    ("low", "high", "limits_rad", "degrees"),
    [
        ([-1.0, -1.0], [1.09, 1.0], [[-1.0, 1.0]] * 2, False),
        ([-1.0, -1.0], [1.11, 1.0], [[-1.0, 1.0]] * 2, True),
        ([-1.11, -1.0], [1.0, 1.0], [[-1.0, 1.0]] * 2, True),
        ([-60.0, -1.0], [62.0, 1.0], [[-1.0, 1.0]] * 2, True),
        ([-60.0, -1.0], [64.0, 1.0], [[-1.0, 1.0]] * 2, False),
        ([-6.3, -1.0], [6.38, 1.0], [[-99.0, 99.0]] * 2, False),
        ([-6.3, -1.0], [6.39, 1.0], [[-99.0, 99.0]] * 2, True),
    ],
)
def test_positions_may_be_a_tenth_of_a_radian_beyond_the_limits_and_two_half_turns_in_any_case(
    low, high, limits_rad, degrees
):
    """63 degrees are 1.1 rad."""
    reader = object.__new__(ParquetReader)
    reader._options = ReadingOptions(joint_names=("a_x", "b_x"))
    reader._path, reader._remarks, reader._names = "set", (), ["time", "state"]
    batch = pa.table({"state": [low, high]}).to_batches()
    reader._batches = lambda _: batch
    columns = table_columns("time", ["state"], joint_names=("a_x", "b_x"))
    found = reader._in_stated_unit(columns, "state", np.array(limits_rad))
    assert (found.scale.get("position_rad") is not None) is degrees
    assert bool(reader._remarks) is degrees
    assert not degrees or f"reaches {max(np.max(high), -np.min(low)):.4g}, beyond" in reader._remarks[0]
