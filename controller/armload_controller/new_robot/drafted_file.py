"""A robot's file while it is drafted: its lines, its holes and what is unchecked."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np

HOLE: Final = '"FILL IN"'
"""Stands for a number that only the arm's manufacturer or user knows."""


@dataclass
class DraftedFile:
    """A robot's file as text.

    Attributes:
        holes: Keys that must be filled in before the file is accepted.
        unchecked: Assumptions and omissions, one sentence each.
    """

    holes: list[str] = field(default_factory=list)
    unchecked: list[str] = field(default_factory=list)
    _lines: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """The file's text."""
        return "\n".join(self._lines) + "\n"

    def add(self, *lines: str) -> None:
        """Add lines unchanged."""
        self._lines += lines

    def value(self, key: str, value: float, where: str, comment: str = "") -> None:
        """Add a line with a number, or with a hole if it is NaN."""
        self.add(f"{key} = {self.number(value, f'{where}.{key}')}" + (f"  # {comment}" if comment else ""))

    def number(self, value: float, place: str) -> str:
        """TOML of a number; a hole, which is listed, if it is NaN."""
        if np.isnan(value):
            self.holes.append(place)
            return HOLE
        return repr(float(f"{value:.12g}"))
