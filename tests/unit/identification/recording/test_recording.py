"""Recordings: rows that are read, rows that are left out and counted, rejected files and their messages."""

from __future__ import annotations

import json

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.csv_columns import CsvColumns
from armload_identification.recording.file_reading import read_recording
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.recording import Recording, check_joints
from armload_identification.recording.run_format import (
    EXCITATION_ATTACHMENT,
    MESSAGE_SCHEMA,
    RUN_ATTACHMENT,
    SCHEMA_NAME,
    TOPIC,
)

pytestmark = pytest.mark.pure

COLUMNS = ReadingOptions(CsvColumns(time=0, position=[1, 2], velocity=[3, 4], current=[5, 6]))


def messages(rows=60, joints=2, **changes):
    """Cycles of a plausible run; `changes` replaces keys, None removes them."""
    out = []
    for k in range(rows):
        t = 0.01 * k
        message = {
            "cycle": k,
            "time_s": 5.0 + t,
            "phase_s": None if k < 10 else round(t - 0.1, 9),
            "segment": "ramp_up" if k < 10 else "periods",
            "command_position_rad": [0.0] * joints,
            "position_rad": [float(np.sin(3.0 * t + j)) for j in range(joints)],
            "velocity_rad_s": [float(3.0 * np.cos(3.0 * t + j)) for j in range(joints)],
            "current_a": [0.1 * k + j for j in range(joints)],
            "torque_offset_nm": [0.0] * joints,
            "statusword": [0x0637] * joints,
            "missing": [False] * joints,
        }
        message.update(changes)
        out.append({key: value for key, value in message.items() if value is not None or key == "phase_s"})
    return out


def write_mcap(path, content, attachments=(), compression=CompressionType.NONE):
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=2000, compression=compression)
        writer.start()
        for name, text in attachments:
            writer.add_attachment(0, 0, name, "text/plain", text.encode())
        schema = writer.register_schema(SCHEMA_NAME, "jsonschema", json.dumps(MESSAGE_SCHEMA).encode())
        channel = writer.register_channel(TOPIC, "json", schema)
        other = writer.register_channel("/other", "json", schema)
        for message in content:
            data = message if isinstance(message, bytes) else json.dumps(message).encode()
            writer.add_message(channel, 0, data, 0)
            writer.add_message(other, 0, b'{"position_rad": [9, 9]}', 0)
        writer.finish()
    return path


def write_csv(path, rows):
    path.write_text("\n".join(rows) + "\n")
    return path


def csv_rows(rows=60, scale=1.0, velocity_scale=1.0):
    t = 0.01 * np.arange(rows)
    table = np.column_stack(
        [
            900.0 + t,
            scale * np.sin(3.0 * t),
            scale * np.cos(2.0 * t),
            velocity_scale * 3.0 * np.cos(3.0 * t),
            velocity_scale * -2.0 * np.sin(2.0 * t),
            0.5 + t,
            -t,
        ]
    )
    return [",".join(f"{value:.5f}" for value in row) for row in table]


@pytest.mark.parametrize("compression", [CompressionType.NONE, CompressionType.ZSTD])
def test_mcap_gives_every_number_back(tmp_path, compression):
    trajectory = FourierTrajectory(0.5, np.zeros(2), np.full((2, 3), 0.1), np.full((2, 3), 0.2))
    attachments = [
        (EXCITATION_ATTACHMENT, format_excitation(Excitation(trajectory, 4))),
        (RUN_ATTACHMENT, '{"load": "loaded", "robot": "er50"}'),
    ]
    content = messages()
    recording = read_recording(write_mcap(tmp_path / "a.mcap", content, attachments, compression))
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
    recording = read_recording(write_mcap(tmp_path / "a.mcap", content))
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
            recording = read_recording(cut)
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
    recording = read_recording(write_mcap(tmp_path / "a.mcap", content))
    assert len(recording.time_s) == 58
    assert recording.source.reasons == {"feedback missing": 2}
    assert recording.source.rows_read == 60
    assert recording.source.rows_dropped == 2


def test_malformed_messages_are_counted(tmp_path):
    content = messages()
    content[30] = b'{"time_s": 5.3, "position_rad": [0.1'
    content[31] = {**messages()[31], "position_rad": [0.1]}
    recording = read_recording(write_mcap(tmp_path / "a.mcap", content))
    assert len(recording.time_s) == 58
    assert recording.source.reasons == {"malformed message": 2}


