"""Units of a table's columns: how programs and people write them, and the factor to SI."""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Mapping
from typing import Final

DEGREE_RAD: Final = math.pi / 180.0
_TURN: Final = 2.0 * math.pi
_UNITS: Final[Mapping[str, Mapping[str, tuple[float, str]]]] = {
    "time_s": {
        "s": (1.0, "sec secs second seconds sekunden secondes"),
        "ms": (1e-3, "msec millis millisecond milliseconds"),
        "us": (1e-6, "usec micros microsecond microseconds"),
        "ns": (1e-9, "nsec nsecs nanos nanosec nanosecond nanoseconds"),
    },
    "position_rad": {
        "rad": (1.0, "rads radian radians"),
        "mrad": (1e-3, ""),
        "deg": (DEGREE_RAD, "degs degree degrees degre degres"),
        "rev": (_TURN, "turn turns"),
    },
    "velocity_rad_s": {
        "rad/s": (1.0, "rads rad radpers radsec radianspersecond"),
        "deg/s": (DEGREE_RAD, "degs deg degree degrees degpers degsec degreespersecond"),
        "rpm": (_TURN / 60.0, "umin 1min trmin"),
    },
    "current_a": {"A": (1.0, "a amp amps ampere amperes"), "mA": (1e-3, "millia")},
    "torque_nm": {"Nm": (1.0, "newtonmeter newtonmeters"), "mNm": (1e-3, "nmm"), "kNm": (1e3, "")},
}
"""Units by quantity: as `--columns` writes them, the factor to SI, and other spellings in letters and digits."""
_SIGNS: Final = str.maketrans({"°": " deg ", "º": " deg ", "µ": "u", "μ": "u", "τ": "tau", "θ": "theta"})


def plain_text(text: str) -> str:
    """A text without accents, with the signs of units and angles as letters.

    Args:
        text: The text, such as "Température [°C]".
    """
    spread = unicodedata.normalize("NFKD", text.translate(_SIGNS))
    return "".join(sign for sign in spread if not unicodedata.combining(sign))


def unit_factor(quantity: str, unit: str) -> float | None:
    """Factor from a unit to SI; None if it is no known unit of the quantity.

    Args:
        quantity: Such as "position_rad".
        unit: Such as "deg", "°/s" or "N m".
    """
    spelling = _letters(plain_text(unit))
    for name, (factor, others) in _UNITS[quantity].items():
        if spelling == _letters(name) or spelling in others.split():
            return factor
    return None


def units_of(quantity: str) -> str:
    """The units that a quantity can be given in, for messages.

    Args:
        quantity: Such as "position_rad".
    """
    return ", ".join(_UNITS[quantity])


def unit_name(quantity: str, factor: float) -> str:
    """A unit by its factor to SI, as `--columns` accepts it; empty for an unknown factor.

    Args:
        quantity: Such as "position_rad".
        factor: One of the factors of `unit_factor`.
    """
    return next((name for name, (known, _) in _UNITS[quantity].items() if math.isclose(known, factor)), "")


def _letters(text: str) -> str:
    return "".join(re.findall(r"[a-z0-9]+", text.lower()))
