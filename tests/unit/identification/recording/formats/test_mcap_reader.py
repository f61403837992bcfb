"""Runs in MCAP: rows that are read, rows that are left out and counted, attachments."""

from __future__ import annotations

import numpy as np
import pytest
from mcap.writer import CompressionType

from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.run_format import (
    EXCITATION_ATTACHMENT,
    RUN_ATTACHMENT,
)
from tests.recording_files import messages, write_mcap

pytestmark = pytest.mark.pure


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD])
def test_mcap_gives_every_number_back(tmp_path, compression):
    trajectory = FourierTrajectory(0.5, np.zeros(2), np.full((2, 3), 0.1), np.full((2, 3), 0.2))
    attachments = [
        (EXCITATION_ATTACHMENT, format_excitation(Excitation(trajectory, 4))),
        (RUN_ATTACHMENT, '{"load": "loaded", "robot": "er50"}'),
    ]
    content = messages()
    recording = read_recording_file(write_mcap(tmp_path / "a.mcap", content, attachments, compression))
    np.testing.assert_array_equal(recording.time_s, [m["time_s"] for m in content])
    for key in ("position_rad", "velocity_rad_s", "current_a"):
        np.testing.assert_array_equal(getattr(recording, key), [m[key] for m in content])
    assert recording.torque_nm is None
    assert np.isnan(recording.phase_s[:10]).all()
    np.testing.assert_array_equal(recording.phase_s[10:], [m["phase_s"] for m in content[10:]])
    assert recording.excitation.periods == 4
    np.testing.assert_array_equal(recording.excitation.trajectory.sin_rad, trajectory.sin_rad)
    assert recording.source.run() == {"load": "loaded", "robot": "er50"}
    assert not recording.source.truncated
    assert recording.source.rows_dropped == 0


def test_a_torque_arm_has_torque_and_no_current(tmp_path):
    content = messages(current_a=None, velocity_rad_s=None, torque_nm=[1.5, -2.5])
    content[7]["torque_nm"] = [1.0, -2.0]
    recording = read_recording_file(write_mcap(tmp_path / "a.mcap", content))
    assert recording.current_a is None
    assert recording.velocity_rad_s is None
    assert recording.phase_s is None
    np.testing.assert_array_equal(recording.torque_nm[[6, 7]], [[1.5, -2.5], [1.0, -2.0]])


def test_a_file_cut_anywhere_reads_to_its_last_whole_part_or_says_why_not(tmp_path):
    content = messages(rows=120)
    whole = write_mcap(tmp_path / "whole.mcap", content).read_bytes()
    cut = tmp_path / "cut.mcap"
    rows = []
    for size in (*range(0, len(whole) - 10, 193), *range(len(whole) - 10, len(whole))):
        cut.write_bytes(whole[:size])
        try:
            recording = read_recording_file(cut)
        except RecordingError:
            rows.append(0)
            continue
        assert recording.source.truncated
        np.testing.assert_array_equal(
            recording.position_rad, [m["position_rad"] for m in content[: len(recording.time_s)]]
        )
        rows.append(len(recording.time_s))
    assert rows == sorted(rows)
    assert rows[-1] == 120


def test_cycles_with_missing_feedback_are_left_out_and_counted(tmp_path):
    content = messages()
    content[20]["missing"] = [False, True]
    content[21]["missing"] = [True, True]
    recording = read_recording_file(write_mcap(tmp_path / "a.mcap", content))
    assert len(recording.time_s) == 58
    assert recording.source.reasons == {"feedback missing": 2}
    assert recording.source.rows_read == 60
    assert recording.source.rows_dropped == 2


def test_malformed_messages_are_counted(tmp_path):
    content = messages()
    content[30] = b'{"time_s": 5.3, "position_rad": [0.1'
    content[31] = {**messages()[31], "position_rad": [0.1]}
    recording = read_recording_file(write_mcap(tmp_path / "a.mcap", content))
    assert len(recording.time_s) == 58
    assert recording.source.reasons == {"malformed message": 2}


def test_a_damaged_attachment_is_named(tmp_path):
    recording = read_recording_file(write_mcap(tmp_path / "a.mcap", messages(), [(RUN_ATTACHMENT, "{")]))
    with pytest.raises(RecordingError, match=r"run\.json is damaged"):
        recording.source.run()


def test_a_digit_that_changed_in_a_file_without_chunks_is_noticed(tmp_path):
    """The checksum of the whole data section, which some writers state, protects what no chunk's does."""
    path = write_mcap(tmp_path / "a.mcap", messages(), use_chunking=False, enable_data_crcs=True)
    assert read_recording_file(path).source.rows_dropped == 0
    whole = path.read_bytes()
    at = whole.index(b'"current_a": [') + 14
    path.write_bytes(whole[:at] + b"9" + whole[at + 1 :])
    with pytest.raises(RecordingError, match="the checksum of its data section is wrong"):
        read_recording_file(path)


@pytest.mark.parametrize("joints", ['["a", "b", "c"]', '["a", "a"]', "[1, 2]", '"ab"', '["a", ""]', "{}"])
def test_joint_names_that_do_not_fit_are_none(tmp_path, joints):
    attachments = [(RUN_ATTACHMENT, f'{{"joints": {joints}}}')]
    assert read_recording_file(write_mcap(tmp_path / "a.mcap", messages(), attachments)).joint_names == ()


def test_the_checksum_of_a_file_of_many_parts_is_right(tmp_path):
    """Of 64 kB each, the last one shorter."""
    content = messages(rows=600)
    path = write_mcap(tmp_path / "a.mcap", content, use_chunking=False, enable_data_crcs=True)
    assert path.stat().st_size > 2 * 2**16
    assert read_recording_file(path).size == 600


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({}, None),
        ({"missing": [False]}, "malformed message"),
        ({"missing": [False, True]}, "feedback missing"),
        ({"position_rad": [0.1]}, "malformed message"),
        ({"current_a": [0.1, 0.2, 0.3]}, "malformed message"),
        ({"current_a": "none"}, "malformed message"),
        ({"time_s": None}, "not finite"),
    ],
)
def test_messages_that_are_written_in_another_order_are_read_too(tmp_path, changes, reason):
    """With the keys sorted, and without those that are not needed."""
    content = []
    for k, message in enumerate(messages()):
        message.pop("missing")
        content.append(dict(sorted({**message, **(changes if k == 30 else {})}.items())))
    found = read_recording_file(write_mcap(tmp_path / "a.mcap", content))
    assert dict(found.source.reasons) == ({} if reason is None else {reason: 1})
    kept = [message for k, message in enumerate(content) if reason is None or k != 30]
    for name in ("time_s", "position_rad", "current_a"):
        np.testing.assert_array_equal(getattr(found, name), [message[name] for message in kept])


def test_without_a_usable_message_the_topics_that_there_are_are_named(tmp_path):
    with pytest.raises(RecordingError, match=r"no usable message on /\S+, so nothing was recorded; it has /other\. "):
        read_recording_file(write_mcap(tmp_path / "a.mcap", [b"{}"] * 5))
