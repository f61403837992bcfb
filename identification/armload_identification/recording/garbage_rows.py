"""Removal of invalid rows from a log: they are dropped and counted; wrong units are refused.

Rows are checked in windows, so that a log may have any length. Windows overlap, as a check requires enough rows on both
sides of a row. A short log is one window.
"""

from __future__ import annotations

import bisect
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.column_units import DEGREE_RAD
from armload_identification.recording.row_block import RowBlock, joined

FIRST_WINDOW: Final = 2**17
"""Rows from which units and sampling interval are determined; a shorter log is a single window."""
_WINDOW: Final = 2**14
_OVERLAP: Final = 2**10
"""Rows at the end of a window that are checked with the next: a wrong time stamp among them costs only its own row."""
_SHORTEST_ROWS: Final = 20
_ABSURD: Final = {"position_rad": 1e3, "velocity_rad_s": 1e3, "current_a": 1e4, "torque_nm": 1e6}
"""Magnitudes that no joint of an arm reaches, in any likely unit."""
_FASTEST_RAD_S: Final = 50.0
_JUMP_WINDOW: Final = 11
_LONGEST_INTERVAL_S: Final = 0.5
_SHORTEST_INTERVAL_S: Final = 1e-5
_TIME_UNITS: Final = {"milliseconds": 1e-3, "microseconds": 1e-6, "nanoseconds": 1e-9}
_USUAL_INTERVAL_S: Final = (1e-4, 0.11)
_CREEP_RAD_S: Final = 0.01
"""A joint that never moves faster than this does not move; with time stamps in ms, 10 rad/s would look like it."""
_MOVED_FAR_RAD: Final = 0.1
_MEDIAN_ROWS: Final = 5
"""Rows over which a median position hides those that are wrong."""
_TURN_RAD: Final = 2.0 * np.pi
_LARGEST_ANGLE_RAD: Final = 6.0 * np.pi
"""Joints that turn further are logged modulo one turn; greater angles are in degrees."""
_SPIKE_WINDOW: Final = 5
_SPIKE: Final = 6.0
"""Deviation of a motor's effort from the median of its neighbours, in steps that nine of ten are below: 14 standard
deviations of white noise. A step, as at a reversal, does not deviate."""
_SPIKES: Final = 0.005
"""Least share of rows with spikes: a few hard stops are genuine, and the weights of the fit bear them."""
_CLOCK_SET_BACK: Final = 0.05
"""Least share of rows in a row that do not follow in time, if the clock started again: setting it costs fewer."""
_REASONS: Final = (
    "not finite",
    "impossible value",
    "same as the row before",
    "time out of range",
    "time not increasing",
    "position jumps",
    "torque or current of several joints jumps",
)
_KEPT: Final = len(_REASONS)


class WrongUnit(RecordingError):
    """Numbers that are in another unit than assumed.

    Attributes:
        factors: Factor to the assumed unit, by quantity.
    """

    def __init__(self, message: str, factors: Mapping[str, float]) -> None:
        super().__init__(message)
        self.factors = factors


