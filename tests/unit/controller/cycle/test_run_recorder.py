"""The recorder: content of its files, also after the writer was killed."""

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from mcap.reader import make_reader

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import CommissioningError, RecordingFailed
from armload_controller.cycle.arm_frames import FRAMES_TOPIC, ArmFrames
from armload_controller.cycle.plugins import CycleStep
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.motion.leg_interpolator import Reference
from armload_controller.motion.setpoints import Segment
from armload_drivers.servos import JointCommand, JointFeedback
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.run_format import MESSAGE_SCHEMA, TOPIC

N = 3
CYCLE_S = 0.004


def feedback(cycle, **changes):
    values = {
        "cycle": cycle,
        "time_s": 12.5 + cycle * CYCLE_S,
        "position_rad": np.array([0.1, -0.2, 0.3]) + 1e-3 * cycle,
        "velocity_rad_s": None,
        "current_a": np.array([1.0, 2.0, 3.0]) + cycle,
        "torque_nm": None,
        "statusword": np.full(N, 0x0637, np.uint16),
        "missing": np.zeros(N, bool),
    }
    return JointFeedback(**(values | changes))


COMMAND = JointCommand(np.array([0.1, 0.2, 0.3]), np.zeros(N), np.zeros(N))


def test_every_number_comes_back(tmp_path):
    path = tmp_path / "a.mcap"
    with Recorder(path, {"run.json": json.dumps({"robot": "x"})}) as recorder:
        for cycle in range(300):
            recorder.write(feedback(cycle), COMMAND, Segment.APPROACH, None)
    recording = read_recording_file(path)
    assert recording.time_s.shape == (300,)
    np.testing.assert_array_equal(recording.position_rad[7], feedback(7).position_rad)
    np.testing.assert_array_equal(recording.current_a[299], feedback(299).current_a)
    assert recording.torque_nm is None
    assert recording.source.run() == {"robot": "x"}
    assert not recording.source.truncated


def test_independent_readers_find_channel_schema_and_index(tmp_path):
    path = tmp_path / "a.mcap"
    with Recorder(path, {}, clock_ns=lambda: 1_700_000_000_000_000_000) as recorder:
        for cycle in range(200):
            recorder.write(feedback(cycle), COMMAND, Segment.PERIODS, cycle * CYCLE_S)
    with path.open("rb") as stream:
        reader = make_reader(stream)
        *_, (_, _, last) = reader.iter_messages()
        schema, channel, message = next(iter(reader.iter_messages()))
        assert reader.get_summary().statistics.message_count == 200
    assert (channel.topic, channel.message_encoding, schema.encoding) == (TOPIC, "json", "jsonschema")
    body = json.loads(message.data)
    assert set(body) <= set(MESSAGE_SCHEMA["properties"])
    assert set(MESSAGE_SCHEMA["required"]) <= set(body)
    assert message.log_time == 1_700_000_000_000_000_000
    assert last.log_time - message.log_time == pytest.approx(199 * CYCLE_S * 1e9)


