"""`armload commission`: recordings that are taken up later, and arguments that are checked before the arm is opened."""

import json
import os
import re
import shutil
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.cli.arm_commands import commission_command
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import CommissioningError
from armload_controller.session.commissioning import ROLES, read_pair
from armload_identification.identification_errors import EstimationError


@pytest.mark.long
def test_four_recordings_without_a_report_are_taken_to_one(armload, recorded, recorded_er50):
    """Other files of an earlier start do not matter."""
    shutil.copy(recorded_er50 / "runs" / "today" / "payload.toml", recorded)
    before = {path.name: path.stat().st_mtime_ns for path in recorded.iterdir()}
    result = armload("commission", "er50", "--output", recorded)
    assert result.exit_code in (0, 3), result.output
    assert "unloaded: already recorded" in result.output
    assert "loaded: already recorded" in result.output
    assert "connecting" not in result.output
    assert (recorded / "payload.toml").is_file()
    assert (recorded / "report.html").is_file()
    recordings = {name: when for name, when in before.items() if name.endswith(".mcap")}
    assert {name: (recorded / name).stat().st_mtime_ns for name in recordings} == recordings
    assert (recorded / "payload.toml").stat().st_mtime_ns > before["payload.toml"]
    again = armload("commission", "er50", "--output", recorded)
    assert "already contains these recordings" in str(again.exception)


def test_recordings_that_do_not_belong_together_are_not_taken_up(recorded):
    robot = load_robot("er50")
    assert read_pair(robot, recorded, "identification")[0].n == robot.n
    with pytest.raises(CommissioningError, match="was recorded on er50, not on prbt"):
        read_pair(load_robot("prbt"), recorded, "identification")
    (recorded / "loaded_identification.mcap").unlink()
    os.link(recorded / "loaded_validation.mcap", recorded / "loaded_identification.mcap")
    with pytest.raises(CommissioningError, match=r"the identification runs .* followed different excitations"):
        read_pair(robot, recorded, "identification")


@pytest.mark.parametrize(
    ("words", "problem"),
    [
        (("--mass-kg", "0"), "mass_kg=` is 0.0 kg; expected a number above 0"),
        (("--calibration", "arm.calibration.toml"), "arm.calibration.toml: the calibration belongs to an arm with"),
        (("--calibration", "nofile.toml"), "nofile.toml"),
        (("--output", "/proc"), "/proc cannot be written to"),
    ],
    ids=["mass", "another arm", "no file", "read-only folder"],
)
def test_arguments_are_checked_before_the_arm_is_opened(armload, recorded_er50, tmp_path, monkeypatch, words, problem):
    monkeypatch.chdir(recorded_er50 / "runs" / "today")
    monkeypatch.setattr("armload_controller.session.arm_access.open_arm", None)
    result = armload("commission", "prbt", "--output", tmp_path / "new", *words)
    assert result.exit_code == 1
    assert problem in str(result.exception)
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("stated", [("--gain-drift", "3%"), ("--reference-mass", "1.2")])
def test_a_drift_that_cannot_be_used_is_refused_before_anything_moves(armload, tmp_path, stated):
    result = armload("commission", "er50", "--output", tmp_path / "run", *stated)
    assert isinstance(result.exception, EstimationError)
    assert not (tmp_path / "run").exists()


# Halves of a commissioning, without an arm ---------------------------------------------------------------------------


@pytest.fixture
def recorded_halves(monkeypatch):
    """Loads that the command has recorded; nothing is moved, and nothing evaluated."""
    halves = []

    def record_half(arm, load, open_servos, operator, plan):
        halves.append((str(load), plan, operator.consent.given))
        for role in ROLES:
            (plan.directory / f"{load}_{role}.mcap").touch()
        return [SimpleNamespace(duration_s=30.0, missing=np.array([1, 2]), skipped=4)] * 2

    def evaluate(arm, plan, tolerance, created):
        raise EstimationError(f"evaluated with {tolerance.mass_share:g}")

    monkeypatch.setattr("armload_controller.session.commissioning.record_half", record_half)
    monkeypatch.setattr("armload_controller.session.commissioning_results.evaluate", evaluate)
    monkeypatch.setattr("armload_controller.session.arm_access.open_arm", None)
    return halves


