"""What is known of a payload beforehand, against the data: refused, noted, or used.

A range, such as a mass of 1 to 3 kg, is no equation. The payload is identified without it, its distribution is
truncated to the ranges, and the payload is identified again as if mass and centre of mass were known to equal the
truncated mean. The error of that mean, with the truncated covariance, affects all ten values and is part of their
intervals, which are limited to the range. A range that the data contradict is refused.

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

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.estimation.prior_knowledge import EXACT, KnownPayload, Prior
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError, NoPayloadMass
from armload_identification.model.mass_center import moments_slope
from armload_identification.model.payload import CONFIDENCE
from armload_identification.pipeline.identification_result import Identification
from armload_identification.verdict.decision_levels import FalseAlarms

_NAMES: Final = ("mass", "centre of mass's x", "centre of mass's y", "centre of mass's z")
_UNITS: Final = ("kg", "mm", "mm", "mm")
_IN_UNIT: Final = (1.0, 1e3, 1e3, 1e3)
_BLIND_WIDTHS: Final = 10.0
"""Standard deviation of a quantity that the data do not determine, in widths of its range: nearly uniform there."""
_POINTS_LOG2: Final = 13
_LEAST_MASS: Final = 1e-3
"""Least mass as a share of the estimated one: at 0 a centre of mass has no meaning."""
_LEAST_VARIANCE: Final = 1e-12
"""Added variance as a share of each coordinate's own, so that a singular matrix has a Cholesky factor."""
_REMEDY: Final = "Correct or omit the range, or check that the recordings are of this payload."


def identified_knowing(known: KnownPayload, identified: Callable[[Prior], Identification]) -> Identification:
    """The payload with prior knowledge.

    Args:
        known: The knowledge.
        identified: Identifies with a prior.

    Raises:
        EstimationError: the data contradict it.
    """
    if known.symmetric:
        _require_symmetric(identified(replace(known, symmetric=False).prior()))
    note = _note_on_mass(known, identified)
    found = within_ranges(identified(known.prior()), known, identified)
    return found.with_notes(note) if note else found


def _require_symmetric(found: Identification) -> None:
    """Raise if the data contradict a symmetry about the flange axis."""
    center, half_width = found.uncertainty.values[1:3], found.uncertainty.half_width_95[1:3]
    if (np.abs(center) > FalseAlarms.certain_half_widths * half_width).any():
        raise EstimationError(
            "the payload was declared symmetric about the flange axis, but from the data its centre of mass lies "
            f"{1e3 * center[0]:+z.1f} and {1e3 * center[1]:+z.1f} mm off that axis (95 %: "
            f"+-{1e3 * half_width[0]:.1f} and {1e3 * half_width[1]:.1f} mm). Omit the symmetry, or check the flange "
            "frame."
        )


def _note_on_mass(known: KnownPayload, identified: Callable[[Prior], Identification]) -> str:
    """A note if the data contradict a weighed mass, but not clearly; empty without cause.

    A known mass is practically exact, so that a wrong one would appear in the result as a fact, with wrong gains
    instead: the data are asked without it, before it is used.
    """
    mass_kg = known.mass_kg
    if mass_kg is None or isinstance(mass_kg, tuple):
        return ""
    refusal = ""
    try:
        free = identified(replace(known, mass_kg=None).prior()).uncertainty
        center, half_width = float(free.values[0]), float(free.half_width_95[0])
    except NoPayloadMass as problem:
        # An empty arm has an accurate mass too, of 0; with an exact mass as prior nothing else would refuse its run.
        refusal, center, half_width = f". Without it: {problem}", problem.mass_kg, problem.half_width_kg
    except EstimationError:
        return ""  # Judged again with the mass, which may complete what the motion does not determine.
    if abs(mass_kg - center) <= half_width:
        return ""
    without = f"{center:.4g} +- {half_width:.2g} kg (95 %)"
    if abs(mass_kg - center) > FalseAlarms.certain_half_widths * half_width:
        why = refusal or (
            f": without it, the mass is {without}. Check the balance, its unit (kg), whether the recordings are of "
            "this payload, and the drive gains (`armload calibrate`); or omit the mass."
        )
        raise EstimationError(f"the weighed mass {mass_kg:g} kg contradicts the data{why}")
    return (
        f"The weighed mass {mass_kg:g} kg is outside the interval of the data: without it, the mass is {without}. "
        "Check the balance, or the drive gains: `armload calibrate`."
    )


