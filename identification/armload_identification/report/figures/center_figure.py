"""The centre of mass drawn on the flange, to scale, from the side and from the front, with its interval as an ellipse.

    x^T H^-1 x = 1,   H_ij = rho_ij h_i h_j

with h the half widths of the 95 % intervals and rho the correlation: the ellipse has the width and height of the
intervals. Colours are the page's (`currentColor` and its variables), so that they follow its colour scheme.
"""

from __future__ import annotations

from math import floor, log10
from typing import Final

import numpy as np

from armload_identification.model.payload import PayloadResult
from armload_identification.numerals import NO_BREAK, numeral
from armload_identification.report.payload_in_words import half_widths

FLANGE_MM: Final = 63.0
"""Diameter of the drawn plate: a common flange, ISO 9409-1."""
_THICK_MM: Final = 8.0
_SIDE: Final = 320
"""Width and height of a drawing, in SVG units."""
_ROOM: Final = 1.25
_LEAST_DOT: Final = 3.5
_AXES: Final = ("x", "y", "z")
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
    scale = 0.5 * _SIDE / reach_mm
    middle = 0.5 * _SIDE
    centre, half = _MM * payload.values[1:4], _MM * half_widths(payload)[1:4]
    x, y = middle + scale * centre[across], middle - scale * centre[up]
    parts = [_flange(across, scale), *_axis_marks(across, up), _ruler(reach_mm, scale)]
    wide, high, turn = _ellipse(half[across], half[up], _correlation(payload, across, up))
    parts.append(
        f'<ellipse cx="{x:.1f}" cy="{y:.1f}" rx="{scale * wide:.2f}" ry="{scale * high:.2f}" '
        f'transform="rotate({-turn:.1f} {x:.1f} {y:.1f})" class="interval"/>'
    )
    parts.append(f'<path class="cross" d="M{x - 7:.1f} {y:.1f}h14M{x:.1f} {y - 7:.1f}v14"/>')
    parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{_LEAST_DOT}" class="centre"/>')
    described = ", ".join(
        f"{_AXES[axis]} {numeral(centre[axis], 1)} ± {numeral(half[axis], 1)}{NO_BREAK}mm" for axis in (across, up)
    )
    title = f"Centre of mass on the flange, {heading[0].lower()}{heading[1:]}: {described}."
    name = f"centre-{_AXES[across]}{_AXES[up]}"
    return (
        f'<svg viewBox="0 0 {_SIDE} {_SIDE}" role="img" aria-labelledby="{name}" class="centre-view">'
        f'<title id="{name}">{title}</title>{"".join(parts)}</svg>'
    )


def _flange(across: int, scale: float) -> str:
    """The plate: edge-on if the view shows z, else face-on."""
    middle, wide = 0.5 * _SIDE, scale * FLANGE_MM
    if across == 2:
        thick = scale * _THICK_MM
        return (
            f'<rect x="{middle - thick:.1f}" y="{middle - 0.5 * wide:.1f}" width="{thick:.1f}" height="{wide:.1f}" '
            'class="flange"/>'
        )
    return f'<circle cx="{middle:g}" cy="{middle:g}" r="{0.5 * wide:.1f}" class="flange"/>'


def _axis_marks(across: int, up: int) -> list[str]:
    """Both axes through the flange's origin, with their letters."""
    end, middle = _SIDE - 8, 0.5 * _SIDE
    return [
        f'<path class="axis" d="M8 {middle:g}H{end}M{middle:g} {end}V8"/>',
        f'<text x="{end}" y="{middle - 8:g}" text-anchor="end">{_AXES[across]}</text>',
        f'<text x="{middle + 6:g}" y="24">{_AXES[up]}</text>',
    ]


def _ruler(reach_mm: float, scale: float) -> str:
    """A length of 1, 2 or 5 times a power of ten, about a quarter of the drawing."""
    rough = 0.5 * reach_mm
    power = 10.0 ** floor(log10(rough))
    length = max(step * power for step in (1.0, 2.0, 5.0) if step * power <= rough)
    left, bottom = 10.0, _SIDE - 12.0
    return (
        f'<path class="ruler" d="M{left:g} {bottom - 4:g}v8m0 -4h{scale * length:.1f}m0 -4v8"/>'
        f'<text x="{left:g}" y="{bottom - 10:g}">{length:g}{NO_BREAK}mm</text>'
    )


def _ellipse(one: float, other: float, correlation: float) -> tuple[float, float, float]:
    """Semi-axes, and angle of the first in degrees, counter-clockwise."""
    cross = correlation * one * other
    values, vectors = np.linalg.eigh(np.array([[one**2, cross], [cross, other**2]]))
    wide, high = np.sqrt(np.maximum(values[::-1], 0.0))
    return float(wide), float(high), float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])))