def test_csv_with_and_without_a_header_line(tmp_path):
    plain = read_recording(write_csv(tmp_path / "a.csv", csv_rows()), COLUMNS)
    names = ReadingOptions(CsvColumns("t", ["q1", "q2"], current=["i1", "i2"]))
    headed = read_recording(write_csv(tmp_path / "b.csv", ["t,q1,q2,v1,v2,i1,i2", *csv_rows()]), names)
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
    read = [read_recording(path, COLUMNS) for path in (plain, other)]
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
    recording = read_recording(write_csv(tmp_path / "a.csv", rows), COLUMNS)
    assert recording.source.rows_read == 101
    assert dict(recording.source.reasons) == {
        "impossible value": 1,
        "not finite": 1,
        "wrong number of columns": 1,
        "not a number": 1,
        "time out of range": 1,
        "time not increasing": 2,
        "position jumps": 1,
        "truncated last row": 1,
    }
    assert recording.source.rows_dropped == 9
    left = [float(good[k].split(",")[0]) for k in range(100) if k not in (10, 11, 12, 13, 14, 20, 30, 40)]
    np.testing.assert_allclose(recording.time_s, left)


def test_one_wild_time_stamp_does_not_cost_the_rest(tmp_path):
    rows = csv_rows(100)
    rows[3] = "905.0" + rows[3][8:]
    recording = read_recording(write_csv(tmp_path / "a.csv", rows), COLUMNS)
    assert dict(recording.source.reasons) == {"time not increasing": 1}


@pytest.mark.parametrize(
    ("rows", "options", "said"),
    [
        ([""], COLUMNS, "is empty"),
        (csv_rows(), ReadingOptions(CsvColumns(0, [1, 2])), "neither motor current nor joint torque"),
        (
            csv_rows(),
            ReadingOptions(CsvColumns(0, [1, 2], current=[6, 7])),
            "have 7 columns, but the column map refers to column 7",
        ),
        (csv_rows(), ReadingOptions(CsvColumns("t", [1, 2], current=[5, 6])), "no header line"),
        (
            ["a,b,c,d,e,f,g", *csv_rows()],
            ReadingOptions(CsvColumns("t", [1, 2], current=[5, 6])),
            "no column 't' .* a, b, c",
        ),
        (["nan,nan,nan,nan,nan,nan,nan"] * 50, COLUMNS, "0 usable rows of 50 .50 not finite"),
        (csv_rows(12), COLUMNS, "12 usable rows"),
        (csv_rows(scale=57.29578), COLUMNS, "look like degrees"),
        (csv_rows(scale=57.29578 / 20), COLUMNS, None),
        (csv_rows(velocity_scale=57.29578), COLUMNS, "velocities look like degrees"),
    ],
)
def test_what_cannot_be_used_is_refused_with_the_reason(tmp_path, rows, options, said):
    path = write_csv(tmp_path / "log.csv", rows)
    if said is None:
        assert len(read_recording(path, options).time_s) == 60
        return
    with pytest.raises(RecordingError, match=said) as caught:
        read_recording(path, options)
    assert str(path) in str(caught.value)


def test_small_angles_in_degrees_betray_themselves_by_the_velocity(tmp_path):
    rows = csv_rows()
    table = np.array([[float(x) for x in row.split(",")] for row in rows])
    table[:, 1:3] *= 0.1 * 57.29578
    table[:, 3:5] *= 0.1
    path = write_csv(tmp_path / "log.csv", [",".join(f"{x:.6f}" for x in row) for row in table])
    with pytest.raises(RecordingError, match="positions look like degrees"):
        read_recording(path, COLUMNS)


def test_a_damaged_attachment_is_named(tmp_path):
    recording = read_recording(write_mcap(tmp_path / "a.mcap", messages(), [(RUN_ATTACHMENT, "{")]))
    with pytest.raises(RecordingError, match=r"run\.json is damaged"):
        recording.source.run()


