"""Results of a recording of one of many arms: the monitored quantities, each with its uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from enum import StrEnum

from armload_identification.recording.run_start import STATED_BY


class QuantityKind(StrEnum):
    """Kind of monitored quantity."""

    MASS = "mass"
    CENTER_X = "centre of mass x"
    CENTER_Y = "centre of mass y"
    CENTER_Z = "centre of mass z"
    GAIN = "gain"
    FRICTION = "friction"
    RESIDUAL = "residual over noise"


PER_PAYLOAD = frozenset({QuantityKind.MASS, QuantityKind.CENTER_X, QuantityKind.CENTER_Y, QuantityKind.CENTER_Z})
"""Quantities of a payload; the others belong to a joint."""
UNITS: Mapping[QuantityKind, tuple[str, float]] = {
    QuantityKind.MASS: ("kg", 1.0),
    QuantityKind.CENTER_X: ("mm", 1e3),
    QuantityKind.CENTER_Y: ("mm", 1e3),
    QuantityKind.CENTER_Z: ("mm", 1e3),
    QuantityKind.GAIN: ("%", 1e2),
    QuantityKind.FRICTION: ("N m", 1.0),
    QuantityKind.RESIDUAL: ("", 1.0),
}
"""Unit in which each is shown, and factor from SI; a gain is its change relative to nominal."""


IN_FUTURE = "not its own date, which is in the future"
"""Where the date of a recording comes from whose own is by a wrong clock."""


@dataclass(frozen=True, order=True)
class Quantity:
    """One monitored quantity of an arm.

    Attributes:
        of: Name of the payload or of the joint; empty for a payload without a name.
    """

    kind: QuantityKind
    of: str

    def __str__(self) -> str:
        """In words."""
        return f"{self.kind} of {self.of}" if self.of else str(self.kind)


@dataclass(frozen=True)
class ArmRun:
    """One recording of one arm.

    Attributes:
        arm: Name of the arm.
        model: Model of the arm; arms of the same model are twins.
        recorded: When it was recorded.
        recording: Its path or URL.
        problem: Why nothing was identified; empty for a result.
        figures: Value and standard deviation due to the run's noise, SI units; determined quantities only.
        dated_by: What states the date: the recording or its time stamps (`STATED_BY`), its file, or the identification.
    """

    arm: str
    model: str
    recorded: datetime
    recording: str
    problem: str
    figures: Mapping[Quantity, tuple[float, float]]
    dated_by: str = STATED_BY[0]
