"""The fit: against NumPy on the stacked system, on exact data, and where the data determine nothing."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.estimation.least_squares import Prior, estimate, estimate_reweighted, estimate_robust
from armload_identification.identification_errors import EstimationError

pytestmark = pytest.mark.pure

NOISE = np.array([2.0, 0.5, 0.1])


def system(rng, samples=400, parameters=10):
    regressor = rng.normal(size=(samples, 3, parameters)) * np.geomspace(10.0, 0.01, parameters)
    theta = rng.normal(size=parameters)
    return regressor, theta, np.ones(samples, dtype=bool)


def test_exact_data_give_the_exact_parameters():
    regressor, theta, valid = system(np.random.default_rng(1))
    fit = estimate(regressor, regressor @ theta, valid, NOISE)
    np.testing.assert_allclose(fit.theta, theta, rtol=1e-10)
    assert fit.rank == 10
    assert fit.residual_rms_nm.max() < 1e-12


def test_it_is_weighted_least_squares_with_its_covariance_and_condition():
    rng = np.random.default_rng(2)
    regressor, theta, valid = system(rng)
    torque = regressor @ theta + NOISE * rng.normal(size=(400, 3))
    fit = estimate(regressor, torque, valid, NOISE)
    rows = (regressor / NOISE[:, None]).reshape(-1, 10)
    expected, *_ = np.linalg.lstsq(rows, (torque / NOISE).reshape(-1), rcond=None)
    np.testing.assert_allclose(fit.theta, expected, rtol=1e-10)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(rows.T @ rows), rtol=1e-8)
    np.testing.assert_allclose(fit.root.T @ fit.root, rows.T @ rows, rtol=1e-9, atol=1e-12)
    assert fit.condition_number == pytest.approx(np.linalg.cond(rows), rel=1e-9)
    np.testing.assert_allclose(fit.singular_values, np.linalg.svd(rows, compute_uv=False), rtol=1e-9)
    np.testing.assert_allclose(fit.residual_nm, torque - regressor @ expected, atol=1e-10)


def test_invalid_samples_do_not_count():
    rng = np.random.default_rng(3)
    regressor, theta, valid = system(rng)
    torque = regressor @ theta
    torque[5:20] += 1e6
    valid[5:20] = False
    fit = estimate(regressor, torque, valid, NOISE)
    np.testing.assert_allclose(fit.theta, theta, rtol=1e-9)
    assert fit.residual_rms_nm.max() < 1e-9


def test_reweighting_finds_the_noise_of_each_joint():
    rng = np.random.default_rng(4)
    regressor, theta, valid = system(rng, 3000)
    torque = regressor @ theta + NOISE * rng.normal(size=(3000, 3))
    fit = estimate_reweighted(regressor, torque, valid, 0.1 * NOISE.min() * np.ones(3))
    np.testing.assert_allclose(1.0 / fit.weight_1_nm, NOISE, rtol=0.05)
    ideal = estimate(regressor, torque, valid, NOISE)
    np.testing.assert_allclose(fit.theta, ideal.theta, atol=0.2 * np.sqrt(np.diag(ideal.covariance)).max())
    assert 1 < fit.iterations < 20


def test_reweighting_of_exact_data_ends():
    regressor, theta, valid = system(np.random.default_rng(5))
    fit = estimate_reweighted(regressor, regressor @ theta, valid, NOISE)
    np.testing.assert_allclose(fit.theta, theta, rtol=1e-9)


def test_undetermined_directions_are_named_and_not_invented():
    rng = np.random.default_rng(6)
    regressor, theta, valid = system(rng)
    regressor[:, :, 7] = 2.0 * regressor[:, :, 4]
    regressor[:, :, 9] = 0.0
    torque = regressor @ theta + NOISE * rng.normal(size=(400, 3))
    fit = estimate(regressor, torque, valid, NOISE)
    assert fit.rank == 8
    assert fit.condition_number == np.inf
    blind = fit.scale[:, None] * fit.undetermined
    np.testing.assert_allclose(regressor @ blind, 0.0, atol=1e-9)
    assert fit.theta[9] == pytest.approx(0.0, abs=1e-12)
    error = fit.theta[[0, 1, 2, 3, 5, 6, 8]] - theta[[0, 1, 2, 3, 5, 6, 8]]
    spread = np.sqrt(np.diag(fit.covariance))[[0, 1, 2, 3, 5, 6, 8]]
    assert (np.abs(error) < 5.0 * spread).all()
    assert fit.theta[4] + 2.0 * fit.theta[7] == pytest.approx(theta[4] + 2.0 * theta[7], rel=0.1)


def test_weights_of_samples_weigh_equation_and_target_alike():
    rng = np.random.default_rng(8)
    regressor, theta, valid = system(rng)
    torque = regressor @ theta + NOISE * rng.normal(size=(400, 3))
    weight = rng.uniform(0.0, 1.0, size=(400, 3))
    rows = (regressor * (weight / NOISE)[:, :, None]).reshape(-1, 10)
    expected, *_ = np.linalg.lstsq(rows, (torque * weight / NOISE).reshape(-1), rcond=None)
    np.testing.assert_allclose(estimate(regressor, torque, valid, NOISE, weight).theta, expected, rtol=1e-9)


def test_reweighting_ends_where_the_noise_is_that_of_the_weighted_residual():
    rng = np.random.default_rng(9)
    regressor, theta, valid = system(rng, 1000)
    torque = regressor @ theta + NOISE * rng.normal(size=(1000, 3))
    weight = np.where(np.arange(1000)[:, None] % 3 == 0, 0.1, 1.0) * np.ones(3)
    torque += 20.0 * (weight < 1.0) * rng.normal(size=(1000, 3))
    fit = estimate_reweighted(regressor, torque, valid, 1e-3 * np.ones(3), weight)
    size = np.sqrt(np.sum((weight * fit.residual_nm) ** 2, axis=0) / np.sum(weight**2, axis=0))
    np.testing.assert_allclose(1.0 / fit.weight_1_nm, size, rtol=1e-3)


def test_the_robust_fit_is_hubers():
    """At its end, the residual clipped at 1.345 deviations is orthogonal to every column."""
    rng = np.random.default_rng(10)
    regressor, theta, valid = system(rng, 1000)
    torque = regressor @ theta + NOISE * rng.normal(size=(1000, 3))
    wild = rng.uniform(size=torque.shape) < 0.1
    torque += np.where(wild, 30.0, 0.0) * NOISE
    fit = estimate_robust(regressor, torque, valid, NOISE)
    spread = np.median(np.abs(fit.residual_nm), axis=0) / 0.67449
    clipped = np.clip(fit.residual_nm / spread, -1.345, 1.345)
    rows = (regressor / spread[:, None]).reshape(-1, 10)
    step = np.linalg.lstsq(rows, clipped.reshape(-1), rcond=None)[0]
    deviation = np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)))
    assert np.abs(step / deviation).max() < 0.01
    plain = estimate_reweighted(regressor, torque, valid, NOISE)
    errors = [np.linalg.norm((other.theta - theta) / deviation) for other in (fit, plain)]
    assert errors[0] < 0.5 * errors[1]


@pytest.mark.parametrize(("apart", "rank"), [(1e-5, 10), (1e-9, 9)])
def test_a_direction_is_determined_down_to_rounding(apart, rank):
    rng = np.random.default_rng(11)
    regressor, theta, valid = system(rng)
    regressor[:, :, 7] = 2.0 * regressor[:, :, 4] + apart * np.abs(regressor[:, :, 4]).max() * rng.normal(size=(400, 3))
    assert estimate(regressor, regressor @ theta, valid, NOISE).rank == rank


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda r, t, v, n: (r[:3], t[:3], v[:3], n), "3 samples of 3 joints are not enough for 10 parameters"),
        (lambda r, t, v, n: (r, t * np.nan, v, n), "not finite"),
        (lambda r, t, v, n: (r, t, v, n * 0.0), "the noise per joint"),
        (lambda r, t, v, n: (r * 0.0, t, v, n), "excites no parameter"),
        (lambda r, t, v, n: (r, t[:, :2], v, n), "do not match"),
    ],
)
def test_what_cannot_be_fitted_is_refused(change, said):
    regressor, theta, valid = system(np.random.default_rng(7))
    with pytest.raises(EstimationError, match=said):
        estimate(*change(regressor, regressor @ theta, valid, NOISE))


@pytest.mark.parametrize("fit", [estimate, estimate_reweighted, estimate_robust])
def test_a_joint_without_noise_does_not_outweigh_the_others_without_limit(fit):
    regressor, theta, valid = system(np.random.default_rng(12))
    for scale in (1.0, 50.0):
        noise = scale * np.array([1.0, 0.0, 1.0])
        found = fit(regressor, regressor @ theta, valid, noise)
        np.testing.assert_allclose(found.theta, theta, rtol=1e-6)
        if fit is not estimate_robust:
            np.testing.assert_allclose(found.weight_1_nm, np.array([1.0, 1e6, 1.0]) / scale, rtol=1e-9)


def test_a_column_of_zeros_has_the_scale_of_the_longest_and_is_undetermined():
    regressor, theta, valid = system(np.random.default_rng(13))
    regressor[:, :, 9] = 0.0
    fit = estimate(regressor, regressor @ theta, valid, NOISE)
    lengths = np.linalg.norm((regressor / NOISE[:, None]).reshape(-1, 10), axis=0)
    np.testing.assert_allclose(fit.scale[:9], 1.0 / lengths[:9], rtol=1e-9)
    assert fit.scale[9] == pytest.approx(1.0 / lengths.max())
    assert fit.rank == 9
    np.testing.assert_allclose(np.abs(fit.undetermined[:, 0]), np.arange(10) == 9, atol=1e-12)


def test_the_residuals_size_is_weighted_like_the_rows():
    rng = np.random.default_rng(14)
    regressor, theta, valid = system(rng)
    torque = regressor @ theta + NOISE * rng.normal(size=(400, 3))
    weight = rng.uniform(0.2, 1.0, size=(400, 3))
    valid[:50] = False
    fit = estimate(regressor, torque, valid, NOISE, weight)
    used = weight * valid[:, None]
    expected = np.sqrt(np.sum((used * fit.residual_nm) ** 2, axis=0) / np.sum(used**2, axis=0))
    np.testing.assert_allclose(fit.residual_rms_nm, expected, rtol=1e-12)


def test_prior_knowledge_counts_as_measurements_of_unit_deviation():
    rng = np.random.default_rng(15)
    regressor, theta, valid = system(rng, parameters=12)
    torque = regressor @ theta + NOISE * rng.normal(size=(400, 3))
    prior = Prior(rng.normal(size=(3, 10)), rng.normal(size=3))
    both = prior.and_nuisance(np.array([0.7, 9.0]), np.array([0.01, np.inf]))
    rows = np.zeros((4, 12))
    rows[:3, :10], rows[3, 10] = prior.rows, 100.0
    stacked = np.vstack([(regressor / NOISE[:, None]).reshape(-1, 12), rows])
    target = np.concatenate([(torque / NOISE).reshape(-1), prior.target, [70.0]])
    expected, *_ = np.linalg.lstsq(stacked, target, rcond=None)
    fit = estimate(regressor, torque, valid, NOISE, prior=both)
    np.testing.assert_allclose(fit.theta, expected, rtol=1e-8)
    np.testing.assert_allclose(fit.prior_rows, rows)
    np.testing.assert_allclose(fit.covariance, np.linalg.inv(stacked.T @ stacked), rtol=1e-6)


def test_whitened_rows_carry_both_weights():
    rng = np.random.default_rng(16)
    regressor, theta, valid = system(rng)
    weight = rng.uniform(0.2, 1.0, size=(400, 3))
    fit = estimate(regressor, regressor @ theta, valid, NOISE, weight)
    along = rng.normal(size=(10, 2))
    np.testing.assert_allclose(fit.whitened(along), (weight / NOISE)[:, :, None] * (regressor @ along), rtol=1e-12)


def test_as_many_equations_as_parameters_are_not_enough_and_one_joint_more_is():
    regressor, theta, valid = system(np.random.default_rng(17), samples=4, parameters=12)
    with pytest.raises(EstimationError, match="not enough for 12 parameters"):
        estimate(regressor, regressor @ theta, valid, NOISE)
    fewer = regressor[:, :, :11]
    np.testing.assert_allclose(estimate(fewer, fewer @ theta[:11], valid, NOISE).theta, theta[:11], rtol=1e-6)


def test_numbers_that_are_not_finite_may_stand_in_samples_that_are_not_used():
    regressor, theta, valid = system(np.random.default_rng(18))
    torque = regressor @ theta
    valid[3] = False
    torque[3] = np.nan
    with pytest.raises(EstimationError, match="not finite"):
        estimate(regressor, torque, np.ones_like(valid), NOISE)
