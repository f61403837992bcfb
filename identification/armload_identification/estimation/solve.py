"""The one solve: Gauss-Newton on robustly weighted rows with priors on all unknowns.

Each run's own unknowns are eliminated group by group: the cost is linear in the number of runs, and each group's
contribution remains available, which shows runs that contradict the others.

A run's own unknowns differ between runs by a standard deviation that is estimated with them, by restricted maximum
likelihood: with x of prior standard deviation s and posterior variance v,

    s^2 = (sum x^2 + nu s_0^2) / (gamma + nu),      gamma = count - sum v / s^2

Rows are weighted by the speed of the joint and by Huber's function; their variance is that of the residual times its
integrated autocorrelation, corrected for what the unknowns absorbed of it. Rows close to a blow to the arm are excluded
on all joints. A group that deviates as a whole has less weight, so that the others dominate.

The covariance is that of the residuals' local spectra (`residual_spectrum`), group by group, and of the priors.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.impacts import struck_samples
from armload_identification.estimation.estimation_constants import Solver
from armload_identification.estimation.problem import EMPTY, Group, Problem
from armload_identification.estimation.residual_spectrum import FREEST, ResidualSpectrum
from armload_identification.estimation.terms import Shared, TorqueAt
from armload_identification.identification_errors import EstimationError
from armload_identification.signals.robust_scale import deviation_by_median

_ZERO: Final = 1e-12
_ROUNDING: Final = 1e-13


@dataclass(frozen=True, eq=False)
class Eliminated:
    """Normal equations of a group with its own unknowns eliminated.

    Attributes:
        information: (s, s) of the shared unknowns.
        gradient: (s,) of these.
        follow: (o, s) dependence of its own unknowns on the shared ones, with the opposite sign.
        own_step: (o,) step of its own unknowns if the shared ones do not change.
        own_gradient: (o,) gradient of its own unknowns.
        own_covariance: (o, o) of its own unknowns if the shared ones are known.
        axes: Information of each axis and combination alone.
    """

    information: FloatArray
    gradient: FloatArray
    follow: FloatArray
    own_step: FloatArray
    own_gradient: FloatArray
    own_covariance: FloatArray
    axes: Sequence[AxisInformation]

    def covariance(self, bread: FloatArray) -> FloatArray:
        """(s + o, s + o) covariance of shared and own unknowns.

        Args:
            bread: (s, s) that of the shared ones.
        """
        across = -bread @ self.follow.T
        own = self.own_covariance - self.follow @ across
        return np.block([[bread, across], [across.T, own]])


@dataclass(frozen=True, eq=False)
class WeightedRows:
    """Weighted rows of an axis in a group.

    Attributes:
        combination: Number of the combination of the group's runs.
        axis: Number of the axis.
        rows: (N, k) derivatives.
        target: (N,) residual.
        place: (k,) indices of the unknowns, the group's own after the shared ones.
    """

    combination: int
    axis: int
    rows: FloatArray
    target: FloatArray
    place: NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class AxisInformation:
    """Information of the rows of an axis; attributes as of `WeightedRows`.

    Attributes:
        information: (k, k).
    """

    combination: int
    axis: int
    place: NDArray[np.intp]
    information: FloatArray


@dataclass(eq=False)
class GroupState:
    """A group during and after the iteration.

    Attributes:
        group: Its rows.
        trust: Weight of the group; 1 unless it deviates as a whole.
        struck: (N,) rows excluded as blows.
        residual_nm: (g, N, n) measured minus predicted torque, as its rows are combined.
        torque: Predicted torque of each run.
    """

    group: Group
    trust: float
    struck: NDArray[np.bool_]
    residual_nm: FloatArray
    torque: list[TorqueAt] = field(default_factory=list)

    @property
    def weighted_nm(self) -> FloatArray:
        """(g, N, n) residual, less where a joint turns or stands."""
        return self.residual_nm * self.group.weight


@dataclass(frozen=True, eq=False)
class GroupSpectrum:
    """Spectrum of a group's residual.

    Attributes:
        spectrum: In a basis of r directions of the unknowns.
        answer: (f, r) change of the f free shared unknowns for one unit of each direction.
    """

    spectrum: ResidualSpectrum
    answer: FloatArray


@dataclass(frozen=True, eq=False)
class Posterior:
    """The unknowns of a problem after its rows.

    Attributes:
        problem: The problem.
        x: All unknowns.
        information: (s, s) inverse covariance of the shared unknowns if the rows are as independent as assumed.
        known: (f, f) the share of the shared unknowns' priors in that, of the f that are not known exactly.
        pull: (f,) gradient of these priors.
        noise_nm: (g, n) standard deviation of a row, by the number of its combination.
        residual_nm: (g, n) RMS residual of moving rows, outliers clipped; less than the noise by what the unknowns
            absorbed.
        correlation: (g, n) integrated autocorrelation in rows, by the number of the combination.
        deviation: Prior standard deviation of all unknowns, as finally adapted.
        steps: Number of iterations.
        groups: Residual and weight of every group.
        eliminated: Contribution of every group.
        weighted_rows: Of a group by its index; their unknowns are those that are not known exactly.
    """

    problem: Problem
    x: FloatArray
    information: FloatArray
    known: FloatArray
    pull: FloatArray
    noise_nm: FloatArray
    residual_nm: FloatArray
    correlation: FloatArray
    deviation: FloatArray
    steps: int
    groups: tuple[GroupState, ...]
    eliminated: tuple[Eliminated, ...]
    weighted_rows: Callable[[int], list[WeightedRows]]

    def value(self, name: str, mounting: str = EMPTY) -> FloatArray:
        """Values of a shared term.

        Args:
            name: Its name.
            mounting: The mounting it refers to; empty for a term of the arm.
        """
        return np.asarray(self.x[self.problem.place(name, mounting)])

    def own_value(self, name: str, group: int = 0, run: int = 0) -> FloatArray:
        """Values of a run's own term.

        Args:
            name: Its name.
            group: Index of the run's group.
            run: Index of the run in it.
        """
        return np.asarray(self.x[self.problem.own_place(name, group, run)])

    @cached_property
    def change_deviation(self) -> FloatArray:
        """(o,) standard deviations of the own unknowns of another run: those of these runs, but not below the stated.

        A few runs of one hour say little about other days.
        """
        own = self.problem.own(0)
        own = slice(own.start, own.start + self.problem.own_size)
        return np.maximum(self.deviation[own], self.problem.prior(self.x)[1][own])

    @cached_property
    def bread(self) -> FloatArray:
        """(s, s) inverse of `information`, 0 for unknowns that are known exactly."""
        return self._whole(_solved(self.information, np.eye(len(self.information))))

    @cached_property
    def covariance(self) -> FloatArray:
        """(s, s) covariance of the shared unknowns."""
        covariance = self._by_priors
        for part in self.spectra:
            covariance = covariance + part.answer @ part.spectrum.covariance() @ part.answer.T
        return self._whole(0.5 * (covariance + covariance.T))

    def spread(self, contrast: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Variance of combinations of the shared unknowns, and its degrees of freedom.

        Args:
            contrast: (k, s).

        Returns:
            (k,) variances, at least a quarter of those for white residuals; (k,) Satterthwaite's degrees of freedom.
        """
        of_free = contrast[:, self._free]
        certain = np.einsum("ki,ij,kj->k", of_free, self._by_priors, of_free)
        white = np.einsum("ki,ij,kj->k", contrast, self.bread, contrast) - certain
        random, scatter = np.zeros(len(contrast)), np.zeros(len(contrast))
        for part in self.spectra:
            along = of_free @ part.answer
            variance = part.spectrum.variance(along)
            random += variance
            scatter += variance**2 / part.spectrum.freedom(along)
        # Variance that does not come from a residual costs no degrees of freedom.
        total = np.maximum(random, Solver.least_of_white * white) + certain
        return total, np.clip(total**2 / np.maximum(scatter, total**2 / FREEST), 1.0, FREEST)

    def joint_spread(self, contrast: FloatArray) -> tuple[FloatArray, float]:
        """Covariance of combinations of the shared unknowns, and its degrees of freedom.

        Args:
            contrast: (k, s).

        Returns:
            (k, k) covariance, and those of the Wishart matrix with that mean whose elements have the same scatter.
        """
        of_free = contrast[:, self._free]
        total = contrast @ self.covariance @ contrast.T
        scatter = sum(1.0 / part.spectrum.joint_freedom(of_free @ part.answer, total) for part in self.spectra)
        return total, float(np.clip(1.0 / scatter, 1.0, FREEST))

    @cached_property
    def spectra(self) -> tuple[GroupSpectrum, ...]:
        """Spectrum of every group's residual."""
        return tuple(self._spectrum(index) for index in range(len(self.groups)))

    def _spectrum(self, index: int) -> GroupSpectrum:
        """The spectrum of a group's residual, on the grid of its rows."""
        state, part = self.groups[index], self.eliminated[index]
        joint = part.covariance(self.bread[np.ix_(self._free, self._free)])
        size = np.sqrt(np.diag(joint))
        values, vectors = np.linalg.eigh(joint / np.outer(size, size))
        root = size[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
        time_s = state.group.time_s
        apart_s = np.diff(time_s).min() if time_s.size > 1 else 1.0
        at = np.rint((time_s - time_s[0]) / apart_s).astype(np.intp)
        weight = self.row_weight(index)
        series = weight.shape[0] * weight.shape[2]
        basis = np.zeros((at[-1] + 1, series, root.shape[1]))
        residual, weights = np.zeros((2, *basis.shape[:2]))
        for rows in self.weighted_rows(index):
            one = rows.combination * weight.shape[2] + rows.axis
            basis[at, one] = rows.rows @ root[rows.place]
            residual[at, one] = rows.target
            weights[at, one] = weight[rows.combination, :, rows.axis]
        return GroupSpectrum(ResidualSpectrum(basis, residual, weights), root[: self._free.size])

    @cached_property
    def _by_priors(self) -> FloatArray:
        """(f, f) covariance of the free shared unknowns by their priors alone."""
        known = self.known
        for index, part in enumerate(self.eliminated):
            known = known + (part.follow.T * self._own_precision(index)) @ part.follow
        inverse = self.bread[np.ix_(self._free, self._free)]
        return np.asarray(inverse @ known @ inverse)

    def _own_precision(self, index: int) -> FloatArray:
        """(o,) of the priors of a group's own unknowns."""
        own = self.problem.own(index)
        return np.asarray(self.deviation[own][self.problem.free[own]] ** -2.0)

    def own_covariance(self, group: int) -> FloatArray:
        """(o, o) covariance of a group's own unknowns if the rows are as independent as assumed.

        Args:
            group: Its index.
        """
        part = self.eliminated[group]
        inverse = self.bread[np.ix_(self._free, self._free)]
        return np.asarray(part.own_covariance + part.follow @ inverse @ part.follow.T)

    def joint_covariance(self, shared: FloatArray, own: FloatArray, group: int) -> FloatArray:
        """(k, k) covariance of combinations of the shared and a group's own unknowns, as `own_covariance`.

        Args:
            shared: (k, s) coefficients of the shared unknowns.
            own: (k, o) coefficients of the group's own ones.
            group: Its index.
        """
        contrast = np.hstack([shared[:, self._free], own])
        whole = self.eliminated[group].covariance(self.bread[np.ix_(self._free, self._free)])
        return np.asarray(contrast @ whole @ contrast.T)

    def response(self, torque_nm: FloatArray, group: int = 0) -> tuple[FloatArray, FloatArray]:
        """Change of the unknowns when torque is added to the first run of a group.

        Args:
            torque_nm: (k, N, n) additions to its torque.
            group: Index of the group.

        Returns:
            (s, k) changes of the shared unknowns and (o, k) of its own.
        """
        part, weight = self.eliminated[group], self.row_weight(group)
        shared, mix = self._free.size, self.groups[group].group.mix[:, 0]
        pull = np.zeros((shared + part.own_step.size, len(torque_nm)))
        for weighted in self.weighted_rows(group):
            one, axis = weighted.combination, weighted.axis
            pull[weighted.place] += weighted.rows.T @ (mix[one] * torque_nm[:, :, axis] * weight[one, :, axis]).T
        of_shared = _solved(self.information, pull[:shared] - part.follow.T @ pull[shared:])
        whole = np.zeros((self.problem.shared_size, len(torque_nm)))
        whole[self._free] = of_shared
        return whole, part.own_covariance @ pull[shared:] - part.follow @ of_shared

    def beside(self, torque_nm: FloatArray, group: int = 0) -> tuple[FloatArray, FloatArray]:
        """What the rows say of further unknowns, beside all others, to first order.

        Args:
            torque_nm: (k, N, n) axis torque per unit of each, on the first run of a group.
            group: Index of the group.

        Returns:
            (k,) gradient and (k, k) information: their estimate is the solution, if nothing else is known of them.
        """
        part, weight, mix = self.eliminated[group], self.row_weight(group), self.groups[group].group.mix[:, 0]
        shared = self._free.size
        gradient, information = np.zeros(len(torque_nm)), np.zeros((len(torque_nm),) * 2)
        pull = np.zeros((shared + part.own_step.size, len(torque_nm)))
        for rows in self.weighted_rows(group):
            columns = mix[rows.combination] * torque_nm[:, :, rows.axis] * weight[rows.combination, :, rows.axis]
            gradient += columns @ rows.target
            information += columns @ columns.T
            pull[rows.place] += rows.rows.T @ columns.T
        across = pull[:shared] - part.follow.T @ pull[shared:]
        information -= pull[shared:].T @ part.own_covariance @ pull[shared:]
        return gradient, information - across.T @ _solved(self.information, across)

    def row_weight(self, group: int = 0) -> FloatArray:
        """(g, N, n) weight of every row of a group: root of its inverse variance.

        Args:
            group: Its index.
        """
        return _row_weights(self.groups[group], self.noise_nm, self.correlation, robust=self.problem.noise.robust)

    def deviates(self, group: int) -> FloatArray:
        """(n,) RMS residual of a group relative to the noise of all.

        Args:
            group: Its index.
        """
        state = self.groups[group]
        return np.asarray(_relative(state, self.noise_nm).max(axis=0))

    def change_without(self, group: int) -> FloatArray:
        """(s,) change of the shared unknowns without a group, by one step from the solution.

        Args:
            group: Its index.
        """
        part = self.eliminated[group]
        change = np.zeros(self.problem.shared_size)
        change[self._free] = -_solved(self.information - part.information, part.gradient)
        return change

    def without_axis(self, axis: int) -> tuple[FloatArray, FloatArray]:
        """The shared unknowns without the rows of an axis, by one step from the solution.

        All gradients count: a direction that only this axis shows is 10^5 times as free without it, and so is what the
        solution still lacks there.

        Args:
            axis: Its number.

        Returns:
            (s,) unknowns, and (s, s) their covariance if rows are as independent as assumed.
        """
        shared, mean = self._free.size, self.problem.prior()[0]
        information, gradient = self.known, self.pull
        for index in range(len(self.groups)):
            own, precision = self.problem.own(index), self._own_precision(index)
            whole = np.diag(np.concatenate([np.zeros(shared), precision]))
            pull = np.concatenate([np.zeros(shared), precision * (mean - self.x)[own][self.problem.free[own]]])
            for rows in self.weighted_rows(index):
                if rows.axis != axis:
                    pull[rows.place] += rows.rows.T @ rows.target
                    whole[np.ix_(rows.place, rows.place)] += rows.rows.T @ rows.rows
            part = _eliminate(whole, pull, shared, ())
            information, gradient = information + part.information, gradient + part.gradient
        covariance = _solved(information, np.eye(shared))
        values = self.x[: self.problem.shared_size].copy()
        values[self._free] += covariance @ gradient
        return values, self._whole(covariance)

    @cached_property
    def _free(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.problem.free[: self.problem.shared_size])

    def _whole(self, matrix: FloatArray) -> FloatArray:
        """A matrix of the free unknowns with zeros for those that are known exactly."""
        whole = np.zeros((self.problem.shared_size,) * 2)
        whole[np.ix_(self._free, self._free)] = matrix
        return whole


def solve(
    problem: Problem,
    progress: Callable[[int, int], None] | None = None,
    *,
    rough: bool = False,
    start: Posterior | None = None,
) -> Posterior:
    """Solve a problem.

    Args:
        problem: The problem.
        progress: Called with the number of iterations done, and an estimate of their total.
        start: Solution of a problem with other priors, from which to start.
        rough: Return the last iterate even if it has not settled; sufficient if only the residual is needed.

    Returns:
        The posterior.

    Raises:
        EstimationError: it does not settle.
    """
    solver = _Solver(problem)
    if start is not None:
        solver.start_from(start)
    for step in range(0 if start is None else Solver.weighing_steps - Solver.fresh_steps, Solver.steps):
        moved = solver.step()
        if step < Solver.weighing_steps:
            solver.weigh(rough=step < Solver.rough_steps)
        if progress is not None:
            progress(step + 1, max(step + 1, Solver.weighing_steps + Solver.rough_steps))
        if moved < Solver.settled and (step > Solver.rough_steps or not problem.adapts):
            return solver.posterior(step + 1)
    if rough:
        return solver.posterior(Solver.steps)
    raise EstimationError(
        f"the fit does not converge within {Solver.steps} steps (the unknowns still change by {moved:.2g} standard "
        f"deviations); {problem.shared_size} unknowns, {len(problem.groups)} runs. Add runs with other motions."
    )


class _Solver:
    """State of the iteration."""

    def __init__(self, problem: Problem) -> None:
        self._problem, self._model = problem, problem.model
        self._shared = problem.shared_size
        self._factors = {
            term.name: np.ones(int(term.pooled.max()) + 1) for term in problem.terms if term.pooled is not None
        }
        mean, self._deviation = problem.prior()
        self._mean, self._x = mean, mean.copy()
        self._free = problem.free
        self._shared_free = np.flatnonzero(self._free[: self._shared])
        self._acting = [problem.acting(index) for index in range(len(problem.groups))]
        self._groups = [
            GroupState(group, 1.0, np.zeros(len(group.time_s), dtype=bool), group.effort_nm) for group in problem.groups
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
        start = np.ones(noise.start_nm.size) if noise.correlation is None else noise.correlation
        self._correlation = np.tile(start, (combinations, 1))
        terms = [term for runs in self._acting for placed in runs for term in placed]
        gains = [np.arange(place.start, place.stop) for term, place in terms if term.law is Shared.GAIN]
        self._gains = np.concatenate([np.zeros(0, dtype=np.intp), *gains])
        self._update()

    def start_from(self, other: Posterior) -> None:
        """Take the unknowns, noise and adapted priors of another solution of the same rows."""
        self._x, self._noise, self._correlation = other.x.copy(), other.noise_nm.copy(), other.correlation.copy()
        own = self._shared
        self._deviation[own:] = other.deviation[own:]
        for state, before in zip(self._groups, other.groups, strict=True):
            state.struck, state.trust = before.struck, before.trust
        self._update()

    def step(self) -> float:
        """One step of all unknowns, shortened until the fit improves; returns its size in standard deviations."""
        eliminated = [self._eliminated(index) for index in range(len(self._groups))]
        information, gradient = self._prior_equations()
        information = information + np.sum([part.information for part in eliminated], axis=0)
        gradient = gradient + np.sum([part.gradient for part in eliminated], axis=0)
        step = _solved(information, gradient)
        bread = _solved(information, np.eye(len(information)))
        self._covariances = [part.covariance(bread) for part in eliminated]
        self._absorb(eliminated)
        whole = np.zeros_like(self._x)
        whole[self._shared_free] = step
        for index, part in enumerate(eliminated):
            whole[self._own_free(index)] = part.own_step - part.follow @ step
        weights = [self._row_weights(state) for state in self._groups]
        before, cost = self._x, self._cost(weights)
        size = float(np.sqrt(max(step @ information @ step, 0.0)))
        if not step.size:
            size = float(np.sqrt(sum(part.own_step @ part.own_gradient for part in eliminated)))
        share = min(1.0, Solver.largest_step / max(float(np.abs(whole[self._gains]).max(initial=0.0)), _ZERO))
        while True:
            self._x = before + share * whole
            self._update()
            if share < Solver.shortest_step or self._cost(weights) <= cost:
                return share * size
            share *= 0.5

    def weigh(self, *, rough: bool) -> None:
        """Update noise, its autocorrelation, blows, and the weights of groups; with `rough`, priors as shares."""
        noise = self._problem.noise
        weighted = [(state, state.weighted_nm) for state in self._groups]
        for number in range(len(self._noise)):
            parts = [
                (state, state.group.weight[number - state.group.first_noise], part[number - state.group.first_noise])
                for state, part in weighted
                if state.group.first_noise <= number < state.group.noises.stop
            ]
            for axis in range(self._noise.shape[1]):
                self._weigh_axis(number, axis, parts)
        if noise.robust:
            for state in self._groups:
                size = np.abs(state.weighted_nm) / self._noise[state.group.noises, None]
                state.struck = struck_samples(size.max(axis=0), state.group.time_s) if not rough else state.struck
                relative = _relative(state, self._noise)
                state.trust = 1.0 / max(float(relative.max()) / Solver.deviates, 1.0) ** 2
        if rough:
            self._pool()
            self._mean, self._deviation = self._problem.prior(self._x, self._factors)

    def _pool(self) -> None:
        """Update the factors on the standard deviations of pooled terms."""
        if not self._factors:
            return
        variance, shared = np.zeros_like(self._x), self._shared_free.size
        for index, covariance in enumerate(self._covariances):
            variance[self._shared_free] = np.diag(covariance)[:shared]
            variance[self._own_free(index)] = np.diag(covariance)[shared:]
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
            for axis in part.axes:
                share = float(np.sum(axis.information * covariance[np.ix_(axis.place, axis.place)]))
                self._absorbed[state.group.first_noise + axis.combination, axis.axis] += share

    def _weigh_axis(
        self, combination: int, axis: int, parts: Sequence[tuple[GroupState, FloatArray, FloatArray]]
    ) -> None:
        """Update a noise and its autocorrelation of an axis, from groups with (N, n) weights and residuals."""
        noise = self._problem.noise
        values = np.concatenate([part[~state.struck, axis] for state, _, part in parts])
        speed = np.concatenate([weight[~state.struck, axis] for state, weight, _ in parts])
        moving = values[speed > Solver.moving]
        if moving.size < Solver.fewest_rows:
            return
        found, bound = _clipped_rms(moving)
        self._residual[combination, axis] = min(found, noise.greatest_nm[axis])
        rows = moving.size / self._correlation[combination, axis]
        found /= np.sqrt(max(1.0 - self._absorbed[combination, axis] / rows, Solver.least_left))
        self._noise[combination, axis] = np.clip(found, noise.least_nm[axis], noise.greatest_nm[axis])
        if noise.correlation is None:
            self._correlation[combination, axis] = _integrated([part[:, axis] for _, _, part in parts], bound)

    def posterior(self, steps: int) -> Posterior:
        """The posterior at the present unknowns."""
        known, pull = self._prior_equations()
        parts = tuple(self._eliminated(index) for index in range(len(self._groups)))
        information = known + np.sum([part.information for part in parts], axis=0)
        return Posterior(
            problem=self._problem,
            x=self._x,
            information=information,
            known=known,
            pull=pull,
            noise_nm=self._noise,
            residual_nm=self._residual,
            correlation=self._correlation,
            deviation=self._deviation,
            steps=steps,
            groups=tuple(self._groups),
            eliminated=parts,
            weighted_rows=self._weighted,
        )

    def _update(self) -> None:
        """The residuals of all groups."""
        for state, terms in zip(self._groups, self._acting, strict=True):
            runs = zip(state.group.runs, terms, strict=True)
            state.torque = [self._model.predict(run.rows, placed, self._x) for run, placed in runs]
            predicted = np.stack([torque.predicted_nm for torque in state.torque])
            state.residual_nm = state.group.effort_nm - state.group.mixed(predicted)

    def _prior_equations(self) -> tuple[FloatArray, FloatArray]:
        """Information and gradient of the free shared unknowns by their priors."""
        place = self._shared_free
        precision = self._deviation[place] ** -2.0
        information = self._known_precision[np.ix_(place, place)] + np.diag(precision)
        gradient = (self._known_target - self._known_precision @ self._x[: self._shared])[place]
        return information, gradient + precision * (self._mean - self._x)[place]

    def _cost(self, weights: Sequence[FloatArray]) -> float:
        """Weighted squares of the residuals and of deviations from the prior."""
        left = sum(
            float(np.sum((state.residual_nm * weight) ** 2))
            for state, weight in zip(self._groups, weights, strict=True)
        )
        prior = np.sum(((self._x - self._mean)[self._free] / self._deviation[self._free]) ** 2)
        shared = self._x[: self._shared]
        return left + float(prior + shared @ self._known_precision @ shared - 2.0 * self._known_target @ shared)

    def _row_weights(self, state: GroupState) -> FloatArray:
        return _row_weights(state, self._noise, self._correlation, robust=self._problem.noise.robust)

    def _own_free(self, index: int) -> NDArray[np.intp]:
        """Indices of a group's own unknowns that are not known exactly."""
        own = self._problem.own(index)
        return np.asarray(own.start + np.flatnonzero(self._free[own]), dtype=np.intp)

    def _eliminated(self, index: int) -> Eliminated:
        """A group's normal equations with its own unknowns eliminated."""
        own = self._own_free(index)
        shared = self._shared_free.size
        information, gradient = np.zeros((shared + own.size, shared + own.size)), np.zeros(shared + own.size)
        axes = []
        for axis in self._weighted(index):
            of_axis = AxisInformation(axis.combination, axis.axis, axis.place, axis.rows.T @ axis.rows)
            axes.append(of_axis)
            information[np.ix_(axis.place, axis.place)] += of_axis.information
            gradient[axis.place] += axis.rows.T @ axis.target
        at = shared + np.arange(own.size)
        information[at, at] += self._deviation[own] ** -2.0
        gradient[at] += (self._mean - self._x)[own] / self._deviation[own] ** 2
        return _eliminate(information, gradient, shared, axes)

    def _weighted(self, index: int) -> list[WeightedRows]:
        """Weighted rows of every axis and combination of a group."""
        state, own = self._groups[index], self._own_free(index)
        shared = self._shared_free.size
        where = np.full(self._problem.size, -1, dtype=np.intp)
        where[self._shared_free], where[own] = np.arange(shared), shared + np.arange(own.size)
        runs = zip(state.torque, self._acting[index], strict=True)
        found = [self._model.derivatives(torque, placed) for torque, placed in runs]
        weight = self._row_weights(state)
        weighted = []
        for axis in range(weight.shape[2]):
            columns, place = _joined([(run.columns[axis], run.place[axis]) for run in found])
            place = where[place]
            kept = place >= 0
            mixed = state.group.mixed(columns[:, :, kept])
            for combination, rows in enumerate(mixed):
                of_rows = weight[combination, :, axis]
                target = state.residual_nm[combination, :, axis] * of_rows
                weighted.append(WeightedRows(combination, axis, rows * of_rows[:, None], target, place[kept]))
        return weighted


def _row_weights(state: GroupState, noise_nm: FloatArray, correlation: FloatArray, *, robust: bool) -> FloatArray:
    """(g, N, n) weight of every row: root of its inverse variance."""
    noises = state.group.noises
    noise = noise_nm[noises, None]
    weight = state.group.weight * (np.sqrt(state.trust) / (noise * np.sqrt(correlation[noises, None])))
    if robust:
        outlying = np.maximum(np.abs(state.weighted_nm) / (Solver.huber * noise), 1.0)
        weight = weight / np.sqrt(outlying)
    return np.asarray(np.where(state.struck[:, None], 0.0, weight))


def clipped_rms(state: GroupState, moved: NDArray[np.bool_]) -> FloatArray:
    """(n,) RMS residual of a group's moving joints with clipped outliers; NaN for others.

    Args:
        state: The group.
        moved: (n,) True for the moving joints.
    """
    found = np.full(moved.size, np.nan)
    for axis in np.flatnonzero(moved):
        fast = state.group.weight[0, :, axis] > Solver.moving
        found[axis] = _clipped_rms(state.weighted_nm[0, fast, axis])[0]
    return found


def _clipped_rms(values: FloatArray) -> tuple[float, float]:
    """RMS with clipped outliers, and the bound at which they were clipped."""
    bound = Solver.outlying * max(float(deviation_by_median(values)), _ZERO)
    return float(np.sqrt(np.mean(np.clip(values, -bound, bound) ** 2))), bound


def _joined(parts: Sequence[tuple[FloatArray, NDArray[np.intp]]]) -> tuple[FloatArray, NDArray[np.intp]]:
    """(g, N, k) columns of the runs of a group for all their unknowns, and (k,) indices of these."""
    if len(parts) == 1:
        return parts[0][0][None], parts[0][1]
    place = np.unique(np.concatenate([where for _, where in parts]))
    joined = np.zeros((len(parts), len(parts[0][0]), place.size))
    for run, (columns, where) in zip(joined, parts, strict=True):
        run[:, np.searchsorted(place, where)] = columns
    return joined, place


def _eliminate(
    information: FloatArray, gradient: FloatArray, shared: int, axes: Sequence[AxisInformation]
) -> Eliminated:
    """Schur complement: the shared unknowns with the group's own eliminated."""
    own = len(gradient) - shared
    if not own:
        nothing = np.zeros((0, shared))
        return Eliminated(information, gradient, nothing, np.zeros(0), np.zeros(0), np.zeros((0, 0)), axes)
    right = np.column_stack([information[shared:, :shared], gradient[shared:], np.eye(own)])
    solution = _solved(information[shared:, shared:], right)
    follow, own_step, inverse = solution[:, :shared], solution[:, shared], solution[:, shared + 1 :]
    return Eliminated(
        information[:shared, :shared] - information[:shared, shared:] @ follow,
        gradient[:shared] - information[:shared, shared:] @ own_step,
        follow,
        own_step,
        gradient[shared:],
        inverse,
        axes,
    )


def _solved(information: FloatArray, right: FloatArray) -> FloatArray:
    """Solution of the normal equations, scaled to unit diagonal, with a small regularisation against rounding."""
    scale = 1.0 / np.sqrt(np.diag(information))
    scaled = information * scale[:, None] * scale + _ROUNDING * np.eye(len(scale))
    tall = scale[:, None] if right.ndim > 1 else scale
    return np.asarray(tall * np.linalg.solve(scaled, right * tall))


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


def _relative(state: GroupState, noise_nm: FloatArray) -> FloatArray:
    """(c, n) RMS over the rows, relative to the noise."""
    relative = state.weighted_nm[:, ~state.struck] / noise_nm[state.group.noises, None]
    return np.asarray(np.sqrt(np.mean(relative**2, axis=1)))
