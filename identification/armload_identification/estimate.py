"""Weighted least squares for the payload's parameters.

    theta = argmin || S^(-1/2) (Phi theta - tau) ||^2                      Chen 2016, eqs. (10), (11)

by an orthogonal factorisation of the whitened system; the normal equations are never formed. Directions of theta
that the motion does not excite are found by the rank and handed on; nothing is invented for them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.errors import EstimationError

FloatArray = NDArray[np.float64]

_RANK_TOLERANCE: Final = 1e-7
_REWEIGHTINGS: Final = 20
_WEIGHTS_SETTLED: Final = 1e-4
_LEAST_NOISE: Final = 1e-6
"""A joint's noise is never taken below this share of the loudest joint's."""


@dataclass(frozen=True, eq=False)
class Estimate:
    """Result of a weighted least squares fit with p parameters to N samples of n joints.

    Attributes:
        theta: (p,) parameters; along undetermined directions the smallest that fit. The payload's ten come
            first, nuisance parameters behind.
        weight_1_nm: (n,) inverse standard deviation each joint was weighted with.
        whitened: (N, n, p) regressor rows times their weight; zero rows where a sample was not used.
        root: (p, p) upper triangular R with R^T R = Phi^T S^-1 Phi, so that ||R (theta - estimate)||^2 is what
            another theta costs.
        undetermined: (p, p - rank) directions of theta that the data say nothing about, orthonormal after
            division by `scale`.
        scale: (p,) unit of each parameter, so that its column has unit length.
        singular_values: (p,) of the whitened regressor in SI units, largest first.
        condition_number: Their ratio, largest over smallest; inf where the rank is not full.
        rank: Number of directions that are determined.
        residual_nm: (N, n) torque minus prediction, unweighted.
        residual_rms_nm: (n,) its RMS over the samples used.
        covariance: (p, p) if the residual were white with the given noise; infinite directions are left out.
        iterations: Solutions until the weights settled; 1 with given weights.
    """

    theta: FloatArray
    weight_1_nm: FloatArray
    whitened: FloatArray
    root: FloatArray
    undetermined: FloatArray
    scale: FloatArray
    singular_values: FloatArray
    condition_number: float
    rank: int
    residual_nm: FloatArray
    residual_rms_nm: FloatArray
    covariance: FloatArray
    iterations: int


def estimate(regressor: FloatArray, torque_nm: FloatArray, valid: NDArray[np.bool_], noise_nm: FloatArray) -> Estimate:
    """Fit with given noise per joint.

    Args:
        regressor: (N, n, p) Phi; its first ten columns are the payload's.
        torque_nm: (N, n) torque of the payload.
        valid: (N,) samples to use.
        noise_nm: (n,) standard deviation of each joint's torque, up to a common factor.

    Returns:
        The fit.

    Raises:
        EstimationError: fewer equations than parameters, numbers that are not finite, or no excitation at all.
    """
    _require_data(regressor, torque_nm, valid, noise_nm)
    noise = np.maximum(noise_nm, _LEAST_NOISE * noise_nm.max())
    return _solve(regressor, torque_nm, valid, 1.0 / noise, 1)


def estimate_reweighted(
    regressor: FloatArray, torque_nm: FloatArray, valid: NDArray[np.bool_], noise_nm: FloatArray
) -> Estimate:
    """Fit with the noise per joint taken from the residual, until it settles.

    Args:
        regressor: (N, n, p) Phi; its first ten columns are the payload's.
        torque_nm: (N, n) torque of the payload.
        valid: (N,) samples to use.
        noise_nm: (n,) noise to begin with.

    Returns:
        The fit with the last weights.

    Raises:
        EstimationError: as `estimate`.
    """
    fit = estimate(regressor, torque_nm, valid, noise_nm)
    for iteration in range(2, _REWEIGHTINGS + 1):
        noise = np.maximum(fit.residual_rms_nm, _LEAST_NOISE * fit.residual_rms_nm.max())
        if noise.max() == 0.0:
            break
        settled = np.abs(noise * fit.weight_1_nm / np.exp(np.mean(np.log(noise * fit.weight_1_nm))) - 1.0).max()
        fit = _solve(regressor, torque_nm, valid, 1.0 / noise, iteration)
        if settled < _WEIGHTS_SETTLED:
            break
    return fit


def _require_data(regressor: FloatArray, torque_nm: FloatArray, valid: NDArray[np.bool_], noise_nm: FloatArray) -> None:
    """Raise unless there is something to fit."""
    samples, joints, parameters = regressor.shape
    used = int(np.count_nonzero(valid))
    if torque_nm.shape != (samples, joints) or valid.shape != (samples,) or noise_nm.shape != (joints,):
        raise EstimationError(
            f"regressor {regressor.shape}, torque {torque_nm.shape}, valid {valid.shape} and noise "
            f"{noise_nm.shape} do not fit; expected (N, n, p), (N, n), (N,), (n,)"
        )
    if used * joints <= parameters:
        raise EstimationError(
            f"{used} samples of {joints} joints are too few for {parameters} parameters. Record a longer run."
        )
    if not (np.isfinite(regressor[valid]).all() and np.isfinite(torque_nm[valid]).all()):
        raise EstimationError("the regressor or the torque holds numbers that are not finite. Clean the recording.")
    if not (np.isfinite(noise_nm).all() and noise_nm.max() > 0.0):
        raise EstimationError(
            f"the noise per joint is {noise_nm.tolist()} N m; expected finite numbers, not all of them 0. "
            "Check that the torque columns hold measurements."
        )


def _solve(
    regressor: FloatArray,
    torque_nm: FloatArray,
    valid: NDArray[np.bool_],
    weight: FloatArray,
    iteration: int,
) -> Estimate:
    """One weighted solution: QR of the whitened columns at unit length, SVD of its small triangle."""
    parameters = regressor.shape[2]
    used = valid[:, None] * weight
    whitened = regressor * used[:, :, None]
    rows = whitened.reshape(-1, parameters)
    length = np.sqrt(np.sum(rows**2, axis=0))
    if length.max() == 0.0:
        raise EstimationError("the motion excites no parameter of the payload. Record a run along an excitation.")
    scale = 1.0 / np.where(length > _RANK_TOLERANCE * length.max(), length, np.inf)
    scale[scale == 0.0] = 1.0 / length.max()
    orthogonal, triangle = np.linalg.qr(rows * scale)
    target = orthogonal.T @ (torque_nm * used).reshape(-1)
    left, values, right = np.linalg.svd(triangle)
    rank = int(np.count_nonzero(values > _RANK_TOLERANCE * values[0]))
    inverse = np.where(np.arange(parameters) < rank, 1.0 / np.where(values > 0.0, values, 1.0), 0.0)
    theta = scale * (right.T @ (inverse * (left.T @ target)))
    residual = torque_nm - regressor @ theta
    half = scale[:, None] * right.T * inverse
    singular_values = np.linalg.svd(triangle / scale, compute_uv=False)
    return Estimate(
        theta=theta,
        weight_1_nm=weight,
        whitened=whitened,
        root=triangle / scale,
        undetermined=right[rank:].T,
        scale=scale,
        singular_values=np.asarray(singular_values, dtype=np.float64),
        condition_number=float(singular_values[0] / singular_values[-1]) if rank == parameters else float("inf"),
        rank=rank,
        residual_nm=residual,
        residual_rms_nm=np.sqrt(np.mean(residual[valid] ** 2, axis=0)),
        covariance=half @ half.T,
        iterations=iteration,
    )
