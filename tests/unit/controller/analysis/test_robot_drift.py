"""An arm over its runs: what each was recorded with, and what is left out."""

import pytest

import armload
from armload_controller.analysis import robot_drift
from armload_controller.analysis.robot_drift import drift
from armload_identification.identification_errors import EstimationError


@pytest.fixture
def looked_at(monkeypatch):
    """What the comparison of one run with its calibration is given."""
    seen = []

    def run_health(run, known, chain, transmission, *, mounting, recorded):
        seen.append((run.source.path.name, mounting, recorded))
        return run

    monkeypatch.setattr(robot_drift, "run_health", run_health)
    monkeypatch.setattr(robot_drift, "arm_drift", lambda known, health: tuple(health))
    return seen


def test_recordings_state_whether_the_arm_was_empty(recorded_er50, looked_at):
    today = recorded_er50 / "runs" / "today"
    calibration = today / "arm.calibration.toml"
    runs = [today / f"{load}_identification.mcap" for load in ("unloaded", "loaded")]
    steps = []
    found = drift("er50", runs, calibration=calibration, progress=lambda *step: steps.append(step))
    names = [run.name for run in runs]
    assert looked_at == [(names[0], "", ""), (names[1], None, "")]
    assert steps[-1] == (2, 2)
    assert (found.robot, found.calibration_name, found.left_out) == ("er50", "arm.calibration.toml", ())
    assert [run.source.path.name for run in found.drift] == names


def test_a_table_states_what_was_mounted(recorded_er50, looked_at, tmp_path):
    today = recorded_er50 / "runs" / "today"
    rows = [f"{today}/loaded_{role}.mcap,{role},,2026-03-0{day}" for day, role in ((1, "identification"), (2, ""))]
    table = tmp_path / "runs.csv"
    table.write_text("\n".join(["recording,mounting,mass_kg,recorded", rows[0], rows[1].replace("_.", "_none.")]))
    found = drift("er50", table, calibration=armload.read_calibration(today / "arm.calibration.toml"))
    assert looked_at == [("loaded_identification.mcap", "identification", "2026-03-01T00:00:00")]
    ((name, reason),) = found.left_out
    assert name.endswith("loaded_none.mcap")
    assert reason


def test_without_a_usable_run_or_a_calibration_it_is_refused(recorded_er50, looked_at, tmp_path):
    today = recorded_er50 / "runs" / "today"
    with pytest.raises(EstimationError, match=r"no recording can be used \(.*none\.mcap: .*\)"):
        drift("er50", [tmp_path / "none.mcap"], calibration=today / "arm.calibration.toml")
    with pytest.raises(EstimationError, match="comparing runs requires the arm's calibration"):
        drift("er50", [today / "loaded_identification.mcap"])
    assert looked_at == []
