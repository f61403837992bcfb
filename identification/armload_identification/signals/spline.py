"""Splines of several values, fitted by least squares.

scipy.interpolate has them too, but takes four times as long to load as NumPy, a third of an identification's time.

References:
    Piegl, Tiller, The NURBS Book, 2nd ed., algorithm A2.2 and equation 3.8.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class Spline:
    """A spline; its first and last pieces continue outside the knots.

    Attributes:
        knots: (m + degree + 1,) ascending, those at the ends repeated.
        coefficients: (m, n).
        degree: Degree of its pieces.
    """

    knots: FloatArray
    coefficients: FloatArray
    degree: int

    @classmethod
    def fit(cls, x: FloatArray, values: FloatArray, knots: FloatArray, degree: int) -> Spline:
        """The spline with the least squares of errors, by normal equations.

        Args:
            x: (N,) ascending.
            values: (N, n) of the spline at x.
            knots: As in the class; samples must determine every coefficient.
            degree: Degree of the pieces.

        Raises:
            numpy.linalg.LinAlgError: they do not.
        """
        first, basis = _basis(knots, degree, x)
        count = knots.size - degree - 1
        band = np.zeros((degree + 1, count))
        right = np.zeros((count, values.shape[1]))
        for row in range(degree + 1):
            for other in range(row, degree + 1):
                band[other - row] += np.bincount(first + row, basis[row] * basis[other], count)
            for column in range(values.shape[1]):
                right[:, column] += np.bincount(first + row, basis[row] * values[:, column], count)
        return cls(knots, _solved(band, right), degree)

    def __call__(self, x: FloatArray, derivative: int = 0) -> FloatArray:
        """(N, n) values, or a derivative, at (N,) x."""
        knots, coefficients, degree = self.knots, self.coefficients, self.degree
        for _ in range(derivative):
            apart = knots[degree + 1 : -1] - knots[1 : -degree - 1]
            coefficients = degree * np.diff(coefficients, axis=0) / apart[:, None]
            knots, degree = knots[1:-1], degree - 1
        first, basis = _basis(knots, degree, x)
        return np.asarray(sum(part[:, None] * coefficients[first + row] for row, part in enumerate(basis)))


def _basis(knots: FloatArray, degree: int, x: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
    """(N,) number of the first spline of the basis that is not 0 at each x, and (degree + 1, N) values from it on."""
    span = np.clip(np.searchsorted(knots, x, side="right") - 1, degree, knots.size - degree - 2)
    basis = np.zeros((degree + 1, x.size))
    basis[0] = 1.0
    for order in range(1, degree + 1):
        for row in range(order):
            before, after = knots[span + row + 1 - order], knots[span + row + 1]
            part = basis[row] / (after - before)
            basis[row] = basis[order] + (after - x) * part
            basis[order] = (x - before) * part
    return span - degree, basis


def _solved(band: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of equations whose symmetric matrix has the diagonals (degree + 1, m), block by block."""
    width, count = band.shape[0] - 1, band.shape[1]
    size = 8 * band.shape[0]
    blocks = -(-count // size)
    upper = np.zeros((blocks * size, size + width))
    place = np.arange(len(upper))
    upper[place, place % size] = 1.0
    for distance, values in enumerate(band):
        upper[place[:count], place[:count] % size + distance] = values
    upper = upper.reshape(blocks, size, -1)
    square = upper[:, :, :size] + np.triu(upper[:, :, :size], 1).transpose(0, 2, 1)
    given = np.zeros((blocks * size, right.shape[1]))
    given[:count] = right
    both = np.concatenate([upper[:, :, size:], given.reshape(blocks, size, -1)], axis=2)
    for block in range(blocks):
        coupling = both[block, :, :width].copy()
        both[block] = np.linalg.solve(square[block], both[block])
        if block + 1 < blocks:
            square[block + 1, :width, :width] -= coupling.T @ both[block, :, :width]
            both[block + 1, :width, width:] -= coupling.T @ both[block, :, width:]
    for block in range(blocks - 2, -1, -1):
        both[block, :, width:] -= both[block, :, :width] @ both[block + 1, :width, width:]
    return both[:, :, width:].reshape(-1, right.shape[1])[:count]
