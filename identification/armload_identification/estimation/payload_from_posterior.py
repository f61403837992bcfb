"""A payload read from the posterior of its problem."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from armload_identification.estimation.arm_from_posterior import identified_body
from armload_identification.estimation.arm_terms import (
    FRICTION_CHANGE,
    GAIN,
    LOAD_FRICTION,
    PAYLOAD,
    SESSION_FRICTION,
    SESSION_LOAD,
)
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.estimation.estimation_constants import Payloads, Solver
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.estimation.payload_problem import PayloadProblem
from armload_identification.estimation.physical_consistency import root_of
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.prior_knowledge import Prior
from armload_identification.estimation.sampled_torque import sampling_doubt
from armload_identification.estimation.solve import solve
from armload_identification.float_array import FloatArray
from armload_identification.model.body_model import BodyModel
from armload_identification.model.mass_center import MassCenterCovariance, unknown_deviation
from armload_identification.model.regressor import PARAMETERS
from armload_identification.signals.reversals import reversal_speed


def estimate_of(
    posterior: Posterior,
    arm: PayloadProblem,
    prior: Prior | None,
    errors: FloatArray,
    *,
    gears: bool = False,
) -> PayloadEstimate:
    """The payload of a posterior, with the errors that no term describes.

    Args:
        posterior: The solution.
        prior: What was known of the payload.
        errors: (k, p) change of the first p unknowns, those of the arm, for one standard deviation of each independent
            error with which they are held.
        gears: Whether gears may lose more in one direction of the power than in the other, as nothing was weighed.
    """
    place = posterior.problem.place(PAYLOAD, PAYLOAD)
    rows = posterior.problem.groups[0].runs[0].rows
    sampled = sampling_doubt(rows, arm.layout.chain, posterior.value(PAYLOAD, PAYLOAD), arm.interval_s)
    shifts = posterior.response(sampled @ posterior.problem.coupling)[place].T
    if prior is not None:
        shifts = np.vstack([shifts, prior.doubts @ posterior.bread[place, place]])
    uneven = np.zeros((0, len(posterior.problem.coupling)))
    if gears:
        own = gear_asymmetry(posterior.value(LOAD_FRICTION))
        uneven = np.vstack([np.diag(own), own])
    gains = errors[:, posterior.problem.place(GAIN)]
    return PayloadEstimate(posterior, arm, shifts, uneven, gains, posterior.considered(errors)[:, place])


def gear_asymmetry(load_friction: FloatArray) -> FloatArray:
    """(n,) standard deviation of the logarithm of a gain by (n,) mu: half the difference between a gear's two losses.

    A gear loses 1/f - 1 of the load while the motor drives it and 1 - b while the load drives the motor. Their mean is
    mu, and half of their difference is an error of the gain that no recording shows.
    """
    return np.asarray(Payloads.asymmetry * load_friction**2)


@dataclass(frozen=True, eq=False)
class PayloadEstimate:
    """A payload of ten parameters in a posterior.

    Attributes:
        posterior: All unknowns.
        arm: Base parameters and speeds.
        shifts: (k, 10) change of theta for one standard deviation of k errors that no term describes.
        uneven_gains: (k, n) change of the logarithm of each gain for one standard deviation of k independent errors by
            gears that do not lose the same in both directions of the power, which no run shows.
        considered_gains: (k, n) change of the logarithm of each gain's inverse for k errors of what was held.
        considered: (k, 10) change of theta for these errors.
    """

    posterior: Posterior
    arm: PayloadProblem
    shifts: FloatArray
    uneven_gains: FloatArray
    considered_gains: FloatArray
    considered: FloatArray

    @property
    def _payload_place(self) -> slice:
        """Place of the parameters among the unknowns."""
        return self.posterior.problem.place(PAYLOAD, PAYLOAD)

    @property
    def theta(self) -> FloatArray:
        """(10,) the parameters; along undetermined directions close to 0."""
        return self.posterior.value(PAYLOAD, PAYLOAD)

    @property
    def runs(self) -> int:
        """Number of runs: two if there is an unloaded one."""
        return len(self.arm.problem.groups[0].runs)

    @cached_property
    def _covariance_if_independent(self) -> FloatArray:
        """(10, 10) covariance if rows are as independent as assumed."""
        return self.posterior.bread[self._payload_place, self._payload_place]

    @cached_property
    def scale(self) -> FloatArray:
        """(10,) unit of each parameter: its prior standard deviation."""
        return self.posterior.deviation[self._payload_place]

    @cached_property
    def blind(self) -> FloatArray:
        """(10, k) directions of theta / `scale` that are not determined, orthonormal."""
        return self._blind(self._covariance_if_independent)

    def _blind(self, covariance: FloatArray) -> FloatArray:
        """(10, k) directions of which a covariance says no more than the prior."""
        values, vectors = np.linalg.eigh(covariance / np.outer(self.scale, self.scale))
        return np.asarray(vectors[:, values > Payloads.blind])

    @property
    def rank(self) -> int:
        """Number of determined directions."""
        return PARAMETERS - len(self.blind.T)

    @cached_property
    def root(self) -> FloatArray:
        """(10, 10) R with ||R (theta - estimate)||^2 the additional cost of another theta."""
        return root_of(self._covariance_if_independent)

    @property
    def condition_number(self) -> float:
        """Ratio of the greatest to the least singular value of `root` in SI units; inf if the rank is not full."""
        return float(np.linalg.cond(self.root)) if self.rank == PARAMETERS else float("inf")

    def doubting(self, *torque_nm: FloatArray) -> PayloadEstimate:
        """The estimate with k further errors.

        Args:
            torque_nm: (k, N, n) axis torque of the loaded run for one standard deviation of each, group by group.
        """
        answer = self.posterior.response(*torque_nm)[self._payload_place]
        return replace(self, shifts=np.vstack([self.shifts, answer.T]))

    @property
    def drifting(self) -> FloatArray:
        """(10,) change of theta per unit of a common factor on the torque of the first run."""
        torque = (state.torque[0].predicted_nm[None] for state in self.posterior.groups)
        return np.asarray(self.doubting(*torque).shifts[-1])

    @property
    def load_friction(self) -> FloatArray:
        """(n,) mu of these runs."""
        found = self.posterior.value(LOAD_FRICTION)
        return found + self.posterior.value(SESSION_LOAD) if self._has(SESSION_LOAD) else found

    @property
    def noise_nm(self) -> FloatArray:
        """(n,) standard deviation of a fitted row of each axis; of the difference of two runs if there are two."""
        return np.asarray(self.posterior.noise_nm[0])

    def spread(self, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Variance of combinations of the parameters, and its degrees of freedom.

        Args:
            slope: (k, 10).

        Returns:
            (k,) each; the variance is inf where a direction is not determined.
        """
        contrast = np.zeros((len(slope), self.posterior.problem.shared_size))
        contrast[:, self._payload_place] = slope
        variance, freedom = self.posterior.spread(contrast)
        total = variance + np.sum((slope @ self._errors_beside_posterior.T) ** 2, axis=1)
        freedom = freedom * (total / np.maximum(variance, 1e-300)) ** 2
        unseen = np.abs((slope * self.scale) @ self.blind).max(axis=1, initial=0.0)
        size = np.sqrt(np.sum((slope * self.scale) ** 2, axis=1))
        return np.where(unseen > Payloads.negligible * size, np.inf, total), freedom

    @cached_property
    def half_width_kg(self) -> float:
        """Half of the 95 % interval of the mass, by a normal distribution."""
        return NORMAL_HALF_WIDTH * float(np.sqrt(self.spread(np.eye(1, PARAMETERS))[0][0]))

    @cached_property
    def covariance(self) -> FloatArray:
        """(10, 10) of theta."""
        place = np.eye(self.posterior.problem.shared_size)[self._payload_place]
        errors = self._errors_beside_posterior
        return np.asarray(self.posterior.covariance_of(place) + errors.T @ errors)

    @cached_property
    def gain_slope(self) -> FloatArray:
        """(10, n) change of theta per change of the logarithm of each gain, the others and the rows as they are."""
        if self.considered.size:
            return np.asarray(-np.linalg.lstsq(self.considered_gains, self.considered)[0].T)
        gains, bread = self.posterior.problem.place(GAIN), self.posterior.bread
        return np.asarray(-bread[self._payload_place, gains] @ np.linalg.pinv(bread[gains, gains]))

    @cached_property
    def _errors_beside_posterior(self) -> FloatArray:
        """(k, 10) the errors that are not in the posterior."""
        return np.vstack([self.shifts, self.uneven_gains @ self.gain_slope.T, self.considered])

    def mass_center(self, slope: FloatArray, mass_kg: float, gain: FloatArray) -> MassCenterCovariance:
        """Covariance of mass and centre of mass, the gains' share apart.

        Args:
            slope: (4, 10) derivatives of mass and centre of mass by theta.
            gain: (n,) gains of the estimate.
        """
        problem = self.posterior.problem
        gains = problem.place(GAIN)
        contrast = np.zeros((4, problem.shared_size))
        seen_slope = slope - ((slope * self.scale) @ self.blind) @ self.blind.T / self.scale
        contrast[:, self._payload_place], of_gains = seen_slope, seen_slope @ self.gain_slope
        contrast[:, gains] = of_gains
        covariance, freedom = self.posterior.joint_spread(contrast)
        shifts = self.shifts @ seen_slope.T
        apart = seen_slope @ (self.considered + self.considered_gains @ self.gain_slope.T).T
        unseen = np.vstack([self.considered_gains, self.uneven_gains])
        unit = unknown_deviation(mass_kg)
        left, size, _ = np.linalg.svd(((slope * self.scale) @ self.blind) / unit[:, None], full_matrices=False)
        seen = float(np.linalg.norm((slope * self.scale) / unit[:, None]))
        blind = left[:, size > Payloads.negligible * seen] * unit[:, None]
        return MassCenterCovariance(
            measured=covariance + shifts.T @ shifts + blind @ blind.T,
            freedom=freedom,
            gain_nm_a=gain,
            gain_slope=of_gains,
            gain_covariance=self.posterior.covariance[gains, gains] + unseen.T @ unseen,
            calibration_slope=apart if len(self.considered) > gain.size else apart[:, :0],
        )

    def without(self, axis: int, *, afresh: bool) -> tuple[FloatArray, FloatArray, int]:
        """(10,) parameters without the rows of an axis, (10, 10) covariance, and number of determined directions.

        Args:
            axis: Its number.
            afresh: Whether noise and weights, in which it had a share, are estimated again; else it is one step.
        """
        problem = self.posterior.problem
        kept = np.arange(problem.noise.start_nm.size) != axis
        groups = [group.changed(lambda rows: rows.weighted(kept)) for group in problem.groups]
        start, steps = (None, Solver.steps) if afresh else (self.posterior, 1)
        found = solve(replace(problem, groups=groups), rough=True, start=start, steps=steps)
        covariance = found.bread[self._payload_place, self._payload_place]
        return found.value(PAYLOAD, PAYLOAD), covariance, PARAMETERS - len(self._blind(covariance).T)

    def seen(self, errors: FloatArray) -> FloatArray:
        """(n, k) squared size of errors of theta, (10, k), in the rows of each axis, in standard deviations."""
        problem = self.posterior.problem
        place = np.searchsorted(np.flatnonzero(problem.free), np.arange(problem.size)[self._payload_place])
        found = np.zeros((problem.noise.start_nm.size, errors.shape[1]))
        for rows in self.posterior.weighted_rows[0]:
            if rows.combination > 0:
                continue  # the mean of two runs, in which the links take up the payload
            at = np.searchsorted(place, rows.place)
            own = np.isin(rows.place, place)
            found[rows.axis] += np.sum((rows.rows[:, own] @ errors[at[own]]) ** 2, axis=0)
        return found

    def _has(self, name: str) -> bool:
        """Whether the problem has a term."""
        return any(term.name == name for term in self.posterior.problem.terms)

    def friction(self, run: int = 0) -> FloatArray:
        """(3, n) Coulomb, viscous and offset changes of a run."""
        own = self.posterior.value(FRICTION_CHANGE, (0, run))
        if self._has(SESSION_FRICTION):
            own = own + self.posterior.value(SESSION_FRICTION)
        return own.reshape(3, -1)

    def friction_covariance(self, run: int) -> FloatArray:
        """(n, 2, 2) of each joint's Coulomb (N m) and viscous changes (N m s/rad) of a run."""
        found, n = self.posterior, self.arm.layout.chain.n
        unit = np.eye(found.problem.size)
        contrast = unit[found.problem.place(FRICTION_CHANGE, (0, run))]
        if self._has(SESSION_FRICTION):
            contrast = contrast + unit[found.problem.place(SESSION_FRICTION)]
        whole = found.joint_covariance(contrast, 0)
        both = np.arange(n)[:, None] + [0, n]
        return np.asarray(whole[both[:, :, None], both[:, None, :]])

    def body(self, run: int) -> BodyModel:
        """The arm as it was in a run of the group."""
        speed = reversal_speed(self.arm.layout.peak_rad_s[None])
        body = identified_body(self.posterior, self.arm.layout.base, speed, self.friction(run))
        return replace(body, load_friction=self.load_friction)


def model_doubts(posterior: Posterior, arm: KnownArm) -> FloatArray:
    """(n, N, n) axis torque of one standard deviation of the model's own error on each joint, for the loaded run.

    The noise of a pair's difference, whose rows are shorter means, is 0.7 to 2.9 times the calibration's.
    """
    runs = posterior.problem.groups[0].runs
    rows = runs[0].rows
    level = np.sqrt(np.mean(rows.effort_nm**2, axis=0))
    usual_nm = arm.noise_nm if len(runs) == 1 else Payloads.noisier * arm.noise_nm
    left = np.sqrt(np.maximum(posterior.noise_nm[0] ** 2 - usual_nm**2, 0.0))
    share = np.divide(Payloads.lasting * left, level, out=np.zeros_like(level), where=level > 0.0)
    return np.asarray((share * rows.effort_nm)[None] * np.eye(level.size)[:, None, :])
