"""Which rows of a log can be right: garbage is left out and counted, a wrong unit is refused."""

from __future__ import annotations

import bisect
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import RecordingError

_ABSURD: Final = {"position_rad": 1e3, "velocity_rad_s": 1e3, "current_a": 1e4, "torque_nm": 1e6}
"""Magnitudes that no joint of an arm has, in any unit somebody may have used."""
_FASTEST_RAD_S: Final = 50.0
_JUMP_WINDOW: Final = 11
_LARGEST_ANGLE_RAD: Final = 6.0 * np.pi
"""Joints that turn further are logged modulo their turn; above this it is degrees."""


def plausible_rows(quantities: dict[str, FloatArray], reasons: dict[str, int]) -> NDArray[np.intp]:
    """Find the rows that can be right.

    Left out are rows that are not finite, hold impossible magnitudes, have a time stamp far from all others
    or one that does not increase, and rows whose position jumps away from its neighbours and back.

    Args:
        quantities: "time_s" (N, 1) and per quantity (N, n).
        reasons: The count of rows left out is added here, by reason.

    Returns:
        Indices of the rows to keep, in order.
    """
    time_s = quantities["time_s"][:, 0]
    kept = np.arange(time_s.size)

    def drop(bad: NDArray[np.bool_], reason: str) -> None:
        nonlocal kept
        if bad.any():
            reasons[reason] = int(bad.sum())
            kept = kept[~bad]

    finite = np.ones(time_s.size, dtype=bool)
    for values in quantities.values():
        finite &= np.isfinite(values).all(axis=1)
    drop(~finite, "not finite")
    absurd = np.zeros(kept.size, dtype=bool)
    for name, bound in _ABSURD.items():
        if name in quantities:
            absurd |= (np.abs(quantities[name][kept]) > bound).any(axis=1)
    drop(absurd, "impossible value")
    if not kept.size:
        return kept
    interval_s = float(np.median(np.abs(np.diff(time_s[kept])))) if kept.size > 1 else 0.0
    span_s = 60.0 + 3.0 * interval_s * kept.size
    drop(np.abs(time_s[kept] - np.median(time_s[kept])) > span_s, "time out of range")
    increasing = _longest_increasing(time_s[kept])
    dropped = np.setdiff1d(np.arange(kept.size), increasing)
    repeated = np.zeros(kept.size, dtype=bool)
    repeated[dropped] = np.isin(time_s[kept][dropped], time_s[kept][increasing])
    backwards = np.zeros(kept.size, dtype=bool)
    backwards[dropped] = ~repeated[dropped]
    drop(repeated | backwards, "time not increasing")
    if kept.size >= _JUMP_WINDOW:
        position = quantities["position_rad"][kept]
        usual = median_filter(position, size=(_JUMP_WINDOW, 1), mode="nearest")
        reach_rad = _FASTEST_RAD_S * max(interval_s, 1e-3) * (_JUMP_WINDOW // 2)
        drop((np.abs(position - usual) > reach_rad).any(axis=1), "position jumps")
    return kept


def _longest_increasing(values: FloatArray) -> NDArray[np.intp]:
    """Indices of the longest strictly increasing subsequence: one wild stamp costs one row, not the rest."""
    if (np.diff(values) > 0.0).all():
        return np.arange(values.size)
    tails: list[float] = []
    tail_index: list[int] = []
    previous = np.full(values.size, -1, dtype=np.intp)
    for index, value in enumerate(values.tolist()):
        length = bisect.bisect_left(tails, value)
        if length == len(tails):
            tails.append(value)
            tail_index.append(index)
        else:
            tails[length] = value
            tail_index[length] = index
        previous[index] = tail_index[length - 1] if length else -1
    chain = []
    index = tail_index[-1]
    while index >= 0:
        chain.append(index)
        index = int(previous[index])
    return np.array(chain[::-1], dtype=np.intp)


def refuse_degrees(path: Path, position: FloatArray) -> None:
    """Refuse joint angles of several turns in many rows: they are degrees.

    Args:
        path: The file, for the message.
        position: (N, n) positions that should be in rad.

    Raises:
        RecordingError: naming what was found and expected.
    """
    finite = position[np.isfinite(position).all(axis=1)]
    if finite.size and np.abs(np.percentile(finite, [5.0, 95.0], axis=0)).max() > _LARGEST_ANGLE_RAD:
        raise RecordingError(
            f"{path}: joint positions reach {np.abs(np.percentile(finite, [5.0, 95.0], axis=0)).max():.0f}, "
            f"expected radians within +-{_LARGEST_ANGLE_RAD:.0f}. They look like degrees: convert them."
        )


def refuse_mixed_units(path: Path, time_s: FloatArray, position: FloatArray, velocity: FloatArray) -> None:
    """Refuse positions and velocities of one recording that are not in the same unit.

    Args:
        path: The file, for the message.
        time_s: (N,) time stamps.
        position: (N, n) positions that should be in rad.
        velocity: (N, n) velocities that should be in rad/s.

    Raises:
        RecordingError: one of the two is in degrees.
    """
    step_s = np.diff(time_s)
    moved = np.abs(np.diff(position, axis=0)).sum()
    told = np.abs(0.5 * (velocity[1:] + velocity[:-1]) * step_s[:, None]).sum()
    ratio = moved / told if told > 0.0 else 1.0
    degree = np.pi / 180.0
    if 0.8 < ratio * degree < 1.25 or 0.8 < ratio / degree < 1.25:
        wrong = "positions" if ratio > 1.0 else "velocities"
        raise RecordingError(
            f"{path}: the positions change {ratio:.3g} times as fast as the velocities say. "
            f"The {wrong} look like degrees: convert them to radians."
        )
