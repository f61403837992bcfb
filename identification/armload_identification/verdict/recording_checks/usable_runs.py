"""The first gate: whether recordings can be used. Every check raises for one mistake and names its remedy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.reading_options import Effort
from armload_identification.recording.recording import Recording, check_joints
from armload_identification.signals.joint_torque import Transmission, reported_effort
from armload_identification.signals.recorded_run import Run
from armload_identification.verdict.decision_levels import Correlations, RunLevels
from armload_identification.verdict.joint_words import numbered_joints
from armload_identification.verdict.recording_checks.effort_mismatch import require_effort, require_same_effort


def usable_runs(
    recordings: Sequence[Recording], n: int, transmission: Transmission, effort: Effort | None = None
) -> list[Run]:
    """The runs of recordings; raises for recordings that cannot be used.

    Args:
        recordings: One, or a loaded and an unloaded one.
        n: Number of joints of the arm.
        transmission: Gains, and coupling.
        effort: The quantity that the arm was calibrated with; None if it was not calibrated.

    Raises:
        RecordingError: another arm's recording, or one with another quantity than the calibration's; two runs that are
            mixed up; no motion; a velocity that is not the position's, or a torque column that is constant, absolute,
            stuck for a part of the run, saturated, or of the wrong sign.
    """
    checks = [partial(check_joints, n=n), *([] if effort is None else [partial(require_effort, effort=effort)])]
    for recording in recordings:
        for of_recording in checks:
            of_recording(recording)
    if len(recordings) == 2:
        for of_both in PAIR_CHECKS:
            of_both(*recordings)
        recordings = [recordings[0], _on_the_turns_of(*recordings)]
    runs = [Run.of(recording, transmission) for recording in recordings]
    for run in runs:
        for of_one in RUN_CHECKS:
            of_one(run)
    return runs


def _moves(run: Run) -> NDArray[np.bool_]:
    """(n,) True for joints that evidently move."""
    return np.asarray(np.ptp(run.recording.position_rad, axis=0) > RunLevels.evident_travel_rad)


def _on_the_turns_of(loaded: Recording, unloaded: Recording) -> Recording:
    """The unloaded run, with joints whole turns away from the loaded run's, where the same torque holds, on theirs."""
    apart = np.median(loaded.position_rad, axis=0) - np.median(unloaded.position_rad, axis=0)
    turns = np.round(apart / (2.0 * np.pi))
    if not turns.any() or unloaded.average is not None:
        return unloaded
    return replace(unloaded, position_rad=unloaded.position_rad + 2.0 * np.pi * turns)


def _refuse_the_same_file(loaded: Recording, unloaded: Recording) -> None:
    if loaded.source.sha256 == unloaded.source.sha256:
        raise RecordingError(
            f"{loaded.source.path} and {unloaded.source.path} are the same recording. Give one run with and one run "
            "without the payload."
        )


def _refuse_exchanged_labels(loaded: Recording, unloaded: Recording) -> None:
    labels = (loaded.source.run().get("load"), unloaded.source.run().get("load"))
    if labels[0] == "unloaded" != labels[1] or labels[1] == "loaded":
        raise RecordingError(
            f"{loaded.source.path} was recorded as '{labels[0]}' and {unloaded.source.path} as '{labels[1]}'. "
            "Exchange the two files."
        )


def _refuse_long_means(run: Run) -> None:
    """Raise for a run so long that its means attenuate the motion: at f, by (pi f T)^2 / 6 of the amplitude."""
    rows = run.recording
    if rows.repeats is None or rows.average is not None:
        return
    steps = np.diff(rows.position_rad, axis=0)
    change = np.mean(np.diff(steps, axis=0) ** 2)
    lost = float(change / max(float(np.mean(steps**2)), np.finfo(float).tiny)) / 24.0
    if lost > RunLevels.lost_to_means:
        mean_s = float(np.median(np.diff(rows.time_s)))
        hours = (rows.time_s[-1] - rows.time_s[0]) / 3600.0
        raise RecordingError(
            f"{rows.source.path}: {hours:.1f} h without a known excitation were reduced to means over "
            f"{1e3 * mean_s:.0f} ms, which reduces the motion's amplitude by about {100.0 * lost:.0f} %. Select a part "
            "of it with `between_s=`, such as its first 600 s."
        )


