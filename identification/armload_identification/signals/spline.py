"""The measured motion of a run as a spline.

Samples are not differentiated: the measured position is fitted by a quintic spline, at the original time stamps, and
the spline is differentiated. The spacing of its knots is chosen by generalised cross-validation.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.signals.signal_constants import SplineFit

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


@dataclass(frozen=True, eq=False)
class MeasuredMotion:
    """Measured positions of one run as a function of time.

    Attributes:
        spline: (n,)-valued quintic spline of the time since the first sample.
        duration_s: Time of the last sample since the first.
        fit_rad: (n,) RMS of the samples about the spline.
    """

    spline: BSpline
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
    best: tuple[float, BSpline, FloatArray] | None = None
    while spacing_s >= SplineFit.samples_per_coefficient * interval_s:
        fine = spacing_s < SplineFit.samples_per_knot * interval_s
        knots = _knots(elapsed, spacing_s)
        coefficients = knots.size - SplineFit.degree - 1
        if coefficients * SplineFit.samples_per_coefficient < elapsed.size:
            spline = fitted_spline(elapsed, position_rad, knots)
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


def fitted_spline(x: FloatArray, values: FloatArray, knots: FloatArray) -> BSpline:
    """The spline with the least squares of errors, by normal equations; its end pieces continue outside the knots.

    `scipy.interpolate.make_lsq_spline` takes a time that grows with the square of the number of knots, with its normal
    equations too.

    Args:
        x: (N,) ascending.
        values: (N, n) of the spline at x.
        knots: (m + degree + 1,) ascending, those at the ends repeated; samples must determine every coefficient.

    Raises:
        numpy.linalg.LinAlgError: they do not.
    """
    from scipy.interpolate import BSpline
    from scipy.linalg import solve_banded

    degree = SplineFit.degree
    basis = BSpline.design_matrix(x, knots, degree)
    normal = (basis.T @ basis).todia()
    return BSpline(knots, solve_banded((degree, degree), normal.data[::-1], basis.T @ values), degree)


def _knots(elapsed: FloatArray, spacing_s: float) -> FloatArray:
    """Knots of a spline; gaps in the data contain none, so that samples determine every coefficient."""
    pieces = max(1, round(elapsed[-1] / spacing_s))
    edges = np.linspace(0.0, elapsed[-1], pieces + 1)
    enough = np.histogram(elapsed, edges)[0] >= SplineFit.samples_per_coefficient
    inner = edges[1:-1][enough[:-1] & enough[1:]]
    ends = SplineFit.degree + 1
    return np.concatenate([[0.0] * ends, inner, [elapsed[-1]] * ends])
