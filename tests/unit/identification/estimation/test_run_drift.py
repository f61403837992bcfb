"""Drift of a pair's gains between its runs: found in a pair that was made to drift, and what it allows for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.estimation.estimation_constants import Drift
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH, ONE_SIDED
from armload_identification.estimation.payload_problem import pair_problem
from armload_identification.estimation.run_drift import RunDrift
from armload_identification.estimation.solve import solve
from armload_identification.model.regressor import payload_torque
from armload_identification.signals.load_signal import load_signal
from armload_identification.signals.recorded_run import Run

pytestmark = pytest.mark.pure

USUAL = Drift.between_runs


@pytest.fixture(scope="module")
def known(calibration, pinocchio_arm):
    chain = pinocchio_arm.chain
    return calibration.level(chain), calibration.transmission(pinocchio_arm.transmission), calibration.known_arm


@pytest.mark.parametrize("factor", [0.98, 0.9995, 1.02, 1.1])
def test_torque_of_the_loaded_run_times_a_factor_is_found_as_the_gains_inverse(pair, known, factor):
    """Also a large one, of which the other unknowns take up a part at first."""
    chain, transmission, arm = known
    loaded, unloaded = pair
    signal = load_signal(
        Run.of(replace(loaded, current_a=factor * loaded.current_a), transmission), Run.of(unloaded, transmission)
    )
    posterior = solve(pair_problem(signal, chain, transmission.coupling, arm).problem)
    drift = RunDrift.of(posterior, arm)
    assert drift.log_factor == pytest.approx(-np.log(factor), abs=4.0 * drift.deviation + 1e-4)
    assert drift.deviation < 0.005
    assert drift.usual == USUAL
    assert drift.heard
    nominal = RunDrift.of(posterior, None)
    assert nominal.usual == 0.0
    assert nominal.heard


def test_a_drift_of_both_runs_since_the_calibration_is_none_between_them(pair, known):
    """3 % of it: where noise hides the arm's own torque, a sixth is taken for a drift between them if none is known."""
    chain, transmission, arm = known
    gains = np.arange(arm.errors.shape[1]) < chain.n

    def between(factor, deviation):
        rng, runs = np.random.default_rng(1), []
        for run in pair:
            noise_a = 0.5 * run.current_a.std(axis=0) * rng.normal(size=run.current_a.shape)
            runs.append(Run.of(replace(run, current_a=factor * run.current_a + noise_a), transmission))
        posterior = solve(pair_problem(load_signal(*runs), chain, transmission.coupling, arm).problem)
        return RunDrift.of(posterior, replace(arm, errors=deviation * gains[None])).log_factor

    unknown, allowed_for = (abs(between(0.97, deviation) - between(1.03, deviation)) for deviation in (1e-6, 0.03))
    assert unknown > 0.15 * 0.06
    assert allowed_for < 0.2 * unknown


def test_a_drift_is_heard_only_if_the_joints_fit_about_as_well_as_in_the_calibration(pair, known):
    chain, transmission, arm = known
    signal = load_signal(*(Run.of(run, transmission) for run in pair))
    posterior = solve(pair_problem(signal, chain, transmission.coupling, arm).problem)
    for factor, heard in ((1e-3, False), (1.0, True), (1e3, True)):
        assert RunDrift.of(posterior, replace(arm, noise_nm=factor * arm.noise_nm)).heard is heard


def test_gears_that_turn_more_heavily_as_a_whole_are_less_of_a_drift_beside_a_factor_on_friction(
    pair, known, pinocchio_arm, monkeypatch
):
    """3 % more friction in the loaded run: four fifths of what it looks like without the factor go."""
    chain, transmission, arm = known
    loaded, unloaded = pair
    states = loaded.excitation.trajectory.evaluate(loaded.phase_s)
    motion = states.position_rad, states.velocity_rad_s, states.acceleration_rad_s2
    payload_nm = payload_torque(chain, pinocchio_arm.payload.theta, *motion)
    rigid_nm = arm.body.link_torque(chain, *motion) + payload_nm + motion[2] @ arm.body.rotor_mass_kg_m2
    more_nm = 0.03 * (arm.body.torque(chain, *motion, payload_nm) - rigid_nm)
    heavy = replace(loaded, current_a=loaded.current_a + more_nm @ transmission.coupling / transmission.gain_nm_a)

    def drift(run):
        signal = load_signal(Run.of(run, transmission), Run.of(unloaded, transmission))
        return RunDrift.of(solve(pair_problem(signal, chain, transmission.coupling, arm).problem), arm).log_factor

    beside = drift(heavy) - drift(loaded)
    monkeypatch.setattr(Drift, "friction", 1e-6)
    alone = drift(heavy) - drift(loaded)
    assert abs(alone) > 0.001
    assert abs(beside) < 0.2 * abs(alone)


def test_its_size_is_in_standard_deviations_of_rows_and_usual_drift():
    assert RunDrift(-0.01, 0.002).size == pytest.approx(0.01 / np.hypot(0.002, USUAL))


def test_a_usual_drift_is_allowed_for_as_far_as_the_rows_leave_it():
    """The mean square of a normal prior of `usual` after a measurement with `deviation`."""
    drift = RunDrift(0.001, 0.003, USUAL)
    precision = USUAL**-2 + 0.003**-2
    mean, variance = 0.001 * 0.003**-2 / precision, 1.0 / precision
    assert drift.allowed == pytest.approx(np.sqrt(mean**2 + variance))
    assert drift.notes() == []


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_drift_beyond_chance_is_allowed_for_whole(sign):
    """The interval then reaches beyond the drift by its own one-sided error."""
    deviation = 0.001
    least = ONE_SIDED * np.hypot(deviation, USUAL)
    certain = RunDrift(sign * 1.01 * least, deviation, USUAL)
    assert NORMAL_HALF_WIDTH * certain.allowed == pytest.approx(1.01 * least + ONE_SIDED * deviation)
    assert RunDrift(sign * 0.99 * least, deviation, USUAL).allowed < 0.95 * certain.allowed
    assert RunDrift(sign * 1.01 * least, deviation, USUAL, heard=False).allowed < 0.95 * certain.allowed


def test_of_nominal_gains_only_a_drift_that_is_noted_counts():
    noted = Drift.noted * np.hypot(0.001, USUAL)
    assert RunDrift(0.99 * noted, 0.001).allowed == 0.0
    assert RunDrift(1.01 * noted, 0.001).allowed > 0.5 * noted


def test_a_certain_drift_is_noted_with_its_interval_in_percent():
    noted = Drift.noted * np.hypot(0.002, USUAL)
    assert RunDrift(0.99 * noted, 0.002, USUAL).notes() == []
    assert RunDrift(0.05, 0.002, USUAL, heard=False).notes() == []
    (note,) = RunDrift(np.log(1.05), 0.002, USUAL).notes()
    assert "drifted by +5.0 +- 0.4 % since the unloaded one" in note
    (note,) = RunDrift(np.log(0.95), 0.002, USUAL).notes()
    assert "drifted by -5.0 +- 0.4 %" in note
