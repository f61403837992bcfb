"""Weighted least squares for the payload's parameters.

    theta = argmin || S^(-1/2) (Phi theta - tau) ||^2                      Chen 2016, eqs. (10), (11)

by an orthogonal factorisation of the whitened system; the normal equations are never formed. Directions of theta
that the motion does not excite are detected by the rank and reported as undetermined.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import EstimationError
from armload_identification.signals.robust_scale import deviation_by_median

_RANK_TOLERANCE: Final = 1e-7
_REWEIGHTINGS: Final = 20
_WEIGHTS_SETTLED: Final = 1e-4
_HUBER: Final = 1.345
_LEAST_NOISE: Final = 1e-6
_BLOCK_ROWS: Final = 512
"""Least noise of a joint as a share of the noisiest joint's."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior knowledge, as k equations whose errors have unit standard deviation.

    Attributes:
        rows: (k, m) coefficients of the first m parameters: 10, or all if nuisance parameters are known too.
        target: (k,) right-hand side.
        doubts: (d, 10) rows^T times the change of the target by one standard deviation of each of d errors that the
            equations have in common, in addition to their own.
    """

    rows: FloatArray
    target: FloatArray
    doubts: FloatArray = field(default_factory=lambda: np.zeros((0, 10)))

    def and_nuisance(self, mean: FloatArray, deviation: FloatArray) -> Prior:
        """This prior extended to the parameters after the payload's ten.

        Args:
            mean: (r,) expected values.
            deviation: (r,) their standard deviations; inf for unknown parameters.
        """
        known = np.flatnonzero(np.isfinite(deviation))
        rows = np.zeros((self.target.size + known.size, 10 + mean.size))
        rows[: self.target.size, :10] = self.rows
        rows[self.target.size + np.arange(known.size), 10 + known] = 1.0 / deviation[known]
        return Prior(rows, np.concatenate([self.target, mean[known] / deviation[known]]))


NOTHING_KNOWN: Final = Prior(np.empty((0, 10)), np.empty(0))


@dataclass(frozen=True, eq=False)
class Estimate:
    """Result of a weighted least squares fit with p parameters to N samples of n joints.

    Attributes:
        theta: (p,) parameters, the payload's ten first, then nuisance parameters; along undetermined directions
            the minimum-norm solution.
        weight_1_nm: (n,) inverse standard deviation with which each joint was weighted.
        sample_weight: (N, n) further factor on every row, 0 where a sample was not used.
        regressor: (N, n, p) Phi as it was fitted, without weights.
        prior_rows: (k, p) coefficients of the prior's equations.
        root: (p, p) upper triangular R with R^T R = Phi^T S^-1 Phi, a prior's equations included, so that
            ||R (theta - estimate)||^2 is the additional cost of another theta.
        undetermined: (p, p - rank) directions of theta that the data do not determine, orthonormal after
            division by `scale`.
        scale: (p,) unit of each parameter, such that its column has unit length.
        singular_values: (p,) of the whitened regressor in SI units, largest first.
        condition_number: Their ratio, largest over smallest; inf if the rank is not full.
        rank: Number of determined directions.
        residual_nm: (N, n) torque minus prediction, unweighted.
        residual_rms_nm: (n,) weighted RMS of the residual over the samples used.
        covariance: (p, p) for white noise of the given size, without undetermined directions.
        iterations: Iterations until the weights converged; 1 with given weights.
    """

    theta: FloatArray
    weight_1_nm: FloatArray
    sample_weight: FloatArray
    regressor: FloatArray
    prior_rows: FloatArray
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

    def whitened(self, directions: FloatArray) -> FloatArray:
        """(N, n, r) regressor rows, times both weights, along directions of theta.

        Args:
            directions: (p, r).
        """
        samples, joints, parameters = self.regressor.shape
        # One product of two matrices is faster than N small ones.
        along = (self.regressor.reshape(-1, parameters) @ directions).reshape(samples, joints, -1)
        along *= (self.sample_weight * self.weight_1_nm)[:, :, None]
        return along


def estimate(
    regressor: FloatArray,
    torque_nm: FloatArray,
    valid: NDArray[np.bool_],
    noise_nm: FloatArray,
    sample_weight: FloatArray | None = None,
    prior: Prior | None = None,
) -> Estimate:
    """Fit with given noise per joint.

    Args:
        regressor: (N, n, p) Phi; its first ten columns are the payload's.
        torque_nm: (N, n) torque of the payload.
        valid: (N,) samples to use.
        noise_nm: (n,) standard deviation of each joint's torque, up to a common factor.
        sample_weight: (N, n) factor on each row, such as one that excludes reversals; 1 if not given.
        prior: Prior knowledge.

    Returns:
        The fit.

    Raises:
        EstimationError: fewer equations than parameters, numbers that are not finite, or no excitation.
    """
    _require_data(regressor, torque_nm, valid, noise_nm)
    noise = np.maximum(noise_nm, _LEAST_NOISE * noise_nm.max())
    return _weighted(regressor, torque_nm, _used(valid, torque_nm, sample_weight), 1.0 / noise, 1, prior)


def estimate_reweighted(
    regressor: FloatArray,
    torque_nm: FloatArray,
    valid: NDArray[np.bool_],
    noise_nm: FloatArray,
    sample_weight: FloatArray | None = None,
    prior: Prior | None = None,
) -> Estimate:
    """Fit with the noise per joint from the residual, at least the given noise, iterated until it settles.

    The residual of a smoothed torque is smaller than the noise before smoothing, hence the lower bound.

    Args:
        regressor: (N, n, p) Phi; its first ten columns are the payload's.
        torque_nm: (N, n) torque of the payload.
        valid: (N,) samples to use.
        noise_nm: (n,) least standard deviation of each joint's torque.
        sample_weight: (N, n) factor on each row; 1 if not given.
        prior: Prior knowledge.

    Returns:
        The fit with the last weights.

    Raises:
        EstimationError: as `estimate`.
    """
    _require_data(regressor, torque_nm, valid, noise_nm)
    weight = _used(valid, torque_nm, sample_weight)
    # One small R factor per joint holds the information of all its rows, whatever the joint's weight.
    triangles = _triangles(regressor, torque_nm, weight)
    count = np.sqrt(np.maximum(np.sum(weight**2, axis=0), 1e-300))
    least = noise = np.maximum(noise_nm, _LEAST_NOISE * noise_nm.max())
    parameters = regressor.shape[2]
    known = _Known.of(prior, parameters)
    solutions = 1
    for _ in range(_REWEIGHTINGS):
        solutions += 1
        rough = _solve((triangles / noise[:, None, None]).reshape(-1, parameters + 1), known)
        size = np.sqrt(np.sum((triangles[:, :, :-1] @ rough.theta - triangles[:, :, -1]) ** 2, axis=1)) / count
        before, noise = noise, np.maximum(size, least)
        settled = np.abs(noise / before - 1.0).max()
        if settled < _WEIGHTS_SETTLED:
            break
    last = _solve((triangles / noise[:, None, None]).reshape(-1, parameters + 1), known)
    return _completed(regressor, torque_nm, weight, 1.0 / noise, solutions, known, last)


def estimate_robust(
    regressor: FloatArray,
    torque_nm: FloatArray,
    valid: NDArray[np.bool_],
    noise_nm: FloatArray,
    sample_weight: FloatArray | None = None,
    prior: Prior | None = None,
) -> Estimate:
    """Fit with the noise per joint from the residual, and reduced weight of outliers.

    Iteratively reweighted least squares with Huber's weights, min(1, k / |r|) for a residual r in robust
    standard deviations of its joint.

    Args:
        regressor: (N, n, p) Phi; its first ten columns are the payload's.
        torque_nm: (N, n) torque of the payload.
        valid: (N,) samples to use.
        noise_nm: (n,) initial noise.
        sample_weight: (N, n) initial factor on each row; 1 if not given.
        prior: Prior knowledge.

    Returns:
        The fit with the last weights.

    Raises:
        EstimationError: as `estimate`.

    References:
        Huber, Robust Statistics, 1981, section 7.8; k = 1.345 keeps 95 % of the efficiency on normal noise.
    """
    fit = estimate_reweighted(regressor, torque_nm, valid, noise_nm, sample_weight, prior)
    given = fit.sample_weight
    for iteration in range(fit.iterations + 1, fit.iterations + _REWEIGHTINGS + 1):
        spread = deviation_by_median(fit.residual_nm[valid])
        spread = np.maximum(spread, _LEAST_NOISE * spread.max())
        if spread.max() == 0.0:
            break
        outlying = np.maximum(np.abs(fit.residual_nm) / (_HUBER * spread), 1.0)
        before = fit.theta
        fit = _weighted(regressor, torque_nm, given / np.sqrt(outlying), 1.0 / spread, iteration, prior)
        if np.abs((fit.theta - before) / fit.scale).max() < _WEIGHTS_SETTLED:
            break
    return fit


def _require_data(regressor: FloatArray, torque_nm: FloatArray, valid: NDArray[np.bool_], noise_nm: FloatArray) -> None:
    """Raise unless shapes match and there are enough finite data."""
    samples, joints, parameters = regressor.shape
    used = int(np.count_nonzero(valid))
    if torque_nm.shape != (samples, joints) or valid.shape != (samples,) or noise_nm.shape != (joints,):
        raise EstimationError(
            f"regressor {regressor.shape}, torque {torque_nm.shape}, valid {valid.shape} and noise "
            f"{noise_nm.shape} do not match; expected (N, n, p), (N, n), (N,), (n,)"
        )
    if used * joints <= parameters:
        raise EstimationError(
            f"{used} samples of {joints} joints are not enough for {parameters} parameters. Record a longer run."
        )
    # All rows first: they are usually finite, and a selection copies them.
    if not all(np.isfinite(data).all() or np.isfinite(data[valid]).all() for data in (regressor, torque_nm)):
        raise EstimationError("the regressor or the torque contains numbers that are not finite. Clean the recording.")
    if not (np.isfinite(noise_nm).all() and noise_nm.max() > 0.0):
        raise EstimationError(
            f"the noise per joint is {noise_nm.tolist()} N m; expected finite numbers, not all of them 0. "
            "Check that the torque columns contain measurements."
        )


def _triangles(regressor: FloatArray, torque_nm: FloatArray, weight: FloatArray) -> FloatArray:
    """(n, p + 1, p + 1) per joint the R factor of its weighted rows, with the target as last column.

    Most nuisance parameters belong to one joint, so that a joint's rows have few non-zero columns.
    """
    _, joints, parameters = regressor.shape
    triangles = np.zeros((joints, parameters + 1, parameters + 1))
    there = np.any(regressor, axis=0)
    for joint in range(joints):
        place = np.append(np.flatnonzero(there[joint]), parameters)
        rows = np.empty((len(torque_nm), place.size))
        np.multiply(regressor[:, joint, place[:-1]], weight[:, joint, None], out=rows[:, :-1])
        np.multiply(torque_nm[:, joint], weight[:, joint], out=rows[:, -1])
        own = _triangle(rows)
        triangles[joint, : len(own), place] = own.T
    return triangles


def _triangle(rows: FloatArray) -> FloatArray:
    """R factor of many rows: of blocks that fit into a processor's cache, then of their R factors, in half the time."""
    blocks, columns = len(rows) // _BLOCK_ROWS, rows.shape[1]
    if blocks > 1:
        cut = blocks * _BLOCK_ROWS
        of_blocks = np.asarray(np.linalg.qr(rows[:cut].reshape(blocks, _BLOCK_ROWS, columns), mode="r"))
        rows = np.concatenate([of_blocks.reshape(-1, columns), rows[cut:]])
    return np.asarray(np.linalg.qr(rows, mode="r"))


