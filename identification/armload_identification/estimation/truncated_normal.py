"""Mass and centre of mass with known ranges: a normal distribution, truncated to these.

The fit's x = [m, c_x, c_y, c_z] is treated as normally distributed with its covariance, widened such that each 95 %
interval equals the fit's by Student's t. Restricted to the ranges, the distribution has another mean and a smaller
covariance, also of correlated quantities without a range. Truncation is done in [m, m c], in which a fit is linear: a
range of c is then proportional to the mass, and remains valid if the mass is poorly known. The moments are computed by
importance sampling at quasi-random points: the coordinates are drawn one by one within their limits, given the previous
ones, and the probabilities of these limits are the weights.

References:
    Genz, Numerical computation of multivariate normal probabilities, Journal of Computational and Graphical
    Statistics 1(2), 1992. Simon, Simon, Constrained Kalman filtering via density function truncation for turbofan
    engine health estimation, International Journal of Systems Science 41(2), 2010.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.estimation.uncertainty import CONFIDENCE

_POINTS_LOG2: Final = 13
_LEAST_MASS: Final = 1e-3
"""Least mass as a share of the estimated one: at 0 a centre of mass has no meaning."""
_LEAST_VARIANCE: Final = 1e-12
"""Added variance as a share of each coordinate's own, so that a singular matrix has a Cholesky factor."""


def truncated_moments(mean: FloatArray, covariance: FloatArray, limits: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance within the limits.

    Args:
        mean: (4,) mass and centre of mass, without the limits.
        covariance: (4, 4) their covariance.
        limits: (4, 2) low and high; -inf and inf where there is none.

    Returns:
        (4,) and (4, 4). For one quantity, the interval of 1.96 standard deviations about the mean, clipped to the
        limits, contains at least 94.8 % of the distribution, wherever the normal one is truncated.
    """
    # Imported here: slower to load than everything else together, and rarely needed.
    from scipy.stats import qmc

    to_moments = np.diag([1.0, *[mean[0]] * 3])
    to_moments[1:, 0] = mean[1:]
    middle = np.concatenate([mean[:1], mean[0] * mean[1:]])
    spread = to_moments @ covariance @ to_moments.T
    triangle = np.linalg.cholesky(spread + np.diag(_LEAST_VARIANCE * np.diag(spread)))
    uniform = qmc.Sobol(4, scramble=True, seed=0).random_base2(_POINTS_LOG2)
    normal = np.zeros_like(uniform)
    weight = np.ones(len(uniform))
    x = np.zeros_like(uniform)
    for i in range(4):
        given = middle[i] + normal[:, :i] @ triangle[i, :i]
        low, high = (np.broadcast_to(edge, given.shape) for edge in limits[i])
        if i == 0:
            low = np.maximum(low, _LEAST_MASS * mean[0])
        else:
            low, high = low * x[:, 0], high * x[:, 0]
        normal[:, i], share = _drawn(uniform[:, i], (low - given) / triangle[i, i], (high - given) / triangle[i, i])
        x[:, i] = given + triangle[i, i] * normal[:, i]
        weight *= share
    x[:, 1:] /= x[:, :1]
    weight /= weight.sum()
    found = weight @ x
    return found, np.asarray((x - found).T @ ((x - found) * weight[:, None]))


def contradicted(mean: FloatArray, covariance: FloatArray, limits: FloatArray) -> bool:
    """Whether no point within the limits lies in the 95 % ellipsoid.

    Args:
        mean: (k,) estimate.
        covariance: (k, k) its covariance.
        limits: (k, 2) low and high.
    """
    from scipy.optimize import lsq_linear
    from scipy.special import gammaincinv

    inverse = np.linalg.inv(np.linalg.cholesky(covariance + np.diag(_LEAST_VARIANCE * np.diag(covariance))))
    nearest = lsq_linear(inverse, inverse @ mean, (limits[:, 0], limits[:, 1]))
    return bool(2.0 * nearest.cost > 2.0 * gammaincinv(0.5 * mean.size, CONFIDENCE))


def _drawn(uniform: FloatArray, low: FloatArray, high: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Standard normal numbers between limits, and the probability of these; from the lower tail, to keep precision."""
    from scipy.special import ndtr, ndtri

    sign = np.where(low > 0.0, -1.0, 1.0)
    first, last = np.where(low > 0.0, -high, low), np.where(low > 0.0, -low, high)
    below, up_to = ndtr(first), ndtr(last)
    drawn = np.clip(ndtri(below + uniform * (up_to - below)), first, last)
    return sign * drawn, up_to - below
