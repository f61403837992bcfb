"""Normal equations of weighted rows: a group's own unknowns eliminated, and the solution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray

_ROUNDING: Final = 1e-13


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Normal equations of a group with its own unknowns eliminated.

    Attributes:
        information: (s, s) of the shared unknowns.
        gradient: (s,) of these.
        follow: (o, s) dependence of its own unknowns on the shared ones, with the opposite sign.
        own_step: (o,) step of its own unknowns if the shared ones do not change.
        own_gradient: (o,) gradient of its own unknowns.
        own_covariance: (o, o) of its own unknowns if the shared ones are known.
        axes: Information of each axis and combination alone.
    """

    information: FloatArray
    gradient: FloatArray
    follow: FloatArray
    own_step: FloatArray
    own_gradient: FloatArray
    own_covariance: FloatArray
    axes: Sequence[AxisInformation]

    def covariance(self, bread: FloatArray) -> FloatArray:
        """(s + o, s + o) covariance of shared and own unknowns.

        Args:
            bread: (s, s) that of the shared ones.
        """
        across = -bread @ self.follow.T
        own = self.own_covariance - self.follow @ across
        return np.block([[bread, across], [across.T, own]])

    def covariance_root(self, information: FloatArray) -> FloatArray:
        """(s + o, s + o) R with R R^T the covariance of shared and own unknowns.

        From the information: of its inverse, rounding spoils what is known well if other unknowns are hardly known.

        Args:
            information: (s, s) of the shared ones, from all groups.
        """
        scale = np.diag(information) ** -0.5
        power, axes = np.linalg.eigh(information * scale[:, None] * scale)
        shared = scale[:, None] * axes / np.sqrt(np.maximum(power, 0.0) + _ROUNDING)
        own = np.linalg.cholesky(self.own_covariance)
        return np.block([[shared, np.zeros((len(shared), len(own)))], [-self.follow @ shared, own]])


@dataclass(frozen=True, eq=False)
class WeightedRows:
    """Weighted rows of an axis in a group.

    Attributes:
        combination: Number of the combination of the group's runs.
        axis: Number of the axis.
        rows: (N, k) derivatives.
        target: (N,) residual.
        place: (k,) indices of the unknowns, the group's own after the shared ones.
    """

    combination: int
    axis: int
    rows: FloatArray
    target: FloatArray
    place: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class AxisInformation:
    """Information of the rows of an axis; attributes as of `WeightedRows`.

    Attributes:
        information: (k, k).
    """

    combination: int
    axis: int
    place: NDArray[np.intp]
    information: FloatArray


def joined_columns(parts: Sequence[tuple[FloatArray, NDArray[np.intp]]]) -> tuple[FloatArray, NDArray[np.intp]]:
    """(g, N, k) columns of the runs of a group for all their unknowns, and (k,) indices of these."""
    if len(parts) == 1:
        return parts[0][0][None], parts[0][1]
    place = np.unique(np.concatenate([where for _, where in parts]))
    joined_columns = np.zeros((len(parts), len(parts[0][0]), place.size))
    for run, (columns, where) in zip(joined_columns, parts, strict=True):
        run[:, np.searchsorted(place, where)] = columns
    return joined_columns, place


def eliminate(
    information: FloatArray, gradient: FloatArray, shared: int, axes: Sequence[AxisInformation]
) -> Eliminated:
    """Schur complement: the shared unknowns with the group's own eliminated."""
    own = len(gradient) - shared
    if not own:
        nothing = np.zeros((0, shared))
        return Eliminated(information, gradient, nothing, np.zeros(0), np.zeros(0), np.zeros((0, 0)), axes)
    right = np.column_stack([information[shared:, :shared], gradient[shared:], np.eye(own)])
    solution = solved(information[shared:, shared:], right)
    follow, own_step, inverse = solution[:, :shared], solution[:, shared], solution[:, shared + 1 :]
    return Eliminated(
        information[:shared, :shared] - information[:shared, shared:] @ follow,
        gradient[:shared] - information[:shared, shared:] @ own_step,
        follow,
        own_step,
        gradient[shared:],
        inverse,
        axes,
    )


def solved(information: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of the normal equations, scaled to unit diagonal, with a small regularisation against rounding."""
    scale = 1.0 / np.sqrt(np.diag(information))
    scaled = information * scale[:, None] * scale + _ROUNDING * np.eye(len(scale))
    tall = scale[:, None] if right.ndim > 1 else scale
    return np.asarray(tall * np.linalg.solve(scaled, right * tall))
