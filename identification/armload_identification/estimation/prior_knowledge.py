"""What is known of a payload beforehand, as equations beside those of the measurement.

A mass from a scale or a centre of mass from a drawing is as good as exact; a CAD model is believed within a stated
confidence; a body that is symmetric about the flange axis has its centre of mass on that axis and two equal moments of
inertia. All of these become rows of the least squares problem with an error of unit standard deviation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.estimation.least_squares import Prior
from armload_identification.estimation.uncertainty import REFERENCE_LENGTH_M, derived
from armload_identification.identification_errors import ModelError
from armload_identification.model.payload import InertialParameters

EXACT: Final = 1e-5
"""Relative standard deviation of a known mass or inertia, and of a known centre of mass in m: finer than any scale
or drawing, and numerically harmless."""


@dataclass(frozen=True)
class KnownPayload:
    """What is known of a payload; None where it is not.

    Attributes:
        mass_kg: Its mass, from a scale.
        center_of_mass_m: (3,) its centre of mass in the flange frame.
        cad: A model of it in the flange frame, believed within `confidence`.
        confidence: Standard deviation of the model: relative for the mass, in units of 0.1 m for the centre
            of mass and of m (0.1 m)^2 for the inertia about the centre of mass.
        symmetric: Whether it is symmetric about the flange axis, z: a chuck, a suction cup, a disc.

    Raises:
        ModelError: a mass or confidence that is not positive, or not three coordinates.
    """

    mass_kg: float | None = None
    center_of_mass_m: Sequence[float] | FloatArray | None = None
    cad: InertialParameters | None = None
    confidence: float = 0.05
    symmetric: bool = False

    def __post_init__(self) -> None:
        if self.mass_kg is not None and not (np.isfinite(self.mass_kg) and self.mass_kg > 0.0):
            raise ModelError(f"the known mass is {self.mass_kg} kg; expected a number above 0")
        if not (np.isfinite(self.confidence) and self.confidence > 0.0):
            raise ModelError(f"the confidence in the CAD model is {self.confidence}; expected a number above 0")
        if self.center_of_mass_m is not None:
            center = np.asarray(self.center_of_mass_m, dtype=np.float64)
            if center.shape != (3,) or not np.isfinite(center).all():
                raise ModelError(f"the known centre of mass is {center.tolist()} m; expected three numbers")
            if self.symmetric and center[:2].any():
                raise ModelError(
                    f"the known centre of mass is {center.tolist()} m, and a body that is symmetric about the flange "
                    "axis has x and y of 0. Leave one of the two out."
                )

    @classmethod
    def weighed(cls, body: InertialParameters) -> KnownPayload:
        """A payload of which all ten parameters are known, such as a calibration weight.

        Args:
            body: It, in the flange frame.
        """
        return cls(cad=body, confidence=EXACT)

    @property
    def gives_scale(self) -> bool:
        """True where the mass is known, without which no gain can be determined from a payload."""
        return self.mass_kg is not None or self.cad is not None

    @property
    def reference_mass_kg(self) -> float | None:
        """The known mass, or the model's; None where there is neither."""
        if self.mass_kg is not None:
            return self.mass_kg
        return self.cad.mass_kg if self.cad is not None else None

    def prior(self) -> Prior:
        """The equations.

        A centre of mass c is known by m c - s = 0, linear in theta; the model's inertia about its centre of
        mass is taken at the model's centre of mass.
        """
        rows: list[FloatArray] = []
        target: list[float] = []
        if self.mass_kg is not None:
            rows.append(np.eye(10)[0] / (EXACT * self.mass_kg))
            target.append(1.0 / EXACT)
        if self.center_of_mass_m is not None:
            size = EXACT * (self.reference_mass_kg or 1.0)
            for axis, coordinate in enumerate(np.asarray(self.center_of_mass_m, dtype=np.float64)):
                row = np.zeros(10)
                row[0], row[1 + axis] = -coordinate, 1.0
                rows.append(row / size)
                target.append(0.0)
        if self.symmetric:
            from_symmetry = _symmetry_rows(self.reference_mass_kg or 1.0)
            rows.extend(from_symmetry)
            target.extend(0.0 for _ in from_symmetry)
        if self.cad is not None:
            from_model = _model_rows(self.cad, self.confidence)
            rows.extend(from_model)
            target.extend(float(row @ self.cad.theta) for row in from_model)
        return Prior(np.array(rows).reshape(-1, 10), np.array(target))


def _model_rows(cad: InertialParameters, confidence: float) -> FloatArray:
    """(10, 10) rows: how mass, centre of mass and inertia about it change, over their standard deviations."""
    _, slope = derived(cad)
    mass = cad.mass_kg
    unit = np.array([mass] + [REFERENCE_LENGTH_M] * 3 + [mass * REFERENCE_LENGTH_M**2] * 6)
    return np.asarray(slope / (confidence * unit)[:, None])


def _symmetry_rows(mass_kg: float) -> FloatArray:
    """(6, 10) rows: s_x = s_y = 0, I_xx = I_yy, I_xy = I_xz = I_yz = 0; a body symmetric about z."""
    rows = np.zeros((6, 10))
    rows[[0, 1], [1, 2]] = 1.0 / (EXACT * mass_kg)
    rows[2, 4], rows[2, 5] = 1.0, -1.0
    rows[[3, 4, 5], [7, 8, 9]] = 1.0
    rows[2:] /= EXACT * mass_kg * REFERENCE_LENGTH_M
    return rows
