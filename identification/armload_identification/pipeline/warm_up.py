"""Decrease of friction while an arm warms up, with the logarithm of its time in operation.

    F(t) = F_session + b ln(1 + t / 10 min)

After two hours of rest a new session starts. The times are those of the runs, and of the windows of long ones; an arm
that was in operation before its first run has a flatter curve. b is used only if it is significant.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.calibration.run_health import RunHealth
from armload_identification.float_array import FloatArray

_SCALE_S: Final = 600.0
_REST_S: Final = 7200.0
WARM_S: Final = 3600.0
"""Time in operation to which friction refers."""
_LEAST_RANGE: Final = 0.5
"""Least range of the logarithm: at least from the start to 6.5 minutes."""
_BEYOND_CHANCE: Final = 4.0
_LEAST_MORE: Final = 3
"""Least number of points in excess of one per session plus one for the slope."""


@dataclass(frozen=True, eq=False)
class WarmUp:
    """Friction over time in operation, n joints.

    Attributes:
        at_work_s: (p,) time in operation of every point.
        session: (p,) number of its session, which is operation without a long rest.
        friction_nm: (p, n) difference from the friction after an hour; NaN if a joint hardly moves.
        slope_nm: (n,) b; 0 if it is not significant.
        of_runs_nm: (r, n) increase of each run's friction because the arm is not warm.
    """

    at_work_s: FloatArray
    session: NDArray[np.intp]
    friction_nm: FloatArray
    slope_nm: FloatArray
    of_runs_nm: FloatArray

    def curve_nm(self, at_work_s: FloatArray) -> FloatArray:
        """(t, n) friction minus that after an hour.

        Args:
            at_work_s: (t,) times in operation.
        """
        return (_log(at_work_s) - _log(WARM_S))[:, None] * self.slope_nm


def warm_up(runs: Sequence[RunHealth], began: Sequence[datetime]) -> WarmUp | None:
    """The warming of an arm.

    Args:
        runs: In the order of time.
        began: Start of each; empty if unknown: then each run is a session.

    Returns:
        The curve; None if no joint's friction depends significantly on the time in operation.
    """
    starts, sessions = _sessions(runs, began)
    points = [
        (start + elapsed_s, which, value, noise)
        for run, start, which in zip(runs, starts, sessions, strict=True)
        for elapsed_s, value, noise in _points(run)
    ]
    time_s, where, values, spread = (np.array(part) for part in zip(*points, strict=True))
    slopes = [_slope(_log(time_s), where, *of_joint) for of_joint in zip(values.T, spread.T, strict=True)]
    slope, deviation = np.transpose(slopes)
    slope = np.where(np.abs(slope) > _BEYOND_CHANCE * deviation, slope, 0.0)
    if not slope.any():
        return None
    part = (_log(time_s) - _log(WARM_S))[:, None] * slope
    of_session, known = (where == where[:, None]).astype(float), np.isfinite(values)
    levels = of_session @ np.where(known, values - part, 0.0) / np.maximum(of_session @ known, 1.0)
    middle_s = starts + 0.5 * np.array([run.length_s for run in runs])
    cold = (_log(middle_s) - _log(WARM_S))[:, None] * slope
    return WarmUp(time_s, where, values - levels, slope, cold)


def _points(run: RunHealth) -> Iterable[tuple[float, FloatArray, FloatArray]]:
    """Time since the start of a run, friction and its noise: of its windows, or of the whole run."""
    if run.course is None:
        return [(0.5 * run.length_s, run.friction.value, run.friction.noise)]
    return zip(run.course.elapsed_s, run.course.friction_nm, run.course.noise_nm, strict=True)


def _log(at_work_s: FloatArray | float) -> FloatArray:
    return np.asarray(np.log1p(np.asarray(at_work_s) / _SCALE_S))


def _sessions(runs: Sequence[RunHealth], began: Sequence[datetime]) -> tuple[FloatArray, NDArray[np.intp]]:
    """(r,) time in operation at the start of each run, and (r,) number of its session."""
    if not began:
        return np.zeros(len(runs)), np.arange(len(runs))
    start_s = np.array([(moment - began[0]).total_seconds() for moment in began])
    rest_s = np.diff(start_s) - [run.length_s for run in runs[:-1]]
    session = np.concatenate([[0], np.cumsum(rest_s > _REST_S)])
    return start_s - start_s[np.searchsorted(session, session)], session


def _slope(
    log_time: FloatArray, session: NDArray[np.intp], values: FloatArray, noise: FloatArray
) -> tuple[float, float]:
    """Slope within sessions and its standard deviation, from the scatter about it, at least from the noise."""
    known = np.isfinite(values) & (noise > 0.0)
    x, y, weight = log_time[known], values[known], noise[known] ** -2.0
    which, place = np.unique(session[known], return_inverse=True)
    free = x.size - which.size - 1
    if free < _LEAST_MORE:
        return 0.0, np.inf
    total = np.bincount(place, weight)
    x = x - (np.bincount(place, weight * x) / total)[place]
    y = y - (np.bincount(place, weight * y) / total)[place]
    information = float(weight @ x**2)
    if np.ptp(x) < _LEAST_RANGE or information <= 0.0:
        return 0.0, np.inf
    slope = float(weight @ (x * y)) / information
    scatter = float(weight @ (y - slope * x) ** 2) / free
    return slope, float(np.sqrt(max(scatter, 1.0) / information))