def _refuse_velocity(run: Run) -> None:
    """Raise for a velocity that is not the derivative of the position, or is so in degrees."""
    rows = run.recording
    if rows.velocity_rad_s is None or rows.average is not None:
        return
    change, expected, size = _changes(rows, np.nan_to_num(rows.velocity_rad_s))
    moves = _moves(run) & (size > 0.0)
    strange = moves & (np.sum(change * expected, axis=0) < Correlations.derivative * size)
    if strange.any():
        raise RecordingError(
            f"{rows.source.path}: the velocity of {numbered_joints(strange)} is not the derivative "
            "of its position. Columns of position and velocity are exchanged, in another joint order, or of "
            "another sign: correct the column map."
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.sum(change**2, axis=0) / np.sum(change * expected, axis=0)
    follows = moves & (np.sum(change * expected, axis=0) > Correlations.same * size)
    for what, factor in (("positions", 180.0 / np.pi), ("velocities", np.pi / 180.0)):
        degrees = follows & (np.abs(np.log(np.where(follows, times, 1.0) / factor)) < RunLevels.degree_within)
        for joint in np.flatnonzero(degrees):
            raise RecordingError(
                f"{rows.source.path}: joint {joint + 1} moves {times[joint]:.3g} times as fast as its velocity "
                f"indicates. Its {what} look like degrees: convert them to radians."
            )


def _refuse_velocity_as_effort(run: Run) -> None:
    """Raise for a current or torque that is the derivative of the position on every joint."""
    if run.recording.average is None:
        change, expected, size = _changes(run.recording, reported_effort(run.recording))
        follows = np.sum(change * expected, axis=0) > Correlations.velocity * size
        if _moves(run).sum() > 1 and follows[_moves(run)].all():
            raise RecordingError(
                f"{run.recording.source.path}: the current or torque of every joint is the derivative of its "
                "position: these columns are velocities. Correct the column map."
            )


def _changes(run: Recording, rate: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Changes of position in parts of a run and the integral of a (N, n) rate, without means, and (n,) their size.

    Noise hardly affects them.
    """
    step_s = np.diff(run.time_s)[:, None]
    whole = step_s < RunLevels.gap * np.median(step_s)
    steps = np.diff(run.position_rad, axis=0), 0.5 * (rate[1:] + rate[:-1]) * step_s
    starts = np.arange(0, len(step_s), max(len(step_s) // RunLevels.velocity_parts, 1))
    change, expected = (np.add.reduceat(whole * step, starts, axis=0) for step in steps)
    change, expected = change - change.mean(axis=0), expected - expected.mean(axis=0)
    return change, expected, np.sqrt(np.sum(change**2, axis=0) * np.sum(expected**2, axis=0))


def _refuse_constant(run: Run) -> None:
    """Raise for a joint that moves while its torque does not change at all."""
    measured = reported_effort(run.recording)
    for joint in np.flatnonzero(_moves(run) & (np.ptp(measured, axis=0) == 0.0)):
        raise RecordingError(
            f"{run.recording.source.path}: joint {joint + 1} moves, but its current or torque is constant at "
            f"{measured[0, joint]:g}. Check the mapping of its 6077 or 6078, or the column map."
        )


def _refuse_copies(run: Run) -> None:
    """Raise for two joints with the same positions or efforts in all rows, unless all that move are alike."""
    pairs = list(combinations(np.flatnonzero(_moves(run)).tolist(), 2))
    for what, values in (("positions", run.recording.position_rad), ("efforts", reported_effort(run.recording))):
        same = [joints for joints in pairs if np.array_equal(*values.T[list(joints)])]
        if 0 < len(same) < len(pairs):
            raise RecordingError(
                f"{run.recording.source.path}: the {what} of joints {same[0][0] + 1} and {same[0][1] + 1} are the same "
                "in all rows: a column was taken twice. Correct the column map."
            )


def _refuse_zeros(run: Run) -> None:
    """Raise for efforts that are exactly 0 in many rows between two far from it: values that are missing."""
    effort = reported_effort(run.recording)
    size, step = np.abs(effort), np.abs(np.diff(effort, axis=0))
    unit = np.where(step > 0.0, step, np.inf).min(axis=0)
    far = size > np.maximum(RunLevels.far_share * size.max(axis=0), RunLevels.far_units * unit)
    missing = np.mean((size[1:-1] == 0.0) & far[:-2] & far[2:], axis=0)
    for joint in np.flatnonzero(missing > RunLevels.missing_share):
        raise RecordingError(
            f"{run.recording.source.path}: the current or torque of joint {joint + 1} is 0 in "
            f"{100.0 * missing[joint]:.2g} % of the rows, between values far from 0: it is missing. Leave it empty."
        )


def _refuse_absolute(run: Run) -> None:
    """Raise for torques that come to zero and never cross it: friction alone changes their sign at each reversal."""
    measured = reported_effort(run.recording)[:, _moves(run)]
    reaches_zero = measured.min(axis=0) < RunLevels.zero_share * measured.max(axis=0)
    if (measured >= 0.0).all() and reaches_zero.sum() > 1:
        raise RecordingError(
            f"{run.recording.source.path}: no joint's current or torque is ever negative, although some come to zero: "
            "absolute values were recorded. Record them with their sign."
        )


def _refuse_saturation(run: Run) -> None:
    """Raise for a run in which a moving joint's torque stays at its greatest value, longer than at any other."""
    rows, repeats = run.recording, run.repeats
    by_chance = np.maximum(RunLevels.saturated_repeats, RunLevels.saturated_over_others * repeats.elsewhere)
    for joint in np.flatnonzero(_moves(run) & (repeats.at_bound >= by_chance)):
        raise RecordingError(
            f"{rows.source.path}: joint {joint + 1} stays at its maximum of {repeats.bound[joint]:.4g} for "
            f"{repeats.at_bound[joint] + 1:.0f} samples in a row: the drive or the measurement is saturated, so the "
            "true torque is unknown. Record a slower run, or raise the drive's current limit."
        )


def _refuse_stuck(run: Run) -> None:
    """Raise for a run in which a joint moves back and forth while its torque stays the same: friction would change."""
    rows, repeats = run.recording, run.repeats
    far_rad = np.maximum(RunLevels.evident_travel_rad, RunLevels.stuck_share * np.ptp(rows.position_rad, axis=0))
    for joint in np.flatnonzero(_moves(run) & (repeats.turned_rad > far_rad)):
        raise RecordingError(
            f"{rows.source.path}: joint {joint + 1} moves back and forth by {repeats.turned_rad[joint]:.2g} rad, but "
            f"its current or torque stays at {repeats.turned_at[joint]:.4g} for {repeats.turned_for[joint]:.0f} "
            "samples in a row: an old value was recorded repeatedly. Record the run again, or select a part without it "
            "with `between_s=`."
        )


def _refuse_fed_energy(run: Run) -> None:
    """Raise for motors that absorb energy over a run that ends where it began: friction dissipates it.

    Only their sum counts: a single joint can receive any amount of energy from the others over a cycle.
    """
    rows, closed = run.recording, _closed_part(run)
    torque, step = run.torque_nm[closed], np.diff(rows.position_rad[closed], axis=0)
    work = 0.5 * (torque[1:] + torque[:-1]) * step
    if _moves(run).any() and work.sum() < RunLevels.fed_energy * np.abs(work).sum():
        raise RecordingError(
            f"{rows.source.path}: the motors of {numbered_joints(_moves(run) & (work.sum(axis=0) < 0.0))} absorb "
            "energy overall, although friction should dissipate it. The sign of the current or torque is flipped: "
            "correct it in the drive (607E) or the recording."
        )


def _closed_part(run: Run) -> NDArray[np.intp]:
    """Rows of a closed motion: whole periods, else the entire run; none if it does not end where it began."""
    rows = run.recording
    if rows.phase_s is not None and rows.excitation is not None:
        inside = np.flatnonzero(np.isfinite(rows.phase_s))
        length_s = run.periods * rows.excitation.trajectory.period_s
        return inside[rows.phase_s[inside] <= rows.phase_s[inside[:1]] + length_s] if length_s else inside[:0]
    if (np.abs(rows.position_rad[-1] - rows.position_rad[0]) < RunLevels.evident_travel_rad).all():
        return np.arange(rows.time_s.size)
    return np.empty(0, dtype=np.intp)


PAIR_CHECKS = (require_same_effort, _refuse_the_same_file, _refuse_exchanged_labels)
RUN_CHECKS = (
    _refuse_long_means,
    _refuse_velocity,
    _refuse_velocity_as_effort,
    _refuse_constant,
    _refuse_copies,
    _refuse_zeros,
    _refuse_absolute,
    _refuse_saturation,
    _refuse_stuck,
    _refuse_fed_energy,
)
