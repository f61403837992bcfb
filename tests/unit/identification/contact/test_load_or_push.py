"""The evidence of a family of explanations, against the Gaussian densities that it stands for."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from armload_identification.contact.load_or_push import _fits as fits

pytestmark = pytest.mark.pure

K, N, M = 5, 2, 3


@pytest.fixture
def problem():
    rng = np.random.default_rng(1)
    root = rng.normal(size=(K * N, K * N))
    noise = root @ root.T + np.eye(K * N)
    return rng.normal(size=(K, N, M)), noise, rng.normal(size=K * N), rng.uniform(0.0, 1.0, size=(4, K))


def test_the_evidence_is_the_mean_likelihood_ratio_of_unknown_to_nothing(problem):
    """With unknowns of variance one the residual has covariance N + H H', in each window with its shares of H."""
    columns, noise, residual, shares = problem
    found = fits(columns, np.linalg.inv(noise), residual, shares)
    nothing = multivariate_normal.logpdf(residual, cov=noise)
    ratios = []
    for share in shares:
        tall = (share[:, None, None] * columns).reshape(K * N, M)
        ratios.append(multivariate_normal.logpdf(residual, cov=noise + tall @ tall.T) - nothing)
    assert found.logarithm == pytest.approx(np.log(np.mean(np.exp(ratios))))
    assert found.best == int(np.argmax(ratios))


def test_the_best_window_gives_the_unknowns_and_their_covariance(problem):
    columns, noise, residual, shares = problem
    inverse = np.linalg.inv(noise)
    found = fits(columns, inverse, residual, shares)
    tall = (shares[found.best][:, None, None] * columns).reshape(K * N, M)
    covariance = np.linalg.inv(np.eye(M) + tall.T @ inverse @ tall)
    np.testing.assert_allclose(found.covariance, covariance)
    np.testing.assert_allclose(found.b, covariance @ tall.T @ inverse @ residual)


def test_very_unlikely_windows_do_not_overflow(problem):
    columns, noise, residual, shares = problem
    found = fits(columns, np.linalg.inv(noise), 1e3 * residual, shares)
    assert np.isfinite(found.logarithm)
