"""NumPy archives: names of arrays, damage, and what is no recording."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.file_reading import read_recording_file
from tests.three_joints import NAMES, POSITION, TIME, TORQUE, assert_read


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_an_archive_of_arrays(tmp_path, save):
    path = tmp_path / "run.npz"
    save(path, time_s=TIME, position_rad=POSITION, torque_nm=TORQUE, joint_names=NAMES, other=np.zeros(3))
    assert_read(read_recording_file(path), NAMES)
    save(path, t=TIME.astype(np.float32), q=POSITION.astype(np.float32), tau=TORQUE)
    assert_read(read_recording_file(path))


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
        read_recording_file(path)


def test_objects_are_not_unpickled_and_damage_is_named(tmp_path):
    path = tmp_path / "run.npz"
    np.savez(path, time_s=np.array([{"a": 1}], dtype=object), position_rad=POSITION)
    with pytest.raises(RecordingError, match=r"run\.npz: damaged, "):
        read_recording_file(path)
    np.savez_compressed(path, time_s=TIME, position_rad=POSITION, torque_nm=TORQUE)
    whole = path.read_bytes()
    for place in range(0, len(whole), 61):
        damaged = bytearray(whole)
        damaged[place] ^= 0x41
        path.write_bytes(damaged)
        try:
            assert_read(read_recording_file(path))
        except RecordingError as error:
            assert "run.npz" in str(error)  # noqa: PT017
        except AssertionError:
            pass
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(RecordingError, match="damaged, "):
        read_recording_file(path)
