"""The bound compared with brute force, and the paper's ten values with finite differences."""

from __future__ import annotations

import numpy as np

from armload_identification.model.payload import InertialParameters
from benchmarks.results.bound import cramer_rao, paper_slope, paper_values

BODY = InertialParameters.from_center_of_mass(
    9.814, [0.13, 0.94, -0.102], [[0.25, -0.02, 0.003], [-0.02, 0.09, 0.026], [0.003, 0.026, 0.18]]
)


def test_bound_equals_the_inverse_information_of_both_runs_with_a_free_body():
    """The arm's own torque is unknown at every phase and joint; payload and body are estimated jointly from all
    rows."""
    random = np.random.default_rng(3)
    samples, joints, periods = 8, 2, 3
    phi = random.normal(size=(samples, joints, 11)) * random.uniform(0.1, 10.0, 11)
    loaded, unloaded = np.array([2.0, 0.7]), np.array([1.5, 0.9])
    body = np.eye(samples * joints)
    rows = phi.reshape(-1, 11)
    with_payload = np.hstack([rows, body]) / np.tile(loaded, samples)[:, None]
    without = np.hstack([np.zeros_like(rows), body]) / np.tile(unloaded, samples)[:, None]
    stacked = np.vstack([with_payload] * periods + [without] * periods)
    expected = np.linalg.inv(stacked.T @ stacked)[:11, :11]
    np.testing.assert_allclose(cramer_rao(phi, np.hypot(loaded, unloaded), periods), expected, rtol=1e-9)


def test_bound_equals_the_scatter_of_many_estimates():
    random = np.random.default_rng(4)
    phi = random.normal(size=(40, 3, 10))
    noise = np.array([1.0, 3.0, 0.5])
    weighted = (phi / noise[:, None]).reshape(-1, 10)
    draws = random.normal(size=(weighted.shape[0], 20000))
    scatter = np.cov(np.linalg.lstsq(weighted, draws, rcond=None)[0])
    bound = cramer_rao(phi, noise, 1)
    np.testing.assert_allclose(np.diag(scatter), np.diag(bound), rtol=0.06)


def test_a_nuisance_column_costs():
    phi = np.random.default_rng(5).normal(size=(20, 2, 11))
    noise = np.ones(2)
    assert (np.diag(cramer_rao(phi, noise, 1))[:10] > np.diag(cramer_rao(phi[:, :, :10], noise, 1))).all()


def test_paper_values_have_the_papers_sign_and_place():
    values = paper_values(BODY)
    np.testing.assert_allclose(values[:4], [9.814, 0.13, 0.94, -0.102])
    assert values[7] == -BODY.theta[7]
    assert values[7] > 0.0  # m c_x c_y dominates, as in the paper's Table 2


def test_slope_of_the_paper_values_is_their_derivative():
    step = 1e-6
    numeric = np.empty((10, 10))
    for i, unit in enumerate(np.eye(10)):
        high, low = (paper_values(InertialParameters(BODY.theta + sign * step * unit)) for sign in (1, -1))
        numeric[:, i] = (high - low) / (2.0 * step)
    np.testing.assert_allclose(paper_slope(BODY), numeric, atol=1e-8)
