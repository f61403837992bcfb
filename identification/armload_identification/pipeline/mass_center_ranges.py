"""Known ranges of mass and centre of mass: which are active, and whether the data contradict them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.prior_knowledge import KnownPayload, Prior
from armload_identification.estimation.truncated_normal import contradicted, truncated_moments
from armload_identification.estimation.uncertainty import NORMAL_HALF_WIDTH
from armload_identification.identification_errors import EstimationError
from armload_identification.pipeline.identification_result import Identification

_NAMES: Final = ("mass", "centre of mass's x", "centre of mass's y", "centre of mass's z")
_UNITS: Final = ("kg", "mm", "mm", "mm")
_IN_UNIT: Final = (1.0, 1e3, 1e3, 1e3)
_BLIND_WIDTHS: Final = 10.0
"""Standard deviation of a quantity that the data do not determine, in widths of its range: nearly uniform there."""
_REMEDY: Final = "Correct or omit the range, or check that the recordings are of this payload."


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
    for quantity in _which((interval[:, 1] < limits[:, 0]) | (interval[:, 0] > limits[:, 1])):
        raise EstimationError(
            f"the {_NAMES[quantity]} was given as {_range(quantity, limits)}, but from the data it is "
            f"{_range(quantity, interval)} (95 %). {_REMEDY}"
        )
    binds = _beyond(interval, limits)
    if not binds.any():
        return found
    mean, covariance = _without_ranges(found, limits)
    ranged = np.isfinite(limits[:, 0])
    if contradicted(mean[ranged], covariance[np.ix_(ranged, ranged)], limits[ranged]):
        said = " and ".join(
            f"the {_NAMES[i]} was given as {_range(i, limits)} and is {_range(i, interval)}" for i in _which(ranged)
        )
        raise EstimationError(
            f"the given ranges together contradict the data: {said} (95 %), and no payload within all of them explains "
            f"the torque. {_REMEDY}"
        )
    result = identified(known.prior_within(*truncated_moments(mean, covariance, limits)))
    binds |= _beyond(result.uncertainty.interval_95[:4], limits)
    ends = np.tile([-np.inf, np.inf], (10, 1))
    ends[:4][binds] = limits[binds]
    uncertainty = replace(result.uncertainty, limits=ends)
    notes = [
        f"the given range of the {_NAMES[i]}, {_range(i, limits)}, is active: without it the 95 % interval is "
        f"{_range(i, interval)}, with it {_range(i, uncertainty.interval_95)}."
        for i in _which(binds)
    ]
    return replace(result, uncertainty=uncertainty, notes=(*notes, *result.notes))


def _beyond(interval: FloatArray, limits: FloatArray) -> NDArray[np.bool_]:
    """(4,) True for intervals that extend beyond the limits."""
    return np.asarray((interval[:, 0] < limits[:, 0]) | (interval[:, 1] > limits[:, 1]))


def _which(there: NDArray[np.bool_]) -> list[int]:
    """Indices of the True elements."""
    return [int(place) for place in np.flatnonzero(there)]


def _without_ranges(found: Identification, limits: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(4,) mass and centre of mass and (4, 4) their covariance, scaled to the 95 % intervals."""
    mean = found.uncertainty.values[:4].copy()
    covariance = found.mass_center.total
    deviation = found.uncertainty.half_width_95[:4] / NORMAL_HALF_WIDTH
    blind = np.isinf(deviation)
    wider = np.where(blind, 1.0, deviation / np.sqrt(np.diag(covariance)))
    covariance = covariance * np.outer(wider, wider)
    for quantity in _which(blind & np.isfinite(limits[:, 0])):
        mean[quantity] = limits[quantity].mean()
        covariance[quantity] = covariance[:, quantity] = 0.0
        covariance[quantity, quantity] = (_BLIND_WIDTHS * np.diff(limits[quantity])[0]) ** 2
    return mean, covariance


def _range(quantity: int, ends: FloatArray) -> str:
    """'1 to 3 kg' for a quantity."""
    low, high = _IN_UNIT[quantity] * ends[quantity]
    return f"{low:.4g} to {high:.4g} {_UNITS[quantity]}"