def within_ranges(
    found: Identification, known: KnownPayload, identified: Callable[[Prior], Identification]
) -> Identification:
    """An identification with known ranges.

    Args:
        found: The identification without them.
        known: The ranges, and other prior knowledge.
        identified: Identifies with a prior.

    Returns:
        `found` if its intervals lie within the ranges; otherwise the identification with them, and a note for each
        active range.

    Raises:
        EstimationError: the data contradict a range, or several together.
    """
    limits = known.limits
    interval = found.uncertainty.interval_95[:4]
    for quantity in np.flatnonzero((interval[:, 1] < limits[:, 0]) | (interval[:, 0] > limits[:, 1])):
        raise EstimationError(
            f"the {_NAMES[quantity]} was given as {_range(quantity, limits)}, but from the data it is "
            f"{_range(quantity, interval)} (95 %). {_REMEDY}"
        )
    binds = _extends_beyond(interval, limits)
    if not binds.any():
        return found
    mean, covariance = _without_ranges(found, limits)
    ranged = np.flatnonzero(np.isfinite(limits[:, 0]))
    if contradicted(mean[ranged], covariance[np.ix_(ranged, ranged)], limits[ranged]):
        said = " and ".join(
            f"the {_NAMES[i]} was given as {_range(i, limits)} and is {_range(i, interval)}" for i in ranged
        )
        raise EstimationError(
            f"the given ranges together contradict the data: {said} (95 %), and no payload within all of them explains "
            f"the torque. {_REMEDY}"
        )
    result = identified(_prior_within(known, *truncated_moments(mean, covariance, limits)))
    binds |= _extends_beyond(result.uncertainty.interval_95[:4], limits)
    ends = np.tile([-np.inf, np.inf], (10, 1))
    ends[:4][binds] = limits[binds]
    uncertainty = replace(result.uncertainty, limits=ends)
    notes = [
        f"the given range of the {_NAMES[i]}, {_range(i, limits)}, is active: without it the 95 % interval is "
        f"{_range(i, interval)}, with it {_range(i, uncertainty.interval_95)}."
        for i in np.flatnonzero(binds)
    ]
    return replace(result, uncertainty=uncertainty, notes=(*notes, *result.notes))


def _extends_beyond(interval: FloatArray, limits: FloatArray) -> NDArray[np.bool_]:
    """(4,) True for intervals that extend beyond the limits."""
    return np.asarray((interval[:, 0] < limits[:, 0]) | (interval[:, 1] > limits[:, 1]))


def _without_ranges(found: Identification, limits: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(4,) mass and centre of mass and (4, 4) their covariance, scaled to the 95 % intervals."""
    mean = found.uncertainty.values[:4].copy()
    covariance = found.mass_center.total
    deviation = found.uncertainty.half_width_95[:4] / NORMAL_HALF_WIDTH
    blind = np.isinf(deviation)
    wider = np.where(blind, 1.0, deviation / np.sqrt(np.diag(covariance)))
    covariance = covariance * np.outer(wider, wider)
    for quantity in np.flatnonzero(blind & np.isfinite(limits[:, 0])):
        mean[quantity] = limits[quantity].mean()
        covariance[quantity] = covariance[:, quantity] = 0.0
        covariance[quantity, quantity] = (_BLIND_WIDTHS * np.diff(limits[quantity])[0]) ** 2
    return mean, covariance


def _range(quantity: np.intp, ends: FloatArray) -> str:
    """'1 to 3 kg' for a quantity."""
    low, high = _IN_UNIT[quantity] * ends[quantity]
    return f"{low:.4g} to {high:.4g} {_UNITS[quantity]}"


def _prior_within(known: KnownPayload, mean: FloatArray, covariance: FloatArray) -> Prior:
    """The equations with the truncated mean (4,), of (4, 4) covariance, for the quantities that have a range."""
    ranged = np.isfinite(known.limits[:, 0])
    values, exact = known.prior(), KnownPayload(float(mean[0]), np.where(ranged, mean, 0.0)[1:]).prior()
    rows, rate = exact.rows[ranged], np.array([1.0 / mean[0], 1.0, 1.0, 1.0])[ranged] / EXACT
    power, axes = np.linalg.eigh(covariance[np.ix_(ranged, ranged)])
    errors = np.sqrt(np.maximum(power, 0.0))[:, None] * axes.T
    return Prior(
        np.vstack([values.rows, rows]),
        np.concatenate([values.target, exact.target[ranged]]),
        errors @ (rate[:, None] * rows),
    )


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
    from scipy.special import ndtr
    from scipy.stats import qmc, truncnorm

    to_moments = moments_slope(float(mean[0]), mean[1:])
    middle = np.concatenate([mean[:1], mean[0] * mean[1:]])
    spread = to_moments @ covariance @ to_moments.T
    triangle = np.linalg.cholesky(spread + np.diag(_LEAST_VARIANCE * np.diag(spread)))
    uniform = qmc.Sobol(4, scramble=True, seed=0).random_base2(_POINTS_LOG2)
    normal = np.zeros_like(uniform)
    weight = np.ones(len(uniform))
    x = np.zeros_like(uniform)
    for i in range(4):
        given = middle[i] + normal[:, :i] @ triangle[i, :i]
        low, high = limits[i]
        if i == 0:
            low = np.maximum(low, _LEAST_MASS * mean[0])
        else:
            low, high = low * x[:, 0], high * x[:, 0]
        low, high = (low - given) / triangle[i, i], (high - given) / triangle[i, i]
        normal[:, i] = truncnorm.ppf(uniform[:, i], low, high)
        x[:, i] = given + triangle[i, i] * normal[:, i]
        # of the lower tail, to keep precision
        weight *= np.where(low > 0.0, ndtr(-low) - ndtr(-high), ndtr(high) - ndtr(low))
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
    return bool(nearest.cost > gammaincinv(0.5 * mean.size, CONFIDENCE))
