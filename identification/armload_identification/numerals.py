"""Formatting of numbers: as many digits as the interval justifies, columns aligned at the decimal point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

NO_BREAK: Final = "\N{NO-BREAK SPACE}"
MINUS: Final = "\N{MINUS SIGN}"
_MOST_DECIMALS: Final = 9
_EXACT_DIGITS: Final = 6
_POINT_CH: Final = 0.5
"""Width of the decimal point, in widths of a digit."""


@dataclass(frozen=True)
class Numeral:
    """A number of a column.

    Attributes:
        text: The number as printed.
        pad_ch: Padding after it, in widths of a digit, that aligns the decimal points.
    """

    text: str
    pad_ch: float


def decimals_for(half_width: float, value: float) -> int:
    """Number of decimals that shows two significant digits of a half width.

    Args:
        half_width: Half width of the value's interval; if it is 0 or not finite, the value itself decides.
    """
    if np.isfinite(half_width) and half_width > 0.0:
        return _decimals(half_width, 2)
    return _decimals(value, _EXACT_DIGITS)


def numeral(value: float, decimals: int, *, signed: bool = False) -> str:
    """A number with a typographic minus sign, and without a sign for zero.

    Args:
        value: The number.
        decimals: Number of decimals.
        signed: Whether positive numbers get a plus sign.
    """
    if not np.isfinite(value):
        return "unknown" if np.isnan(value) else f"{MINUS if value < 0.0 else ''}\N{INFINITY}"
    text = f"{abs(value):.{decimals}f}"
    zero = not text.strip("0.")
    if value < 0.0 and not zero:
        return MINUS + text
    return f"+{text}" if signed and not zero else text


def align(texts: Sequence[str]) -> tuple[Numeral, ...]:
    """Numbers of a column with the padding that aligns their decimal points.

    Args:
        texts: Printed numbers, with or without a decimal point; texts may be empty.
    """
    behind = [len(digits) + _POINT_CH * len(point) for _, point, digits in (text.partition(".") for text in texts)]
    widest = max(behind, default=0.0)
    return tuple(Numeral(text, widest - width) for text, width in zip(texts, behind, strict=True))


def common_decimals(values: ArrayLike, digits: int) -> int:
    """Common number of decimals of a column.

    Args:
        values: (k,) numbers.
        digits: Significant digits of the greatest one.
    """
    numbers = np.asarray(values, dtype=np.float64)
    greatest = float(np.max(np.abs(numbers), where=np.isfinite(numbers), initial=0.0))
    return _decimals(greatest, digits)


def scientific(value: float) -> tuple[str, str]:
    """A number as mantissa of two digits and power of ten.

    Returns:
        Both as text; the power is empty if the number is not finite.
    """
    if not np.isfinite(value):
        return numeral(value, 0), ""
    mantissa, _, exponent = f"{value:.1e}".partition("e")
    return mantissa.replace("-", MINUS), str(int(exponent)).replace("-", MINUS)


def counted(count: int, what: str) -> str:
    """'1 arm' or '3 arms'."""
    return f"{count} {what}{'' if count == 1 else 's'}"


def _decimals(size: float, digits: int) -> int:
    """Number of decimals that shows `digits` significant digits; 0 for zero and for numbers that are not finite."""
    if not np.isfinite(size) or size == 0.0:
        return 0
    # From the rounded number: 0.0996 to two digits is 0.10.
    exponent = int(f"{size:.{digits - 1}e}".partition("e")[2])
    return int(np.clip(digits - 1 - exponent, 0, _MOST_DECIMALS))