def test_foxglove_gets_the_arm_in_3d_and_identification_does_not(tmp_path):
    """Read with the library's own reader, composed link by link, and compared with Pinocchio's flange."""
    robot = load_robot("er50")
    n, path = robot.n, tmp_path / "a.mcap"
    model = pin.Model()
    for i in range(n):
        axis = pin.JointModelRevoluteUnaligned(robot.chain.axis[i])
        model.addJoint(i, axis, pin.SE3(robot.chain.placement[i]), f"joint {i}")
    still, state_word = np.zeros(n), np.full(n, 0x1637, np.uint16)
    position = np.sin(0.02 * np.arange(100)[:, None] + np.arange(n))
    with Recorder(path, {}, frames=ArmFrames(robot.chain, robot.joint_names)) as recorder:
        for cycle, q in enumerate(position):
            measured = JointFeedback(cycle, 5.0 + 0.01 * cycle, q, still, still, None, state_word, still.astype(bool))
            recorder.write(measured, JointCommand(q, still, still), Segment.PERIODS, 0.01 * cycle)
    assert read_recording_file(path).size == 100
    with path.open("rb") as stream:
        frames = list(make_reader(stream).iter_messages(topics=[FRAMES_TOPIC]))
    assert 17 <= len(frames) <= 20
    assert {schema.name for schema, _, _ in frames} == {"foxglove.FrameTransforms"}
    for _, _, message in frames:
        pose, parent = np.eye(4), "base"
        for link in json.loads(message.data)["transforms"]:
            assert link["parent_frame_id"] == parent
            parent = link["child_frame_id"]
            shift = [link["translation"][key] for key in "xyz"]
            turn = [link["rotation"][key] for key in "xyzw"]
            pose = pose @ pin.SE3(pin.Quaternion(np.array(turn)).matrix(), np.array(shift)).homogeneous
            assert link["timestamp"]["sec"] * 10**9 + link["timestamp"]["nsec"] == message.log_time
        assert parent == "flange"
        data = model.createData()
        pin.forwardKinematics(model, data, position[message.sequence])
        np.testing.assert_allclose(pose, data.oMi[n].homogeneous @ robot.chain.flange, atol=1e-9)


def test_recordings_are_never_overwritten(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(CommissioningError, match="never overwritten"):
        Recorder(path, {})
    assert path.read_bytes() == b"precious"


def test_a_second_attempt_keeps_what_the_first_left(tmp_path):
    path = tmp_path / "a.mcap"
    for _ in range(2):
        with pytest.raises(ZeroDivisionError), Recorder(path, {}) as recorder:  # noqa: PT012
            for cycle in range(30):
                recorder.write(feedback(cycle), COMMAND, Segment.APPROACH, None)
            raise ZeroDivisionError
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.partial-2.mcap", "a.partial.mcap"]


def test_cycles_without_feedback_are_distinguished_from_measured_ones(tmp_path):
    path = tmp_path / "a.mcap"
    with Recorder(path, {}) as recorder:
        for cycle in range(60):
            missing = np.array([False, cycle in {20, 21}, False])
            recorder.write(feedback(cycle, missing=missing), COMMAND, Segment.APPROACH, None)
    recording = read_recording_file(path)
    assert recording.source.reasons == {"feedback missing": 2}
    assert len(recording.time_s) == 58


def test_a_full_disk_is_named(tmp_path):
    path = tmp_path / "a.mcap"
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, limit[1]))
    try:
        with pytest.raises(RecordingFailed, match="too large"), Recorder(path, {}) as recorder:  # noqa: PT012
            for cycle in range(10_000):
                recorder.write(feedback(cycle), COMMAND, Segment.APPROACH, None)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert not path.exists()


@contextmanager
def disk_of(size):
    """No file of this process can be larger than this."""
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limit[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)


def test_a_full_disk_ends_the_run_when_it_is_full_and_not_when_the_run_is_over(tmp_path):
    recorder = Recorder(tmp_path / "a.mcap", {})
    with disk_of(20_000):
        with pytest.raises(RecordingFailed, match="too large"):  # noqa: PT012
            for cycle in range(10_000):
                recorder.write(feedback(cycle), COMMAND, Segment.APPROACH, None)
        assert recorder.rows < 1000
        with pytest.raises(RecordingFailed):
            recorder.__exit__(None, None, None)
    assert [path.name for path in tmp_path.iterdir()] == ["a.partial.mcap"], "only a complete recording has its name"


def test_a_full_disk_is_named_when_something_is_attached(tmp_path):
    recorder = Recorder(tmp_path / "a.mcap", {})
    with disk_of(20_000):
        with pytest.raises(RecordingFailed, match="too large"):
            recorder.attach("payload.toml", "x" * 40_000)
        with pytest.raises(RecordingFailed):
            recorder.__exit__(None, None, None)


