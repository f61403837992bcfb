"""Nominal drive gains, fitted with the payload within their assumed uncertainty.

If the assumed gain is too low by the factor exp(e_j), the measured torque of its axis is tau exp(-e_j). Every uncertain
gain is an unknown with its assumed covariance:

    y = (Phi theta + friction) - sum_j share_j e_j,        (mu, e) ~ (known, Sigma)

Axes that agree with each other correct those that do not: with nominal gains fitted like this, the two mountings'
centres of mass on the UR10e are 168 and 172 mm from the flange axis and at heights of 42 and 46 mm; with nominal gains
not fitted, 175 and 181, 51 and 55; with calibrated gains 170 and 43.

For prior and data to be weighted correctly against each other, a joint's noise is that in the band in which the payload
moves, 4 to 8 times the residual's RMS on that arm. With the RMS, friction of its joint 1 was taken for a gain error of
12 %.

The data contradict a gain if its value estimated from the other axes differs from the assumed one by more than was
assumed and by more than three standard deviations of that estimate. It is then treated as unknown, and named; at most
a third of the axes, as beyond that it is not clear which are right: others that the data contradict are named as well,
but keep their prior. A gain error cannot be found if no other axis measures the payload. The test is made with that
gain free: while it is held near its assumed value, the error counts as noise and hides itself. On an arm of seven
joints, the standard deviation for the axis that carries most of the payload is then 2.2 % with a gain error of 5 % and
6.9 % with one of 20 %; with that gain free it is 0.9 and 1.0 %.

Calibrated gains are known from more than one pair and are not fitted; their covariance is one of the errors that widen
the intervals. Fitted again within it, they put the centres of mass of the UR10e's two mountings 0.0 instead of 1.1 mm
apart in radius, but 2.8 instead of 2.4 in height; on simulated arms they change hardly anything. To use a pair for the
gains as well, add its runs to the calibration, its mass unknown: 0.1 and 2.1 mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.unloaded_arm import BodyFit
from armload_identification.estimation.friction_columns import FrictionColumns, FrictionDifference
from armload_identification.estimation.least_squares import Estimate, Prior, estimate
from armload_identification.estimation.uncertainty import (
    ResidualSpectrum,
    determined_basis,
    nuisance_half_width,
)
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import LoadSignal

COMMON_DEVIATION: Final = 0.01
"""Relative standard deviation of an error common to all nominal gains, such as warm magnets: it does not average out
over the axes, and only a known mass reveals it."""
UNKNOWN_DEVIATION: Final = 1.0
"""Standard deviation of the logarithm of a contradicted gain. With 0.1, an error of 20 % was pulled towards 0 while the
noise was estimated, and the rest of it counted as noise."""
_CONTRADICTS: Final = 3.0
_ASSUMED: Final = 2.0
"""Half width of the assumed range of a gain in standard deviations, 95 %."""
_MATTERS: Final = 0.03
"""Friction of one pair of runs can look like a gain error of this size: on the UR10e, 0.962 to 1.037 at one joint."""
_NINE_OF_TEN: Final = 1.28
_SUSPECT: Final = 0.7
"""Share of the smallest error worth naming from which a gain is tried as unknown: with the gain held or free, the other
axes' estimates agree within 15 %."""
_POOR: Final = 2.0
"""A pair measures a gain poorly if its standard deviation exceeds the assumed one by this factor."""
_POORLY: Final = 2.0
"""Factor on the threshold of a poorly measured gain, because such a joint's friction looks like a gain error: 15 %,
three standard deviations, at joint 1 of the UR10e."""
_MINORITY: Final = 3
"""At most one axis in this many may be contradicted."""
_ITERATIONS: Final = 12
_ROUGH_ITERATIONS: Final = 2
"""The other axes' estimate of a gain is then within 1 % of its final value."""
_SETTLED: Final = 1e-6
_LARGEST_STEP: Final = 0.5
"""Largest change of a log gain in one iteration: the gain of a drive with inverted sign would diverge."""


