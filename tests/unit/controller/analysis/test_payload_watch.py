"""Watching a recording: events of grasping and dropping, a growing file, and refusals."""

from __future__ import annotations

import re
from dataclasses import replace
from io import StringIO
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from armload_controller.analysis.arm_in_use import ArmInUse
from armload_controller.analysis.payload_watch import HeardBus, PayloadWatch, WatchedMoment, follow
from armload_controller.analysis.stated_drift import StatedDrift
from armload_controller.analysis.watch_history import WatchDiary
from armload_controller.cli.output.watch_output import moment_text, shown_moments
from armload_controller.cli.screen import Screen
from armload_identification.files.calibration_file import write_calibration
from armload_identification.identification_errors import EstimationError, RecordingError

IDLE_LOOKS = 10


@pytest.fixture(scope="module")
def calibration_file(calibration, tmp_path_factory):
    path = tmp_path_factory.mktemp("arm") / "arm.calibration.toml"
    write_calibration(path, calibration)
    return path


@pytest.fixture(scope="module")
def robot(pinocchio_arm):
    """The parts of a robot that a watch needs."""
    return SimpleNamespace(
        chain=pinocchio_arm.chain,
        transmission=pinocchio_arm.transmission,
        csv_columns=None,
        name="six",
        description="an arm",
        own=lambda run: run,
        joint_names=tuple(f"j{joint}" for joint in range(1, 7)),
        calibration_file=None,
    )


@pytest.fixture(scope="module")
def table(pinocchio_arm):
    """Lines of a table: the payload is grasped after one third of the time and dropped after two."""
    trajectory = pinocchio_arm.trajectory(6, period_s=10.0)
    empty, loaded = (pinocchio_arm.run(trajectory, load, seed=8 + load, with_phase=False) for load in (False, True))
    rows = min(empty.size, loaded.size)
    third = rows // 3
    current = empty.current_a[:rows].copy()
    current[third : 2 * third] = loaded.current_a[third : 2 * third]
    names = ["time_s", *(f"position_{j}" for j in range(1, 7)), *(f"current_{j}" for j in range(1, 7))]
    values = np.column_stack([loaded.time_s[:rows], loaded.position_rad[:rows], current])
    lines = [",".join(names), *(",".join(f"{value:.7f}" for value in row) for row in values)]
    return lines, float(loaded.time_s[third]), float(loaded.time_s[2 * third])


KINDS = ["something acts", "changed", "grasped", "something acts", "changed", "dropped"]


def events_of(moments):
    return [event for moment in moments for event in moment.events]


def test_grasped_and_dropped_are_reported_with_their_mass(robot, calibration_file, table, pinocchio_arm, tmp_path):
    lines, grasped_s, dropped_s = table
    path = tmp_path / "shift.csv"
    path.write_text("\n".join(lines) + "\n", "utf-8")
    moments = list(PayloadWatch(robot, calibration_file, 1.0).file(path))
    events = events_of(moments)
    assert [event.kind for event in events] == KINDS
    for event, at_s in zip(events, np.repeat([grasped_s, dropped_s], 3), strict=True):
        # the onset is that of the mean of 0.1 s in which the torque begins to rise
        assert -0.1 < event.time_s - at_s < 1.0
    mass_kg = pinocchio_arm.payload.mass_kg
    assert events[0].joints
    for event, change_kg in ((events[2], mass_kg), (events[5], -mass_kg)):
        assert abs(event.mass_kg - change_kg) < 2.0 * event.half_width_95_kg < 0.4 * mass_kg
    assert str(events[2]).startswith("grasped (+")
    document = moments[-1].to_dict("six")
    assert document["changes"] == 2
    assert document["center_of_mass_m"] == [None, None, None]


def test_a_growing_file_is_seen_once(robot, calibration_file, table, tmp_path):
    lines, *_ = table
    path = tmp_path / "shift.partial.csv"
    half = len(lines) // 2
    path.write_text("\n".join(lines[:half]) + "\n", "utf-8")
    watch = PayloadWatch(robot, calibration_file, 1.0)
    waits = []

    def wait(seconds):
        waits.append(seconds)
        if len(waits) == 1:
            path.write_text("\n".join(lines) + "\n", "utf-8")

    moments = list(follow(watch, path, wait, 0.5))
    stamps = [moment.payload.time_s for moment in moments]
    assert stamps == sorted(stamps)
    assert moments[-1].payload.refused == 0
    assert moments[-1].payload.time_s == pytest.approx(float(lines[-1].split(",")[0]))
    assert [event.kind for event in events_of(moments)] == KINDS
    assert len(waits) == IDLE_LOOKS + 2


def test_a_recording_that_gets_its_name_is_finished(robot, calibration_file, table, tmp_path):
    path = tmp_path / "shift.partial.csv"
    path.write_text("\n".join(table[0]) + "\n", "utf-8")
    moments = list(follow(PayloadWatch(robot, calibration_file), path, lambda _: path.unlink(), 0.5))
    assert moments[-1].payload.changes == 2


