"""Fit an arm to all its runs at once: Gauss-Newton on robustly weighted rows, run by run.

Every run has a few unknowns of its own in addition to the shared ones, so that the normal equations have an arrow
structure. The runs' own unknowns are eliminated run by run: the cost is linear in the number of runs, and each run's
contribution remains available, which identifies runs that contradict the others.

Rows are weighted by the speed of the joint and by Huber's function; their variance is that of the residual times its
integrated autocorrelation. Rows close to a blow to the arm are excluded on all joints. A run that deviates as a whole
has less weight, so that the others dominate.

The covariance is a sandwich over blocks of 5 s, averaged with the model's own covariance if there are few blocks, times
the square of 1.25: without this factor, halves of the UR10e's data differ by an rms z of 1.24.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.calibration.arm_model import PER_RUN, ArmModel, Unknowns
from armload_identification.calibration.arm_prior import ArmPrior, change_deviation
from armload_identification.calibration.arm_rows import ArmRows
from armload_identification.estimation.empty_arm.impacts import struck_samples
from armload_identification.identification_errors import EstimationError
from armload_identification.signals.robust_scale import deviation_by_median

HALVES: Final = 1.25
"""Factor on the standard deviations from the blocks, from comparing halves of the UR10e's data."""
_HUBER: Final = 2.0
_BLOCK_S: Final = 5.0
_ENOUGH_BLOCKS: Final = 30.0
_LAGS: Final = 25
_UNCORRELATED: Final = 0.05
_OFF: Final = 3.0
"""RMS residual of a run on any joint, relative to the noise of all runs, from which its weight is reduced."""
MOVING: Final = 0.3
"""Weight from which a joint counts as moving in a row, mainly for the noise."""
_OUTLYING: Final = 3.0
_STEPS: Final = 40
_ROUGH: Final = 5
"""Iterations in which friction's scale is adapted and no row is excluded."""
_WEIGHED: Final = 10
"""Iterations after which noise, blows and weights of runs are fixed: a row that alternates between used and excluded
would keep changing the gains by 0.01 %."""
_SETTLED: Final = 0.05
"""Change of all unknowns together, in standard deviations, below which the fit has settled."""
_SHORTEST: Final = 0.01
"""Shortest share of a step: full steps of poorly determined unknowns could oscillate across the kink of |tau|."""
_LARGEST_STEP: Final = 0.3
_ZERO: Final = 1e-12
_ROUNDING: Final = 1e-13


@dataclass(frozen=True, eq=False)
class FittedRun:
    """Residual, friction and influence of one run.

    Attributes:
        name: Name of the run.
        mounting: Name of its payload; empty for an empty arm.
        changes: (3 n,) Coulomb, viscous and offset changes.
        change_deviation: (3 n,) their expected standard deviations.
        residual_rms_nm: (n,) weighted RMS of effort minus prediction, axis torque with nominal gains.
        off: RMS over all joints of that, relative to the noise of all runs: 1 for a typical run.
        struck: Number of rows excluded as blows.
        rows: Number of rows.
        influence: (n,) change of ln(gain) without this run, in standard deviations.
    """

    name: str
    mounting: str
    changes: FloatArray
    change_deviation: FloatArray
    residual_rms_nm: FloatArray
    off: float
    struck: int
    rows: int
    influence: FloatArray


@dataclass(frozen=True, eq=False)
class ArmFit:
    """The unknowns of an arm with their covariance.

    Attributes:
        unknowns: The layout of x.
        x: (p,) shared unknowns.
        covariance: (p, p) covariance of x.
        bread: (p, p) inverse information: the covariance if the rows were as independent as their weights assume.
        noise_nm: (n,) standard deviation of a row.
        correlation: (n,) its integrated autocorrelation, in rows.
        level_nm: (n,) RMS effort.
        blocks: Number of blocks for the covariance.
        steps: Number of iterations.
        runs: Every run.
    """

    unknowns: Unknowns
    x: FloatArray
    covariance: FloatArray
    bread: FloatArray
    noise_nm: FloatArray
    correlation: FloatArray
    level_nm: FloatArray
    blocks: int
    steps: int
    runs: tuple[FittedRun, ...]


