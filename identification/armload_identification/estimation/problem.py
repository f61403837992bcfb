"""A problem: rows of runs, the terms that act on them, what else is known, and the noise.

The unknowns are laid out in one vector: those that several runs share first, then each run's own, run by run.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.term_kinds import Placed, Scope, Term
from armload_identification.float_array import FloatArray

if TYPE_CHECKING:
    from armload_identification.estimation.arm_rows import ArmRows

EMPTY: Final = ""
"""Mounting of a run without a payload."""
Owner = str | tuple[int, int]
"""What has values of a term: the arm (empty), a mounting by its name, or a run by its group's index and its own."""
ALONE: Final = np.eye(1)
DIFFERENCE_AND_MEAN: Final = np.array([[1.0, -1.0], [0.5, 0.5]])
"""Rows of two runs of one motion: the first without what both have in common."""
DIFFERENCE: Final = DIFFERENCE_AND_MEAN[:1]
"""The first of these rows alone, for runs whose common friction no law describes well enough."""


@dataclass(frozen=True, eq=False)
class RunRows:
    """The rows of a run and what it carried.

    Attributes:
        mounting: Name of its payload; empty for an empty arm.
    """

    rows: ArmRows
    mounting: str = EMPTY


@dataclass(frozen=True, eq=False)
class Group:
    """Runs whose rows are used together: one run, or g runs of one motion whose N rows are at equal phases.

    Attributes:
        runs: These runs.
        mix: (c, g) the combinations of their rows that are fitted, each with a noise of its own.
        first_noise: Number of the first combination's noise; groups with the same number share their noises.
    """

    runs: tuple[RunRows, ...]
    mix: FloatArray = field(default_factory=lambda: ALONE)
    first_noise: int = 0

    @property
    def noises(self) -> slice:
        """Numbers of its combinations' noises."""
        return slice(self.first_noise, self.first_noise + len(self.mix))

    @cached_property
    def effort_nm(self) -> FloatArray:
        """(c, N, n) combinations of the measured torque."""
        return self.mixed(np.stack([run.rows.effort_nm for run in self.runs]))

    @cached_property
    def weight(self) -> FloatArray:
        """(N, n) weight of a row, the least of its runs'."""
        return np.asarray(np.min([run.rows.weight for run in self.runs], axis=0))

    @property
    def time_s(self) -> FloatArray:
        """(N,) time of the rows."""
        return self.runs[0].rows.time_s

    def with_effort(self, effort_nm: FloatArray) -> Group:
        """The group with another (N, n) axis torque of its first run."""
        first, *others = self.runs
        return replace(self, runs=(replace(first, rows=replace(first.rows, effort_nm=effort_nm)), *others))

    def changed(self, change: Callable[[ArmRows], ArmRows]) -> Group:
        """The group with other rows of each run."""
        return replace(self, runs=tuple(replace(run, rows=change(run.rows)) for run in self.runs))

    def mixed(self, values: FloatArray) -> FloatArray:
        """(c, N, ...) combinations of the runs' values.

        Args:
            values: (g, N, ...).
        """
        return values if len(self.runs) == 1 else np.tensordot(self.mix, values, axes=1)


@dataclass(frozen=True, eq=False)
class Known:
    """Knowledge of several terms together: a Gaussian over their values one after the other.

    Attributes:
        terms: Name of each term and the mounting it refers to, empty for a term of the arm.
        precision: (k, k) inverse covariance.
        target: (k,) precision times mean.
    """

    terms: tuple[tuple[str, str], ...]
    precision: FloatArray
    target: FloatArray


@dataclass(frozen=True, eq=False)
class Noise:
    """Standard deviation of a row, and what is estimated of it.

    Attributes:
        start_nm: (n,) of an axis, far from reversals.
        least_nm: (n,) or (g, n), by the number of the combination: its least value; the same as `greatest_nm` if known.
        greatest_nm: (n,) its greatest value.
        correlation: (n,) integrated autocorrelation in rows; None to estimate it.
        least_correlation: (g or 1, L) autocorrelation of rows that have it, by the lag in rows from 0.
        robust: Whether outlying rows have less weight, and blows none.
    """

    start_nm: FloatArray
    least_nm: FloatArray
    greatest_nm: FloatArray
    correlation: FloatArray | None = None
    robust: bool = True
    least_correlation: FloatArray = field(default_factory=lambda: ALONE)

    @classmethod
    def unknown(
        cls, level_nm: FloatArray, least_nm: float | FloatArray = 1e-12, least_correlation: FloatArray = ALONE
    ) -> Noise:
        """Estimated from the residual, at most the torque itself.

        Args:
            level_nm: (n,) RMS torque.
            least_nm: Least value, or (g, n): a few rows can be fitted without any residual.
            least_correlation: Of the attribute.
        """
        return cls(level_nm, np.clip(least_nm, 1e-12, level_nm), level_nm, least_correlation=least_correlation)

    @classmethod
    def given(cls, noise_nm: FloatArray, correlation: FloatArray) -> Noise:
        """Known, and no row is outlying: for a residual that is to be judged.

        Args:
            noise_nm: (n,) standard deviation.
            correlation: (n,) integrated autocorrelation in rows.
        """
        return cls(noise_nm, noise_nm, noise_nm, correlation, robust=False)