class GarbageFilter:
    """Passes on valid rows, and counts the others by reason.

    Dropped are rows with values that are not finite or impossibly large, equal to the row before, with a time stamp
    that is far from all others or does not increase, with a position that jumps away from its neighbours and back, and
    with a torque or current that does so on several joints, if there are many of them. Positions that were recorded
    modulo one turn go on.

    Args:
        path: Name of the recording in messages.
        with_effort: Whether a recording without torque and current is refused.

    Attributes:
        path: Name of the recording in messages.
        reasons: Rows dropped so far, by reason.
    """

    def __init__(self, path: Path, *, with_effort: bool = True) -> None:
        self.path, self._with_effort = path, with_effort
        self._waiting: list[RowBlock] = []
        self._before: RowBlock | None = None
        self._interval_s: float | None = None
        self._turned_rad: FloatArray | float = 0.0
        self.reasons: Counter[str] = Counter()

    def valid(self, blocks: Iterable[RowBlock]) -> Iterator[RowBlock]:
        """The valid rows of a log.

        Args:
            blocks: Its rows, valid or not.

        Yields:
            Valid rows, with a delay.

        Raises:
            RecordingError: neither torque nor current, or a wrong unit.
        """
        for block in blocks:
            self._waiting.append(block)
            wanted = FIRST_WINDOW if self._interval_s is None else _WINDOW
            if sum(part.size for part in self._waiting) > wanted + _OVERLAP:
                yield self._judged(_OVERLAP)
        if self._waiting:
            yield self._judged(0)

    def require_enough(self, kept: int, rows_read: int, others: Mapping[str, int]) -> None:
        """Raise if too few rows of a log are usable.

        Args:
            kept: Number of usable rows.
            rows_read: Number of rows of the log, valid or not.
            others: Rows that were dropped by the reader, by reason.

        Raises:
            RecordingError: naming what was dropped and why.
        """
        if kept >= _SHORTEST_ROWS:
            return
        reasons = Counter(others) + self.reasons
        listed = ", ".join(f"{count} {reason}" for reason, count in reasons.items()) or "no row dropped"
        raise RecordingError(
            f"{self.path}: {kept} usable rows of {rows_read} ({listed}), expected {_SHORTEST_ROWS} or more. "
            "Check that the file is complete and that the columns are correct."
        )

    def _judged(self, left: int) -> RowBlock:
        """The valid ones of all waiting rows, except for the last `left`, which keep waiting."""
        rows = joined(self._waiting)
        first = self._interval_s is None
        if first and self._with_effort and rows.effort is None:
            raise RecordingError(
                f"{self.path}: the recording has neither motor current nor joint torque. "
                "Identification requires one of them: record 6078 or 6077, or name their columns."
            )
        if first:
            refuse_degrees(self.path, rows)
        window = rows if self._before is None else joined([self._before, rows])
        known = window.size - rows.size
        verdict, self._interval_s = _reasons_to_drop(window, self._interval_s)
        if first:
            refuse_clock_that_started_again(self.path, window.time_s, verdict == _REASONS.index("time not increasing"))
        if first and np.count_nonzero(verdict == _KEPT) > 1:
            refuse_time_unit(self.path, self._interval_s)
            valid = np.flatnonzero(verdict == _KEPT)
            refuse_creeping(self.path, self._interval_s, window.time_s[valid], window.position_rad[valid])
        settled = rows.size - left
        verdict = verdict[known : known + settled]
        if self._before is not None:
            late = rows.time_s[:settled] <= self._before.time_s[-1]
            verdict[late & (verdict == _KEPT)] = _REASONS.index("time not increasing")
        self.reasons += Counter({reason: int(np.sum(verdict == code)) for code, reason in enumerate(_REASONS)})
        good = verdict == _KEPT
        kept = rows.rows(slice(0, settled)) if good.all() else rows.rows(np.flatnonzero(good))
        self._waiting = [rows.rows(slice(settled, None))] if left else []
        recent = kept if self._before is None else joined([self._before, kept])
        kept = self._without_turns(kept, recent, first)
        if recent.size:
            self._before = recent.rows(slice(max(recent.size - _JUMP_WINDOW, 0), None))
        if first and kept.velocity_rad_s is not None and kept.size > 1:
            refuse_mixed_units(self.path, kept.time_s, kept.position_rad, kept.velocity_rad_s)
        return kept

    def _without_turns(self, kept: RowBlock, recent: RowBlock, first: bool) -> RowBlock:
        """The rows, the last of the recent ones, with positions that go on where they were recorded modulo one turn."""
        rows = recent.rows(slice(max(recent.size - kept.size - 1, 0), None))
        turns = -np.round(np.diff(rows.position_rad, axis=0) / _TURN_RAD)
        turns[np.diff(rows.time_s) > _LONGEST_INTERVAL_S] = 0.0  # long enough to turn that far
        if first and turns.any():
            self._turned_rad = np.where(turns.any(axis=0), -_TURN_RAD * np.round(rows.position_rad[0] / _TURN_RAD), 0.0)
        if not (turns.any() or np.any(self._turned_rad)):
            return kept
        turned_rad = self._turned_rad + _TURN_RAD * np.cumsum(np.pad(turns, ((1, 0), (0, 0))), axis=0)[-kept.size :]
        self._turned_rad = turned_rad[-1]
        return replace(kept, position_rad=kept.position_rad + turned_rad)


