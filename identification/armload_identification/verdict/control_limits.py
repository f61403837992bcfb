"""Control limits for a figure of an arm over its runs, and since when it is another one.

The figure is measured against the calibration, so that its centre is zero. Its spread from run to run is that of the
differences of successive runs, which a change of level hardly moves; where runs are few, the spread that was expected
beforehand decides. A change of level is one that the runs on either side of it show together: the levels are the
piecewise constant course that fits best, each further change at the price of a false alarm in a hundred such reports.

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
"""The expected spread counts as much as so many differences of runs."""
_OF_DIFFERENCES: Final = 2.0 / 3.0
"""Degrees of freedom of a mean square successive difference, per run."""
_HALF: Final = float(chdtri(1.0, 0.5))
_CLIPPED: Final = 9.0
"""A squared difference counts for at most so many times what the median one says: it may be a change."""
_LEAST_LEVEL: Final = 2
"""Runs of a level; a single one that is off is no change yet."""


@dataclass(frozen=True)
class LevelChange:
    """A change of level.

    Attributes:
        index: The first run behind it; 0 where all runs differ from the calibration.
        before: Level before it; 0, the calibration's, for index 0.
        after: Level behind it.
        deviation: Standard deviation of the difference.
    """

    index: int
    before: float
    after: float
    deviation: float


@dataclass(frozen=True, eq=False)
class ControlChart:
    """A figure over r runs, in their order.

    Attributes:
        values: (r,) difference from the calibration; NaN where a run does not show it.
        deviation: (r,) standard deviation of each: of the run itself and from run to run.
        limit: (r,) half the distance of the control limits, the calibration's own error on the run's motion included.
        spread: Standard deviation from run to run.
        outside: (r,) beyond the limits.
        alone: (r,) off from the runs beside it by more than chance; left out of the levels.
        level: (r,) level at each run; NaN where there are too few.
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
    """The chart of a figure.

    Args:
        values: (r,) difference from the calibration, by run; NaN where a run does not show it.
        noise: (r,) standard deviation by the run's own noise.
        doubt: (r,) standard deviation by the calibration's errors.
        usual: Standard deviation that is expected from run to run.
        charts: How many charts the report has: all of them together are to raise few false alarms.

    Returns:
        Limits, levels and changes.
    """
    shown: NDArray[np.intp] = np.flatnonzero(np.isfinite(values))
    v, own, known = values[shown], noise[shown], doubt[shown]
    spread = _spread(v, own, usual)
    deviation = np.hypot(own, spread)
    # A change of level and a run that is off by itself, upwards or downwards, at every run of every chart.
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
        # The first level is held against the calibration, whose error all its runs share.
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
    """Standard deviation from run to run, from the mean square of successive differences."""
    count = values.size - 1
    if count < 1:
        return usual
    ranges = np.diff(values) ** 2
    ranges = np.minimum(ranges, _CLIPPED * float(np.median(ranges)) / _HALF)
    seen = 0.5 * float(np.mean(ranges) - np.mean(noise[1:] ** 2 + noise[:-1] ** 2))
    return float(np.sqrt((_EXPECTED_RUNS * usual**2 + count * max(seen, 0.0)) / (_EXPECTED_RUNS + count)))


def _alone(values: FloatArray, deviation: FloatArray, bound: float) -> NDArray[np.bool_]:
    """Runs that differ from those beside them."""
    if values.size < _LEAST_LEVEL + 1:
        return np.zeros(values.size, dtype=bool)
    # Away from both neighbours, and to the same side of them; the first and the last run have one.
    step = np.diff(values) / (bound * np.hypot(deviation[1:], deviation[:-1]))
    before, behind = np.concatenate([[-step[0]], step]), np.concatenate([-step, [step[-1]]])
    return np.asarray((np.minimum(before, behind) > 1.0) | (np.maximum(before, behind) < -1.0))


def _levels(values: FloatArray, weight: FloatArray, price: float) -> list[tuple[int, int]]:
    """Beginning and end of every level: least weighted squares, and a price for each level behind the first."""
    count = values.size
    if count == 0:
        return []
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(np.stack([weight, weight * values, weight * values**2], 1), 0)])
    best, begin = np.full(count + 1, np.inf), np.zeros(count + 1, dtype=np.intp)
    best[0] = -price
    for end in range(1, count + 1):
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
