"""The unknowns of a problem after its rows, their covariance, and what other rows or none would change.

The covariance is that of the residuals' local spectra (`residual_spectrum`), group by group, and of the priors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.normal_equations import (
    Eliminated,
    GroupState,
    WeightedRows,
    solved,
)
from armload_identification.estimation.problem import EMPTY, Owner, Problem
from armload_identification.estimation.residual_spectrum import FREEST, ResidualSpectrum
from armload_identification.float_array import FloatArray


@dataclass(frozen=True, eq=False)
class Posterior:
    """The unknowns of a problem after its rows.

    Attributes:
        x: All unknowns.
        information: (s, s) inverse covariance of the shared unknowns if the rows are as independent as assumed.
        known: (f, f) the share of the shared unknowns' priors in that, of the f that are not known exactly.
        noise_nm: (g, n) standard deviation of a row, by the number of its combination.
        residual_nm: (g, n) RMS residual of moving rows, outliers clipped; less than the noise by what the unknowns
            absorbed.
        correlation: (g, n) integrated autocorrelation in rows, by the number of the combination.
        deviation: Prior standard deviation of all unknowns, as finally adapted.
        steps: Number of iterations.
        groups: Residual and weight of every group.
        eliminated: Contribution of every group.
    """

    problem: Problem
    x: FloatArray
    information: FloatArray
    known: FloatArray
    noise_nm: FloatArray
    residual_nm: FloatArray
    correlation: FloatArray
    deviation: FloatArray
    steps: int
    groups: tuple[GroupState, ...]
    eliminated: tuple[Eliminated, ...]

    def value(self, name: str, owner: Owner = EMPTY) -> FloatArray:
        """Values of a term.

        Args:
            owner: What has them: the arm, a mounting, or a run by its group's index and its own.
        """
        return np.asarray(self.x[self.problem.place(name, owner)])

    @property
    def delay_s(self) -> float:
        """Delay of the torque, all its terms together."""
        return float(self.groups[0].torque[0].moved[0])

    @cached_property
    def change_deviation(self) -> FloatArray:
        """(o,) standard deviations of the own unknowns of another run: those of these runs, but not below the stated.

        A few runs of one hour say little about other days.
        """
        own = slice(self.problem.shared_size, self.problem.shared_size + self.problem.own_size)
        return np.maximum(self.deviation[own], self.problem.prior(self.x)[1][own])

    @cached_property
    def bread(self) -> FloatArray:
        """(s, s) inverse of `information`, 0 for unknowns that are known exactly."""
        return self._with_known(solved(self.information, np.eye(len(self.information))))

    @cached_property
    def covariance(self) -> FloatArray:
        """(s, s) covariance of the shared unknowns."""
        covariance = self._by_priors
        for spectrum, answer in self.spectra:
            covariance = covariance + answer @ spectrum.covariance() @ answer.T
        return self._with_known(0.5 * (covariance + covariance.T))

    def spread(self, contrast: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Variance of combinations of the shared unknowns, and its degrees of freedom.

        Args:
            contrast: (k, s).

        Returns:
            (k,) variances, at least those by the least noise of the rows; (k,) Satterthwaite's degrees of freedom. Of
            spectra of 10 to 40 degrees of freedom, and 1 to 3 times the least variance, 94.5 to 96.3 % are held.
        """
        of_free = contrast[:, self._free]
        certain = np.einsum("ki,ij,kj->k", of_free, self._by_priors, of_free)
        random, white, scatter = np.zeros((3, len(contrast)))
        for spectrum, answer in self.spectra:
            along = of_free @ answer
            variance = spectrum.variance(along)
            random += variance
            white += spectrum.variance(along, white=True)
            scatter += variance**2 / spectrum.freedom(along)
        least = self._sampled(of_free)
        # More than the least counts as far as it is more than such a spectrum scatters by.
        chance = least * np.sqrt(2.0 * scatter) / np.maximum(random, 1e-300)
        real = np.clip((white - least) / np.maximum(chance, 1e-300), 0.0, 1.0)
        total = least + real * np.maximum(random - least, 0.0) + certain
        # Variance that does not come from a residual costs no degrees of freedom.
        scatter = real * scatter
        return total, np.clip(total**2 / np.maximum(scatter, total**2 / FREEST), 1.0, FREEST)

    def _sampled(self, of_free: FloatArray) -> FloatArray:
        """(k,) variances of combinations of the free shared unknowns if no row has more than its least noise."""
        noise = self.problem.noise
        least_nm = np.broadcast_to(noise.least_nm, self.noise_nm.shape)
        faded = np.broadcast_to(noise.least_correlation, (len(self.noise_nm), noise.least_correlation.shape[-1]))
        shared = solved(self.information, of_free.T)
        found = np.zeros(len(of_free))
        for index, (state, part) in enumerate(zip(self.groups, self.eliminated, strict=True)):
            whole, at = np.vstack([shared, -part.follow @ shared]), row_places(state.group.time_s)
            for rows in self.weighted_rows[index]:
                answer = np.zeros((at[-1] + 1, len(of_free)))
                answer[at] = rows.rows @ whole[rows.place] * rows.weight[:, None]
                number = state.group.first_noise + rows.combination
                square = np.sum(answer**2, axis=0)
                for lag, share in enumerate(faded[number][1:], 1):
                    square += 2.0 * share * np.sum(answer[lag:] * answer[:-lag], axis=0)
                found += least_nm[number, rows.axis] ** 2 * square
        return found

    def covariance_of(self, contrast: FloatArray) -> FloatArray:
        """(k, k) covariance of combinations, (k, s), of the shared unknowns, with the variances of `spread`."""
        found = contrast @ self.covariance @ contrast.T
        scale = np.sqrt(self.spread(contrast)[0] / np.maximum(np.diag(found), 1e-300))
        return np.asarray(found * scale[:, None] * scale)

    def joint_spread(self, contrast: FloatArray) -> tuple[FloatArray, float]:
        """Covariance of combinations of the shared unknowns, and its degrees of freedom.

        Args:
            contrast: (k, s).

        Returns:
            (k, k) covariance, and those of the Wishart matrix with that mean whose elements have the same scatter.
        """
        of_free, total = contrast[:, self._free], self.covariance_of(contrast)
        scatter = sum(1.0 / spectrum.joint_freedom(of_free @ answer, total) for spectrum, answer in self.spectra)
        return total, float(np.clip(1.0 / scatter, 1.0, FREEST))

    @cached_property
    def spectra(self) -> list[tuple[ResidualSpectrum, FloatArray]]:
        """Spectrum of every group's residual, and (f, r) change of the f free shared unknowns per unit of its basis."""
        return [self._spectrum(index) for index in range(len(self.groups))]

    def _spectrum(self, index: int) -> tuple[ResidualSpectrum, FloatArray]:
        """The spectrum of a group's residual, on the grid of its rows."""
        state, part = self.groups[index], self.eliminated[index]
        root, at = part.covariance_root(self.information), row_places(state.group.time_s)
        basis = np.zeros((at[-1] + 1, len(self.weighted_rows[index]), root.shape[1]))
        residual, weights = np.zeros((2, *basis.shape[:2]))
        for one, rows in enumerate(self.weighted_rows[index]):
            basis[at, one] = rows.rows @ root[rows.place]
            residual[at, one], weights[at, one] = rows.target, rows.weight
        return ResidualSpectrum(basis, residual, weights), root[: self._free.size]

    @cached_property
    def _by_priors(self) -> FloatArray:
        """(f, f) covariance of the free shared unknowns by their priors alone."""
        known = self.known
        for state, part in zip(self.groups, self.eliminated, strict=True):
            known = known + (part.follow.T * self.deviation[state.own] ** -2.0) @ part.follow
        inverse = self.bread[np.ix_(self._free, self._free)]
        return np.asarray(inverse @ known @ inverse)

    def joint_covariance(self, contrast: FloatArray, group: int) -> FloatArray:
        """(k, k) covariance of combinations of unknowns if the rows are as independent as assumed.

        Args:
            contrast: (k, u) coefficients of all unknowns; of those of single runs only this group's count.
            group: Its index.
        """
        contrast = np.hstack([contrast[:, self._free], contrast[:, self.groups[group].own]])
        whole = self.eliminated[group].covariance(self.bread[np.ix_(self._free, self._free)])
        return np.asarray(contrast @ whole @ contrast.T)

    def response(self, *torque_nm: FloatArray) -> FloatArray:
        """(s, k) changes of the shared unknowns by (k, N, n) axis torque on the first runs of groups 0, 1 and so on."""
        whole = np.zeros((self.problem.shared_size, len(torque_nm[0])))
        whole[self._free] = solved(self.information, self._added(torque_nm, 0)[2])
        return whole

    def considered(self, errors: FloatArray) -> FloatArray:
        """(k, s) changes of the shared unknowns for (k, p) changes of the first p of them, which are held firmly."""
        held = slice(0, errors.shape[1])
        return np.asarray(errors @ np.linalg.solve(self.bread[held, held], self.bread[held]))

    def beside(
        self, *torque_nm: FloatArray, first: int = 0, errors: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """What the rows say of further unknowns, beside all others, to first order.

        Args:
            torque_nm: (k, N, n) axis torque per unit of each, on the first run of one group after the other.
            first: Index of the first of these groups.
            errors: (m, p) change of the first p shared unknowns, which are held firmly, for one standard deviation of
                independent errors: they are unknown here, too.

        Returns:
            (k,) gradient and (k, k) information: their estimate is the solution, if nothing else is known of them.
        """
        gradient, information, across = self._added(torque_nm, first)
        information = information - across.T @ solved(self.information, across)
        if errors is None:
            return gradient, information
        # The errors are m more unknowns, of variance 1: the same of them, and across to the further ones.
        unit = np.pad(errors, ((0, 0), (0, self.problem.shared_size - errors.shape[1])))[:, self._free]
        of_rows = np.sum([part.information for part in self.eliminated], axis=0)
        free = unit.T - solved(self.information, of_rows @ unit.T)
        of_errors = np.eye(len(unit)) + unit @ of_rows @ free
        pull, both = unit @ np.sum([part.gradient for part in self.eliminated], axis=0), across.T @ free
        answer = np.linalg.solve(of_errors, np.column_stack([pull, both.T]))
        return gradient - both @ answer[:, 0], information - both @ answer[:, 1:]

    def _added(self, torque_nm: Sequence[FloatArray], first: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(k,) gradient and (k, k) information of `beside`, and (f, k) information across to the shared unknowns."""
        shared, unknowns = self._free.size, len(torque_nm[0])
        gradient, information = np.zeros(unknowns), np.zeros((unknowns, unknowns))
        across = np.zeros((shared, unknowns))
        for group, torque in enumerate(torque_nm, first):
            part, mix = self.eliminated[group], self.groups[group].group.mix[:, 0]
            pull = np.zeros((shared + part.own_step.size, unknowns))
            for rows in self.weighted_rows[group]:
                added = mix[rows.combination] * torque[:, :, rows.axis] * rows.weight
                gradient += added @ rows.target
                information += added @ added.T
                pull[rows.place] += rows.rows.T @ added.T
            across += pull[:shared] - part.follow.T @ pull[shared:]
            information -= pull[shared:].T @ part.own_covariance @ pull[shared:]
        return gradient, information, across

    @cached_property
    def weighted_rows(self) -> list[list[WeightedRows]]:
        """Weighted rows of every group; their unknowns are those that are not known exactly."""
        robust = self.problem.noise.robust
        weights = (state.row_weights(self.noise_nm, self.correlation, robust=robust) for state in self.groups)
        return [list(state.weighted_rows(weight)) for state, weight in zip(self.groups, weights, strict=True)]

    def deviates(self, group: int) -> FloatArray:
        """(n,) RMS residual of a group relative to the noise of all.

        Args:
            group: Its index.
        """
        return np.asarray(self.groups[group].relative_residual(self.noise_nm).max(axis=0))

    def change_without(self, group: int) -> FloatArray:
        """(s,) change of the shared unknowns without a group, by one step from the solution.

        Args:
            group: Its index.
        """
        part = self.eliminated[group]
        change = np.zeros(self.problem.shared_size)
        change[self._free] = -solved(self.information - part.information, part.gradient)
        return change

    @cached_property
    def _free(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.problem.free[: self.problem.shared_size])

    def _with_known(self, matrix: FloatArray) -> FloatArray:
        """A matrix of the free unknowns with zeros for those that are known exactly."""
        whole = np.zeros((self.problem.shared_size,) * 2)
        whole[np.ix_(self._free, self._free)] = matrix
        return whole


def row_places(time_s: FloatArray) -> NDArray[np.intp]:
    """(N,) places of rows on the grid of their times, (N,), which may have gaps."""
    apart_s = np.diff(time_s).min() if time_s.size > 1 else 1.0
    return np.asarray(np.rint((time_s - time_s[0]) / apart_s), dtype=np.intp)