@dataclass(frozen=True, eq=False)
class Problem:
    """What `solve` solves.

    Attributes:
        terms: All terms.
        groups: All runs.
        noise: Of their rows.
        coupling: (n, n) C of the motors.
        known: Knowledge of several terms together, in addition to the priors of each.
    """

    terms: Sequence[Term]
    groups: Sequence[Group]
    noise: Noise
    coupling: FloatArray
    known: Sequence[Known] = ()

    @cached_property
    def mountings(self) -> tuple[str, ...]:
        """Names of all payloads, sorted."""
        return tuple(sorted({run.mounting for group in self.groups for run in group.runs} - {EMPTY}))

    @cached_property
    def _places(self) -> dict[tuple[str, Owner], slice]:
        """Place of each term's values, by its name and what has them: the arm, a mounting, or a run of a group."""
        runs = [(group, run) for group, whole in enumerate(self.groups) for run in range(len(whole.runs))]
        owners: dict[Scope, Sequence[Owner]] = {Scope.ARM: [EMPTY], Scope.MOUNTING: self.mountings, Scope.RUN: runs}
        places, start = {}, 0
        for scope, of_scope in owners.items():
            for owner in of_scope:
                for term in self._terms_of(scope):
                    places[term.name, owner] = slice(start, start + term.mean.size)
                    start += term.mean.size
        return places

    @cached_property
    def shared_size(self) -> int:
        """Number of shared unknowns."""
        return self.size - sum(len(group.runs) for group in self.groups) * self.own_size

    @cached_property
    def own_size(self) -> int:
        """Number of unknowns of each run's own."""
        return sum(term.mean.size for term in self._terms_of(Scope.RUN))

    def own(self, group: int) -> slice:
        """Place of the unknowns of a group's runs.

        Args:
            group: Its index.
        """
        before = sum(len(other.runs) for other in self.groups[:group])
        start = self.shared_size + before * self.own_size
        return slice(start, start + len(self.groups[group].runs) * self.own_size)

    @cached_property
    def size(self) -> int:
        """Number of all unknowns."""
        return max((place.stop for place in self._places.values()), default=0)

    def place(self, name: str, owner: Owner = EMPTY) -> slice:
        """Place of a term's values.

        Args:
            owner: What has them: the arm, a mounting, or a run by its group's index and its own.
        """
        return self._places[name, owner]

    def acting(self, group: int) -> tuple[Placed, ...]:
        """The terms that act on each run of a group.

        Args:
            group: Its index.
        """
        parts = []
        for number, run in enumerate(self.groups[group].runs):
            owners: dict[Scope, Owner] = {Scope.ARM: EMPTY, Scope.MOUNTING: run.mounting, Scope.RUN: (group, number)}
            placed = [(term, self._places.get((term.name, owners[term.scope]))) for term in self.terms]
            parts.append(tuple((term, place) for term, place in placed if place is not None))
        return tuple(parts)

    def prior(
        self, values: FloatArray | None = None, factors: Mapping[str, FloatArray] | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Mean and standard deviation of all unknowns by their terms alone.

        Args:
            values: All unknowns, if priors that are shares of other values are to be adapted to them.
            factors: Estimated factors on the standard deviations of pooled terms, by name.
        """
        now = {}
        if values is not None:
            now = {name: values[place] for (name, owner), place in self._places.items() if owner == EMPTY}
        mean, deviation = np.zeros(self.size), np.zeros(self.size)
        for term in self.terms:
            spread = term.deviation if term.rescaled is None or values is None else term.rescaled(now)
            if factors is not None and term.pooled is not None:
                spread = spread * factors[term.name][term.pooled]
            for place in self.places(term):
                mean[place], deviation[place] = term.mean, spread
        return mean, deviation

    @property
    def adapts(self) -> bool:
        """Whether noise, weights or priors change from step to step."""
        noise = self.noise
        priors = any(term.rescaled is not None or term.pooled is not None for term in self.terms)
        return priors or noise.robust or noise.correlation is None or bool((noise.least_nm < noise.greatest_nm).any())

    @cached_property
    def free(self) -> NDArray[np.bool_]:
        """True for unknowns that are not known exactly."""
        return np.asarray(self.prior()[1] > 0.0)

    def places(self, term: Term) -> list[slice]:
        """All places of a term.

        Args:
            term: One of `terms`.
        """
        return [place for (name, _), place in self._places.items() if name == term.name]

    def _terms_of(self, scope: Scope) -> list[Term]:
        return [term for term in self.terms if term.scope is scope]
