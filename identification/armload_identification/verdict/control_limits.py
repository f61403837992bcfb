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

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from armload_identification.float_array import FloatArray
from armload_identification.signals.signal_constants import SampleNoise
from armload_identification.verdict.decision_levels import ChartLevels, FalseAlarms


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
        outside: (r,) True beyond the limits.
        alone: (r,) True for outliers, which differ significantly from the neighbouring runs; not used for the levels.
        level: (r,) level at each run; NaN if there are too few.
        changes: The changes of level.
    """

    values: FloatArray
    deviation: FloatArray
    limit: FloatArray
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
    spread = _deviation_between_runs(v, own, usual)
    deviation = np.hypot(own, spread)
    # Change of level or outlier, upwards or downwards, at every run of every chart.
    tests = ChartLevels.tests_per_run * charts * max(shown.size, 1)
    freedom = ChartLevels.expected_runs + ChartLevels.freedom_per_difference * max(shown.size - 1, 0)
    bound = -float(stdtrit(freedom, FalseAlarms.probability / tests))
    alone = _isolated_runs(v, deviation, bound)
    kept: NDArray[np.intp] = np.flatnonzero(~alone)
    level, changes = np.full(shown.size, np.nan), []
    before, before_variance = 0.0, None
    for start, end in _level_segments(v[kept], deviation[kept] ** -2.0, bound**2):
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
    limit = ChartLevels.limit_deviations * np.hypot(deviation, known)

    full = np.full((4, values.size), np.nan)
    full[:, shown] = deviation, limit, level, alone
    return ControlChart(values, full[0], full[1], np.abs(values) > full[1], full[3] == 1.0, full[2], tuple(changes))


def _deviation_between_runs(values: FloatArray, noise: FloatArray, usual: float) -> float:
    """Standard deviation between runs, from the mean square of successive differences."""
    count = values.size - 1
    if count < 1:
        return usual
    ranges = np.diff(values) ** 2
    usual_range = float(np.median(ranges)) / SampleNoise.median_of_normal**2
    ranges = np.minimum(ranges, ChartLevels.clipped * usual_range)
    seen = 0.5 * float(np.mean(ranges) - np.mean(noise[1:] ** 2 + noise[:-1] ** 2))
    expected = ChartLevels.expected_runs
    return float(np.sqrt((expected * usual**2 + count * max(seen, 0.0)) / (expected + count)))


def _isolated_runs(values: FloatArray, deviation: FloatArray, bound: float) -> NDArray[np.bool_]:
    """Runs that differ from their neighbours."""
    if values.size < ChartLevels.runs_of_level + 1:
        return np.zeros(values.size, dtype=bool)
    # Away from both neighbours, in the same direction; the first and the last run have only one.
    step = np.diff(values) / (bound * np.hypot(deviation[1:], deviation[:-1]))
    before, behind = np.concatenate([[-step[0]], step]), np.concatenate([-step, [step[-1]]])
    return np.asarray((np.minimum(before, behind) > 1.0) | (np.maximum(before, behind) < -1.0))


def _level_segments(values: FloatArray, weight: FloatArray, price: float) -> list[tuple[int, int]]:
    """Start and end of every level: weighted least squares with a penalty for each level after the first."""
    count = values.size
    if count == 0:
        return []
    sums = np.concatenate([np.zeros((1, 3)), np.cumsum(np.stack([weight, weight * values, weight * values**2], 1), 0)])
    best, begin = np.full(count + 1, np.inf), np.zeros(count + 1, dtype=np.intp)
    best[0] = -price
    # No level ends after fewer runs, unless there are no more.
    for end in range(min(ChartLevels.runs_of_level, count), count + 1):
        starts = np.arange(0, max(end - ChartLevels.runs_of_level, 0) + 1)
        part = sums[end] - sums[starts]
        cost = best[starts] + price + part[:, 2] - part[:, 1] ** 2 / part[:, 0]
        chosen = int(np.argmin(cost))
        best[end], begin[end] = cost[chosen], starts[chosen]
    levels, end = [], count
    while end > 0:
        levels.append((int(begin[end]), end))
        end = int(begin[end])
    return levels[::-1]
