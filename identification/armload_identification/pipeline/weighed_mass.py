"""Comparison of a weighed mass with the mass that the data give without it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Final

from armload_identification.estimation.prior_knowledge import KnownPayload, Prior
from armload_identification.identification_errors import EstimationError, NoPayloadMass
from armload_identification.pipeline.identification_result import Identification

CONTRADICTS: Final = 2.0
"""Half widths of the 95 % interval from which prior knowledge is refused: exceeded by chance in one of 10,000 cases,
while a correct mass lies outside the interval itself in one of 20. Between the two a note is given."""


def note_on_mass(known: KnownPayload, identified: Callable[[Prior], Identification]) -> str:
    """Compare a weighed mass with the data, before it is used.

    A known mass is practically exact, so that a wrong one would appear in the result as a fact, with wrong gains
    instead.

    Args:
        known: The prior knowledge.
        identified: Identifies with a prior.

    Returns:
        A note if the mass is outside the interval but does not clearly contradict the data; otherwise empty.

    Raises:
        EstimationError: the data contradict the mass.
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
    if abs(mass_kg - center) > CONTRADICTS * half_width:
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