def test_a_full_disk_does_not_hide_why_the_run_has_ended(tmp_path):
    with disk_of(20_000), pytest.raises(ZeroDivisionError), Recorder(tmp_path / "a.mcap", {}) as recorder:  # noqa: PT012
        with pytest.raises(RecordingFailed):
            recorder.attach("payload.toml", "x" * 40_000)
        raise ZeroDivisionError


@pytest.mark.parametrize("known", ["command", "reference", "neither"])
def test_a_cycle_of_which_the_command_or_its_part_of_the_run_is_unknown_is_not_recorded(tmp_path, known):
    command = COMMAND if known == "command" else None
    still = np.zeros(N)
    reference = Reference(still, still, still, Segment.APPROACH, None) if known == "reference" else None
    with Recorder(tmp_path / "a.mcap", {}) as recorder:
        recorder.on_cycle(CycleStep(feedback(1), command, reference, None, None, None))
        assert recorder.rows == 0


def test_a_folder_that_went_away_is_named(tmp_path):
    folder = tmp_path / "runs"
    folder.mkdir()
    recorder = Recorder(folder / "a.mcap", {})
    recorder.write(feedback(1), COMMAND, Segment.APPROACH, None)
    shutil.rmtree(folder)
    with pytest.raises(RecordingFailed, match=r"a\.partial\.mcap could not be written: No such file"):
        recorder.__exit__(None, None, None)


def test_a_recording_that_is_removed_while_it_is_written_ends_the_run_at_the_next_flush(tmp_path):
    folder = tmp_path / "runs"
    folder.mkdir()
    with (  # noqa: PT012
        pytest.raises(RecordingFailed, match=r"a\.partial\.mcap was removed"),
        Recorder(folder / "a.mcap", {}) as recorder,
    ):
        recorder.write(feedback(1), COMMAND, Segment.APPROACH, None)
        shutil.rmtree(folder)
        for cycle in range(2, 60):
            recorder.write(feedback(cycle), COMMAND, Segment.APPROACH, None)


def test_a_disk_without_room_for_the_beginning_is_named_before_anything_is_switched_on(tmp_path):
    limit = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limit[1]))
    try:
        with pytest.raises(CommissioningError, match="choose an --output that can be written"):
            Recorder(tmp_path / "a.mcap", {"configuration.toml": "x" * 5000})
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
    assert list(tmp_path.iterdir()) == []


def test_a_run_of_which_nothing_was_recorded_leaves_no_file(tmp_path):
    with Recorder(tmp_path / "a.mcap", {"run.json": "{}"}):
        pass
    assert not list(tmp_path.iterdir())


def test_a_run_that_ends_with_an_error_stays_partial_and_whole(tmp_path):
    path = tmp_path / "a.mcap"
    with pytest.raises(ZeroDivisionError), Recorder(path, {}) as recorder:  # noqa: PT012
        for cycle in range(30):
            recorder.write(feedback(cycle), COMMAND, Segment.APPROACH, None)
        raise ZeroDivisionError
    assert not path.exists()
    recording = read_recording_file(tmp_path / "a.partial.mcap")
    assert len(recording.time_s) == 30
    assert not recording.source.truncated


PROMISED_S = 0.25
"""Longest part of a run that may be lost with the process."""


@pytest.mark.parametrize("cycle_s", [0.002, 0.004, 0.02, 0.03])
def test_the_file_is_never_more_than_a_quarter_of_a_second_behind(tmp_path, cycle_s):
    """The content of the file at any moment is what a kill -9 at that moment leaves."""
    partial = tmp_path / "a.partial.mcap"
    behind_s, size, held_s = [], 0, np.nan
    with Recorder(tmp_path / "a.mcap", {}) as recorder:
        for cycle in range(round(2.0 / cycle_s)):
            recorder.write(feedback(cycle, time_s=cycle * cycle_s), COMMAND, Segment.APPROACH, None)
            if partial.stat().st_size != size:
                size = partial.stat().st_size
                held_s = read_recording_file(partial).time_s[-1] if cycle * cycle_s > 1.0 else np.nan
            behind_s.append(cycle * cycle_s - held_s)
    assert np.count_nonzero(np.isfinite(behind_s)) > 20
    assert np.nanmax(behind_s) <= PROMISED_S


