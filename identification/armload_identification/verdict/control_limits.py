"""Control limits for a quantity of an arm over its runs, and changes of its level.

The quantity is relative to the calibration, so that its expected value is zero. Its spread between runs is estimated
from the differences of successive runs, which a change of level hardly affects; with few runs the expected spread
dominates. The levels are the piecewise constant function that fits best, with a penalty for each change that gives one
false alarm in a hundred such reports.

References:
    Shewhart, Economic Control of Quality of Manufactured Product, 1931; Montgomery, Introduction to Statistical Quality
    Control, ch. 6.4 (individuals and moving ranges); Jackson et al., IEEE Signal Processing Letters 12, 2005
    (optimal partitioning).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri, stdtrit

from armload_core.arrays import FloatArray

LIMIT: Final = 3.0
"""Standard deviations of the control limits."""
FALSE_ALARM: Final = 0.01
"""Probability that a report of an unchanged arm names a change."""
_EXPECTED_RUNS: Final = 5.0
"""Weight of the expected spread, in differences of runs."""
_OF_DIFFERENCES: Final = 2.0 / 3.0
"""Degrees of freedom of a mean square successive difference, per run."""
_HALF: Final = float(chdtri(1.0, 0.5))
_CLIPPED: Final = 9.0
"""A squared difference is limited to this multiple of the variance from the median one: it may be a change."""
_LEAST_LEVEL: Final = 2
"""Least number of runs of a level; a single deviating run is not a change."""


@dataclass(frozen=True)
class LevelChange:
    """A change of level.

    Attributes:
        index: The first run after it; 0 if all runs differ from the calibration.
        before: Level before it; 0, the calibration's, for index 0.
        after: Level after it.
        deviation: Standard deviation of the difference.
    """

    index: int
    before: float
    after: float
    deviation: float


@dataclass(frozen=True, eq=False)
class ControlChart:
    """A quantity over r runs, in their order.

    Attributes:
        values: (r,) difference from the calibration; NaN if a run does not determine it.
        deviation: (r,) standard deviation of each: of the run itself and between runs.
        limit: (r,) half the distance of the control limits, the calibration's own error on the run's motion included.
        spread: Standard deviation between runs.
        outside: (r,) True beyond the limits.
        alone: (r,) True for outliers, which differ significantly from the neighbouring runs; not used for the levels.
        level: (r,) level at each run; NaN if there are too few.
        changes: The changes of level.
    """

    values: FloatArray
    deviation: FloatArray
    limit: FloatArray
    spread: float
    outside: NDArray[np.bool_]
    alone: NDArray[np.bool_]
    level: FloatArray
    changes: tuple[LevelChange, ...]


def control_chart(values: FloatArray, noise: FloatArray, doubt: FloatArray, usual: float, charts: int) -> ControlChart:
    """The chart of a quantity.

    Args:
        values: (r,) difference from the calibration, by run; NaN if a run does not determine it.
        noise: (r,) standard deviation due to the run's own noise.
        doubt: (r,) standard deviation due to the calibration's errors.
        usual: Expected standard deviation between runs.
        charts: Number of charts of the report, which have the false alarm rate together.

    Returns:
        Limits, levels and changes.
    """
    shown: NDArray[np.intp] = np.flatnonzero(np.isfinite(values))
    v, own, known = values[shown], noise[shown], doubt[shown]
    spread = _spread(v, own, usual)
    deviation = np.hypot(own, spread)
    # Change of level or outlier, upwards or downwards, at every run of every chart.
    tests = 4.0 * charts * max(shown.size, 1)
    freedom = _EXPECTED_RUNS + _OF_DIFFERENCES * max(shown.size - 1, 0)
    bound = -float(stdtrit(freedom, FALSE_ALARM / tests))
    alone = _alone(v, deviation, bound)
    kept: NDArray[np.intp] = np.flatnonzero(~alone)
    level, changes = np.full(shown.size, np.nan), []
    before, before_variance = 0.0, None
    for start, end in _levels(v[kept], deviation[kept] ** -2.0, bound**2):
        part = kept[start:end]
        weight = deviation[part] ** -2.0
        mean, variance = float(np.average(v[part], weights=weight)), 1.0 / float(weight.sum())
        # The first level is compared with the calibration, whose error all its runs share.
        other = float(np.mean(known[part] ** 2)) if before_variance is None else before_variance
        size = float(np.sqrt(variance + other))
        if abs(mean - before) > bound * size:
            changes.append(LevelChange(int(shown[part[0]]), before, mean, size))
        level[part[0] : kept[end] if end < kept.size else shown.size] = mean
        before, before_variance = mean, variance
    limit = LIMIT * np.hypot(deviation, known)

    def whole(part: FloatArray) -> FloatArray:
        full = np.full(values.size, np.nan)
        full[shown] = part
        return full

    marked = np.zeros((2, values.size), dtype=bool)
    marked[:, shown] = np.abs(v) > limit, alone
    return ControlChart(
        values, whole(deviation), whole(limit), spread, marked[0], marked[1], whole(level), tuple(changes)
    )


def _spread(values: FloatArray, noise: FloatArray, usual: float) -> float:
    """Standard deviation between runs, from the mean square of successive differences."""
    count = values.size - 1
    if count < 1:
        return usual
    ranges = np.diff(values) ** 2
    ranges = np.minimum(ranges, _CLIPPED * float(np.median(ranges)) / _HALF)
    seen = 0.5 * float(np.mean(ranges) - np.mean(noise[1:] ** 2 + noise[:-1] ** 2))
    return float(np.sqrt((_EXPECTED_RUNS * usual**2 + count * max(seen, 0.0)) / (_EXPECTED_RUNS + count)))


def _alone(values: FloatArray, deviation: FloatArray, bound: float) -> NDArray[np.bool_]:
    """Runs that differ from their neighbours."""
    if values.size < _LEAST_LEVEL + 1:
        return np.zeros(values.size, dtype=bool)
    # Away from both neighbours, in the same direction; the first and the last run have only one.
    step = np.diff(values) / (bound * np.hypot(deviation[1:], deviation[:-1]))
    before, behind = np.concatenate([[-step[0]], step]), np.concatenate([-step, [step[-1]]])
    return np.asarray((np.minimum(before, behind) > 1.0) | (np.maximum(before, behind) < -1.0))


def _levels(values: FloatArray, weight: FloatArray, price: float) -> list[tuple[int, int]]:
    """Start and end of every level: weighted least squares with a penalty for each level after the first."""
    count = values.size
    if count == 0:
        return []
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(np.stack([weight, weight * values, weight * values**2], 1), 0)])
    best, begin = np.full(count + 1, np.inf), np.zeros(count + 1, dtype=np.intp)
    best[0] = -price
    # No level ends after fewer runs, unless there are no more.
    for end in range(min(_LEAST_LEVEL, count), count + 1):
        starts = np.arange(0, max(end - _LEAST_LEVEL, 0) + 1)
        part = sums[end] - sums[starts]
        cost = best[starts] + price + part[:, 2] - part[:, 1] ** 2 / part[:, 0]
        chosen = int(np.argmin(cost))
        best[end], begin[end] = cost[chosen], starts[chosen]
    levels, end = [], count
    while end > 0:
        levels.append((int(begin[end]), end))
        end = int(begin[end])
    return levels[::-1]