def _used(valid: NDArray[np.bool_], torque_nm: FloatArray, sample_weight: FloatArray | None) -> FloatArray:
    """(N, n) weight of every row, 0 for samples that are not used."""
    given = np.ones_like(torque_nm) if sample_weight is None else sample_weight
    return np.where(valid[:, None], given, 0.0)


@dataclass(frozen=True, eq=False)
class _Known:
    """A prior as equations of all p parameters.

    Attributes:
        rows: (k, p) coefficients.
        target: (k,) right-hand side.
    """

    rows: FloatArray
    target: FloatArray

    @classmethod
    def of(cls, prior: Prior | None, parameters: int) -> _Known:
        """From a prior on the first parameters."""
        known = NOTHING_KNOWN if prior is None else prior
        rows = np.zeros((known.target.size, parameters))
        rows[:, : known.rows.shape[1]] = known.rows
        return cls(rows, known.target)


@dataclass(frozen=True, eq=False)
class _Solution:
    """A solution of whitened equations; for the other attributes see `Estimate`.

    Attributes:
        triangle: (p, p) R of the columns at unit length.
        right: (p, p) its right singular vectors, as rows.
        inverse: (p,) inverse singular values, 0 for undetermined directions.
    """

    theta: FloatArray
    scale: FloatArray
    triangle: FloatArray
    right: FloatArray
    inverse: FloatArray
    rank: int


