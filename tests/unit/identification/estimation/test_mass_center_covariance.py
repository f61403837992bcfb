"""Covariance of mass and centre of mass: as in the intervals, with one number of degrees of freedom, without gains."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t as student

from armload_identification.estimation.least_squares import estimate
from armload_identification.estimation.mass_center_covariance import GainShare, mass_center_covariance
from armload_identification.estimation.uncertainty import quantify, shifts_by
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_regressor

pytestmark = pytest.mark.pure

SAMPLES = 500
STEP_S = 0.02
NOTHING = np.zeros((0, SAMPLES, 6))


@pytest.fixture(scope="module")
def regressor(pinocchio_arm):
    state = pinocchio_arm.trajectory(period_s=SAMPLES * STEP_S).evaluate(np.arange(SAMPLES) * STEP_S)
    return payload_regressor(pinocchio_arm.chain, state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)


def fitted(regressor, arm, seed):
    noise = np.random.default_rng(seed).normal(size=(SAMPLES, 6)) * arm.noise_nm
    torque = regressor @ arm.payload.theta + noise
    return estimate(regressor, torque, np.ones(SAMPLES, dtype=bool), arm.noise_nm), torque


def test_it_is_the_covariance_of_the_intervals(regressor, pinocchio_arm):
    fit, torque = fitted(regressor, pinocchio_arm, 1)
    doubts = 0.02 * torque[None] * np.eye(6)[:, None, :]
    body = InertialParameters(fit.theta)
    known = mass_center_covariance(fit, body, doubts, None)
    reported = quantify(fit, body, shifts_by(fit, doubts))
    deviation = reported.half_width_95[:4] / student.ppf(0.975, reported.degrees_of_freedom[:4])
    np.testing.assert_allclose(np.sqrt(np.diag(known.measured)), deviation, rtol=1e-9)
    assert known.gain_nm_a.size == 0
    np.testing.assert_allclose(known.from_gains, 0.0)


def test_gains_stand_apart_as_slopes(regressor, pinocchio_arm):
    """A small change of one gain changes the result by its slope, as a fit to the changed torque shows."""
    fit, torque = fitted(regressor, pinocchio_arm, 2)
    transmission = pinocchio_arm.transmission
    known = mass_center_covariance(
        fit, InertialParameters(fit.theta), NOTHING, GainShare.of(fit, torque, transmission, None)
    )
    for axis in range(6):
        step = 5e-4 * transmission.gain_shares(torque)[axis]
        again = estimate(regressor, torque + step, np.ones(SAMPLES, dtype=bool), pinocchio_arm.noise_nm)
        change = (InertialParameters(again.theta).values - InertialParameters(fit.theta).values)[:4] / 5e-4
        np.testing.assert_allclose(known.gain_slope[:, axis], change, rtol=0.01, atol=1e-3)
    np.testing.assert_array_equal(known.gain_nm_a, transmission.gain_nm_a)
    np.testing.assert_array_equal(known.gain_covariance, transmission.covariance)
    # All gains together scale the torque: the mass changes and the centre of mass does not.
    np.testing.assert_allclose(known.gain_slope.sum(axis=1), [fit.theta[0], 0, 0, 0], atol=1e-6)


def test_the_freedom_is_that_of_the_matrix_scatter(regressor, pinocchio_arm):
    """Over 120 fits the whitened matrices scatter like Wishart matrices of about that many degrees of freedom."""
    made = []
    for seed in range(120):
        fit, _ = fitted(regressor, pinocchio_arm, 100 + seed)
        made.append(mass_center_covariance(fit, pinocchio_arm.payload, NOTHING, None))
    mean = np.mean([each.measured for each in made], axis=0)
    root = np.linalg.inv(np.linalg.cholesky(mean))
    scatter = np.mean([np.sum((root @ each.measured @ root.T - np.eye(4)) ** 2) for each in made])
    reported = 1.0 / np.mean([1.0 / each.freedom for each in made])
    assert 0.6 <= reported * scatter / 20.0 <= 1.6, (reported, 20.0 / scatter)


def test_what_the_motion_does_not_show_is_as_good_as_unknown(regressor, pinocchio_arm):
    """Without the columns of c_y and the inertia, c_y has a deviation of a metre, the mass keeps its own."""
    blind = regressor.copy()
    blind[:, :, 2] = 0.0
    blind[:, :, 4:] = 0.0
    torque = blind @ pinocchio_arm.payload.theta + np.random.default_rng(4).normal(size=(SAMPLES, 6))
    fit = estimate(blind, torque, np.ones(SAMPLES, dtype=bool), pinocchio_arm.noise_nm)
    assert fit.rank == 3
    deviation = np.sqrt(np.diag(mass_center_covariance(fit, pinocchio_arm.payload, NOTHING, None).measured))
    assert deviation[2] == pytest.approx(1.0, rel=0.01)
    assert deviation[0] < 0.05 * pinocchio_arm.payload.mass_kg
    assert deviation[1] < 0.01