@dataclass(frozen=True, eq=False)
class GainFit:
    """The n gains as estimated from a pair of runs.

    Attributes:
        log_gain: (n,) e: the logarithm of the ratio of estimated to assumed gain.
        half_width_95: (n,) half width of its 95 % interval.
        contradicted: (n,) True where the data contradict the assumed gain, so that it was treated as unknown.
        beyond: (n,) True where they contradict it too, but a third of the gains are treated as unknown already.
        assumed_deviation: (n,) assumed relative standard deviation.
        noticeable: (n,) error of a log gain that is named with a probability of 90 %, if it is the only one;
            computed from the noise with that gain free, so that it does not grow with the error.
        slope: (p, n) derivative of theta by the logarithm of each assumed gain.
        covariance: (n, n) of the logarithms of the estimated gains, without `common_deviation`.
        common_deviation: Standard deviation of an error common to all gains, which was not fitted: 0 if a known mass
            reveals it.
        held: The fit of payload and friction with the gains held at their estimates: the same estimate, for
            comparison with another that is made with the same gains.
    """

    log_gain: FloatArray
    half_width_95: FloatArray
    contradicted: NDArray[np.bool_]
    beyond: NDArray[np.bool_]
    assumed_deviation: FloatArray
    noticeable: FloatArray
    slope: FloatArray
    covariance: FloatArray
    common_deviation: float
    held: Estimate


def fit_with_gains(
    signal: LoadSignal,
    columns: FrictionColumns,
    fit: Estimate,
    friction: FrictionDifference,
    transmission: Transmission,
    prior: Prior,
    arm: BodyFit | None,
    least_nm: FloatArray,
) -> tuple[Estimate, FrictionDifference, GainFit, LoadSignal]:
    """Fit a payload and friction again, together with the gains.

    Args:
        signal: Torque difference and its motion, with the assumed gains.
        columns: Of payload and friction.
        fit: The fit with the assumed gains.
        friction: Which joints have friction columns, and the prior of these.
        transmission: The gains; its covariance states which are uncertain, and by how much.
        prior: Prior knowledge of the payload.
        arm: How well the body is known, if it was fitted to the unloaded run.
        least_nm: (n,) lower bound of each joint's noise.

    Returns:
        The fit, whose parameters after payload and friction are the last steps of e and therefore close to 0; friction
        and gains; and the fitted signal, with the estimated gains.
    """
    system = _System(signal, columns, fit, friction, transmission, prior, least_nm)
    assumed = transmission.covariance
    covariance, contradicted = assumed.copy(), np.zeros(len(assumed), dtype=bool)
    found = system.solve(covariance)
    deviation = system.by_others(found, covariance)[1]
    beyond = np.zeros_like(contradicted)
    searching = True
    while searching:
        searching = False
        full = _MINORITY * (np.count_nonzero(contradicted) + 1) > len(assumed)
        for axis in system.suspects(found, covariance, contradicted):
            freed = covariance.copy()
            freed[axis], freed[:, axis] = 0.0, 0.0
            freed[axis, axis] = UNKNOWN_DEVIATION**2
            trial = system.solve_freed(freed, found)
            value, free = system.by_others(trial, freed)
            deviation[axis] = free[axis]
            if abs(value[axis]) <= system.named_from(free)[axis]:
                continue
            if full:
                beyond[axis] = True
                continue
            found, covariance = system.solve(freed, trial, system.noise_of(trial.fit)), freed
            deviation = np.minimum(deviation, system.by_others(found, covariance)[1])
            contradicted[axis] = searching = True
            break
    scale_known = bool(prior.target.any())
    if scale_known:
        nominal = (transmission.deviation > 0.0) & ~contradicted
        found = system.solve(covariance + COMMON_DEVIATION**2 * np.outer(nominal, nominal), found, found.noise_nm)
    common = 0.0 if scale_known else COMMON_DEVIATION
    gains = system.gains(found, contradicted, beyond, deviation, common)
    return found.fit, system.friction(found, arm), gains, found.signal


@dataclass(frozen=True, eq=False)
class _Found:
    """A solution.

    Attributes:
        fit: Its last step.
        coefficient: (2 n,) of friction.
        log_gain: (n,) e.
        signal: The signal with these gains.
        known: Covariance of the prior on friction and gains, in the order of their columns in `fit`.
        regressor: (K, n, p) of the last step.
        target_nm: (K, n) torque that the last step was fitted to.
        noise_nm: (n,) noise that weighted it.
    """

    fit: Estimate
    coefficient: FloatArray
    log_gain: FloatArray
    signal: LoadSignal
    known: FloatArray
    regressor: FloatArray
    target_nm: FloatArray
    noise_nm: FloatArray