def test_files_that_are_no_recording(tmp_path):
    with pytest.raises(RecordingError, match="cannot be read"):
        read_recording(tmp_path / "absent.mcap")
    empty = tmp_path / "empty.mcap"
    empty.write_bytes(b"")
    with pytest.raises(RecordingError, match="empty"):
        read_recording(empty)
    with pytest.raises(RecordingError, match="the table has no header line, so its columns are unknown"):
        read_recording(write_csv(tmp_path / "a.csv", csv_rows()))
    with pytest.raises(RecordingError, match="nothing was recorded"):
        read_recording(write_mcap(tmp_path / "none.mcap", []))


def test_another_arms_recording_is_refused(tmp_path):
    recording = read_recording(write_csv(tmp_path / "a.csv", csv_rows()), COLUMNS)
    check_joints(recording, 2)
    with pytest.raises(RecordingError, match=r"has 2 joints, the robot 6"):
        check_joints(recording, 6)


def test_joints_are_known_by_name_and_chosen_by_it(tmp_path):
    run = json.dumps({"robot": "er50", "joints": ["shoulder", "elbow", "wrist"]})
    excitation = Excitation(FourierTrajectory(0.5, np.zeros(3), np.eye(3), np.zeros((3, 3))), 4)
    attachments = [(RUN_ATTACHMENT, run), (EXCITATION_ATTACHMENT, format_excitation(excitation))]
    recording = read_recording(write_mcap(tmp_path / "a.mcap", messages(joints=3), attachments))
    assert recording.joint_names == ("shoulder", "elbow", "wrist")
    chosen = recording.named_joints(["wrist", "shoulder"])
    assert chosen.joint_names == ("wrist", "shoulder")
    for name in ("position_rad", "velocity_rad_s", "current_a"):
        np.testing.assert_array_equal(getattr(chosen, name), getattr(recording, name)[:, [2, 0]])
    np.testing.assert_array_equal(chosen.excitation.trajectory.sin_rad, np.eye(3)[[2, 0]])
    with pytest.raises(RecordingError, match="no joint named gripper; the recording has shoulder, elbow, wrist"):
        recording.named_joints(["shoulder", "gripper"])
    nameless = read_recording(write_csv(tmp_path / "a.csv", csv_rows()), COLUMNS)
    assert nameless.joint_names == ()
    with pytest.raises(RecordingError, match="does not name its joints"):
        nameless.named_joints(["shoulder"])


@pytest.mark.parametrize("joints", ['["a", "b", "c"]', '["a", "a"]', "[1, 2]", '"ab"', '["a", ""]', "{}"])
def test_joint_names_that_do_not_fit_are_none(tmp_path, joints):
    attachments = [(RUN_ATTACHMENT, f'{{"joints": {joints}}}')]
    assert read_recording(write_mcap(tmp_path / "a.mcap", messages(), attachments)).joint_names == ()


def test_a_long_runs_joints_are_chosen_with_all_that_was_kept_of_it(tmp_path):
    excitation = Excitation(FourierTrajectory(5.0, np.zeros(3), np.full((3, 1), 0.1), np.zeros((3, 1))), 4)
    content = messages(rows=200, joints=3)
    rng = np.random.default_rng(1)
    for k, message in enumerate(content):
        message |= {"phase_s": 0.01 * k, "current_a": rng.normal(size=3).round(3).tolist()}
    path = write_mcap(tmp_path / "a.mcap", content, [(EXCITATION_ATTACHMENT, format_excitation(excitation))])
    recording = read_recording(path, short_rows=50)
    chosen = recording.joints([2, 0])
    assert f"{recording.size} rows (average of {recording.average.periods} periods) of time_s, " in str(recording)
    order = np.ix_([2, 0], [2, 0])
    np.testing.assert_array_equal(chosen.average.effort_covariance, recording.average.effort_covariance[order])
    np.testing.assert_array_equal(chosen.repeats.bound, recording.repeats.bound[[2, 0]])
    np.testing.assert_array_equal(chosen.current_a, recording.current_a[:, [2, 0]])


def test_names_given_with_arrays_must_be_as_many_as_the_joints():
    time_s, position = 0.01 * np.arange(30.0), np.sin(np.arange(60.0)).reshape(30, 2) * 0.01
    run = Recording.from_arrays(time_s, position, torque_nm=position, joint_names=["a", "b"])
    assert run.named_joints(["b"]).n == 1
    for names in (["a"], ["a", "a"]):
        with pytest.raises(RecordingError, match="expected 2 different names"):
            Recording.from_arrays(time_s, position, torque_nm=position, joint_names=names)
