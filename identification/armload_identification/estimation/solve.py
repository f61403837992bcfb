"""The one solve: Gauss-Newton on robustly weighted rows with priors on all unknowns.

Each run's own unknowns are eliminated group by group: the cost is linear in the number of runs, and each group's
contribution remains available, which shows runs that contradict the others.

A run's own unknowns differ between runs by a standard deviation that is estimated with them, by restricted maximum
likelihood: with x of prior standard deviation s and posterior variance v,

    s^2 = (sum x^2 + nu s_0^2) / (gamma + nu),      gamma = count - sum v / s^2

Where it is a share of the joint's friction, it is the less the higher the gain. If it were held, a higher gain would
explain such differences by smaller ones, and nothing else shows the scale that all gains have in common: with a stated
deviation of the scale of 10 % the mass was 19 % too low.

Rows are weighted by the speed of the joint and by Huber's function; their variance is that of the residual times its
integrated autocorrelation, corrected for what the unknowns absorbed of it. Rows close to a blow to the arm are excluded
on all joints. A group that deviates as a whole has less weight, so that the others dominate.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.estimation_constants import Solver
from armload_identification.estimation.normal_equations import Eliminated, GroupState, solved
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.problem import Problem
from armload_identification.estimation.term_kinds import Shared
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError
from armload_identification.signals.robust_scale import deviation_by_median

_ZERO: Final = 1e-12


def solve(
    problem: Problem,
    *,
    rough: bool = False,
    start: Posterior | None = None,
    steps: int = Solver.steps,
) -> Posterior:
    """Solve a problem.

    Args:
        start: Solution of a problem with other priors, from which to start.
        rough: Return the last iterate even if it has not settled; sufficient if only the residual is needed.
        steps: Most steps.

    Returns:
        The posterior.

    Raises:
        EstimationError: it does not settle.
    """
    solver = _Solver(problem)
    if start is not None:
        solver.start_from(start)
    first = 0 if start is None else Solver.weighing_steps - Solver.fresh_steps
    for step in range(first, first + steps):
        moved = solver.step()
        if step < Solver.weighing_steps:
            solver.weigh(rough=step < Solver.rough_steps)
        if moved < Solver.settled and (step > Solver.rough_steps or not problem.adapts):
            return solver.posterior(step + 1)
    if rough:
        return solver.posterior(first + steps)
    raise EstimationError(
        f"the fit does not converge within {steps} steps (the unknowns still change by {moved:.2g} standard "
        f"deviations); {problem.shared_size} unknowns, {len(problem.groups)} runs. Add runs with other motions."
    )


class _Solver:
    """State of the iteration."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._shared = problem.shared_size
        self._factors = {
            term.name: np.ones(int(term.pooled.max()) + 1) for term in problem.terms if term.pooled is not None
        }
        mean, self._deviation = problem.prior()
        self._mean, self._x = mean, mean.copy()
        self._free = problem.free
        self._shared_free = np.flatnonzero(self._free[: self._shared])
        places, count = np.arange(problem.size), range(len(problem.groups))
        parts = zip(problem.groups, map(problem.acting, count), map(problem.own, count), strict=True)
        self._groups = [
            GroupState(group, acting, problem.coupling, self._shared_free, places[own][self._free[own]])
            for group, acting, own in parts
        ]
        self._known_precision = np.zeros((self._shared, self._shared))
        self._known_target = np.zeros(self._shared)
        for known in problem.known:
            place = np.concatenate([np.arange(self._shared)[problem.place(*term)] for term in known.terms])
            self._known_precision[np.ix_(place, place)] += known.precision
            self._known_target[place] += known.target
        combinations = max(group.noises.stop for group in problem.groups)
        noise = problem.noise
        self._noise = np.tile(noise.start_nm, (combinations, 1))
        self._residual = self._noise.copy()
        self._least = np.broadcast_to(noise.least_nm, self._noise.shape)
        least = 2.0 * noise.least_correlation.sum(axis=1, keepdims=True) - 1.0
        self._least_correlation = np.broadcast_to(least, self._noise.shape)
        start = np.ones(noise.start_nm.size) if noise.correlation is None else noise.correlation
        self._correlation = np.tile(start, (combinations, 1))
        gains = [places[place] for term in problem.terms if term.law is Shared.GAIN for place in problem.places(term)]
        self._gains = np.concatenate([places[:0], *gains])
        shares = [places[place] for term in problem.terms if term.rescaled for place in problem.places(term)]
        self._shares = np.concatenate([places[:0], *shares])
        self._adapted()
        self._update()

    def start_from(self, other: Posterior) -> None:
        """Take the unknowns, noise and adapted priors of another solution of the same rows."""
        self._x, self._noise, self._correlation = other.x.copy(), other.noise_nm.copy(), other.correlation.copy()
        self._deviation[self._shared :] = other.deviation[self._shared :]
        self._adapted()
        for state, before in zip(self._groups, other.groups, strict=True):
            state.struck, state.trust = before.struck, before.trust
        self._update()

    def step(self) -> float:
        """One step of all unknowns, shortened until the fit improves; returns its size in standard deviations."""
        eliminated = self._eliminated()
        information, gradient = self._prior_equations()
        information = information + np.sum([part.information for part in eliminated], axis=0)
        gradient = gradient + np.sum([part.gradient for part in eliminated], axis=0) - self._pull_on_gains()
        step = solved(information, gradient)
        bread = solved(information, np.eye(len(information)))
        self._covariances = [part.covariance(bread) for part in eliminated]
        self._absorb(eliminated)
        whole = np.zeros_like(self._x)
        whole[self._shared_free] = step
        for state, part in zip(self._groups, eliminated, strict=True):
            whole[state.own] = part.own_step - part.follow @ step
        before, cost = self._x, self._cost()
        size = float(np.sqrt(max(step @ information @ step, 0.0)))
        if not step.size:
            size = float(np.sqrt(sum(part.own_step @ part.own_gradient for part in eliminated)))
        share = min(1.0, Solver.largest_step / max(float(np.abs(whole[self._gains]).max(initial=0.0)), _ZERO))
        while True:
            self._x = before + share * whole
            self._update()
            if share < Solver.shortest_step or self._cost() <= cost:
                return share * size
            share *= 0.5

    def weigh(self, *, rough: bool) -> None:
        """Update noise, its autocorrelation, blows, and the weights of groups; with `rough`, priors as shares."""
        parts: list[list[tuple[GroupState, FloatArray]]] = [[] for _ in self._noise]
        for state in self._groups:
            for own, residual in zip(parts[state.group.noises], state.weighted_nm, strict=True):
                own.append((state, residual))
        for combination, axis in np.ndindex(self._noise.shape):
            self._weigh_axis(combination, axis, parts[combination])
        if self._problem.noise.robust:
            for state in self._groups:
                state.judge(self._noise, blows=not rough)
        if rough:
            self._pool()
            self._mean, self._deviation = self._problem.prior(self._x, self._factors)
            self._adapted()

    def _pool(self) -> None:
        """Update the factors on the standard deviations of pooled terms."""
        if not self._factors:
            return
        variance, shared = np.zeros_like(self._x), self._shared_free.size
        for state, covariance in zip(self._groups, self._covariances, strict=True):
            variance[self._shared_free] = np.diag(covariance)[:shared]
            variance[state.own] = np.diag(covariance)[shared:]
        stated = self._problem.prior(self._x)[1]
        for term in self._problem.terms:
            if term.pooled is None:
                continue
            places = self._problem.places(term)
            size = np.stack([(self._x[place] - term.mean) / stated[place] for place in places])
            known = np.stack([variance[place] / self._deviation[place] ** 2 for place in places])
            for number in range(len(self._factors[term.name])):
                values = term.pooled == number
                freedom = float(np.sum(1.0 - known[:, values])) + term.freedom
                square = (float(np.sum(size[:, values] ** 2)) + term.freedom) / freedom
                self._factors[term.name][number] = np.sqrt(square)

    def _absorb(self, eliminated: Sequence[Eliminated]) -> None:
        """Count the independent rows of every combination and axis that the unknowns absorb."""
        self._absorbed = np.zeros_like(self._noise)
        for state, part, covariance in zip(self._groups, eliminated, self._covariances, strict=True):
            for (combination, axis), (place, information) in part.axes.items():
                share = float(np.sum(information * covariance[np.ix_(place, place)]))
                self._absorbed[state.group.first_noise + combination, axis] += share

    def _weigh_axis(self, combination: int, axis: int, parts: Sequence[tuple[GroupState, FloatArray]]) -> None:
        """Update a noise and its autocorrelation of an axis, from groups with (N, n) residuals."""
        noise = self._problem.noise
        values = np.concatenate([part[~state.struck, axis] for state, part in parts])
        speed = np.concatenate([state.group.weight[~state.struck, axis] for state, _ in parts])
        moving = values[speed > Solver.moving]
        if moving.size < Solver.fewest_rows:
            return
        found, bound = _clipped_rms(moving)
        self._residual[combination, axis] = min(found, noise.greatest_nm[axis])
        rows = moving.size / self._correlation[combination, axis]
        found /= np.sqrt(max(1.0 - self._absorbed[combination, axis] / rows, Solver.least_left))
        self._noise[combination, axis] = np.clip(found, self._least[combination, axis], noise.greatest_nm[axis])
        if noise.correlation is None:
            found = _integrated([part[:, axis] for _, part in parts], bound)
            self._correlation[combination, axis] = max(found, self._least_correlation[combination, axis])

    def posterior(self, steps: int) -> Posterior:
        """The posterior at the present unknowns."""
        known, _ = self._prior_equations()
        parts = self._eliminated()
        return Posterior(
            problem=self._problem,
            x=self._x,
            information=known + np.sum([part.information for part in parts], axis=0),
            known=known,
            noise_nm=self._noise,
            residual_nm=self._residual,
            correlation=self._correlation,
            deviation=self._deviation,
            steps=steps,
            groups=tuple(self._groups),
            eliminated=parts,
        )

    def _update(self) -> None:
        """The residuals of all groups, and shares of a friction that is less with a higher gain."""
        for state in self._groups:
            state.move_to(self._x)
        if self._shares.size:
            higher = self._log_gain - self._adapted_gain
            self._deviation = self._adapted_deviation.copy()
            self._deviation[self._shares] *= np.exp(-np.resize(higher, self._shares.size))

    def _adapted(self) -> None:
        """Remember at which gains the standard deviations were adapted."""
        self._adapted_deviation, self._adapted_gain = self._deviation, self._log_gain

    @property
    def _log_gain(self) -> FloatArray:
        """(n,) logarithm of each axis's factor, all its terms together."""
        return np.asarray(self._x[self._gains].reshape(-1, len(self._problem.coupling)).sum(axis=0))

    def _pull_on_gains(self) -> FloatArray:
        """Gradient of the free shared unknowns by priors that are shares of the friction."""
        pull = np.zeros(self._shared)
        if self._shares.size:
            relative = self._x[self._shares] / self._deviation[self._shares]
            of_axes = np.sum(relative.reshape(-1, len(self._problem.coupling)) ** 2, axis=0)
            pull[self._gains] = np.resize(of_axes, self._gains.size)
        return pull[self._shared_free]

    def _prior_equations(self) -> tuple[FloatArray, FloatArray]:
        """Information and gradient of the free shared unknowns by their priors."""
        place = self._shared_free
        precision = self._deviation[place] ** -2.0
        information = self._known_precision[np.ix_(place, place)] + np.diag(precision)
        gradient = (self._known_target - self._known_precision @ self._x[: self._shared])[place]
        return information, gradient + precision * (self._mean - self._x)[place]

    def _cost(self) -> float:
        """Squares of the residuals, with the weights of the present step, and of deviations from the prior."""
        left = sum(
            float(np.sum((state.residual_nm * weight) ** 2))
            for state, weight in zip(self._groups, self._weights, strict=True)
        )
        prior = np.sum(((self._x - self._mean)[self._free] / self._deviation[self._free]) ** 2)
        shared = self._x[: self._shared]
        return left + float(prior + shared @ self._known_precision @ shared - 2.0 * self._known_target @ shared)

    def _eliminated(self) -> tuple[Eliminated, ...]:
        """The normal equations of all groups, with the weights of their rows at the present unknowns."""
        robust = self._problem.noise.robust
        self._weights = [state.row_weights(self._noise, self._correlation, robust=robust) for state in self._groups]
        parts = []
        for state, weight in zip(self._groups, self._weights, strict=True):
            precision = self._deviation[state.own] ** -2.0
            pull = (self._mean - self._x)[state.own] / self._deviation[state.own] ** 2
            parts.append(state.eliminated(weight, precision, pull))
        return tuple(parts)


