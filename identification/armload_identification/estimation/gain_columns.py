"""Nominal drive gains, fitted with the payload within what is assumed of them.

A gain that is assumed too low by exp(e_j) makes the measured torque of its axis tau exp(-e_j). Every gain is an unknown
with the covariance that is assumed of it:

    y = (Phi theta + friction) - sum_j share_j e_j,        (mu, e) ~ (known, Sigma)

Axes that agree with each other correct those that do not: by nominal gains the two mountings' centres of mass on the
UR10e lie 168 and 172 mm from the flange axis and 42 and 46 mm out; with the gains taken as they are, 175, 181, 51 and
55; by calibrated gains 170 and 43.

What is known weighs as much as it should only beside data that weigh as much as they should: a joint's noise is that
in the band in which the payload moves, 4 to 8 times the residual's RMS on that arm. By the RMS, friction of its joint 1
was read as a gain 12 % off.

A gain that the data contradict is one that, estimated from the other axes alone, lies beyond what was assumed of it and
beyond three of its own deviations. It is taken as unknown then, and named; at most a third of the axes, for of
more nothing says which are right. Nor is a gain found that no other axis measures the payload beside. All of this is
judged with that gain free: while it is held near what was assumed, the error that it leaves counts as noise and hides
it. On an arm of seven joints, the deviation of the gain that carries most of the payload is 2.2 % so with an error of
5 % and 6.9 % with one of 20 %; with that gain free it is 0.9 and 1.0 %.

Calibrated gains are known from more than one pair, and are taken as they are, their covariance among the doubts: fitted
again, the two heights on the UR10e are 2.6 mm apart, not 0.4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.body_fit import BodyFit
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
"""Relative standard deviation of what all nominal gains share, such as magnets that are warm: no data show it, and
independent errors of many axes would average out."""
UNKNOWN_DEVIATION: Final = 1.0
"""Deviation of the logarithm of a gain that the data contradict. With 0.1, an error of 20 % was pulled towards 0 while
the noise was found, and what was left of it counted as noise."""
_CONTRADICTS: Final = 3.0
_ASSUMED: Final = 2.0
"""Deviations that a gain may be off and still be within what was assumed of it, 95 %."""
_MATTERS: Final = 0.03
"""Friction of one pair of runs is read as a gain of this size: on the UR10e, 0.962 to 1.037 at one joint."""
_NINE_OF_TEN: Final = 1.28
_SUSPECT: Final = 0.7
"""Share of what is worth naming, beyond which a gain is tried as unknown: held and free, the other axes find the same
within 15 %."""
_POOR: Final = 2.0
"""Deviations that were assumed, beyond which a pair measures a gain poorly."""
_POORLY: Final = 2.0
"""Factor on what is named of a poorly measured gain: such a joint's friction is read as gain. On the UR10e, joint 1 is
found 15 % off, three of its deviations."""
_MINORITY: Final = 3
"""One axis in so many may be contradicted."""
_ITERATIONS: Final = 12
_ROUGH_ITERATIONS: Final = 2
"""The other axes' opinion of a gain is then within 1 % of where it settles."""
_SETTLED: Final = 1e-6
_LARGEST_STEP: Final = 0.5
"""Of a log gain in one iteration: the gain of a drive whose sign is inverted would run away."""


