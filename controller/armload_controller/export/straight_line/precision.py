"""Double or single precision of generated C: its type, its literals, its functions."""

from __future__ import annotations

from enum import StrEnum

import numpy as np

from armload_controller.export.text_format import exact
from armload_identification.float_array import FloatArray


class Precision(StrEnum):
    """Precision of the computation, by its type name in C."""

    DOUBLE = "double"
    SINGLE = "float"

    @property
    def dtype(self) -> type[np.float64] | type[np.float32]:
        """The same type in numpy."""
        return np.float64 if self is Precision.DOUBLE else np.float32

    @property
    def suffix(self) -> str:
        """Suffix of math.h functions and of literals of this type."""
        return "" if self is Precision.DOUBLE else "f"

    def listed(self, values: FloatArray) -> str:
        """Literals of (k,) numbers on one line."""
        return ", ".join(self.literal(float(value)) for value in values)

    def rows(self, values: FloatArray) -> str:
        """Literals of (m, k) numbers, one row per line."""
        return ",\n    ".join(self.listed(row) for row in values)

    def literal(self, value: float) -> str:
        """The shortest literal of this type that represents the number, without an implicit conversion."""
        if self is Precision.DOUBLE:
            return exact(value)
        text = np.format_float_positional(np.float32(value) + np.float32(0.0), unique=True, trim="0")
        if len(text) > 15:
            text = np.format_float_scientific(np.float32(value), unique=True, trim="0")
        return f"{text}f"
