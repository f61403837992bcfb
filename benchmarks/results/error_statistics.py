"""Statistics of many trials."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.model.payload import SMALLEST_MARGIN, InertialParameters
from benchmarks.arms.trials import Trial
from benchmarks.results.bound import paper_values
from benchmarks.results.tally import Tally

OUTSIDE: Final = 0.07
EXACT: Final = "gains exact"
NOMINAL: Final = "gains nominal, within 2 %"
CALIBRATED: Final = "gains calibrated"


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors of the trials that had a result; S of them.

    Attributes:
        seeds: All trials, refused ones included.
        mass_share: (S,) relative error of the mass.
        center_m: (S,) distance between estimated and true centre of mass.
        paper_share: (S, 10) relative errors of the paper's ten values.
        value_errors: (S, 10) errors of mass, centre of mass and inertia about it.
        inside: (S, 10) whether the interval contains the truth.
        determined: (S, 10) whether the value is reported as determined.
    """

    seeds: int
    mass_share: FloatArray
    center_m: FloatArray
    paper_share: FloatArray
    value_errors: FloatArray
    inside: NDArray[np.bool_]
    determined: NDArray[np.bool_]

    @classmethod
    def of(cls, trials: Sequence[Trial], truth: InertialParameters) -> Errors:
        """Errors against the truth in the same frame."""
        done = [trial for trial in trials if not trial.refused]
        shape = (len(done), 10)
        values = np.array([trial.parameters.values for trial in done]).reshape(shape)
        paper = np.array([paper_values(trial.parameters) for trial in done]).reshape(shape)
        errors = values - truth.values
        with np.errstate(divide="ignore"):
            share = paper / paper_values(truth) - 1.0
        return cls(
            seeds=len(trials),
            mass_share=errors[:, 0] / truth.mass_kg,
            center_m=np.sqrt(np.sum(errors[:, 1:4] ** 2, axis=1)),
            paper_share=share,
            value_errors=errors,
            inside=np.abs(errors) <= np.array([trial.half_width_95 for trial in done]).reshape(shape),
            determined=np.array([trial.determined for trial in done], dtype=bool).reshape(shape),
        )

    def share(self, good: NDArray[np.bool_]) -> float:
        """Share of ALL seeds that are good; refused ones are not."""
        return float(np.count_nonzero(good)) / self.seeds


@dataclass(slots=True)
class Census:
    """Running counts over all trials.

    Attributes:
        results: Number of results.
        refused: Seeds without a result.
        impossible: Physically impossible results, by the margin required of a payload file.
        intervals: On the normative plant, by what is known of the gains: parameters reported as determined, and how
            many of them lie outside their interval.
    """

    results: int = 0
    refused: int = 0
    impossible: int = 0
    intervals: dict[str, tuple[int, int]] = field(default_factory=dict)

    def add(self, trials: Sequence[Trial], truth: InertialParameters, intervals: str | None) -> None:
        """Count the trials of one setup; their intervals under a label, or not (None) off the normative plant."""
        done = [trial for trial in trials if not trial.refused]
        self.results += len(done)
        self.refused += len(trials) - len(done)
        self.impossible += sum(trial.margin < SMALLEST_MARGIN for trial in done)
        if intervals is not None and done:
            errors = Errors.of(trials, truth)
            determined, outside = self.intervals.get(intervals, (0, 0))
            determined += int(np.count_nonzero(errors.determined))
            outside += int(np.count_nonzero(errors.determined & ~errors.inside))
            self.intervals[intervals] = (determined, outside)

    def judge(self, tally: Tally) -> None:
        """Judge that no result is impossible and that few determined values lie outside their interval."""
        tally.judge(
            "no result of this program is physically impossible after reading its file back",
            f"{self.impossible} of {self.results}",
            self.impossible == 0,
        )
        print(f"  {self.refused} seeds were refused with a reason")
        for label, (determined, outside) in self.intervals.items():
            share = outside / max(determined, 1)
            tally.judge(
                f"normative plant, {label}: at most {OUTSIDE:.0%} of the values called determined lie outside "
                "their interval",
                f"{share:.1%} of {determined}",
                share <= OUTSIDE,
            )