def _weighted(
    regressor: FloatArray,
    torque_nm: FloatArray,
    sample_weight: FloatArray,
    weight: FloatArray,
    iteration: int,
    prior: Prior | None,
) -> Estimate:
    """One weighted solution."""
    parameters = regressor.shape[2]
    known = _Known.of(prior, parameters)
    triangles = _triangles(regressor, torque_nm, sample_weight * weight)
    solution = _solve(triangles.reshape(-1, parameters + 1), known)
    return _completed(regressor, torque_nm, sample_weight, weight, iteration, known, solution)


def _solve(equations: FloatArray, known: _Known) -> _Solution:
    """QR of the whitened columns at unit length, SVD of its small triangle.

    Args:
        equations: (m, p + 1) R factors of the rows, the target as last column.
        known: The prior's equations.
    """
    parameters = equations.shape[1] - 1
    equations = np.vstack([equations, np.column_stack([known.rows, known.target])])
    length = np.sqrt(np.sum(equations[:, :-1] ** 2, axis=0))
    if length.max() == 0.0:
        raise EstimationError("the motion excites no parameter of the payload. Record a run along an excitation.")
    scale = 1.0 / np.where(length > _RANK_TOLERANCE * length.max(), length, np.inf)
    scale[scale == 0.0] = 1.0 / length.max()
    equations[:, :-1] *= scale
    both = np.asarray(np.linalg.qr(equations, mode="r"))
    triangle, target = both[:parameters, :parameters], both[:parameters, parameters]
    left, values, right = np.linalg.svd(triangle)
    rank = int(np.count_nonzero(values > _RANK_TOLERANCE * values[0]))
    inverse = np.where(np.arange(parameters) < rank, 1.0 / np.where(values > 0.0, values, 1.0), 0.0)
    theta = scale * (right.T @ (inverse * (left.T @ target)))
    return _Solution(theta, scale, triangle, right, inverse, rank)