@dataclass(eq=False)
class _Run:
    """State of a run during the iteration."""

    rows: ArmRows
    mounting: str
    changes: FloatArray
    trust: float
    struck: NDArray[np.bool_]
    residual: FloatArray


@dataclass(frozen=True, eq=False)
class _Reduced:
    """Information and gradient of the shared unknowns, and the dependence of the run's own unknowns on these."""

    information: FloatArray
    gradient: FloatArray
    follow: FloatArray
    own_step: FloatArray


@dataclass(frozen=True, eq=False)
class _WeightedRows:
    """(N, k) rows and (N,) residuals of an axis, weighted, and (k,) indices of their unknowns."""

    rows: FloatArray
    target: FloatArray
    place: NDArray[np.intp]


def fit_arm(
    model: ArmModel,
    runs: Sequence[tuple[ArmRows, str]],
    prior: ArmPrior,
    peak_rad_s: FloatArray,
    progress: Callable[[int, int], None] | None = None,
    *,
    rough: bool = False,
) -> ArmFit:
    """Fit all runs.

    Args:
        model: Predictions and derivatives.
        runs: Rows and mounting of every run.
        prior: Prior knowledge.
        peak_rad_s: (n,) greatest speeds.
        progress: Called with the number of iterations done, and an estimate of their total.
        rough: Return the last iterate even if it has not settled; sufficient if only the residual is needed.

    Returns:
        The fit.

    Raises:
        EstimationError: it does not settle.
    """
    return _Fitter(model, runs, prior, peak_rad_s).fit(progress, rough=rough)


