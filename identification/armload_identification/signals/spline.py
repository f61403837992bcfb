"""Splines of several values, fitted by least squares, and the measured motion of a run as one.

Samples are not differentiated: the measured position is fitted by a quintic spline, at the original time stamps, and
the spline is differentiated. The spacing of its knots is chosen by generalised cross-validation.

scipy.interpolate has them too, but takes four times as long to load as NumPy, a third of an identification's time.

References:
    Piegl, Tiller, The NURBS Book, 2nd ed., algorithm A2.2 and equation 3.8.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.signals.signal_constants import SplineFit


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


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """Measured positions of one run as a function of time.

    Attributes:
        spline: (n,)-valued quintic spline of the time since the first sample.
        duration_s: Time of the last sample since the first.
        fit_rad: (n,) RMS of the samples about the spline.
    """

    spline: Spline
    duration_s: float
    fit_rad: FloatArray


def fit_motion(time_s: FloatArray, position_rad: FloatArray) -> MeasuredMotion:
    """Fit a quintic spline to measured positions, with the spacing of the knots chosen from the data.

    Args:
        time_s: (N,) increasing, irregular.
        position_rad: (N, n) measured positions.

    Returns:
        The motion.

    Raises:
        RecordingError: too short for a spline.
    """
    elapsed = time_s - time_s[0]
    interval_s = float(np.median(np.diff(elapsed)))
    spacing_s = min(SplineFit.coarsest_s, elapsed[-1] / SplineFit.fewest_pieces)
    best: tuple[float, Spline, FloatArray] | None = None
    while spacing_s >= SplineFit.samples_per_coefficient * interval_s:
        fine = spacing_s < SplineFit.samples_per_knot * interval_s
        knots = _knots(elapsed, spacing_s)
        coefficients = knots.size - SplineFit.degree - 1
        if coefficients * SplineFit.samples_per_coefficient < elapsed.size:
            spline = Spline.fit(elapsed, position_rad, knots, SplineFit.degree)
            misfit = np.mean((position_rad - spline(elapsed)) ** 2, axis=0)
            # The sum of logarithms prevents joints with a large stroke from dominating.
            logarithms = np.log(misfit + SplineFit.negligible_rad**2)
            score = float(np.sum(logarithms) - 2 * misfit.size * np.log1p(-coefficients / elapsed.size))
            needed = misfit.size * np.log(SplineFit.motion_over_noise) if fine else 0.0
            if best is None or score < best[0] - needed:
                best = (score, spline, np.sqrt(misfit))
            elif fine:
                break
        spacing_s *= 0.5
    if best is None:
        raise RecordingError(
            f"{elapsed.size} samples over {elapsed[-1]:.3g} s are not enough to fit a motion. Record a longer run."
        )
    return MeasuredMotion(best[1], float(elapsed[-1]), best[2])


def _knots(elapsed: FloatArray, spacing_s: float) -> FloatArray:
    """Knots of a spline; gaps in the data contain none, so that samples determine every coefficient."""
    pieces = max(1, round(elapsed[-1] / spacing_s))
    edges = np.linspace(0.0, elapsed[-1], pieces + 1)
    counts = np.histogram(elapsed, edges)[0]
    enough = counts >= SplineFit.samples_per_coefficient
    inner = edges[1:-1][enough[:-1] & enough[1:]]
    ends = SplineFit.degree + 1
    return np.concatenate([[0.0] * ends, inner, [elapsed[-1]] * ends])