class _System:
    """Payload, friction and gains of one pair of runs."""

    def __init__(
        self,
        signal: LoadSignal,
        columns: FrictionColumns,
        fit: Estimate,
        friction: FrictionDifference,
        transmission: Transmission,
        prior: Prior,
        least_nm: FloatArray,
    ) -> None:
        self._signal, self._columns, self._start, self._prior = signal, columns, fit, prior
        self._transmission, self._friction, self._least_nm = transmission, friction, least_nm
        self._chosen = np.concatenate([friction.load_joints, friction.viscous_joints])
        self._axes = np.flatnonzero(transmission.deviation > 0.0)
        self._first_gain = 10 + int(np.count_nonzero(self._chosen))
        self._noise_nm = self.noise_of(fit)
        self._worth_naming = np.maximum(_ASSUMED * transmission.deviation, _MATTERS)
        self._known_friction = np.flatnonzero(np.isfinite(friction.known_deviation[self._chosen]))

    def solve_freed(self, covariance: FloatArray, before: _Found) -> _Found:
        """A rough solution with a gain free, weighted by the noise that remains without that gain's error."""
        rough = self.solve(covariance, before, iterations=_ROUGH_ITERATIONS)
        return self.solve(covariance, rough, self.noise_of(rough.fit), iterations=1)

    def solve(
        self,
        covariance: FloatArray,
        start: _Found | None = None,
        noise_nm: FloatArray | None = None,
        iterations: int = _ITERATIONS,
    ) -> _Found:
        """Solve by the Gauss-Newton method.

        Args:
            covariance: (n, n) of all log gains.
            start: Where to begin; the fit with the assumed gains if not given.
            noise_nm: (n,) noise of the joints; that of the fit with the assumed gains if not given.
            iterations: At most.
        """
        noise = self._noise_nm if noise_nm is None else noise_nm
        transmission, axes = self._transmission, self._axes
        first = self._start if start is None else start.fit
        theta, own = first.theta[:10], first.theta[10 : self._first_gain]
        log_gain = np.zeros(len(covariance)) if start is None else start.log_gain.copy()
        known = self._known(covariance)
        for _ in range(iterations):
            changed = transmission.changed_by(log_gain)
            signal, columns = self._signal.with_torque_times(changed), self._columns.with_empty_times(changed)
            beside = columns.chosen(theta, self._chosen)
            payload_nm = columns.payload_nm(theta)
            # A common error of all gains scales links, payload and their friction alike, so that no data reveal it.
            load = self._coefficients(own)[: len(covariance)]
            growth = columns.growth(theta, load)
            of_links = columns.slope_of_empty(theta, load) * transmission.gain_shares(columns.empty_nm)[axes]
            shares = of_links - transmission.gain_shares(payload_nm + beside @ own)[axes]
            everything = np.empty((*growth.shape, self._first_gain + axes.size))
            np.multiply(columns.regressor, (1.0 + growth)[:, :, None], out=everything[:, :, :10])
            everything[:, :, 10 : self._first_gain] = beside
            everything[:, :, self._first_gain :] = shares.transpose(1, 2, 0)
            target = signal.torque_nm + growth * payload_nm
            knowledge = self._equations(known, log_gain, everything.shape[2])
            fit = estimate(everything, target, signal.valid, noise, self._start.sample_weight, knowledge)
            theta, own, step = fit.theta[:10], fit.theta[10 : self._first_gain], fit.theta[self._first_gain :]
            if np.abs(step).max() < _SETTLED:
                break
            log_gain[axes] += np.clip(step, -_LARGEST_STEP, _LARGEST_STEP)
        return _Found(fit, self._coefficients(own), log_gain, signal, known, everything, target, noise)

    def held(self, found: _Found) -> Estimate:
        """The last step of a solution with the gains held at their estimates."""
        friction = self._known_friction.size
        return estimate(
            found.regressor[:, :, : self._first_gain],
            found.target_nm,
            found.signal.valid,
            found.noise_nm,
            self._start.sample_weight,
            self._equations(found.known[:friction, :friction], None, self._first_gain),
        )

    def noise_of(self, fit: Estimate) -> FloatArray:
        """(n,) noise of each joint's torque in the band in which the payload moves, at least the residual's RMS."""
        in_band = np.sqrt(ResidualSpectrum.of(fit, determined_basis(fit)).in_band()) / fit.weight_1_nm
        return np.asarray(np.maximum(np.maximum(in_band, fit.residual_rms_nm), self._least_nm))

    def by_others(self, found: _Found, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) each log gain as estimated without its own prior, and its standard deviation.

        Args:
            found: The solution with this covariance.
            covariance: (n, n) prior covariance of the log gains.
        """
        axes = self._axes
        before = np.diag(covariance)[axes]
        after = np.minimum(np.diag(found.fit.covariance)[self._first_gain :], 0.999 * before)
        value, deviation = np.zeros(len(covariance)), np.zeros(len(covariance))
        # Removes the axis's own prior.
        value[axes] = found.log_gain[axes] * before / (before - after)
        deviation[axes] = np.sqrt(after * before / (before - after))
        return value, deviation

    def suspects(self, found: _Found, covariance: FloatArray, contradicted: NDArray[np.bool_]) -> list[int]:
        """Axes whose gain may be contradicted, the most contradicted first.

        The selection uses the size of the error, not its significance, which is known only with the gain free.
        """
        value, deviation = self.by_others(found, covariance)
        off = np.where(contradicted, 0.0, np.abs(value))
        first = np.argsort(-off / self.named_from(deviation), kind="stable")
        return [int(axis) for axis in first if off[axis] > _SUSPECT * self._worth_naming[axis]]

    def named_from(self, deviation: FloatArray) -> FloatArray:
        """(n,) error of each log gain, as estimated by the other axes, from which the data contradict the assumed gain.

        Args:
            deviation: (n,) standard deviation of the other axes' estimate.
        """
        poor = deviation > _POOR * self._transmission.deviation
        return np.asarray(np.maximum(self._worth_naming, np.where(poor, _POORLY, 1.0) * _CONTRADICTS * deviation))

    def friction(self, found: _Found, arm: BodyFit | None) -> FrictionDifference:
        """The friction of a solution."""
        before = self._friction
        return self._columns.difference(
            found.fit, found.coefficient, self._chosen, before.known, before.known_deviation, arm
        )

    def gains(
        self,
        found: _Found,
        contradicted: NDArray[np.bool_],
        beyond: NDArray[np.bool_],
        deviation: FloatArray,
        common: float,
    ) -> GainFit:
        """The gains of a solution.

        Args:
            found: The solution.
            contradicted: (n,) True for those that the data contradict.
            beyond: (n,) True for those that they contradict beyond the third that is treated as unknown.
            deviation: (n,) standard deviation of the other axes' estimate of each.
            common: Standard deviation of their common error.
        """
        axes, known = self._axes, self._known_friction.size
        half_width = np.zeros(contradicted.size)
        half_width[axes] = nuisance_half_width(found.fit)[self._first_gain - 10 :]
        # Derivative of theta by the mean of the prior, W (x - mean) = 0 among the equations.
        rows = found.fit.prior_rows[self._prior.target.size :]
        basis = determined_basis(found.fit)
        answer = basis @ (basis.T @ rows.T) @ np.linalg.inv(np.linalg.cholesky(found.known))
        slope = np.zeros((found.fit.theta.size, contradicted.size))
        slope[:, axes] = answer[:, known:]
        covariance = np.zeros((contradicted.size, contradicted.size))
        covariance[np.ix_(axes, axes)] = found.fit.covariance[self._first_gain :, self._first_gain :]
        assumed = np.asarray(self._transmission.deviation)
        noticeable = self.named_from(deviation) + _NINE_OF_TEN * deviation
        return GainFit(
            log_gain=found.log_gain,
            half_width_95=half_width,
            contradicted=contradicted,
            beyond=beyond,
            assumed_deviation=assumed,
            noticeable=noticeable,
            slope=slope,
            covariance=covariance,
            common_deviation=common,
            held=self.held(found),
        )

    def _coefficients(self, own: FloatArray) -> FloatArray:
        """(2 n,) coefficients of friction, 0 for those without a column."""
        coefficient = np.zeros(self._chosen.size)
        coefficient[self._chosen] = own
        return coefficient

    def _known(self, covariance: FloatArray) -> FloatArray:
        """Covariance of the known coefficients of friction and of the gains that have columns."""
        own = np.flatnonzero(self._chosen)[self._known_friction]
        axes, known = self._axes, own.size
        whole = np.zeros((known + axes.size, known + axes.size))
        whole[:known, :known] = np.diag(self._friction.known_deviation[own] ** 2)
        whole[known:, known:] = covariance[np.ix_(axes, axes)]
        return whole

    def _equations(self, known: FloatArray, log_gain: FloatArray | None, parameters: int) -> Prior:
        """Prior of payload, friction and, if fitted, gains, relative to the present gains."""
        own = np.flatnonzero(self._chosen)[self._known_friction]
        of_gains = np.zeros(0) if log_gain is None else -log_gain[self._axes]
        mean = np.concatenate([self._friction.known[own], of_gains])
        whitening = np.linalg.inv(np.linalg.cholesky(known))
        place = np.concatenate([10 + self._known_friction, np.arange(self._first_gain, parameters)])
        rows = np.zeros((self._prior.target.size + place.size, parameters))
        rows[: self._prior.target.size, :10] = self._prior.rows
        rows[self._prior.target.size :, place] = whitening
        return Prior(rows, np.concatenate([self._prior.target, whitening @ mean]))
