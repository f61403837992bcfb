"""The result for a reader: a sentence, the table of the ten parameters, plain and reported estimates compared.

Undetermined parameters have no number, only how far they are from being determined.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.model.payload import (
    AXES,
    DETERMINED_SHARE,
    InertialParameters,
    PayloadResult,
    derived,
    value_scale,
)
from armload_identification.numerals import NO_BREAK, Numeral, align, decimals_for, numeral
from armload_identification.pipeline.identification_result import Identification
from armload_identification.verdict.joint_words import listed

_KG_M2: Final = f"kg{NO_BREAK}m²"
_MM: Final = 1e3


_NAMES: Final = (
    ("mass", "m", "", "kg"),
    *(("centre of mass", "c", axis, "m") for axis in AXES),
    *(("moment of inertia", "I", axis, _KG_M2) for axis in ("xx", "yy", "zz")),
    *(("product of inertia", "I", axes, _KG_M2) for axes in ("xy", "xz", "yz")),
)
_NAMED: Final = [dict(zip(("quantity", "symbol", "index", "unit"), names, strict=True)) for names in _NAMES]
"""Names of the ten parameters, the first cells of their rows."""


def mass_card(payload: PayloadResult) -> tuple[str, str] | None:
    """The mass and its interval, each with the unit; None if it is not determined."""
    if not payload.determined[0]:
        return None
    value, low, high = _rounded(payload.values[:1], half_widths(payload)[:1], payload.interval_95[:1])[0]
    return f"{value}{NO_BREAK}kg", f"{low} to {high}{NO_BREAK}kg"


def headline(payload: PayloadResult) -> str:
    """The result in one to three sentences with intervals."""
    card = mass_card(payload)
    mass = "The mass of the payload is not determined by these data."
    if card is not None:
        mass = f"The payload weighs {card[0]} {_bracket(card[1])}."
    millimetres = _rounded(_MM * payload.values[1:4], _MM * half_widths(payload)[1:4], _MM * payload.interval_95[1:4])
    known = payload.determined[1:4]
    known_parts = [
        f"{axis}{NO_BREAK}={NO_BREAK}{value}{NO_BREAK}mm {_bracket(f'{low} to {high} mm')}"
        for axis, (value, low, high), there in zip(AXES, millimetres, known, strict=True)
        if there
    ]
    unknown = [axis for axis, there in zip(AXES, known, strict=True) if not there]
    if not known_parts:
        return f"{mass} Its centre of mass is not determined."
    center = f"Its centre of mass lies at {listed(known_parts)} in the {payload.frame} frame."
    missing = f" Its position along {listed(unknown)} is not determined." if unknown else ""
    return f"{mass} {center}{missing}"


def truth_sentence(payload: PayloadResult, truth: InertialParameters) -> str:
    """Error of a simulated payload's mass and centre of mass, if determined.

    Args:
        truth: The payload that was simulated, in the same frame.
    """
    known_parts = []
    if payload.determined[0]:
        known_parts.append(f"the mass is {_error_text(0, payload.values[0], truth.mass_kg)} off")
    if payload.determined[1:4].all():
        off_m = float(np.linalg.norm(payload.values[1:4] - truth.center_of_mass_m))
        known_parts.append(f"the centre of mass {numeral(_MM * off_m, 1)}{NO_BREAK}mm")
    if not known_parts:
        return ""
    return f"The simulated payload is known exactly: {listed(known_parts)}."


def parameter_rows(
    payload: PayloadResult, half_width_95: FloatArray, truth: InertialParameters | None
) -> list[dict[str, Any]]:
    """The table of the ten parameters.

    Args:
        half_width_95: (10,) half widths of the 95 % intervals, also of undetermined parameters; nan if unknown.
        truth: In simulation, the payload in the same frame; else None.

    Returns:
        Cells of each row: names; whether it is `determined`; `estimate`, and `low` and `high` end of its 95 % interval,
        without a number if it is not; `limit_share`, half width divided by the greatest with which it would be
        determined, None if unknown, as for undetermined parameters of a payload file; `truth`, `error` of the estimate,
        and whether the truth is `covered` by the interval, None or empty without truth or estimate.
    """
    values, known, intervals = payload.values, payload.determined, payload.interval_95
    limits = DETERMINED_SHARE * value_scale(payload.model.mass_kg)
    # The truth of an undetermined parameter is shown with the digits of one just determined.
    shown = np.where(known, half_widths(payload), limits)
    rounded = _rounded(values, shown, intervals)
    texts = [row if there else ("", "", "") for row, there in zip(rounded, known, strict=True)]
    estimates, lows, highs = (align(column) for column in zip(*texts, strict=True))
    exact = None if truth is None else derived(truth)[0]
    truths: Sequence[Numeral | None] = (None,) * 10
    if exact is not None:
        truths = align([numeral(t, decimals_for(w, t) + 1) for t, w in zip(exact, shown, strict=True)])
    rows = []
    for i, names in enumerate(_NAMED):
        share = None if np.isnan(half_width_95[i]) else float(half_width_95[i] / limits[i])
        error, covered = "", None
        if exact is not None and known[i]:
            error = _error_text(i, values[i], exact[i], shown[i])
            covered = bool(intervals[i, 0] <= exact[i] <= intervals[i, 1])
        numbers: dict[str, Any] = {"estimate": estimates[i], "low": lows[i], "high": highs[i], "truth": truths[i]}
        judged = {"determined": bool(known[i]), "limit_share": share, "error": error, "covered": covered}
        rows.append(names | numbers | judged)
    return rows


def compared_rows(identification: Identification, payload: PayloadResult) -> list[dict[str, Any]]:
    """Names of the determined parameters, `plain` estimate, `reported` one, which is physically possible, and `change`.

    The change is reported minus plain, in half widths of the interval.
    """
    plain = derived(identification.plain_parameters)[0]
    widths = half_widths(payload)
    chosen = np.flatnonzero(payload.determined)
    decimals = [decimals_for(widths[i], payload.values[i]) for i in chosen]
    change = np.divide(payload.values - plain, widths, out=np.zeros(10), where=widths > 0.0)
    columns = (
        align([numeral(plain[i], d) for i, d in zip(chosen, decimals, strict=True)]),
        align([numeral(payload.values[i], d) for i, d in zip(chosen, decimals, strict=True)]),
        align([numeral(change[i], 2, signed=True) for i in chosen]),
    )
    rows = zip(chosen, *columns, strict=True)
    return [_NAMED[i] | {"plain": one, "reported": other, "change": apart} for i, one, other, apart in rows]


def half_widths(payload: PayloadResult) -> FloatArray:
    """(10,) half widths; nan where not determined."""
    return np.asarray(0.5 * (payload.interval_95[:, 1] - payload.interval_95[:, 0]))


def _rounded(values: FloatArray, half_widths: FloatArray, intervals: FloatArray) -> list[tuple[str, str, str]]:
    """Value, low and high end, each with the digits that the half width justifies."""
    rows = []
    for value, half_width, (low, high) in zip(values, half_widths, intervals, strict=True):
        decimals = decimals_for(half_width, value)
        rows.append((numeral(value, decimals), numeral(low, decimals), numeral(high, decimals)))
    return rows


def _bracket(interval: str) -> str:
    """An interval without line breaks."""
    return f"({interval})".replace(" ", NO_BREAK)


def _error_text(index: int, value: float, truth: float, half_width: float = np.nan) -> str:
    """Estimate minus truth: of the mass in percent, of the centre of mass in millimetres, else in its unit."""
    if index == 0:
        return f"{numeral(100.0 * (value / truth - 1.0), 2, signed=True)}{NO_BREAK}%"
    if index <= len(AXES):
        return f"{numeral(_MM * (value - truth), 1, signed=True)}{NO_BREAK}mm"
    return f"{numeral(value - truth, decimals_for(half_width, value), signed=True)}{NO_BREAK}{_KG_M2}"
