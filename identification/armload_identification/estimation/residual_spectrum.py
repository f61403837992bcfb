"""Local spectra of residuals, and the variances of a fit's parameters that follow from them.

Residuals of such fits are not white: friction, ripple and drift colour them, and the textbook covariance is 4 to 10
times too small. Resampling a few periods undercovers as well. What matters is the residual's power at the regressor's
frequencies, so the residual's spectrum S_j(f) is estimated per joint, locally in frequency, and

    cov(theta) = A^-1 [ sum_j sum_f Phi_j(f)^* S_j(f) Phi_j(f)^T ] A^-1,     A = Phi^T S^-1 Phi

(the sandwich of White and of Newey and West in the frequency domain). The power that the fit removed from the residual
is restored bin by bin with the square of the leverage's complement (HC3): the first power is correct only for white
noise, and slow noise coincides with the leverage. As a local spectrum is estimated from few bins, the quantile is
Student's with Satterthwaite's degrees of freedom for each quantity. Systematic error that repeats in every period is in
the residual and so in the interval, except for what the parameters absorbed.

Weights w place residual and regressor at the same times, which a spectrum does not show; S_j is therefore multiplied by
mean(w^4) / mean(w^2)^2: by two if half of the rows are excluded.

References:
    Newey, West, Econometrica 55(3), 1987. Bell, McCaffrey, Survey Methodology 28(2), 2002.
    MacKinnon, White, Journal of Econometrics 29(3), 1985. Satterthwaite, Biometrics Bulletin 2(6), 1946.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from armload_identification.float_array import FloatArray

_WIDEST_HALF_WINDOW: Final = 8
"""Bins on either side over which a spectrum is averaged: half the bin's number, from 1 to this.

