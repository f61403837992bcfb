"""Recordings: files that are none, joints and their names."""

from __future__ import annotations

import json

import numpy as np
import pytest

from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.recording import Recording, check_joints, hashes_by_name
from armload_identification.recording.run_format import (
    EXCITATION_ATTACHMENT,
    RUN_ATTACHMENT,
)
from tests.recording_files import csv_rows, messages, table_columns, write_csv, write_mcap

pytestmark = pytest.mark.pure

COLUMNS = ReadingOptions(table_columns(time=0, position=[1, 2], velocity=[3, 4], current=[5, 6]))


def test_files_that_are_no_recording(tmp_path):
    with pytest.raises(RecordingError, match="cannot be read"):
        read_recording_file(tmp_path / "absent.mcap")
    empty = tmp_path / "empty.mcap"
    empty.write_bytes(b"")
    with pytest.raises(RecordingError, match="empty"):
        read_recording_file(empty)
    with pytest.raises(RecordingError, match="the table has no header line, so its 7 columns are unknown"):
        read_recording_file(write_csv(tmp_path / "a.csv", csv_rows()))
    with pytest.raises(RecordingError, match="nothing was recorded"):
        read_recording_file(write_mcap(tmp_path / "none.mcap", []))


def test_another_arms_recording_is_refused(tmp_path):
    recording = read_recording_file(write_csv(tmp_path / "a.csv", csv_rows()), COLUMNS)
    check_joints(recording, 2)
    with pytest.raises(RecordingError, match=r"has 2 joints, the robot 6"):
        check_joints(recording, 6)


def test_joints_are_known_by_name_and_chosen_by_it(tmp_path):
    run = json.dumps({"robot": "er50", "joints": ["shoulder", "elbow", "wrist"]})
    excitation = Excitation(FourierTrajectory(0.5, np.zeros(3), np.eye(3), np.zeros((3, 3))), 4)
    attachments = [(RUN_ATTACHMENT, run), (EXCITATION_ATTACHMENT, format_excitation(excitation))]
    recording = read_recording_file(write_mcap(tmp_path / "a.mcap", messages(joints=3), attachments))
    assert recording.joint_names == ("shoulder", "elbow", "wrist")
    chosen = recording.named_joints(["wrist", "shoulder"])
    assert chosen.joint_names == ("wrist", "shoulder")
    for name in ("position_rad", "velocity_rad_s", "current_a"):
        np.testing.assert_array_equal(getattr(chosen, name), getattr(recording, name)[:, [2, 0]])
    np.testing.assert_array_equal(chosen.excitation.trajectory.sin_rad, np.eye(3)[[2, 0]])
    with pytest.raises(RecordingError, match="no joint named gripper; the recording has shoulder, elbow, wrist"):
        recording.named_joints(["shoulder", "gripper"])
    nameless = read_recording_file(write_csv(tmp_path / "a.csv", csv_rows()), COLUMNS)
    assert nameless.joint_names == ()
    with pytest.raises(RecordingError, match="does not name its joints"):
        nameless.named_joints(["shoulder"])


def test_a_long_runs_joints_are_chosen_with_all_that_was_kept_of_it(tmp_path):
    excitation = Excitation(FourierTrajectory(5.0, np.zeros(3), np.full((3, 1), 0.1), np.zeros((3, 1))), 4)
    content = messages(rows=200, joints=3)
    rng = np.random.default_rng(1)
    for k, message in enumerate(content):
        message |= {"phase_s": 0.01 * k, "current_a": rng.normal(size=3).round(3).tolist()}
    path = write_mcap(tmp_path / "a.mcap", content, [(EXCITATION_ATTACHMENT, format_excitation(excitation))])
    recording = read_recording_file(path, short_rows=50)
    chosen = recording.joints([2, 0])
    assert f"{recording.size} rows (average of {recording.average.periods} periods) of time_s, " in str(recording)
    order = np.ix_([2, 0], [2, 0])
    np.testing.assert_array_equal(chosen.average.effort_covariance, recording.average.effort_covariance[order])
    np.testing.assert_array_equal(chosen.repeats.bound, recording.repeats.bound[[2, 0]])
    np.testing.assert_array_equal(chosen.current_a, recording.current_a[:, [2, 0]])


def test_two_recordings_of_one_name_keep_both_hashes():
    time_s, position = 0.01 * np.arange(30.0), np.sin(np.arange(60.0)).reshape(30, 2) * 0.01
    one, other = (Recording.from_arrays(time_s, position, torque_nm=k * position).source for k in (1, 2))
    assert set(hashes_by_name([one, other]).values()) == {one.sha256, other.sha256}


def test_names_given_with_arrays_must_be_as_many_as_the_joints():
    time_s, position = 0.01 * np.arange(30.0), np.sin(np.arange(60.0)).reshape(30, 2) * 0.01
    run = Recording.from_arrays(time_s, position, torque_nm=position, joint_names=["a", "b"])
    assert run.named_joints(["b"]).n == 1
    for names in (["a"], ["a", "a"]):
        with pytest.raises(RecordingError, match="expected 2 different names"):
            Recording.from_arrays(time_s, position, torque_nm=position, joint_names=names)


def test_rows_whose_effort_jumps_on_several_joints_are_left_out_but_a_hard_stop_is_kept(pair):
    def with_effort(factor):
        return Recording.from_arrays(loaded.time_s, loaded.position_rad, current_a=factor * loaded.current_a)

    loaded = pair[0]
    jumps = np.random.default_rng(3).random(len(loaded.time_s)) < 0.01
    spoiled = with_effort(np.where(jumps, 5.0, 1.0)[:, None])
    (reason,) = spoiled.source.reasons.values()
    assert 0.9 * jumps.sum() < reason <= jumps.sum()
    assert not np.isin(spoiled.time_s, loaded.time_s[jumps]).sum() > 0.1 * jumps.sum()
    stop = np.ones((len(loaded.time_s), 1))
    stop[-5:-3] = [[-6.0], [-3.0]]
    assert with_effort(stop).source.rows_dropped == 0
    one = np.ones_like(loaded.current_a)
    one[jumps, 2] = 5.0
    assert with_effort(one).source.rows_dropped == 0, "one joint may do so by itself"
