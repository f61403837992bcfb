"""Slow rounds recorded before the periods are used, too: compared with the periods alone, and with the truth."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.estimation.estimation_constants import Drift
from armload_identification.estimation.run_drift import RunDrift
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.signals.joint_torque import Transmission

pytestmark = pytest.mark.pure

SLOW_S = 40.0
"""Duration of the slow round of the period of 5 s."""


def after_slow_round(run, slow, pause_s):
    """A run with a slow round before it; between both the drives are off."""

    def both(name):
        return np.concatenate([getattr(slow, name), getattr(run, name)])

    time_s = np.concatenate([slow.time_s - slow.time_s[-1] + run.time_s[0] - pause_s, run.time_s])
    phase_s = np.concatenate([np.full(slow.size, np.nan), run.phase_s])
    return replace(run, time_s=time_s, position_rad=both("position_rad"), current_a=both("current_a"), phase_s=phase_s)


@pytest.fixture(scope="module")
def runs(pinocchio_arm):
    """Loaded and unloaded periods, and slow rounds."""
    path = pinocchio_arm.trajectory()
    slowly = replace(path, base_frequency_hz=1.0 / SLOW_S)
    periods = [pinocchio_arm.run(path, load, seed=61 + load) for load in (True, False)]
    slow = [pinocchio_arm.run(slowly, load, seed=71 + load, periods=1, with_phase=False) for load in (True, False)]
    return periods, slow


@pytest.fixture(scope="module")
def identified(pinocchio_arm):
    exact = Transmission(
        pinocchio_arm.transmission.gain_nm_a, pinocchio_arm.transmission.coupling, np.ones(pinocchio_arm.n, dtype=bool)
    )
    return lambda loaded, unloaded: identify_runs(loaded, unloaded, pinocchio_arm.chain, exact)


@pytest.fixture(scope="module")
def alone(runs, identified):
    return identified(*runs[0])


@pytest.fixture(scope="module")
def together(runs, identified):
    pauses_s = (20.0, 3.0)
    return identified(*(after_slow_round(*each) for each in zip(*runs, pauses_s, strict=True)))


def test_slow_rounds_narrow_the_intervals_that_gravity_determines(alone, together, pinocchio_arm):
    truth = pinocchio_arm.payload
    narrower = together.uncertainty.half_width_95[:4] / alone.uncertainty.half_width_95[:4]
    assert (narrower < 0.8).all(), narrower
    assert abs(together.parameters.mass_kg - truth.mass_kg) < together.uncertainty.half_width_95[0]
    assert len(together.plain.posterior.groups) == 2


def test_slow_rounds_have_a_noise_of_their_own(together):
    difference, _, slow = together.plain.posterior.noise_nm
    assert (slow > difference).all(), "it is not averaged over periods"
    np.testing.assert_allclose(together.plain.noise_nm, difference)


def test_an_approach_before_one_slow_round_is_left_out(runs, identified, together):
    periods, (loaded, unloaded) = runs
    late = loaded.rows(loaded.time_s > loaded.time_s[0] + 4.0)
    found = identified(after_slow_round(periods[0], late, 5.0), after_slow_round(periods[1], unloaded, 5.0))
    assert len(found.plain.posterior.groups) == 2
    assert found.parameters.mass_kg == pytest.approx(together.parameters.mass_kg, rel=2e-3)


def test_slow_rounds_of_different_motions_are_not_used(runs, identified, alone, pinocchio_arm):
    periods, (loaded, _) = runs
    other = replace(pinocchio_arm.trajectory(seed=9), base_frequency_hz=1.0 / SLOW_S)
    unloaded = pinocchio_arm.run(other, False, seed=80, periods=1, with_phase=False)
    found = identified(after_slow_round(periods[0], loaded, 5.0), after_slow_round(periods[1], unloaded, 5.0))
    np.testing.assert_array_equal(found.plain.theta, alone.plain.theta)


@pytest.mark.parametrize("axis", [1, 4])
def test_an_axis_can_be_left_out_of_periods_and_slow_rounds(together, axis):
    values, covariance, rank = together.plain.without(axis, afresh=False)
    again, same_covariance, same_rank = together.plain.without(axis, afresh=True)
    assert rank == same_rank
    np.testing.assert_allclose(values, again, atol=0.015)
    np.testing.assert_allclose(np.diag(covariance), np.diag(same_covariance), rtol=0.3)


@pytest.mark.parametrize(
    ("factor", "with_slow"), [(0.99, False), (1.0, False), (1.0, True), (1.01, False), (1.01, True)]
)
def test_gains_that_drift_between_the_runs_are_allowed_for(runs, calibration, pinocchio_arm, factor, with_slow):
    """In periods and slow rounds alike: else the slow round would seem to speak against it."""
    loaded, unloaded = (after_slow_round(*each, 5.0) if with_slow else each[0] for each in zip(*runs, strict=True))
    loaded = replace(loaded, current_a=factor * loaded.current_a)
    level, gains = calibration.level(pinocchio_arm.chain), calibration.transmission(pinocchio_arm.transmission)
    known = calibration.known_arm
    found = identify_runs(loaded, unloaded, level, gains, arm=known)
    error_kg = abs(found.parameters.mass_kg - pinocchio_arm.payload.mass_kg)
    assert error_kg < found.uncertainty.half_width_95[0]
    drift = RunDrift.of(found.plain.posterior, known)
    assert drift.log_factor == pytest.approx(-np.log(factor), abs=0.005)
    assert (drift.allowed < 2.5 * Drift.between_runs) == (factor == 1.0)
    assert any("as if all gains had drifted" in note for note in found.notes) == bool(drift.size > Drift.noted)


def test_a_pair_that_fits_badly_is_not_heard():
    certain, doubted = (RunDrift(0.01, 0.002, Drift.between_runs, heard) for heard in (True, False))
    assert certain.notes()
    assert not doubted.notes()
    assert doubted.allowed < 3.0 * Drift.between_runs < certain.allowed
    assert RunDrift(0.002, 0.002).allowed == 0.0, "of nominal gains only a drift that the pair shows"