def test_both_halves_are_recorded_and_evaluated(armload, recorded_halves, tmp_path):
    result = armload("commission", "prbt", "--output", tmp_path, "--mass-kg", "2", "--tolerance", "0.05", "0.01")
    assert str(result.exception) == "evaluated with 0.05"
    assert [load for load, *_ in recorded_halves] == ["unloaded", "loaded"]
    plans = {(plan.directory, plan.mass_kg, plan.slow_only) for _, plan, _ in recorded_halves}
    assert plans == {(tmp_path, 2.0, False)}
    assert "payload 'gripper' mounted on the simulated flange\n" in result.output
    assert re.search(
        r"unloaded: 60 s of motion in 0 s \(.* times real time\), 6 feedback frames missing, 8 cycles sk", result.output
    )


def test_consent_is_given_by_yes_alone(armload, recorded_halves, tmp_path):
    for words, given in ((), False), (("--yes",), True):
        armload("commission", "prbt", "--output", tmp_path / str(given), *words)
        assert {agreed for *_, agreed in recorded_halves} == {given}
        recorded_halves.clear()


def test_the_empty_half_says_how_to_go_on_and_the_loaded_one_requires_it(armload, recorded_halves, tmp_path):
    words = ("commission", "prbt", "--runs")
    assert "--runs loaded requires --output: the folder used by" in str(armload(*words, "loaded").exception)
    missing = armload(*words, "loaded", "--output", tmp_path / "none")
    assert "unloaded_identification.mcap is missing: create it with" in str(missing.exception)
    assert not (tmp_path / "none").exists()
    result = armload(*words, "unloaded", "--output", tmp_path, "--json", columns=500)
    assert result.exit_code == 0, (result.output, result.exception)
    assert f"recorded: {tmp_path}. Mount the payload, then: --runs loaded --output {tmp_path}" in result.stderr
    assert json.loads(result.stdout)["files"] == {"directory": str(tmp_path)}
    again = armload(*words, "unloaded", "--output", tmp_path)
    assert "already contains these recordings, which are never overwritten" in str(again.exception)
    loaded = armload(*words, "loaded", "--output", tmp_path)
    assert str(loaded.exception) == "evaluated with 0.02"
    assert [load for load, *_ in recorded_halves] == ["unloaded", "loaded"]
    assert "mounted on the simulated flange" not in loaded.output


def test_slow_rounds_alone_have_no_periods_to_repeat(armload, tmp_path):
    result = armload("commission", "prbt", "--output", tmp_path / "a", "--slow-only", "--until", "1%", columns=300)
    assert result.exit_code == 2
    assert "no periods are run with --slow-only" in result.output


@pytest.mark.parametrize(
    ("given", "answer", "refused"), [(True, None, False), (False, True, False), (False, False, True)]
)
def test_the_payload_is_mounted_before_a_real_arm_goes_on(given, answer, refused):
    asked = []
    consent = SimpleNamespace(given=given, ask=lambda question: asked.append(question) or answer)
    arm = load_robot("prbt").with_bus("socketcan", "can0")
    with pytest.raises(CommissioningError, match="Continue later with --runs loaded") if refused else nullcontext():
        commission_command._have_payload_mounted(arm, None, consent)
    question = "The drives are off, the brakes are on. Is the payload mounted and the workspace clear?"
    assert asked == ([] if given else [question])
    settings = replace(arm.drives.settings.drives[0], has_brake=False)
    arm = SimpleNamespace(drives=SimpleNamespace(settings=SimpleNamespace(drives=[settings])))
    assert commission_command.mounting_question(arm).startswith("The drives are off. Is the payload mounted")


@pytest.mark.parametrize("there", [(), ("payload.toml", "report.html"), ("payload.toml", "arm.calibration.toml")])
def test_only_files_that_were_written_are_named(tmp_path, there):
    for name in there:
        (tmp_path / name).touch()
    keys = {"payload.toml": "payload", "report.html": "report", "arm.calibration.toml": "calibration"}
    assert commission_command._files(tmp_path) == {"directory": tmp_path} | {
        keys[name]: tmp_path / name for name in there
    }