class _Fitter:
    """State of the iteration."""

    def __init__(
        self, model: ArmModel, runs: Sequence[tuple[ArmRows, str]], prior: ArmPrior, peak_rad_s: FloatArray
    ) -> None:
        self._model, self._prior, self._peak = model, prior, peak_rad_s
        of = model.unknowns
        self._x = np.zeros(of.size)
        self._x[of.load] = np.linalg.solve(prior.precision, prior.target)[of.load]
        own = np.zeros(PER_RUN * of.n)
        self._runs = [
            _Run(rows, mounting, own.copy(), 1.0, np.zeros(len(rows.time_s), dtype=bool), rows.effort_nm)
            for rows, mounting in runs
        ]
        self._noise = np.maximum(prior.level_nm, _ZERO)
        self._correlation = np.ones(of.n)
        self._drift = change_deviation(of, self._x, prior.level_nm, peak_rad_s)

    def fit(self, progress: Callable[[int, int], None] | None, *, rough: bool) -> ArmFit:
        """Iterate until the unknowns settle."""
        of = self._model.unknowns
        for step in range(_STEPS):
            moved = self._step()
            if step < _WEIGHED:
                self._weigh(rough=step < _ROUGH)
            if progress is not None:
                progress(step + 1, max(step + 1, _WEIGHED + _ROUGH))
            if step > _ROUGH and moved < _SETTLED:
                return self._result(step + 1)
        if rough:
            return self._result(_STEPS)
        raise EstimationError(
            f"the calibration does not converge within {_STEPS} steps (the unknowns still change by {moved:.2g} "
            f"standard deviations); {of.size} unknowns, {len(self._runs)} runs. Add runs with other motions."
        )

    def _step(self) -> float:
        """One step of all unknowns, shortened until the fit improves; returns its size in standard deviations."""
        of = self._model.unknowns
        reduced = [self._reduced(run) for run in self._runs]
        information = self._prior.precision + np.sum([part.information for part in reduced], axis=0)
        gradient = self._prior.target - self._prior.precision @ self._x
        gradient = gradient + np.sum([part.gradient for part in reduced], axis=0)
        step = _solved(information, gradient)
        own_steps = [part.own_step - part.follow @ step for part in reduced]
        weights = [self._row_weights(run) for run in self._runs]
        before_x, before = self._x, [run.changes for run in self._runs]
        cost = self._cost(weights)
        share = min(1.0, _LARGEST_STEP / max(float(np.abs(step[of.log_h]).max()), _ZERO))
        while True:
            self._x = before_x + share * step
            for run, changes, own in zip(self._runs, before, own_steps, strict=True):
                run.changes = changes + share * own
                run.residual = run.rows.effort_nm - self._model.predict(run.rows, run.mounting, self._x, run.changes)
            if share < _SHORTEST or self._cost(weights) <= cost:
                return share * float(np.sqrt(step @ information @ step))
            share *= 0.5

    def _cost(self, weights: Sequence[FloatArray]) -> float:
        """Weighted squares of the residuals and of deviations from the prior."""
        left = sum(float(np.sum((run.residual * weight) ** 2)) for run, weight in zip(self._runs, weights, strict=True))
        own = sum(float(np.sum((run.changes / self._drift) ** 2)) for run in self._runs)
        return left + own + float(self._x @ self._prior.precision @ self._x - 2.0 * self._prior.target @ self._x)

    def _row_weights(self, run: _Run) -> FloatArray:
        """(N, n) weight of every row: root of its inverse variance."""
        size = np.abs(run.residual * run.rows.weight) / self._noise
        huber = np.sqrt(np.minimum(1.0, _HUBER / np.maximum(size, _ZERO)))
        weight = run.rows.weight * huber * (np.sqrt(run.trust) / (self._noise * np.sqrt(self._correlation)))
        return np.asarray(np.where(run.struck[:, None], 0.0, weight))

    def _local(self, run: _Run) -> tuple[FloatArray, FloatArray, list[_WeightedRows]]:
        """Information and gradient of shared and own unknowns, and the weighted rows of every axis."""
        of = self._model.unknowns
        size = of.size + PER_RUN * of.n
        information, gradient = np.zeros((size, size)), np.zeros(size)
        derivatives = self._model.differentiate(run.rows, run.mounting, self._x, run.changes)
        weight = self._row_weights(run)
        weighted = []
        for axis, (columns, place) in enumerate(zip(derivatives.columns, derivatives.place, strict=True)):
            rows = columns * weight[:, axis, None]
            target = run.residual[:, axis] * weight[:, axis]
            information[np.ix_(place, place)] += rows.T @ rows
            gradient[place] += rows.T @ target
            weighted.append(_WeightedRows(rows, target, place))
        own = np.arange(of.size, size)
        information[own, own] += self._drift**-2.0
        gradient[own] -= run.changes / self._drift**2
        return information, gradient, weighted

    def _reduced(self, run: _Run) -> _Reduced:
        """A run's normal equations with its own unknowns eliminated."""
        information, gradient, _ = self._local(run)
        return _eliminate(information, gradient, self._model.unknowns.size)

    def _weigh(self, *, rough: bool) -> None:
        """Update noise, its autocorrelation, blows, and the weights of runs."""
        of = self._model.unknowns
        weighted = [run.residual * run.rows.weight for run in self._runs]
        used = [~run.struck for run in self._runs]
        for axis in range(of.n):
            values = np.concatenate([part[keep, axis] for part, keep in zip(weighted, used, strict=True)])
            speed = np.concatenate([run.rows.weight[keep, axis] for run, keep in zip(self._runs, used, strict=True)])
            moving = values[speed > MOVING]
            if moving.size < _LAGS:
                continue
            spread = max(float(deviation_by_median(moving)), _ZERO)
            clipped = np.clip(moving, -_OUTLYING * spread, _OUTLYING * spread)
            noise = min(float(np.sqrt(np.mean(clipped**2))), float(self._prior.level_nm[axis]))
            self._noise[axis] = max(noise, _ZERO)
            self._correlation[axis] = _integrated([part[:, axis] for part in weighted], _OUTLYING * spread)
        for run, part in zip(self._runs, weighted, strict=True):
            size = np.abs(part) / self._noise
            run.struck = struck_samples(size, run.rows.time_s) if not rough else run.struck
            run.trust = 1.0 / max(float(_off(part, self._noise, run.struck).max()) / _OFF, 1.0) ** 2
        if rough:
            self._drift = change_deviation(of, self._x, self._prior.level_nm, self._peak)

    def _result(self, steps: int) -> ArmFit:
        """Covariance and contribution of each run."""
        of = self._model.unknowns
        parts, meat, blocks = [], self._prior.precision.copy(), 0
        for run in self._runs:
            information, gradient, weighted = self._local(run)
            reduced = _eliminate(information, gradient, of.size)
            parts.append(reduced)
            block = np.asarray(run.rows.time_s / _BLOCK_S, dtype=np.intp)
            sums = np.zeros((int(block.max()) + 1, len(information)))
            for axis in weighted:
                gathered = np.zeros((len(sums), axis.place.size))
                np.add.at(gathered, block, axis.rows * axis.target[:, None])
                sums[:, axis.place] += gathered
            ahead = sums[:, : of.size] - sums[:, of.size :] @ reduced.follow
            own = reduced.follow.T * self._drift**-2.0
            meat += ahead.T @ ahead + own @ reduced.follow
            blocks += len(sums)
        information = self._prior.precision + np.sum([part.information for part in parts], axis=0)
        bread = _solved(information, np.eye(of.size))
        share = blocks / (blocks + _ENOUGH_BLOCKS)
        covariance = HALVES**2 * (share * bread @ meat @ bread + (1.0 - share) * bread)
        deviation = np.sqrt(np.diag(covariance))[of.log_h]
        return ArmFit(
            unknowns=of,
            x=self._x,
            covariance=0.5 * (covariance + covariance.T),
            bread=bread,
            noise_nm=self._noise,
            correlation=self._correlation,
            level_nm=self._prior.level_nm,
            blocks=blocks,
            steps=steps,
            runs=tuple(
                self._fitted(run, part, information, deviation) for run, part in zip(self._runs, parts, strict=True)
            ),
        )

    def _fitted(self, run: _Run, part: _Reduced, information: FloatArray, deviation: FloatArray) -> FittedRun:
        """A run's residual, and its influence on the gains."""
        weighted = run.residual * run.rows.weight
        # Without the run: one step from the solution of all runs, at which the gradients cancel.
        moved = np.abs(_solved(information - part.information, part.gradient)[self._model.unknowns.log_h])
        return FittedRun(
            name=run.rows.name,
            mounting=run.mounting,
            changes=run.changes,
            change_deviation=self._drift,
            residual_rms_nm=np.sqrt(np.mean(weighted[~run.struck] ** 2, axis=0)),
            off=float(np.sqrt(np.mean(_off(weighted, self._noise, run.struck) ** 2))),
            struck=int(np.count_nonzero(run.struck)),
            rows=len(run.rows.time_s),
            influence=moved / deviation,
        )