def clipped_rms(state: GroupState, moved: NDArray[np.bool_]) -> FloatArray:
    """(n,) RMS residual of a group's moving joints with clipped outliers; NaN for others.

    Args:
        moved: (n,) True for the moving joints.
    """
    found = np.full(moved.size, np.nan)
    for axis in np.flatnonzero(moved):
        fast = state.group.weight[:, axis] > Solver.moving
        found[axis] = _clipped_rms(state.weighted_nm[0, fast, axis])[0]
    return found


def _clipped_rms(values: FloatArray) -> tuple[float, float]:
    """RMS with clipped outliers, and the bound at which they were clipped."""
    bound = Solver.outlying * max(float(deviation_by_median(values)), _ZERO)
    return float(np.sqrt(np.mean(np.clip(values, -bound, bound) ** 2))), bound


def _integrated(parts: Sequence[FloatArray], bound: float) -> float:
    """Integrated autocorrelation, in rows, up to where it has decayed."""
    covariance = np.zeros(Solver.lags)
    for part in parts:
        values = np.clip(part, -bound, bound)
        for lag in range(min(Solver.lags, len(values))):
            covariance[lag] += values[lag:] @ values[: len(values) - lag]
    if covariance[0] <= 0.0:
        return 1.0
    share = covariance / covariance[0]
    faded = np.flatnonzero(share < Solver.uncorrelated)
    last = int(faded[0]) if faded.size else Solver.lags
    return max(1.0 + 2.0 * float(share[1:last].sum()), 1.0)
