"""`armload commission`: recordings that are taken up later, and arguments that are checked before the arm is opened."""

import os
import shutil

import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import CommissioningError
from armload_controller.session.commissioning import read_pair
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
    assert read_pair(robot, recorded, "identification").loaded.n == robot.n
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