WRITER = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from test_run_recorder import COMMAND, CYCLE_S, feedback
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.motion.setpoints import Segment

with Recorder(Path(sys.argv[1]), {}) as recorder:
    for cycle in range(100_000):
        recorder.write(feedback(cycle), COMMAND, Segment.APPROACH, None)
        print(cycle, flush=True)
"""


def test_kill_minus_nine_loses_at_most_a_quarter_of_a_second(tmp_path):
    path = tmp_path / "killed.mcap"
    writer = subprocess.Popen(
        [sys.executable, "-c", WRITER, str(path), str(Path(__file__).parent)], stdout=subprocess.PIPE, text=True
    )
    for line in writer.stdout:
        if int(line) >= 1000:
            break
    os.kill(writer.pid, signal.SIGKILL)
    written = [int(line), *(int(rest) for rest in writer.stdout if rest.strip())][-1]
    writer.stdout.close()
    writer.wait(timeout=10)
    recording = read_recording_file(tmp_path / "killed.partial.mcap")
    assert recording.source.truncated
    lost_s = (feedback(written).time_s) - recording.time_s[-1]
    assert -CYCLE_S * 1.5 <= lost_s <= 0.25
    np.testing.assert_allclose(np.diff(recording.time_s), CYCLE_S, atol=1e-9)


def test_attachments_have_the_media_type_of_their_names(tmp_path):
    path = tmp_path / "a.mcap"
    with Recorder(path, {"run.json": "{}", "configuration.toml": ""}) as recorder:
        recorder.write(feedback(0), COMMAND, Segment.APPROACH, None)
    with path.open("rb") as file:
        kinds = {attached.name: attached.media_type for attached in make_reader(file).iter_attachments()}
    assert kinds == {"run.json": "application/json", "configuration.toml": "application/toml"}


def test_rows_and_phases_are_counted(tmp_path):
    with Recorder(tmp_path / "a.mcap", {}) as recorder:
        assert recorder.rows == 0
        for cycle in range(5):
            recorder.write(feedback(cycle), COMMAND, Segment.PERIODS, 0.5 * cycle if cycle > 1 else None)
        assert recorder.rows == 5
        phase_s, time_s = recorder.measured
        assert phase_s.tolist() == [1.0, 1.5, 2.0]
        assert time_s == pytest.approx([12.508, 12.512, 12.516])


def test_partial_names_are_counted_from_two(tmp_path):
    names = []
    for _ in range(3):
        recorder = Recorder(tmp_path / "a.mcap", {})
        recorder.write(feedback(0), COMMAND, Segment.APPROACH, None)
        names.append(recorder.partial.name)
        recorder.__exit__(RuntimeError, RuntimeError(), None)
    assert names == ["a.partial.mcap", "a.partial-2.mcap", "a.partial-3.mcap"]


@pytest.mark.parametrize(("cycles", "messages"), [(13, 1), (14, 2), (26, 2), (27, 3)])
def test_frames_of_the_links_are_written_every_50_milliseconds(tmp_path, cycles, messages):
    """Every 0.05 s: with cycles of 4 ms, 13 cycles later."""
    path = tmp_path / "a.mcap"
    robot = load_robot("er50")
    with Recorder(path, {}, frames=ArmFrames(robot.chain, robot.joint_names)) as recorder:
        for cycle in range(cycles):
            recorder.write(feedback(cycle, position_rad=np.zeros(6)), None, Segment.APPROACH, None)
    with path.open("rb") as file:
        assert sum(1 for _ in make_reader(file).iter_messages(FRAMES_TOPIC)) == messages
