"""Prior knowledge of a payload, as equations in addition to those of the measurement.

A mass from a scale or a centre of mass from a drawing is practically exact; a CAD model is trusted within a stated
confidence; a body that is symmetric about the flange axis has its centre of mass on that axis and two equal moments of
inertia. All of these become rows of the least squares problem with an error of unit standard deviation.

A range, such as a mass of 1 to 3 kg, is not such a row (`pipeline.prior_contradictions`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Final

import numpy as np

from armload_identification.argument_types import wrong_type
from armload_identification.estimation.arm_terms import PAYLOAD
from armload_identification.estimation.problem import Known
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.payload import (
    REFERENCE_LENGTH_M,
    InertialParameters,
    derived,
    value_scale,
)

FARTHEST_M: Final = 5.0
"""Greatest coordinate of a known centre of mass in the flange frame: beyond it, the unit is wrong."""
EXACT: Final = 1e-5
"""Relative standard deviation of a known mass or inertia, and standard deviation of a known centre of mass in m: finer
than any scale or drawing, and numerically harmless."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior knowledge of a payload, as k equations whose errors have unit standard deviation.

    Attributes:
        rows: (k, 10) coefficients of the parameters.
        target: (k,) right-hand side.
        doubts: (d, 10) rows^T times the change of the target by one standard deviation of each of d errors that the
            equations have in common, in addition to their own.
    """

    rows: FloatArray
    target: FloatArray
    doubts: FloatArray = field(default_factory=lambda: np.zeros((0, 10)))

    def known(self, mounting: str = PAYLOAD) -> Known:
        """As knowledge of a mounting's payload."""
        return Known(((PAYLOAD, mounting),), self.rows.T @ self.rows, self.rows.T @ self.target)


