"""NumPy archives: names of arrays, damage, and what is no recording."""

from __future__ import annotations

import json

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.file_reading import read_recording

TIME = 0.01 * np.arange(90)
POSITION = np.column_stack([np.sin(TIME), np.cos(2.0 * TIME), 0.5 * TIME])
TORQUE = 3.0 * POSITION + 1.0
NAMES = ["shoulder", "elbow", "wrist"]


def assert_read(recording, names=()):
    np.testing.assert_allclose(recording.time_s, TIME, atol=1e-7)
    np.testing.assert_allclose(recording.position_rad, POSITION, atol=1e-6)
    np.testing.assert_allclose(recording.torque_nm, TORQUE, atol=1e-6)
    assert recording.joint_names == tuple(names)
    assert len(recording.source.sha256) == 64
    assert recording.source.rows_read == TIME.size


def columns(position="q{}", torque="tau{}"):
    return {
        "t": TIME,
        **{position.format(j + 1): POSITION[:, j] for j in range(3)},
        **{torque.format(j + 1): TORQUE[:, j] for j in range(3)},
    }


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


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_an_archive_of_arrays(tmp_path, save):
    path = tmp_path / "run.npz"
    save(path, time_s=TIME, position_rad=POSITION, torque_nm=TORQUE, joint_names=NAMES, other=np.zeros(3))
    assert_read(read_recording(path), NAMES)
    save(path, t=TIME.astype(np.float32), q=POSITION.astype(np.float32), tau=TORQUE)
    assert_read(read_recording(path))


@pytest.mark.parametrize(
    ("arrays", "said"),
    [
        ({"time_s": TIME, "torque_nm": TORQUE}, "no array position_rad; the archive has time_s, torque_nm"),
        ({"time_s": TIME, "position_rad": POSITION, "torque_nm": TORQUE[:50]}, r"torque_nm has shape \(50, 3\)"),
        ({"time_s": TIME, "position_rad": np.ascontiguousarray(POSITION.T), "torque_nm": TORQUE}, "shape"),
        ({"time_s": TIME, "position_rad": TIME}, "shape"),
        ({"time_s": TIME, "position_rad": np.asfortranarray(POSITION), "torque_nm": TORQUE}, "row by row"),
        ({"time_s": TIME, "position_rad": POSITION + 1j, "torque_nm": TORQUE}, "real numbers"),
        ({"time_s": TIME, "position_rad": POSITION}, "neither motor current nor joint torque"),
    ],
)
def test_arrays_that_are_no_recording_are_refused(tmp_path, arrays, said):
    path = tmp_path / "run.npz"
    np.savez(path, **arrays)
    with pytest.raises(RecordingError, match=said):
        read_recording(path)


def test_objects_are_not_unpickled_and_damage_is_named(tmp_path):
    path = tmp_path / "run.npz"
    np.savez(path, time_s=np.array([{"a": 1}], dtype=object), position_rad=POSITION)
    with pytest.raises(RecordingError, match=r"run\.npz: damaged, "):
        read_recording(path)
    np.savez_compressed(path, time_s=TIME, position_rad=POSITION, torque_nm=TORQUE)
    whole = path.read_bytes()
    for place in range(0, len(whole), 61):
        damaged = bytearray(whole)
        damaged[place] ^= 0x41
        path.write_bytes(damaged)
        try:
            assert_read(read_recording(path))
        except RecordingError as error:
            assert "run.npz" in str(error)  # noqa: PT017
        except AssertionError:
            pass
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(RecordingError, match="damaged, "):
        read_recording(path)