@dataclass(frozen=True, eq=False)
class GainFit:
    """What a pair of runs says of n gains.

    Attributes:
        log_gain: (n,) e: the logarithm of the estimated gain over the assumed one.
        half_width_95: (n,) of it.
        contradicted: (n,) True where the data contradict what was assumed, so that the gain was taken as unknown.
        assumed_deviation: (n,) relative standard deviation that was assumed.
        noticeable: (n,) error of a log gain that is named with a probability of 90 %, were it the only one that is off;
            by the noise with that gain free, so that it does not grow with its error.
        slope: (p, n) by how much theta moves with the logarithm of each gain as it was assumed.
        covariance: (n, n) of the logarithms of the estimated gains, without what all of them share.
        held: The fit of payload and friction with the gains held where they were estimated: the same estimate, for
            comparison with another that is made with the same gains.
    """

    log_gain: FloatArray
    half_width_95: FloatArray
    contradicted: NDArray[np.bool_]
    assumed_deviation: FloatArray
    noticeable: FloatArray
    slope: FloatArray
    covariance: FloatArray
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
        signal: Torque difference and its motion, by the gains as they are assumed.
        columns: Of payload and friction.
        fit: With the gains as they are.
        friction: What has columns in it, and what is known of it.
        transmission: The gains; which of them are uncertain, and by how much, is in its covariance.
        prior: What is known of the payload.
        arm: How well the body is known, where it was fitted to the unloaded run.
        least_nm: (n,) least noise of each joint.

    Returns:
        The fit, whose parameters behind payload and friction are what is left of e, and so next to 0; friction and
        gains; and the signal by the estimated gains, which is what was fitted.
    """
    system = _System(signal, columns, fit, friction, transmission, prior, least_nm)
    assumed = transmission.covariance
    covariance, contradicted = assumed.copy(), np.zeros(len(assumed), dtype=bool)
    found = system.solve(covariance)
    deviation = system.by_others(found, covariance)[1]
    named = True
    while named and _MINORITY * (np.count_nonzero(contradicted) + 1) <= len(assumed):
        named = False
        for axis in system.suspects(found, covariance, contradicted):
            freed = covariance.copy()
            freed[axis], freed[:, axis] = 0.0, 0.0
            freed[axis, axis] = UNKNOWN_DEVIATION**2
            trial = system.solve_freed(freed, found)
            value, free = system.by_others(trial, freed)
            deviation[axis] = free[axis]
            named = bool(abs(value[axis]) > system.named_from(free)[axis])
            if named:
                found, covariance = system.solve(freed, trial, system.noise_of(trial.fit)), freed
                deviation = np.minimum(deviation, system.by_others(found, covariance)[1])
                contradicted[axis] = True
                break
    gains = system.gains(found, contradicted, deviation)
    return found.fit, system.friction(found, arm), gains, found.signal


@dataclass(frozen=True, eq=False)
class _Found:
    """A solution.

    Attributes:
        fit: The last step of it.
        coefficient: (2 n,) of friction.
        log_gain: (n,) e.
        signal: By these gains.
        known: Covariance of what was known of friction and gains, in the order of `fit`'s columns that it is about.
        regressor: (K, n, p) that the last step was fitted with.
        target_nm: (K, n) what it was fitted to.
        noise_nm: (n,) by which noise.
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
        """Roughly another solution, by the noise that is left when a gain that is off no longer adds to it."""
        rough = self.solve(covariance, before, iterations=_ROUGH_ITERATIONS)
        return self.solve(covariance, rough, self.noise_of(rough.fit), iterations=1)

    def solve(
        self,
        covariance: FloatArray,
        start: _Found | None = None,
        noise_nm: FloatArray | None = None,
        iterations: int = _ITERATIONS,
    ) -> _Found:
        """Gauss and Newton.

        Args:
            covariance: (n, n) of all log gains.
            start: Where to begin; without, at the fit with the gains as they are assumed.
            noise_nm: (n,) noise of the joints; without, that of the same fit.
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
            payload_nm = columns.regressor @ theta
            # An error that all gains share changes links, payload and their friction alike, and no data show it.
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
        """The last step of a solution with the gains held where it found them."""
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
        """(n,) deviation of each joint's torque in the band in which the payload moves; at least that in all bands."""
        in_band = np.sqrt(ResidualSpectrum.of(fit, determined_basis(fit)).in_band()) / fit.weight_1_nm
        return np.asarray(np.maximum(np.maximum(in_band, fit.residual_rms_nm), self._least_nm))

    def by_others(self, found: _Found, covariance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(n,) what the other axes and the data say of each log gain by themselves, and its standard deviation.

        Args:
            found: The solution with this covariance.
            covariance: (n, n) of the log gains before.
        """
        axes = self._axes
        before = np.diag(covariance)[axes]
        after = np.minimum(np.diag(found.fit.covariance)[self._first_gain :], 0.999 * before)
        value, deviation = np.zeros(len(covariance)), np.zeros(len(covariance))
        # The axis' own prior taken out again.
        value[axes] = found.log_gain[axes] * before / (before - after)
        deviation[axes] = np.sqrt(after * before / (before - after))
        return value, deviation

    def suspects(self, found: _Found, covariance: FloatArray, contradicted: NDArray[np.bool_]) -> list[int]:
        """Axes that may be contradicted, those first whose held gain is most so.

        Which they are depends on how far each is off, not on how surely: that is known with the gain free.
        """
        value, deviation = self.by_others(found, covariance)
        off = np.where(contradicted, 0.0, np.abs(value))
        first = np.argsort(-off / self.named_from(deviation), kind="stable")
        return [int(axis) for axis in first if off[axis] > _SUSPECT * self._worth_naming[axis]]

    def named_from(self, deviation: FloatArray) -> FloatArray:
        """(n,) error of each gain, by the other axes, beyond which the data contradict what was assumed.

        Args:
            deviation: (n,) of what the other axes say.
        """
        poor = deviation > _POOR * self._transmission.deviation
        return np.asarray(np.maximum(self._worth_naming, np.where(poor, _POORLY, 1.0) * _CONTRADICTS * deviation))

    def friction(self, found: _Found, arm: BodyFit | None) -> FrictionDifference:
        """Friction as it came out beside the gains."""
        before = self._friction
        return self._columns.difference(
            found.fit, found.coefficient, self._chosen, before.known, before.known_deviation, arm
        )

    def gains(self, found: _Found, contradicted: NDArray[np.bool_], deviation: FloatArray) -> GainFit:
        """The gains of a solution.

        Args:
            found: The solution.
            contradicted: (n,) which of them are.
            deviation: (n,) of what the other axes say of each.
        """
        axes, known = self._axes, self._known_friction.size
        half_width = np.zeros(contradicted.size)
        half_width[axes] = nuisance_half_width(found.fit)[self._first_gain - 10 :]
        # Theta's answer to another mean of what was known, W (x - mean) = 0 among the equations.
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
            found.log_gain, half_width, contradicted, assumed, noticeable, slope, covariance, self.held(found)
        )

    def _coefficients(self, own: FloatArray) -> FloatArray:
        """(2 n,) coefficients of friction from those that have columns."""
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
        """What is known of payload, friction and, where they are fitted, gains, about the gains as they are now."""
        own = np.flatnonzero(self._chosen)[self._known_friction]
        of_gains = np.zeros(0) if log_gain is None else -log_gain[self._axes]
        mean = np.concatenate([self._friction.known[own], of_gains])
        whitening = np.linalg.inv(np.linalg.cholesky(known))
        place = np.concatenate([10 + self._known_friction, np.arange(self._first_gain, parameters)])
        rows = np.zeros((self._prior.target.size + place.size, parameters))
        rows[: self._prior.target.size, :10] = self._prior.rows
        rows[self._prior.target.size :, place] = whitening
        return Prior(rows, np.concatenate([self._prior.target, whitening @ mean]))