def _completed(
    regressor: FloatArray,
    torque_nm: FloatArray,
    sample_weight: FloatArray,
    weight: FloatArray,
    iteration: int,
    known: _Known,
    solution: _Solution,
) -> Estimate:
    """A solution with the residual of every row."""
    scale, rank = solution.scale, solution.rank
    samples, joints, parameters = regressor.shape
    residual = torque_nm - (regressor.reshape(-1, parameters) @ solution.theta).reshape(samples, joints)
    half = scale[:, None] * solution.right.T * solution.inverse
    root = solution.triangle / scale
    singular_values = np.linalg.svd(root, compute_uv=False)
    full = rank == scale.size
    return Estimate(
        theta=solution.theta,
        weight_1_nm=weight,
        sample_weight=sample_weight,
        regressor=regressor,
        prior_rows=known.rows,
        root=root,
        undetermined=solution.right[rank:].T,
        scale=scale,
        singular_values=np.asarray(singular_values, dtype=np.float64),
        condition_number=float(singular_values[0] / singular_values[-1]) if full else float("inf"),
        rank=rank,
        residual_nm=residual,
        residual_rms_nm=_weighted_rms(residual, sample_weight),
        covariance=half @ half.T,
        iterations=iteration,
    )


def _weighted_rms(residual: FloatArray, sample_weight: FloatArray) -> FloatArray:
    """(n,) RMS with the squares of the weights as weights."""
    square = sample_weight**2
    return np.asarray(np.sqrt(np.sum(square * residual**2, axis=0) / np.maximum(np.sum(square, axis=0), 1e-300)))
