"""Summary of a recording from any source, and of what is missing to identify a payload from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import IdentificationError
from armload_identification.recording.recording import Recording
from armload_identification.recording.reduction.phase_advance import interruptions, measured_periods
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import load_signal
from armload_identification.signals.recorded_run import Run
from armload_identification.signals.repetition import repeated_after
from armload_identification.verdict.recording_checks.effort_mismatch import (
    EFFORT_NAMES,
    effort_used,
    require_same_effort,
)

_GAP_INTERVALS: Final = 3.0
"""Multiple of the median interval from which two rows have a gap between them."""
_MOVES_RAD_S: Final = 0.01
_MOVES_RAD: Final = 0.01
_SLOWEST_HZ: Final = 20.0


@dataclass(frozen=True, eq=False)
class RecordingSurvey:
    """Facts about one recording.

    Attributes:
        duration_s: From its first to its last row.
        rate_hz: Rows per second, from the median interval.
        holes: Number of gaps: rows further apart than three intervals.
        longest_hole_s: The longest gap; 0 without any.
        position_rad: (n, 2) least and greatest position of each joint.
        speed_rad_s: (n,) speed of each joint that 99.9 % of the rows do not exceed: single steps do not count.
        effort: (n, 2) least and greatest torque or current; None without either.
        moving_s: Start and end of the motion since the first row; None if the arm does not move.
        period_s: Period of the motion, from its excitation or its repetition; None if it is not periodic.
        periods: Number of whole periods; 0 without a period. Of an interrupted run, how often every part was measured.
        interruptions: How often it was paused or slowed down within the periods of its excitation.
        missing: What is missing to identify a payload from it, one phrase each.
    """

    recording: Recording
    duration_s: float
    rate_hz: float
    holes: int
    longest_hole_s: float
    position_rad: FloatArray
    speed_rad_s: FloatArray
    effort: FloatArray | None
    moving_s: tuple[float, float] | None
    period_s: float | None
    periods: int
    interruptions: int
    missing: tuple[str, ...]

    @property
    def effort_kind(self) -> str | None:
        """Kind of the effort: "joint torque", "motor current", or None."""
        return None if self.effort is None else EFFORT_NAMES[effort_used(self.recording)]


def survey(recording: Recording) -> RecordingSurvey:
    """Summarise a recording.

    Args:
        recording: The recording; it may lack torque and current.
    """
    time_s, position = recording.time_s, recording.position_rad
    step_s = np.diff(time_s)
    interval_s = float(np.median(step_s))
    holes = step_s[step_s > _GAP_INTERVALS * interval_s]
    speed = np.abs(np.diff(position, axis=0)) / step_s[:, None]
    # Over a tenth of a second, so that encoder noise does not count as motion.
    window = max(round(0.1 / interval_s), 1)
    slow = np.abs(position[window:] - position[:-window]).max(axis=1) / (window * interval_s)
    moving = np.flatnonzero(slow > _MOVES_RAD_S) if (np.ptp(position, axis=0) > _MOVES_RAD).any() else np.zeros(0, int)
    moving_s = None
    if moving.size:
        moving_s = float(time_s[moving[0]] - time_s[0]), float(time_s[moving[-1] + window] - time_s[0])
    period_s, periods = _period_of(recording, moving_s)
    interrupted = interruptions(recording)
    duration_s = float(time_s[-1] - time_s[0])
    if recording.average is not None and recording.excitation is not None:
        duration_s = recording.average.periods * recording.excitation.trajectory.period_s
    effort = recording.effort
    return RecordingSurvey(
        recording=recording,
        duration_s=duration_s,
        rate_hz=1.0 / interval_s,
        holes=int(holes.size),
        longest_hole_s=float(holes.max(initial=0.0)),
        position_rad=np.stack([position.min(axis=0), position.max(axis=0)], axis=1),
        speed_rad_s=np.percentile(speed, 99.9, axis=0),
        effort=None if effort is None else np.stack([effort.min(axis=0), effort.max(axis=0)], axis=1),
        moving_s=moving_s,
        period_s=period_s,
        periods=periods,
        interruptions=interrupted,
        missing=_missing(recording, interval_s, moves=moving_s is not None, measured=not interrupted or periods > 0),
    )


def pair_mismatch(loaded: Recording, unloaded: Recording) -> str | None:
    """Why two recordings are not a pair of the same motion and quantities; None if they are.

    Args:
        loaded: Run with the payload.
        unloaded: Run without it.
    """
    try:
        load_signal(*(Run.of(run, Transmission(np.ones(run.n), np.eye(run.n))) for run in (loaded, unloaded)))
        require_same_effort(loaded, unloaded)
    except IdentificationError as problem:
        return str(problem)
    return None


def _period_of(recording: Recording, moving_s: tuple[float, float] | None) -> tuple[float | None, int]:
    """Period and whole periods of a motion."""
    if recording.excitation is not None:
        return recording.excitation.trajectory.period_s, measured_periods(recording)
    if moving_s is None:
        return None, 0
    elapsed = recording.time_s - recording.time_s[0]
    inside = (elapsed >= moving_s[0]) & (elapsed <= moving_s[1])
    period_s = repeated_after(elapsed[inside], recording.position_rad[inside])
    return period_s, 0 if period_s is None else int((moving_s[1] - moving_s[0]) / period_s + 0.01)


def _missing(recording: Recording, interval_s: float, *, moves: bool, measured: bool) -> tuple[str, ...]:
    """Reasons why a recording cannot be used; `measured`: every part of the period was, if it was interrupted."""
    missing = []
    if recording.effort is None:
        missing.append("joint torque or motor current: record 6077 or 6078, or the effort of the joints")
    elif (np.ptp(recording.effort, axis=0) == 0.0).all():
        missing.append("a torque or current that changes: every column is constant")
    if not moves:
        missing.append("motion: no joint moves")
    if interval_s * _SLOWEST_HZ > 1.0:
        missing.append(f"rows: {1.0 / interval_s:.3g} per second, {_SLOWEST_HZ:g} or more are recommended")
    if not measured:
        missing.append("a part of the period at full speed: in every period the run was paused or slowed down there")
    if recording.source.truncated:
        missing.append("its end: the file is truncated")
    return tuple(missing)
