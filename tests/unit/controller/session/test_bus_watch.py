"""A live arm: moments before there is anything to estimate, and events in its recording."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from types import SimpleNamespace

import numpy as np
import pytest
from jsonschema import validate
from mcap.reader import make_reader

from armload_controller.analysis.payload_watch import PayloadWatch
from armload_controller.analysis.watch_history import WatchDiary
from armload_controller.cli.output.watch_output import moment_text
from armload_controller.control_errors import CommissioningError
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.session import bus_watch
from armload_controller.session.bus_watch import BusWatch
from armload_drivers.cia402.arm_settings import EffortFeedback
from armload_drivers.listening.overheard_arm import OverheardCycle
from armload_drivers.servos import JointFeedback
from armload_identification.files.calibration_file import write_calibration
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import Effort
from armload_identification.recording.run_format import EVENTS_TOPIC, TOPIC

SILENT, STEP_S = 25, 0.1


def cycle(number, *, enabled=True, step_s=STEP_S, position=(0.0,) * 6, current=(0.0,) * 6):
    """A cycle of an arm whose clock began long ago."""
    feedback = JointFeedback(
        cycle=number,
        time_s=5000.0 + step_s * number,
        position_rad=np.array(position),
        velocity_rad_s=None,
        current_a=np.array(current),
        torque_nm=None,
        statusword=np.zeros(6, dtype=np.uint16),
        missing=np.zeros(6, dtype=np.bool_),
    )
    return OverheardCycle(feedback, None, enabled=enabled)


@pytest.fixture
def robot(pinocchio_arm):
    return SimpleNamespace(
        name="six",
        description="",
        file="six.toml",
        n=6,
        chain=pinocchio_arm.chain,
        transmission=pinocchio_arm.transmission,
        joint_names=tuple(f"j{joint}" for joint in range(1, 7)),
        calibration_file=None,
    )


@pytest.fixture
def payload(robot, calibration, tmp_path):
    write_calibration(tmp_path / "arm.calibration.toml", calibration)
    return PayloadWatch(robot, tmp_path / "arm.calibration.toml")


@pytest.mark.parametrize("enabled", [False, True])
def test_silence_before_the_first_cycle(robot, payload, enabled):
    cycles = iter([*[None] * SILENT, *(cycle(number, enabled=enabled) for number in range(15))])
    ticks = iter(STEP_S * np.arange(1000.0))
    left = iter(range(SILENT + 15))
    watching = BusWatch(robot, payload, None, 1.0, clock=lambda: next(ticks), effort=Effort.CURRENT)
    moments = list(watching.moments(cycles, lambda: next(left, None) is not None))
    assert [each.time_s for each in moments] == pytest.approx([None, None, 5001.0, 5001.4])
    diary = WatchDiary(robot, payload, "here")
    for each in moments:
        diary.add(each)
        json.dumps(each.to_dict("six"), allow_nan=False)
    assert moment_text(moments[0]).strip() == "nothing received from the arm yet"
    assert np.array_equal(diary.history().time_s, [5001.0, 5001.4])


@pytest.mark.long
def test_events_are_recorded_beside_the_rows(robot, payload, pinocchio_arm, tmp_path):
    trajectory = pinocchio_arm.trajectory(6, period_s=10.0)
    empty, loaded = (pinocchio_arm.run(trajectory, load, seed=8 + load, with_phase=False) for load in (False, True))
    half = empty.size // 2
    step_s = float(np.median(np.diff(empty.time_s)))
    rows = [*zip(empty.position_rad, empty.current_a, strict=True)][:half]
    rows += [*zip(loaded.position_rad, loaded.current_a, strict=True)][half:]
    cycles = [cycle(k, step_s=step_s, position=q, current=i) for k, (q, i) in enumerate(rows)]
    path = tmp_path / "shift.mcap"
    left = iter(range(len(cycles)))
    with Recorder(path, {}) as recorder:
        watching = BusWatch(robot, payload, recorder, 1.0, effort=Effort.CURRENT)
        moments = list(watching.moments(iter(cycles), lambda: next(left, None) is not None))
    found = [event for moment in moments for event in moment.events]
    assert [event.kind for event in found] == ["something acts", "changed", "grasped"]
    with path.open("rb") as file:
        recorded = [(schema, message) for schema, _, message in make_reader(file).iter_messages(EVENTS_TOPIC)]
        file.seek(0)
        begun_ns = next(message.log_time for _, _, message in make_reader(file).iter_messages(TOPIC))
    assert sorted((json.loads(each.data) for _, each in recorded), key=str) == sorted(
        json.loads(json.dumps([asdict(event) for event in found])), key=str
    )
    for schema, each in recorded:
        event = json.loads(each.data)
        validate(event, json.loads(schema.data))
        assert each.log_time - begun_ns == pytest.approx(1e9 * (event["time_s"] - 5000.0), abs=1e3)
    assert read_recording_file(path).size == len(cycles)


def test_a_recording_under_another_master_says_so_and_what_the_arm_carries(monkeypatch, tmp_path):
    given = []
    monkeypatch.setattr(bus_watch, "robot_recorder", lambda *values: given.append(values) or "recorder")
    assert bus_watch.recorder_of("robot", tmp_path, None) == "recorder"
    bus_watch.recorder_of("robot", tmp_path, "loaded")
    assert given == [
        ("robot", tmp_path, {"overheard": True}),
        ("robot", tmp_path, {"overheard": True, "load": "loaded"}),
    ]


@pytest.mark.parametrize(("reported", "effort"), [("CURRENT", Effort.CURRENT), ("TORQUE", Effort.TORQUE)])
def test_another_effort_than_the_calibrations_is_refused(robot, payload, reported, effort):
    drives = [SimpleNamespace(feedback=EffortFeedback[reported])]
    robot.drives = SimpleNamespace(settings=SimpleNamespace(drives=drives))
    if effort is payload.effort:
        BusWatch(robot, payload, None)
        return
    with pytest.raises(CommissioningError, match=r"report torque, .* calibrated with current\. Calibrate it from"):
        BusWatch(robot, payload, None)
    with pytest.raises(CommissioningError, match=r"Give --effort current if .* else calibrate it from"):
        BusWatch(robot, payload, None, effort=effort)


def test_moments_come_at_their_period_and_count_what_was_lost(robot):
    found = [replace(cycle(number, enabled=number % 2 == 0), lost=number % 3) for number in range(25)]
    left = iter(range(25))
    watching = BusWatch(robot, None, None, 1.0, clock=lambda: 0.0, effort=Effort.CURRENT)
    moments = list(watching.moments(iter(found), lambda: next(left, None) is not None))
    assert [each.time_s for each in moments] == pytest.approx([5001.0, 5002.0, 5002.4])
    assert [each.bus.cycles for each in moments] == [11, 21, 25]
    assert [each.bus.lost for each in moments] == [10, 21, 24]