def _eliminate(information: FloatArray, gradient: FloatArray, shared: int) -> _Reduced:
    """Schur complement: the shared unknowns with the run's own eliminated."""
    from scipy.linalg import cho_factor, cho_solve

    factor = cho_factor(information[shared:, shared:])
    follow = cho_solve(factor, information[shared:, :shared])
    own = cho_solve(factor, gradient[shared:])
    return _Reduced(
        information[:shared, :shared] - information[:shared, shared:] @ follow,
        gradient[:shared] - information[:shared, shared:] @ own,
        follow,
        own,
    )


def _solved(information: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of the normal equations, scaled to unit diagonal, with a small regularisation against rounding."""
    from scipy.linalg import cho_factor, cho_solve

    scale = 1.0 / np.sqrt(np.diag(information))
    factor = cho_factor(information * scale[:, None] * scale + _ROUNDING * np.eye(len(scale)))
    tall = scale[:, None] if right.ndim > 1 else scale
    return np.asarray(tall * cho_solve(factor, right * tall))


def _integrated(parts: Sequence[FloatArray], bound: float) -> float:
    """Integrated autocorrelation, in rows, up to where it has decayed."""
    covariance = np.zeros(_LAGS)
    for part in parts:
        values = np.clip(part, -bound, bound)
        for lag in range(min(_LAGS, len(values))):
            covariance[lag] += values[lag:] @ values[: len(values) - lag]
    if covariance[0] <= 0.0:
        return 1.0
    share = covariance / covariance[0]
    faded = np.flatnonzero(share < _UNCORRELATED)
    last = int(faded[0]) if faded.size else _LAGS
    return max(1.0 + 2.0 * float(share[1:last].sum()), 1.0)


def _off(weighted: FloatArray, noise_nm: FloatArray, struck: NDArray[np.bool_]) -> FloatArray:
    """(n,) RMS over the rows, relative to the noise."""
    return np.asarray(np.sqrt(np.mean((weighted[~struck] / noise_nm) ** 2, axis=0)))
