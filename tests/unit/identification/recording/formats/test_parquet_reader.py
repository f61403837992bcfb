"""Parquet tables and LeRobot data sets: columns, times, episodes, and damage."""

from __future__ import annotations

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.csv_columns import CsvColumns
from armload_identification.recording.file_reading import read_recording
from armload_identification.recording.reading_options import ReadingOptions
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
    assert_read(read_recording(path))
    assert_read(read_recording(path, ReadingOptions(CsvColumns(0, [1, 2, 3], torque=["tau1", "tau2", "tau3"]))))
    with pytest.raises(RecordingError, match="no column 'tau9' for torque_nm; there are t, q1"):
        read_recording(path, ReadingOptions(CsvColumns(0, [1, 2, 3], torque=["tau1", "tau2", "tau9"])))
    pq.write_table(pa.table({"a": TIME}), path)
    with pytest.raises(RecordingError, match="no time column"):
        read_recording(path)


@pytest.mark.parametrize("unit", ["ms", "us", "ns"])
@pytest.mark.parametrize("kind", [pa.duration, lambda unit: pa.timestamp(unit, "UTC")], ids=["duration", "timestamp"])
def test_times_of_a_parquet_table_may_be_dates_and_durations(tmp_path, kind, unit):
    """As pandas and polars write them; they were refused as damaged."""
    ticks = np.round(TIME * {"ms": 1e3, "us": 1e6, "ns": 1e9}[unit]).astype(np.int64)
    path, since_1970 = tmp_path / "run.parquet", 1_700_000_000 * {"ms": 10**3, "us": 10**6, "ns": 10**9}[unit]
    pq.write_table(pa.table({**columns(), "t": pa.array(ticks).cast(kind(unit))}), path)
    assert_read(read_recording(path))
    found = columns()
    del found["t"]
    pq.write_table(pa.table({**found, "__index_level_0__": pa.array(ticks + since_1970).cast(kind(unit))}), path)
    np.testing.assert_allclose(np.diff(read_recording(path).time_s), np.diff(TIME), atol=1e-6)


def lerobot(folder, episodes=1, names=NAMES):
    (folder / "meta").mkdir(parents=True)
    (folder / "data" / "chunk-000").mkdir(parents=True)
    info = {"codebase_version": "v3.0", "features": {"observation.state": {"names": [f"{n}.pos" for n in names]}}}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    table = {
        "observation.state": pa.FixedSizeListArray.from_arrays(POSITION.ravel(), 3),
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
    assert_read(read_recording(lerobot(tmp_path / "set")), NAMES)
    (tmp_path / "set" / "meta" / "info.json").write_text("[" * 100_000)
    with pytest.raises(RecordingError, match=r"info\.json: cannot be read"):
        read_recording(tmp_path / "set")


def test_of_a_data_set_of_several_episodes_one_is_chosen(tmp_path):
    """Each episode is a separate recording with its own rows, name and hash."""
    folder = lerobot(tmp_path / "three", episodes=3)
    with pytest.raises(RecordingError, match=r"3 episodes \(0 to 2\).*`episode=`, such as 3"):
        read_recording(folder)
    with pytest.raises(RecordingError, match=r"no episode 3, there are 0 to 2\. Correct `episode=`"):
        read_recording(folder, ReadingOptions(episode=3))
    parts = [read_recording(folder, ReadingOptions(episode=number)) for number in range(3)]
    np.testing.assert_array_equal(np.vstack([part.position_rad for part in parts]), POSITION)
    assert [part.source.path for part in parts] == [tmp_path / f"three episode {number}" for number in range(3)]
    assert len({part.source.sha256 for part in parts}) == 3
    one = lerobot(tmp_path / "one")
    assert_read(read_recording(one, ReadingOptions(episode=0)), NAMES)
    with pytest.raises(RecordingError, match=r"no episode 1, there are 0 to 0"):
        read_recording(one, ReadingOptions(episode=1))


def test_a_file_without_episodes_has_none_to_choose(tmp_path):
    path = tmp_path / "run.parquet"
    pq.write_table(pa.table(columns()), path)
    with pytest.raises(RecordingError, match=r"no episode 0, no column episode_index"):
        read_recording(path, ReadingOptions(episode=0))
    log = tmp_path / "run.csv"
    log.write_text("t,q1\n0,0\n")
    with pytest.raises(RecordingError, match=r"run\.csv: has no episodes.*Omit `episode=`"):
        read_recording(log, ReadingOptions(episode=0))


def test_damaged_tables_are_named(tmp_path):
    path = tmp_path / "run.parquet"
    pq.write_table(pa.table(columns()), path)
    whole = path.read_bytes()
    for damaged in (whole[:500], whole[:200] + b"\xff" * 300 + whole[500:], whole[:-30] + b"\xff" * 30):
        path.write_bytes(damaged)
        with pytest.raises(RecordingError, match=r"run\.parquet: damaged, "):
            read_recording(path)
    uneven = pa.table({"t": TIME, "position": pa.array([[1.0] * (1 + k % 2) for k in range(TIME.size)])})
    pq.write_table(uneven, path)
    with pytest.raises(RecordingError, match="damaged, "):
        read_recording(path)