Chosen by simulation of noise with 30 % of its variance correlated over 0.1 to 2 s and the rest white: instead of 95 %,
fixed windows of 4, 8, 16 bins cover 92, 89, 84 %, this one 93.5 to 95 %, because slow noise has its power in the lowest
bins, as does a gravity-driven regressor. On the excitation of `er50` with 1, 3 and 10 periods, 300 seeds each: 94.4 to
95.3 % over all ten quantities, none below 91.7 %.
"""
_BAND_SHARE: Final = 0.9999
FREEST: Final = 1e6
_FLAT: Final = 1e-12
"""Lower bound of the eigenvalues of a correlation matrix when it is inverted."""


class ResidualSpectrum:
    """Local spectra of a whitened residual, and the resulting variances of combinations of parameters.

    Args:
        basis: (N, n, r) orthonormal basis Q of the fit's columns.
        residual: (N, n) whitened residual.
        weight: (N, n) factor on every row, contained in both, as `Estimate.sample_weight`.
    """

    def __init__(self, basis: FloatArray, residual: FloatArray, weight: FloatArray) -> None:
        samples = residual.shape[0]
        transformed = np.fft.rfft(basis, axis=0) / np.sqrt(samples)
        parts = transformed.view(np.float64)
        leverage = np.einsum("kjr,kjr->kj", parts, parts)
        held = np.cumsum(leverage.sum(axis=1))
        bins = min(int(np.searchsorted(held, _BAND_SHARE * held[-1])) + 2 * _WIDEST_HALF_WINDOW, held.size)
        self._basis, leverage = transformed[:bins], leverage[:bins]
        power = np.abs(np.fft.rfft(residual, axis=0)[:bins]) ** 2 / samples
        # Every bin except the first (and the last, for an even number of samples) represents two frequencies.
        self._twice = np.full(bins, 2.0)
        self._twice[0] = 1.0
        if bins == held.size and samples % 2 == 0:
            self._twice[-1] = 1.0
        self._in_window = _summed(np.ones(bins))
        of_white = 1.0 - np.minimum(leverage, 1.0)
        left = of_white**2
        self._free = np.maximum(self._averaged(left), 1e-12)
        square = weight**2
        # A joint whose weights are all 0 has no residual either.
        gated = np.mean(square**2, axis=0) / np.maximum(np.mean(square, axis=0) ** 2, 1e-300)
        self._level = gated * self._averaged(power) / self._free
        self._of_white = self._free / np.maximum(self._averaged(of_white), 1e-12)
        self._expected = self._level * left

    def _averaged(self, values: FloatArray) -> FloatArray:
        """Moving average over frequency of (bins, n) values."""
        return _summed(values) / self._in_window[:, None]

    def covariance(self) -> FloatArray:
        """(r, r) covariance of the coefficients of the basis."""
        root = np.sqrt(self._level * self._twice[:, None])
        weighted = (self._basis * root[:, :, None]).reshape(-1, self._basis.shape[2])
        # Real and imaginary parts separately: products of real matrices suffice.
        return np.asarray(weighted.real.T @ weighted.real + weighted.imag.T @ weighted.imag)

    def variance(self, contrast: FloatArray, *, white: bool = False) -> FloatArray:
        """(k,) variance of contrast (k, r) times the coefficients; with `white`, if the noise is equal at all bins."""
        level = self._level * (self._of_white if white else 1.0) * self._twice[:, None]
        return np.asarray(np.einsum("bjk,bj->k", self._power_along(contrast), level))

    def _power_along(self, contrast: FloatArray) -> FloatArray:
        """(bins, n, k) power of the basis along contrast (k, r)."""
        return np.asarray(np.abs(self._basis @ contrast.T) ** 2)

    def _spread(self, power: FloatArray) -> FloatArray:
        """(bins, n, k) expected share of each bin of the periodogram in variances by (bins, n, k) power."""
        gain = power * (self._twice[:, None] / self._free)[:, :, None]
        share = _summed(gain / self._in_window[:, None, None], transposed=True)
        return np.asarray(share * self._expected[:, :, None])

    def freedom(self, contrast: FloatArray) -> FloatArray:
        """(k,) Satterthwaite's degrees of freedom of these variances."""
        spread = self._spread(self._power_along(contrast))
        # A bin of the periodogram has two degrees of freedom; the first and last have one.
        square = np.sum(spread**2 * (2.0 / self._twice)[:, None, None], axis=(0, 1))
        total = np.sum(spread, axis=(0, 1))
        freedom = np.divide(2.0 * total**2, square, out=np.full(total.shape, FREEST), where=square > 0.0)
        return np.asarray(np.clip(freedom, 1.0, FREEST))

    def joint_freedom(self, contrast: FloatArray, total: FloatArray) -> float:
        """Degrees of freedom of a covariance matrix to which this spectrum contributes.

        Args:
            contrast: (k, r) combinations of the coefficients.
            total: (k, k) covariance of these combinations, all contributions included.

        Returns:
            Those of the Wishart matrix with that mean whose elements have the same scatter.
        """
        k = len(contrast)
        turned = self._basis @ (whitening(total, _FLAT) @ contrast).T
        rows, columns = np.triu_indices(k)
        spread = self._spread((turned[:, :, rows] * turned[:, :, columns].conj()).real)
        spread = spread**2 * (2.0 / self._twice)[:, None, None]
        # Off the diagonal every element counts twice.
        scatter = np.sum(spread * np.where(rows == columns, 1.0, 2.0))
        return float(np.clip(k * (k + 1) / max(float(scatter), 1e-300), 1.0, FREEST))


def whitening(covariance: FloatArray, flat: float) -> FloatArray:
    """(k, k) W with W' W = C^-1; eigenvalues of the correlation matrix below `flat` count as that."""
    size = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    power, axes = np.linalg.eigh(covariance / np.outer(size, size))
    return np.asarray((axes / np.sqrt(np.maximum(power, flat))).T / size)


def _summed(values: FloatArray, *, transposed: bool = False) -> FloatArray:
    """Sums of (bins, ...) values over a window about each bin; transposed: over the bins in whose windows each is."""
    total = values.copy()
    for bins, others in _windows(len(values)):
        into, of = (others, bins) if transposed else (bins, others)
        total[into] += values[of]
    return total


def _windows(bins: int) -> Iterator[tuple[slice, slice]]:
    """Bins, and others that are in their windows: wider at higher frequencies, mirrored at zero."""
    for half in range(1, min(_WIDEST_HALF_WINDOW, bins // 2) + 1):
        first = 2 * half if half > 1 else 1
        yield slice(first, bins - half), slice(first + half, bins)
        yield slice(first, bins), slice(first - half, bins - half)
    if bins > 1:
        yield from [(slice(1), slice(1, 2))] * 2