@dataclass(frozen=True)
class KnownPayload:
    """Prior knowledge of a payload; None for unknown quantities.

    Attributes:
        mass_kg: Its mass, from a scale, or a range (low, high).
        center_of_mass_m: (3,) its centre of mass in the flange frame; each coordinate a number or a range.
        cad: A model of it in the flange frame, trusted within `confidence`.
        confidence: Standard deviation of the model: relative for the mass, in units of 0.1 m for the centre
            of mass and of m (0.1 m)^2 for the inertia about the centre of mass.
        symmetric: Whether it is symmetric about the flange axis, z: a chuck, a suction cup, a disc.

    Raises:
        TypeError: a mass or coordinate that is no number.
        ModelError: a mass or confidence that is not positive, not three coordinates, a range whose lower number is
            not below the higher, or a symmetric body with a centre of mass off the flange axis.

    Examples:
        >>> import armload
        >>> known = armload.KnownPayload(mass_kg=(9, 9.85), center_of_mass_m=((-0.2, 0.2), (-0.2, 0.2), (0, 0.3)))
        >>> run = "runs/today/{}_identification.mcap".format
        >>> low, high = armload.identify("er50", run("loaded"), run("unloaded"), known=known).intervals["mass"]
        >>> 9 <= low < high <= 9.85
        True
    """

    mass_kg: float | tuple[float, float] | None = None
    center_of_mass_m: Sequence[float | tuple[float, float]] | FloatArray | None = None
    cad: InertialParameters | None = None
    confidence: float = 0.05
    symmetric: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.confidence) and self.confidence > 0.0):
            raise ModelError(f"the confidence in the CAD model is {self.confidence}; expected a number above 0")
        if self.mass_kg is not None:
            _require_known("mass", "kg", self.mass_kg)
            if np.ndim(self.mass_kg):
                object.__setattr__(self, "mass_kg", tuple(np.asarray(self.mass_kg, dtype=np.float64).tolist()))
            if isinstance(self.mass_kg, tuple):
                if self.mass_kg[0] < 0.0:
                    raise ModelError(f"`mass_kg=` is {self.mass_kg[0]} to {self.mass_kg[1]} kg; expected 0 or more")
            elif self.mass_kg <= 0.0:
                raise ModelError(f"`mass_kg=` is {self.mass_kg} kg; expected a number above 0")
        if self.center_of_mass_m is None:
            return
        if len(self.center_of_mass_m) != 3:
            raise ModelError(
                f"the known centre of mass is {_plain(self.center_of_mass_m)} m; expected three numbers or ranges"
            )
        for axis, coordinate in zip("xyz", self.center_of_mass_m, strict=True):
            _require_known(f"centre of mass's {axis}", "m", coordinate)
            if np.abs(coordinate).max() > FARTHEST_M:
                raise ModelError(
                    f"the known centre of mass's {axis} is {coordinate} m; expected m from the flange, at most "
                    f"{FARTHEST_M:g}. Is it in mm?"
                )
        if self.symmetric and np.any([np.any(coordinate) for coordinate in self.center_of_mass_m[:2]]):
            raise ModelError(
                f"the known centre of mass is {_plain(self.center_of_mass_m)} m, but a body that is symmetric about "
                "the flange axis has x = y = 0. Give only one of the two."
            )

    @property
    def reference_mass_kg(self) -> float | None:
        """The known mass, else the model's; None if there is neither."""
        if self.mass_kg is not None and not isinstance(self.mass_kg, tuple):
            return self.mass_kg
        return self.cad.mass_kg if self.cad is not None else None

    @property
    def limits(self) -> FloatArray:
        """(4, 2) ranges of mass (kg) and centre of mass (m); -inf and inf where there is none."""
        limits = np.tile([-np.inf, np.inf], (4, 1))
        entries = (self.mass_kg, *([None] * 3 if self.center_of_mass_m is None else self.center_of_mass_m))
        for row, entry in zip(limits, entries, strict=True):
            if entry is not None and np.ndim(entry) == 1:
                row[:] = np.asarray(entry, dtype=np.float64)
        return limits

    def prior(self) -> Prior:
        """The equations, without the ranges.

        A centre of mass c is known by m c - s = 0, linear in theta; the model's inertia about its centre of
        mass is taken at the model's centre of mass.
        """
        size_kg, mass = self.reference_mass_kg or 1.0, np.eye(1, 10)
        equations = [(np.zeros((0, 10)), np.zeros(0))]
        if self.mass_kg is not None and not isinstance(self.mass_kg, tuple):
            equations.append((mass / (EXACT * self.mass_kg), np.array([1.0 / EXACT])))
        for axis, coordinate in enumerate(() if self.center_of_mass_m is None else self.center_of_mass_m):
            if np.ndim(coordinate) == 0:
                row = (np.eye(1, 10, 1 + axis) - float(coordinate) * mass) / (EXACT * size_kg)
                equations.append((row, np.zeros(1)))
        if self.symmetric:
            equations.append((_symmetry_rows(size_kg), np.zeros(6)))
        if self.cad is not None:
            # derivatives of mass, centre of mass and inertia about it, divided by their standard deviations
            rows = derived(self.cad)[1] / (self.confidence * value_scale(self.cad.mass_kg))[:, None]
            equations.append((rows, rows @ self.cad.theta))
        return Prior(*map(np.concatenate, zip(*equations, strict=True)))


def _require_known(name: str, unit: str, value: float | tuple[float, float]) -> None:
    """Raise unless the value is a number or a range from a lower number to a higher one."""
    if not all(isinstance(each, Real) for each in np.asarray(value, dtype=object).flat):
        raise wrong_type("mass_kg" if unit == "kg" else "center_of_mass_m", value, "numbers, or ranges (low, high)")
    known = np.asarray(value, dtype=np.float64)
    if known.shape not in {(), (2,)} or not np.isfinite(known).all():
        raise ModelError(f"the known {name} is {known.tolist()} {unit}; expected a number, or a range (low, high)")
    if known.shape == (2,) and known[0] >= known[1]:
        raise ModelError(f"the known {name} is {known[0]:g} to {known[1]:g} {unit}; expected the lower number first")


def _plain(center: Sequence[float | tuple[float, float]] | FloatArray) -> list[float | list[float]]:
    """A centre of mass for messages."""
    return [np.asarray(coordinate, dtype=np.float64).tolist() for coordinate in center]


def _symmetry_rows(mass_kg: float) -> FloatArray:
    """(6, 10) rows: s_x = s_y = 0, I_xx = I_yy, I_xy = I_xz = I_yz = 0; a body symmetric about z."""
    rows = np.zeros((6, 10))
    rows[[0, 1], [1, 2]] = 1.0 / (EXACT * mass_kg)
    rows[2, 4], rows[2, 5] = 1.0, -1.0
    rows[[3, 4, 5], [7, 8, 9]] = 1.0
    rows[2:] /= EXACT * mass_kg * REFERENCE_LENGTH_M
    return rows