def test_what_does_not_fit_is_refused(robot, calibration_file, table, tmp_path):
    with pytest.raises(EstimationError, match="armload calibrate"):
        PayloadWatch(robot)
    lines, *_ = table
    path = tmp_path / "torque.csv"
    path.write_text("\n".join([lines[0].replace("current", "torque"), *lines[1:]]) + "\n", "utf-8")
    with pytest.raises(RecordingError, match="no current, which the arm was calibrated with"):
        list(PayloadWatch(robot, calibration_file).file(path))
    with pytest.raises(RecordingError, match="cannot be read"):
        list(follow(PayloadWatch(robot, calibration_file), tmp_path / "lost.csv", lambda _: None, 0.5))


def test_on_a_terminal_there_is_one_table_and_events_above_it(robot, calibration_file, table, tmp_path):
    path = tmp_path / "shift.csv"
    path.write_text("\n".join(table[0]) + "\n", "utf-8")
    moments = list(PayloadWatch(robot, calibration_file, 5.0).file(path))
    shown = Console(width=120, force_terminal=True, file=StringIO(), color_system=None)
    screen = Screen()
    screen.console = shown
    with shown_moments(screen, "six", robot.joint_names) as show:
        for moment in moments:
            show(moment)
    text = shown.file.getvalue()
    assert "grasped (+" in text
    assert moment_text(moments[-1]).strip() in text
    assert text.count("feedback frames missing") >= len(moments), "the table is drawn anew"
    lines = Console(width=200, file=StringIO())
    screen.console = lines
    with shown_moments(screen, "six", robot.joint_names) as show:
        for moment in moments:
            show(moment)
    assert [line for line in lines.file.getvalue().splitlines() if line == moment_text(moments[-1])]
    centred = replace(moments[-1].payload, values=np.array([1.0, -1e-5, 1e-5, 0.1]), determined=np.ones(4, dtype=bool))
    assert "centre 0 +- " in moment_text(replace(moments[-1], payload=centred))
    nothing = replace(centred, values=np.array([-1e-4, 0.0, 0.0, 0.0]))
    assert "s    0.000 +- " in moment_text(replace(moments[-1], payload=nothing)), "zero has no minus sign"
    bus = HeardBus(0, (0,) * 6, enabled=False, silent_s=1.0)
    assert "nothing received from the arm yet" in moment_text(WatchedMoment(0.0, None, bus=bus))
    assert repr(WatchedMoment(0.0, None, bus=bus)).splitlines()[1].split() == ["0.00", "not", "estimated", "free"]


@pytest.mark.parametrize("measured", [False, True])
def test_a_drift_of_the_gains_is_allowed_for_and_measured_by_a_reference(
    robot, calibration_file, pinocchio_arm, tmp_path, measured
):
    """All currents of the day are 2 % higher; what is assumed is printed once, and stands in the report."""
    arm = pinocchio_arm
    trajectory = arm.trajectory(6, period_s=10.0)
    loaded, empty = (arm.run(trajectory, load, seed=70 + load, with_phase=False) for load in (True, False))
    reference = replace(empty, current_a=1.02 * empty.current_a) if measured else None
    watching = PayloadWatch(robot, calibration_file, drift=StatedDrift(0.02, reference))
    diary, screen = WatchDiary(robot, watching, "a run"), Screen()
    screen.console = Console(width=500, file=StringIO())
    with shown_moments(screen, "six", robot.joint_names) as show:
        for part in np.array_split(np.arange(loaded.size), 20):
            watching.take(loaded.time_s[part], loaded.position_rad[part], 1.02 * loaded.current_a[part])
            show(watching.moment())
            diary.add(watching.moment())
    found = watching.moment().payload
    off, half = abs(found.mass_kg - arm.payload.mass_kg), found.half_width_95[0]
    assert off < half
    assert (off < 0.02 * arm.payload.mass_kg) == measured
    (note,) = [line for line in screen.console.file.getvalue().splitlines() if "all gains" in line.lower()]
    said = r"is corrected: -[12]\.\d+ \+- .* %" if measured else "2 %.*as stated.* 1 % would change the mass by"
    assert re.search(said, note)
    assert re.search(said, diary.history().drift)
    known = diary.history().known
    assert known[-1]
    assert not known[0]
    assert watching.moment().to_numbers()["gain_drift"] == found.gains.deviation


@pytest.mark.parametrize(
    ("stated", "message"),
    [
        (StatedDrift(0.5), "gain_drift is 0.5: expected .* at most 0.2"),
        (StatedDrift(None, None, 1.2), "reference_mass_kg is 1.2"),
        (StatedDrift(0.02), "requires the arm's calibration"),
    ],
)
def test_a_drift_that_cannot_be_used_is_refused(robot, stated, message):
    with pytest.raises(EstimationError, match=message):
        stated.session(robot, ArmInUse(robot.chain, robot.transmission))
