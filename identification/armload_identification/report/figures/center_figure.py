"""The centre of mass drawn on the flange, to scale, from the side and from the front, with its interval as an ellipse.

    x^T H^-1 x = 1,   H_ij = rho_ij h_i h_j

with h the half widths of the 95 % intervals and rho the correlation: the ellipse has the width and height of the
intervals. Colours are the page's (`currentColor` and its variables), so that they follow its colour scheme.
"""

from __future__ import annotations

from math import floor, log10
from typing import Final

import numpy as np

from armload_identification.model.payload import AXES, PayloadResult
from armload_identification.numerals import NO_BREAK, numeral
from armload_identification.report.page import rendered
from armload_identification.report.payload_in_words import half_widths

FLANGE_MM: Final = 63.0
"""Diameter of the drawn plate: a common flange, ISO 9409-1."""
_THICK_MM: Final = 8.0
_MIDDLE: Final = 160.0
"""Half of a drawing's width and height, in SVG units."""
_ROOM: Final = 1.25
_MM: Final = 1e3


def center_views(payload: PayloadResult) -> list[tuple[str, str]]:
    """Headings of the drawings whose two coordinates are determined, and their `svg` elements.

    Args:
        payload: The result, in the flange frame.
    """
    wanted = (("From the side", 2, 0), ("From the front, onto the flange", 0, 1))
    known = payload.determined[1:4]
    drawn = [view for view in wanted if known[view[1]] and known[view[2]]]
    if not drawn:
        return []
    centre, half = _MM * payload.values[1:4], _MM * half_widths(payload)[1:4]
    reach = _ROOM * max(float(np.abs(centre[known]).max() + half[known].max()), 0.75 * FLANGE_MM)
    return [(name, _drawing(payload, name, across, up, reach)) for name, across, up in drawn]


def _correlation(payload: PayloadResult, one: int, other: int) -> float:
    """Correlation of two coordinates; 0 if unknown."""
    if payload.mass_center is None:
        return 0.0
    covariance = payload.mass_center.total[1:, 1:]
    size = float(np.sqrt(covariance[one, one] * covariance[other, other]))
    return float(np.clip(covariance[one, other] / size, -0.999, 0.999)) if size > 0.0 else 0.0


def _drawing(payload: PayloadResult, heading: str, across: int, up: int, reach_mm: float) -> str:
    """One view: `across` to the right, `up` upwards."""
    scale = _MIDDLE / reach_mm
    centre, half = _MM * payload.values[1:4], _MM * half_widths(payload)[1:4]
    wide, high, turn = _ellipse(half[across], half[up], _correlation(payload, across, up))
    described = ", ".join(
        f"{AXES[axis]} {numeral(centre[axis], 1)} ± {numeral(half[axis], 1)}{NO_BREAK}mm" for axis in (across, up)
    )
    return rendered(
        "figures/center.svg.j2",
        name=f"centre-{AXES[across]}{AXES[up]}",
        title=f"Centre of mass on the flange, {heading[0].lower()}{heading[1:]}: {described}.",
        axes=(AXES[across], AXES[up]),
        x=_MIDDLE + scale * centre[across],
        y=_MIDDLE - scale * centre[up],
        ellipse=(scale * wide, scale * high, -turn),
        plate=(scale * _THICK_MM, scale * FLANGE_MM),
        ruler_mm=_ruler_mm(reach_mm),
        scale=scale,
    )


def _ruler_mm(reach_mm: float) -> float:
    """A length of 1, 2 or 5 times a power of ten, about a quarter of the drawing."""
    rough = 0.5 * reach_mm
    power = 10.0 ** floor(log10(rough))
    return max(step * power for step in (1.0, 2.0, 5.0) if step * power <= rough)


def _ellipse(one: float, other: float, correlation: float) -> tuple[float, float, float]:
    """Semi-axes, and angle of the first in degrees, counter-clockwise."""
    cross = correlation * one * other
    values, vectors = np.linalg.eigh(np.array([[one**2, cross], [cross, other**2]]))
    wide, high = np.sqrt(np.maximum(values[::-1], 0.0))
    return float(wide), float(high), float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
