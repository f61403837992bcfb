"""The truncated normal distribution of mass and centre of mass against formulas and rejection sampling."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import truncnorm

from armload_identification.pipeline.prior_contradictions import contradicted, truncated_moments

pytestmark = pytest.mark.pure

MEAN = np.array([2.0, 0.01, -0.02, 0.08])
NOWHERE = np.tile([-np.inf, np.inf], (4, 1))


def correlated():
    deviation = np.array([0.2, 0.01, 0.01, 0.02])
    correlation = np.eye(4)
    correlation[0, 3] = correlation[3, 0] = -0.8
    return correlation * np.outer(deviation, deviation)


@pytest.mark.parametrize("limits", [(1.9, 2.1), (2.0, 9.0), (2.3, 2.5), (0.5, 1.7), (2.5, 9.0)])
def test_a_range_of_the_mass_gives_the_formulas_moments_and_holds_95_percent(limits):
    ranges = NOWHERE.copy()
    ranges[0] = limits
    mean, covariance = truncated_moments(MEAN, correlated(), ranges)
    exact = truncnorm((limits[0] - 2.0) / 0.2, (limits[1] - 2.0) / 0.2, 2.0, 0.2)
    assert mean[0] == pytest.approx(exact.mean(), abs=1e-3 * exact.std())
    assert np.sqrt(covariance[0, 0]) == pytest.approx(exact.std(), rel=5e-3)
    reach = 1.96 * np.sqrt(covariance[0, 0])
    assert exact.cdf(mean[0] + reach) - exact.cdf(mean[0] - reach) > 0.947


def test_a_range_of_one_narrows_what_is_correlated_as_plain_sampling_does():
    ranges = NOWHERE.copy()
    ranges[0], ranges[3] = (1.9, 2.05), (0.08, 0.2)
    mean, covariance = truncated_moments(MEAN, correlated(), ranges)
    # Truncated in [m, m c] with the slope at the mean, as in a fit.
    to_moments = np.diag([1.0, 2.0, 2.0, 2.0])
    to_moments[1:, 0] = MEAN[1:]
    x = np.random.default_rng(3).multivariate_normal(
        [2.0, *(2.0 * MEAN[1:])], to_moments @ correlated() @ to_moments.T, 400_000
    )
    x[:, 1:] /= x[:, :1]
    kept = x[((x[:, [0, 3]] > ranges[[0, 3], 0]) & (x[:, [0, 3]] < ranges[[0, 3], 1])).all(axis=1)]
    deviation = kept.std(axis=0)
    np.testing.assert_allclose((mean - kept.mean(axis=0)) / deviation, 0.0, atol=0.02)
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), deviation, rtol=0.02)


def test_ranges_that_hold_one_by_one_but_not_together_are_contradicted():
    covariance = np.array([[1.0, 0.99], [0.99, 1.0]])
    assert contradicted(np.zeros(2), covariance, np.array([[1.0, 2.0], [-2.0, -1.0]]))
    assert not contradicted(np.zeros(2), covariance, np.array([[1.0, 2.0], [1.0, 2.0]]))
