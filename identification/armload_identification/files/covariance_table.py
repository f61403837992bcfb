"""`[covariance]` of a payload file: how precisely mass and centre of mass are known."""

from __future__ import annotations

from typing import Annotated, Final

import numpy as np
from msgspec import Meta

from armload_identification.float_array import FloatArray
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.storage import toml_text
from armload_identification.storage.strict_toml import (
    BadValue,
    NumberList,
    NumberRows,
    Table,
    require_array_shapes,
    require_shape,
)

_ASYMMETRY: Final = 1e-9
_BELOW_ZERO: Final = 1e-6
"""Allowed asymmetry of a correlation matrix, and its lowest eigenvalue, negated: digits lost, by other programs too."""


class _GainsTable(Table):
    """The share of the drive gains, n gains."""

    gain_nm_a: NumberList
    slope: NumberRows
    covariance: NumberRows


class CovarianceTable(Table):
    """Covariance of [mass, cx, cy, cz] and, if gains were applied, its dependence on them."""

    mass_center: NumberRows
    degrees_of_freedom: Annotated[float, Meta(gt=0)]
    gains: _GainsTable | None = None
    calibration_slope: NumberRows | None = None

    def __post_init__(self) -> None:
        require_shape("mass_center", self.mass_center, (4, 4))
        require_covariance("mass_center", self.mass_center)
        if self.gains is not None:
            n = self.gains.gain_nm_a.size
            require_array_shapes("gains", self.gains, {"slope": (4, n), "covariance": (n, n)})
            require_covariance("gains.covariance", self.gains.covariance)
        if self.calibration_slope is not None:
            require_shape("calibration_slope", self.calibration_slope, (4, self.calibration_slope.shape[1]))

    def covariance(self) -> MassCenterCovariance:
        """As in a `PayloadResult`."""
        gains, slope = self.gains, self.calibration_slope
        known = () if gains is None else (gains.gain_nm_a, gains.slope, gains.covariance)
        considered = {} if slope is None else {"calibration_slope": slope}
        return MassCenterCovariance(self.mass_center, self.degrees_of_freedom, *known, **considered)


def covariance_lines(known: MassCenterCovariance | None) -> list[str]:
    """The lines of `[covariance]`; none without a covariance."""
    if known is None:
        return []
    slope = [[float(f"{value:.3e}") for value in row] for row in known.calibration_slope]
    entries = {"mass_center": known.measured, "degrees_of_freedom": known.freedom}
    entries |= {"calibration_slope": np.array(slope)} if known.calibration_slope.size else {}
    lines = [
        "# Of [mass, cx, cy, cz] in kg and m, without the share of the drive gains, which results obtained with the",
        "# same gains have in common. slope: change of the four per change of the logarithm of each gain; covariance:",
        "# of these logarithms. calibration_slope: change per standard deviation of each other error of a calibration.",
        *toml_text.table("covariance", entries),
    ]
    if known.gain_nm_a.size:
        gains = {"gain_nm_a": known.gain_nm_a, "slope": known.gain_slope, "covariance": known.gain_covariance}
        lines += toml_text.table("covariance.gains", gains)
    return lines


def require_covariance(key: str, matrix: FloatArray) -> None:
    """Raise unless a square matrix is symmetric and positive semidefinite.

    Raises:
        BadValue: naming the key.
    """
    size = np.sqrt(np.abs(np.diag(matrix)))
    scaled = matrix / np.maximum(np.outer(size, size), np.finfo(np.float64).tiny)
    sound = np.abs(scaled - scaled.T).max() <= _ASYMMETRY
    try:  # unlike eigenvalues, this wakes no thread of BLAS, which then spins for 30 ms
        np.linalg.cholesky(scaled + _BELOW_ZERO * np.eye(len(size)))
    except np.linalg.LinAlgError:
        sound = False
    if not sound:
        raise BadValue(key, matrix.tolist(), "expected a covariance: symmetric, no eigenvalue below 0")
