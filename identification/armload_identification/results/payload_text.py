"""A payload's ten values as text: as many digits as the interval justifies, and no number for undetermined values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from armload_identification.model.payload import PARAMETER_NAMES, PayloadResult
from armload_identification.report.numerals import decimals_for

UNITS: Final = ("kg", "m", "m", "m", "kg m2", "kg m2", "kg m2", "kg m2", "kg m2", "kg m2")
NOT_DETERMINED: Final = "not determined"


@dataclass(frozen=True)
class ValueText:
    """One of the ten values.

    Attributes:
        name: As in `PARAMETER_NAMES`.
        estimate: The number, or `NOT_DETERMINED`.
        interval: "low to high", or empty.
        unit: Its unit.
    """

    name: str
    estimate: str
    interval: str
    unit: str


def value_texts(payload: PayloadResult) -> tuple[ValueText, ...]:
    """The ten values in the order of `PARAMETER_NAMES`."""
    texts = []
    for i, name in enumerate(PARAMETER_NAMES):
        estimate, interval = NOT_DETERMINED, ""
        if payload.determined[i]:
            low, high = payload.interval_95[i]
            digits = decimals_for((high - low) / 2, payload.values[i])
            estimate, interval = f"{payload.values[i]:.{digits}f}", f"{low:.{digits}f} to {high:.{digits}f}"
        texts.append(ValueText(name, estimate, interval, UNITS[i]))
    return tuple(texts)
