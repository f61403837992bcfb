"""What follows from the four recordings, and what is told of the calibration."""

from dataclasses import dataclass, replace
from datetime import UTC, datetime
from types import SimpleNamespace

import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import CommissioningError, UnsafeBus
from armload_controller.session import commissioning_results
from armload_controller.session.commissioning import CommissioningPlan
from armload_controller.session.commissioning_results import commission, evaluate
from armload_identification.identification_errors import EstimationError
from armload_identification.verdict.tolerance import Tolerance

ER50 = load_robot("er50")
NAMES = [f"{load}_{role}.mcap" for load in ("unloaded", "loaded") for role in ("identification", "validation")]
CREATED = datetime(2026, 3, 1, 10, 30, tzinfo=UTC)


@dataclass
class FakeFindings:
    """Notes what is written, with what was known by then."""

    log: list
    truth: object = None
    validated: bool = False

    def with_validation_in_provenance(self):
        return replace(self, validated=True)

    def save(self, path):
        self.log.append((path.name, self.validated))

    def report(self, path, created):
        self.log.append((path.name, self.truth and self.truth.mass_kg, created))


@pytest.mark.parametrize("simulated", [True, False])
def test_the_first_pair_identifies_the_second_validates_and_the_report_is_last(monkeypatch, tmp_path, simulated):
    log, calls = [], []
    monkeypatch.setattr(
        commissioning_results, "read_pair", lambda arm, directory, role: (f"loaded {role}", f"empty {role}")
    )
    monkeypatch.setattr(
        commissioning_results, "identify", lambda *runs, **known: calls.append((runs, known)) or FakeFindings(log)
    )
    monkeypatch.setattr(
        commissioning_results, "_calibrate", lambda arm, folder, runs, mass_kg: log.append((runs, mass_kg)) or ["r"]
    )
    arm = ER50 if simulated else ER50.with_bus("socketcan", "can0")
    plan, tolerance = CommissioningPlan(tmp_path, 4.0, "arm.toml"), Tolerance(0.05)
    findings, remarks = evaluate(arm, plan, tolerance, CREATED)
    ((runs, known),) = calls
    assert runs == (arm, "loaded identification", "empty identification")
    assert known["validation"] == ("loaded validation", "empty validation")
    assert (known["calibration"], known["known"].mass_kg) == ("arm.toml", 4.0)
    assert (known["tolerance"], known["drift"]) == (tolerance, plan.drift)
    mass_kg = ER50.simulation.payload("paper").mass_kg if simulated else None
    four = tuple(f"{load} {role}" for role in ("identification", "validation") for load in ("empty", "loaded"))
    assert log == [("payload.toml", True), (four, 4.0), ("report.html", mass_kg, CREATED)]
    assert (findings.validated, remarks) == (True, ["r"])


@pytest.fixture
def calibrated(monkeypatch, tmp_path):
    """Lines that are told of a calibration with some outcome."""

    def calibrated(outcome, mass_kg=None, stated=()):
        def calibrate(arm, runs):
            if isinstance(outcome, Exception):
                raise outcome
            return outcome

        monkeypatch.setattr(commissioning_results, "calibrate_from_runs", calibrate)
        monkeypatch.setattr(commissioning_results, "runs_of_commissioning", lambda runs, mass_kg: (runs, mass_kg))
        monkeypatch.setattr(commissioning_results, "masses_otherwise_recorded", lambda runs, mass_kg: stated)
        monkeypatch.setattr(commissioning_results, "write_calibration", lambda path, result: path.touch())
        return commissioning_results._calibrate(ER50, tmp_path, (), mass_kg)

    return calibrated


def test_a_calibration_that_is_not_possible_costs_nothing_but_itself(calibrated, tmp_path):
    assert calibrated(EstimationError("too slow")) == ["warning: no calibration was written: too slow"]
    assert list(tmp_path.iterdir()) == []


def test_what_a_calibration_leaves_out_and_doubts_is_told_in_order(calibrated, tmp_path):
    result = SimpleNamespace(left_out=[("a.mcap", "cut short")], warnings=["a doubt"])
    path = tmp_path / "arm.calibration.toml"
    assert calibrated(result, 4.0, [5.25]) == [
        "calibration: left out: a.mcap: cut short",
        "calibration: a doubt",
        "calibration: the recordings state 5.25 kg, which was not used. `armload calibrate` would use it: give it a "
        "table of runs with the correct mass_kg.",
        f"calibration: {path}, for the next payload: --calibration {path}",
    ]
    assert path.exists()


def test_only_what_is_missing_is_recorded_and_the_rest_evaluated(tmp_path, monkeypatch):
    halves, evaluated = [], []
    for name in NAMES[:3]:
        (tmp_path / name).touch()
    monkeypatch.setattr(commissioning_results, "record_half", lambda *given: halves.append((given[0], *given[1::3])))
    monkeypatch.setattr(commissioning_results, "evaluate", lambda *given: (evaluated.append(given[1:]), ["r"]))
    tolerance = Tolerance(0.05)
    assert commission("er50", tmp_path, mounted="gearbox", mass_kg=4.0, tolerance=tolerance) is None
    ((arm, load, plan),) = halves
    assert (str(load), arm.simulation.payload_name) == ("loaded", "gearbox")
    assert (plan.directory, plan.mass_kg, plan.calibration) == (tmp_path, 4.0, None)
    assert evaluated == [(plan, tolerance)]


def test_a_finished_commissioning_and_a_real_arm_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(commissioning_results, "record_half", None)
    (tmp_path / "report.html").touch()
    with pytest.raises(CommissioningError, match="contains a finished commissioning: choose another folder"):
        commission(ER50, tmp_path)
    with pytest.raises(UnsafeBus, match="not simulated in this process, but on socketcan: a real arm is commissioned"):
        commission(ER50.with_bus("socketcan", "can0"), tmp_path / "other")
    assert not (tmp_path / "other").exists()
