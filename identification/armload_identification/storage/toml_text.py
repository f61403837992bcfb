"""The text of TOML values; every number is read back identically."""

from __future__ import annotations

import json
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike


def text(value: str) -> str:
    """A string."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def number(value: float) -> str:
    """A float."""
    return repr(float(value))


def array(value: ArrayLike) -> str:
    """An array of floats; a matrix gets one line per row."""
    numbers = np.asarray(value, dtype=np.float64)
    if numbers.ndim == 1:
        return "[" + ", ".join(number(v) for v in numbers) + "]"
    return "[\n" + "".join(f"    {array(row)},\n" for row in numbers) + "]"


def inline(values: Mapping[str, str]) -> str:
    """An inline table of values that are TOML already; keys must be bare or quoted."""
    return "{ " + ", ".join(f"{key} = {value}" for key, value in values.items()) + " }"
