"""What is known of a payload beforehand, against the data: refused, noted, or used."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.prior_knowledge import KnownPayload, Prior, contradicted, truncated_moments
from armload_identification.estimation.uncertainty import NORMAL_HALF_WIDTH
from armload_identification.identification_errors import EstimationError, NoPayloadMass
from armload_identification.pipeline.identification_result import Identification

_CONTRADICTS: Final = 2.0
"""Half widths of the 95 % interval from which prior knowledge is refused: exceeded by chance in one of 10,000 cases,
while a correct mass lies outside the interval itself in one of 20. Between the two a note is given."""
_NAMES: Final = ("mass", "centre of mass's x", "centre of mass's y", "centre of mass's z")
_UNITS: Final = ("kg", "mm", "mm", "mm")
_IN_UNIT: Final = (1.0, 1e3, 1e3, 1e3)
_BLIND_WIDTHS: Final = 10.0
"""Standard deviation of a quantity that the data do not determine, in widths of its range: nearly uniform there."""
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
    if (np.abs(center) > _CONTRADICTS * half_width).any():
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
    refusal: NoPayloadMass | None = None
    try:
        free = identified(replace(known, mass_kg=None).prior()).uncertainty
    except NoPayloadMass as problem:
        # An empty arm has an accurate mass too, of 0; with an exact mass as prior nothing else would refuse its run.
        refusal, center, half_width = problem, problem.mass_kg, problem.half_width_kg
    except EstimationError:
        return ""  # Judged again with the mass, which may complete what the motion does not determine.
    else:
        center, half_width = float(free.values[0]), float(free.half_width_95[0])
    if abs(mass_kg - center) <= half_width:
        return ""
    without = f"{center:.4g} +- {half_width:.2g} kg (95 %)"
    if abs(mass_kg - center) > _CONTRADICTS * half_width:
        if refusal is not None:
            raise EstimationError(f"the weighed mass {mass_kg:g} kg contradicts the data. Without it: {refusal}")
        raise EstimationError(
            f"the weighed mass {mass_kg:g} kg contradicts the data: without it, the mass is {without}. Check the "
            "balance, its unit (kg), whether the recordings are of this payload, and the drive gains (`armload "
            "calibrate`); or omit the mass."
        )
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