def _reasons_to_drop(rows: RowBlock, interval_s: float | None) -> tuple[NDArray[np.intp], float]:
    """(N,) index of the reason to drop each row, `_KEPT` for valid rows, and the sampling interval in s."""
    verdict = np.full(rows.size, _KEPT)
    kept = np.arange(rows.size)

    def drop(bad: NDArray[np.bool_], reason: str) -> None:
        nonlocal kept
        if bad.any():
            verdict[kept[bad]] = _REASONS.index(reason)
            kept = kept[~bad]

    measured = {name: values for name in _ABSURD if (values := getattr(rows, name)) is not None}
    # The maximum per quantity clears nearly all windows; the comparison is also False for NaN.
    suspect = {
        name: values for name, values in measured.items() if not np.abs(values).max(initial=0.0) <= _ABSURD[name]
    }
    drop(~np.isfinite(rows.time_s), "not finite")
    for values in suspect.values():
        drop(~np.isfinite(values[kept]).all(axis=1), "not finite")
    for name, values in suspect.items():
        drop((np.abs(values[kept]) > _ABSURD[name]).any(axis=1), "impossible value")
    time_s = rows.time_s
    again = np.diff(time_s[kept], prepend=np.nan) == 0.0
    for values in measured.values() if again.any() else ():
        again[1:] &= (values[kept[1:]] == values[kept[:-1]]).all(axis=1)
    drop(again, "same as the row before")
    if interval_s is None:
        interval_s = float(np.median(np.abs(np.diff(time_s[kept])))) if kept.size > 1 else 0.0
    span_s = 60.0 + 3.0 * interval_s * kept.size
    middle_s = np.median(time_s[kept]) if kept.size else 0.0
    drop(np.abs(time_s[kept] - middle_s) > span_s, "time out of range")
    backwards = np.ones(kept.size, dtype=bool)
    backwards[_longest_increasing(time_s[kept])] = False
    drop(backwards, "time not increasing")
    if kept.size >= _JUMP_WINDOW:
        reach_rad = _FASTEST_RAD_S * max(interval_s, 1e-3) * (_JUMP_WINDOW // 2)
        drop(_jumps(rows.position_rad[kept], reach_rad), "position jumps")
        if rows.effort is not None:
            drop(_spikes(rows.effort[kept]), "torque or current of several joints jumps")
    return verdict, interval_s


def _jumps(position: FloatArray, reach_rad: float) -> NDArray[np.bool_]:
    """(N,) True for rows in which a joint is further than `reach_rad` from the median of its neighbours."""
    # Such a row has a step of at least a tenth of that distance among its neighbours; nearly all logs have none.
    steps = np.abs(np.diff(position, axis=0)) > reach_rad / (_JUMP_WINDOW - 1)
    near = np.arange(-_JUMP_WINDOW, _JUMP_WINDOW + 1)
    return _from_neighbours(position, steps, near, _JUMP_WINDOW, reach_rad, 1)


def _spikes(effort: FloatArray) -> NDArray[np.bool_]:
    """(N,) True for rows in which the (N, n) efforts of two joints or more are far from those of their neighbours."""
    step = np.abs(np.diff(effort, axis=0))
    usual_step = np.percentile(step, 90.0, axis=0)
    far = np.where(usual_step > 0.0, _SPIKE * usual_step, np.inf)
    spikes = _from_neighbours(effort, step > far, np.arange(2), _SPIKE_WINDOW, far, min(2, effort.shape[1]))
    return spikes & (np.mean(spikes) > _SPIKES)


def _from_neighbours(
    values: FloatArray, steps: NDArray[np.bool_], near: NDArray[np.intp], window: int, far: Any, joints: int
) -> NDArray[np.bool_]:
    """(N,) True where that many joints' (N, n) values are far from the median of a window, near (N - 1, n) steps."""
    found = np.zeros(len(values), dtype=bool)
    at = np.flatnonzero(np.count_nonzero(steps, axis=1) >= joints) if steps.any() else np.zeros(0, dtype=np.intp)
    if at.size:
        rows = np.unique(np.clip(at[:, None] + near, 0, len(values) - 1))
        padded = np.pad(values, ((window // 2, window // 2), (0, 0)), mode="edge")
        usual = np.median(sliding_window_view(padded, window, axis=0)[rows], axis=-1)
        found[rows] = np.count_nonzero(np.abs(values[rows] - usual) > far, axis=1) >= joints
    return found


def _longest_increasing(values: FloatArray) -> NDArray[np.intp]:
    """Indices of the longest strictly increasing subsequence: one wrong stamp costs one row, not the rest."""
    if (np.diff(values) > 0.0).all():
        return np.arange(values.size)
    known = values.tolist()
    ends: list[int] = []  # of a subsequence of each length, the one with the least last value
    before: list[int] = []
    for index, value in enumerate(known):
        length = bisect.bisect_left(ends, value, key=known.__getitem__)
        before.append(ends[length - 1] if length else -1)
        ends[length : length + 1] = [index]
    chain = [ends[-1]]
    while before[chain[-1]] >= 0:
        chain.append(before[chain[-1]])
    return np.array(chain[::-1], dtype=np.intp)


def refuse_degrees(path: Path, rows: RowBlock) -> None:
    """Raise `WrongUnit` for joint angles of several turns in many rows, which are degrees."""
    finite = rows.position_rad[np.isfinite(rows.position_rad).all(axis=1)]
    reach = np.abs(np.percentile(finite, [5.0, 95.0], axis=0)).max() if finite.size else 0.0
    if reach <= _LARGEST_ANGLE_RAD:
        return
    velocity = rows.velocity_rad_s
    alike = velocity is not None and 0.8 < _speed_ratio(rows.time_s, rows.position_rad, velocity) < 1.25
    raise WrongUnit(
        f"{path}: joint positions reach {reach:.0f}, expected radians within +-{_LARGEST_ANGLE_RAD:.0f}. They look "
        "like degrees: convert them.",
        dict.fromkeys(["position_rad", "velocity_rad_s"] if alike else ["position_rad"], DEGREE_RAD),
    )


def refuse_clock_that_started_again(path: Path, time_s: FloatArray, dropped: NDArray[np.bool_]) -> None:
    """Raise if (N,) times go back for long: the rows that remain would be of two motions, and look like one."""
    for begin, end in np.flatnonzero(np.diff(np.pad(dropped, 1))).reshape(-1, 2):
        steps_s = np.diff(time_s[max(begin - 1, 0) : end + 1])
        if end - begin > _CLOCK_SET_BACK * dropped.size and steps_s.min() < 0.0 < np.median(steps_s):
            row = max(begin - 1, 0) + int(np.argmin(steps_s)) + 2
            raise RecordingError(
                f"{path}: the time stamps start again at row {row} of {dropped.size}, {-steps_s.min():.3g} s earlier "
                "than the row before. The recording contains several runs: give each its own file."
            )


def refuse_time_unit(path: Path, interval_s: float) -> None:
    """Raise `WrongUnit` if the median interval (s) is not in seconds: no arm is recorded at 1 Hz or 1 MHz."""
    if _SHORTEST_INTERVAL_S <= interval_s <= _LONGEST_INTERVAL_S:
        return
    low, high = _USUAL_INTERVAL_S
    unit = next((name for name, second in _TIME_UNITS.items() if low <= interval_s * second <= high), None)
    advice = "Check the column of the time stamps." if unit is None else f"They look like {unit}: convert them."
    raise WrongUnit(
        f"{path}: the interval of the time stamps is {interval_s:.3g}, expected seconds, from "
        f"{_SHORTEST_INTERVAL_S:g} to {_LONGEST_INTERVAL_S:g}. {advice}",
        {} if unit is None else {"time_s": _TIME_UNITS[unit]},
    )


def refuse_creeping(path: Path, interval_s: float, time_s: FloatArray, position: FloatArray) -> None:
    """Raise `WrongUnit` for stamps in ms of so fast a log that their median interval could be one in s.

    The joints' (N, n) positions, in rad, change far, but with (N,) times in s at speeds of no motion.
    """
    if interval_s <= _USUAL_INTERVAL_S[1] or len(position) < 2 * _MEDIAN_ROWS:
        return
    position = np.median(sliding_window_view(position, _MEDIAN_ROWS, axis=0), axis=-1)
    step_s = np.diff(time_s[_MEDIAN_ROWS // 2 : _MEDIAN_ROWS // 2 + len(position)])
    fastest = float((np.abs(np.diff(position, axis=0)) / step_s[:, None]).max())
    if np.ptp(position, axis=0).max() > _MOVED_FAR_RAD and fastest < _CREEP_RAD_S:
        raise WrongUnit(
            f"{path}: the interval of the time stamps is {interval_s:.3g}, and no joint moves faster than "
            f"{fastest:.2g} rad/s. The time stamps look like milliseconds: convert them to seconds.",
            {"time_s": 1e-3},
        )


def refuse_mixed_units(path: Path, time_s: FloatArray, position: FloatArray, velocity: FloatArray) -> None:
    """Raise `WrongUnit` if (N, n) positions, velocities and (N,) times are not all in rad, rad/s and s."""
    ratio = _speed_ratio(time_s, position, velocity)
    for unit, second in _TIME_UNITS.items():
        if 0.8 < ratio / second < 1.25:
            raise WrongUnit(
                f"{path}: the positions change {ratio:.3g} times as fast as the velocities indicate. The time stamps "
                f"look like {unit}: convert them to seconds.",
                {"time_s": second},
            )
    if 0.8 < ratio * DEGREE_RAD < 1.25 or 0.8 < ratio / DEGREE_RAD < 1.25:
        wrong, quantity = ("positions", "position_rad") if ratio > 1.0 else ("velocities", "velocity_rad_s")
        raise WrongUnit(
            f"{path}: the positions change {ratio:.3g} times as fast as the velocities indicate. The {wrong} look like "
            "degrees: convert them to radians.",
            {quantity: DEGREE_RAD},
        )


def _speed_ratio(time_s: FloatArray, position: FloatArray, velocity: FloatArray) -> float:
    """How much faster the (N, n) positions change over the (N,) times than the velocities say; 1 without motion."""
    moved = np.nansum(np.abs(np.diff(position, axis=0)))
    reported = np.nansum(np.abs(0.5 * (velocity[1:] + velocity[:-1]) * np.diff(time_s)[:, None]))
    return float(moved / reported) if reported > 0.0 else 1.0
