"""Notes to the operator about an identification, one or two sentences each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.contradicted_gains import GainFit
from armload_identification.estimation.disturbances import Disturbance, Disturbances, Disturbed
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.estimation.empty_arm.unloaded_arm import BodyFit
from armload_identification.estimation.estimation_constants import Drift
from armload_identification.estimation.payload_change import Event, events_during
from armload_identification.estimation.payload_from_posterior import PayloadEstimate, gear_asymmetry
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.estimation.prior_knowledge import EXACT
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import DETERMINED_SHARE
from armload_identification.pipeline.identification_result import Identification
from armload_identification.recording.recording import RecordingSource
from armload_identification.signals.joint_torque import Gains
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.signals.motion import ABOVE_BAND, Motion
from armload_identification.signals.recorded_run import Run
from armload_identification.signals.signal_constants import SamePath, Smoothing
from armload_identification.verdict.decision_levels import ArmFit, PayloadChangeLevels, PayloadFit, Timing
from armload_identification.verdict.joint_words import listed, numbered_joints, remarked_joints
from armload_identification.verdict.recording_checks.column_mistakes import strange_joints
from armload_identification.verdict.recording_checks.friction_validity import friction_notes, standard_deviations

_DOUBTFUL: Final = "Mass and centre of mass may lie outside their intervals."
_CHECKED_BY: Final = "Several runs with a weighed payload show it: `armload calibrate`."


def notes_on(
    found: Identification,
    gains: Gains,
    arm: KnownArm | None,
    body: BodyFit | None = None,
) -> list[str]:
    """Notes on recordings, gains, signal and result.

    Args:
        gains: The gains that the runs' torques were computed with.
        arm: The calibrated arm, or None.
        body: The body fitted to the unloaded run, or None.
    """
    return [
        *_on_arm(found.signal, body),
        *misfit_notes(found),
        *_on_recordings(found.sources),
        *_on_interruptions(found.signal),
        *_on_times(found),
        *_on_paths(found.signal),
        *_on_nominal_gains(gains, found),
        *_on_contradictions(found.gains),
        *_on_signal(found.signal, found.struck),
        *_on_result(found),
        *_on_blows(found.signal.loaded, found.struck),
        *_on_calibrated_arm(found.plain, arm),
    ]


_STANDARD_GRAVITY_M_S2: Final = 9.80665
_CHECK: Final = {
    Disturbed.ZERO: "the joint's zero (a gear that gives way looks the same)",
    Disturbed.TILT: "the fastening of the base",
    Disturbed.HOSE: "hoses",
    Disturbed.PULL: "the clock (a wrong one looks like a vertical force)",
    Disturbed.FORCE: "what touches the arm",
}


def disturbance_notes(disturbances: Disturbances, since: str) -> Iterator[str]:
    """A note on what explains the rows: a joint's zero, the base, a hose, or a force.

    Args:
        disturbances: What the rows say of them.
        since: What the base would have tilted since.
    """
    if not (named := disturbances.named):
        return
    said = "The loaded run is as if " + ", or ".join(_disturbance_in_words(one, since) for one in named)
    if not disturbances.explanations:
        said += ". But that alone does not explain it, the cause may be another, and the intervals may not hold"
    elif any(one.of is not Disturbed.PULL for one in named):
        said += "; the intervals allow for that alone"
    checks = listed(list(dict.fromkeys(_CHECK[one.of] for one in named)))
    hangs = "".join(
        f" The mass may be {one.size / _STANDARD_GRAVITY_M_S2:.2g} kg too {'great' if one.error[0] > 0.0 else 'small'} "
        "by the vertical force, which the intervals do not contain."
        for one in named
        if one.of is Disturbed.PULL
    )
    yield f"{said}.{hangs} Check {checks}."


def _disturbance_in_words(one: Disturbance, since: str) -> str:
    """A disturbance, to be followed on from 'as if'."""
    half_width = NORMAL_HALF_WIDTH * one.deviation
    if one.of is Disturbed.PULL:
        way = "down" if one.error[0] > 0.0 else "up"
        return f"a force of {one.size:.1f} +- {half_width:.1f} N pulled the flange {way}"
    if one.of is Disturbed.FORCE:
        along = ", ".join(f"{force_n:+.1f}" for force_n in one.error)
        return f"a force of {one.size:.1f} +- {half_width:.1f} N pulled at the flange (base frame: {along} N)"
    if one.of is Disturbed.HOSE:
        does, way = ("held", "back to") if one.error[0] > 0.0 else ("pushed", "away from")
        middle = f"joint {one.joint + 1} {way} the middle of its travel"
        return f"a hose or cable {does} {middle}, with {one.size:.3g} +- {half_width:.2g} N m (RMS)"
    angle = f"{np.degrees(one.size):.2f} +- {np.degrees(half_width):.2f} deg"
    if one.of is Disturbed.TILT:
        return f"the base had tilted by {angle} since {since}"
    return f"joint {one.joint + 1} stood {angle} {'above' if one.error[0] > 0.0 else 'below'} its recorded position"


def _on_recordings(sources: Sequence[RecordingSource]) -> Iterator[str]:
    """Rows and joints that were left out, and truncated files."""
    for name, source in zip(("loaded", "unloaded"), sources, strict=False):
        if source.rows_dropped:
            listed = ", ".join(f"{count} {reason}" for reason, count in source.reasons.items())
            yield f"{name} recording: {source.rows_dropped} of {source.rows_read} rows dropped ({listed})."
        if source.truncated:
            yield f"{name} recording: the file is truncated; everything before that was used."
        if source.ignored_joints:
            yield (f"{name} recording: ignored, because not part of this arm: {', '.join(source.ignored_joints)}.")


def _on_interruptions(signal: LoadSignal) -> Iterator[str]:
    """Runs that were interrupted within their periods."""
    for name, run in (("loaded", signal.loaded), ("unloaded", signal.unloaded)):
        if run.periods and run.interruptions:  # a prediction has no periods
            often, least = (f"{count} times" if count > 1 else "once" for count in (run.interruptions, run.periods))
            yield (
                f"{name} recording: the run was continued, paused or slowed down {often} within its periods. What was "
                f"measured at full speed was used: every part of the period at least {least}."
            )


def _on_times(found: Identification) -> Iterator[str]:
    """A clock that is not that of the excitation, and torque that is not of the time of its position."""
    run = found.signal.loaded
    took_s, rate = len(run.time_s) * run.interval_s, run.rate
    if SamePath.period_share < abs(rate - 1.0) < Timing.other_speed_share:
        yield (
            f"A period took {took_s:.4g} s by the time stamps, {took_s / rate:.4g} s by the excitation: if the clock "
            "is wrong, so are accelerations and what follows from them. Check the time stamps."
        )
    delay_s = found.plain.posterior.delay_s
    if abs(delay_s) > Timing.late_s:
        yield (
            f"The torque belongs to positions {1e3 * abs(delay_s):.0f} ms {'before' if delay_s > 0.0 else 'after'} it. "
            f"{_DOUBTFUL} Check that torque and position have the same time stamps, and that neither is smoothed."
        )


def _on_paths(signal: LoadSignal) -> Iterator[str]:
    """Joints on which the positions of the two runs differ by more than a servo sags."""
    apart = signal.mismatch_rad > PayloadFit.apart_rad
    if joints := remarked_joints(apart, "{:.1f} deg RMS", np.degrees(signal.mismatch_rad)):
        yield (
            f"The positions of the two runs differ on {joints}, more than a servo sags by: a zero was moved, or the "
            f"runs were not commanded alike. {_DOUBTFUL} Check the zeros, and record both runs again."
        )


def _on_nominal_gains(gains: Gains, found: Identification) -> Iterator[str]:
    """Gains that were not calibrated: nothing weighed shows their scale, and no interval has their drift."""
    if gains.calibrated.all():
        return
    if gains.fitted:
        what = "Torques are as reported" if gains.from_torque else "Drive gains are nominal"
        each = 100.0 * NORMAL_HALF_WIDTH * float(np.sqrt(np.diag(gains.own_covariance).max()))
        allowed = f"The intervals allow for errors (95 %) of {each:.2g} % on each joint"
        if found.uncertainty.half_width_95[0] < 10.0 * EXACT * found.parameters.mass_kg:
            yield f"{what}, and the known mass sets their scale. {allowed}."
            return
        all_together = 100.0 * NORMAL_HALF_WIDTH * gains.common_deviation
        lost = float(found.plain.load_friction.max())
        uneven = 100.0 * NORMAL_HALF_WIDTH * float(gear_asymmetry(np.array([lost]))[0])
        way = f"if gears that lose {100.0 * lost:.0f} % of their load lose more in one direction than in the other"
        of_gears = f", and of {uneven:.0f} % {way}" if uneven >= 1.0 else ""
        shift_kg = Drift.between_runs * abs(float(found.plain.drifting[0]))
        yield (
            f"{what}: the scale is not verified, and an error that all joints have in common gives the same relative "
            f"error of the mass. {allowed}, of {all_together:.2g} % on all together{of_gears}. A weighed payload "
            "verifies the scale: `armload calibrate`."
        )
        if shift_kg > Drift.matters * found.uncertainty.half_width_95[0]:
            yield (
                f"A drift of all gains by {100.0 * Drift.between_runs:.1f} % from one run to the other would change "
                f"the mass by {shift_kg:.2g} kg. The intervals do not allow for that; those of a calibrated arm do."
            )
    elif not gains.from_torque:
        yield (
            f"Nominal drive gains are used for {numbered_joints(~gains.calibrated)}: the calibration could not "
            "determine them."
        )


def _on_contradictions(gains: GainFit | None) -> Iterator[str]:
    """Gains that the data contradict, each with its error, and gains that cannot be checked."""
    if gains is None:
        return
    named = gains.contradicted | gains.possible
    if gains.disagree:
        one = (
            f"a wrong gain of one of {numbered_joints(gains.possible)}"
            if gains.possible.any()
            else "no wrong gain alone"
        )
        yield (
            f"The drive gains contradict each other, which {one} explains. {_DOUBTFUL} Check torque constants and gear "
            "ratios, or calibrate the arm: `armload calibrate`."
        )
    for joint in np.flatnonzero(gains.contradicted):
        size, half_width = gains.log_gain[joint], gains.half_width_95[joint]
        low, high = (f"{100.0 * np.expm1(value):+.1f} %" for value in (size - half_width, size + half_width))
        off = f"{100.0 * abs(np.expm1(size)):.1f} % {'higher' if size > 0.0 else 'lower'}"
        allowed = 100.0 * NORMAL_HALF_WIDTH * gains.assumed_deviation[joint]
        yield (
            f"The data contradict the drive gain of joint {joint + 1}: if those of the other joints are within "
            f"{allowed:.1f} %, it is {off} than assumed (95 %, with what all gains have in common: {low} to "
            f"{high}). It was estimated with the payload. Check its torque constant and gear ratio, or calibrate the "
            "arm: `armload calibrate`."
        )
    hidden = ~named & (gains.noticeable > PayloadFit.unjudged_gain)
    unlimited = hidden & (gains.noticeable >= np.log1p(PayloadFit.unlimited_gain))
    if joints := remarked_joints(hidden & ~unlimited, "up to {:.0f} %", 100.0 * np.expm1(gains.noticeable)):
        yield (
            f"An error of the drive gain may go unnoticed in these runs on {joints}; a larger one is reported with a "
            f"probability of at least 90 %. {_CHECKED_BY}"
        )
    if unlimited.any():
        yield (
            f"These runs say nothing about the drive gain of {numbered_joints(unlimited)}: even an error of "
            f"{100.0 * PayloadFit.unlimited_gain:.0f} % may go unnoticed. {_CHECKED_BY}"
        )


def _on_signal(signal: LoadSignal, struck: NDArray[np.bool_]) -> Iterator[str]:
    """Losses by smoothing, gaps, and a single period; (K,) struck samples are no gaps."""
    loss = signal.smoothing_loss
    if joints := remarked_joints(loss > Smoothing.loss_limit, "{:.0f} %", 100.0 * loss):
        yield (
            f"Smoothing removed more than {100.0 * Smoothing.loss_limit:.0f} % of the signal of {joints}: it is mostly "
            "noise, or sampled too slowly."
        )
    if gaps := np.count_nonzero(~signal.valid & ~struck):
        yield f"{gaps} of {signal.valid.size} samples are in gaps and were not used."
    few = any(0 < run.periods < PayloadFit.fewest_periods for run in (signal.loaded, signal.unloaded))
    if few and signal.loaded.periodic and signal.noise_source == ABOVE_BAND:
        yield (
            "A run contains only one period, so its noise was taken from the signal above the motion's band, and the "
            "repeatability of the periods is unknown. Record three or more."
        )


def _on_result(found: Identification) -> Iterator[str]:
    """Friction that was compensated, directions and values that are not determined, and impossible estimates."""
    plain, uncertainty = found.plain, found.uncertainty
    if plain.rank < plain.theta.size:
        yield (
            f"The motion determines {plain.rank} of {plain.theta.size} parameter directions; the rest was chosen as "
            "for a compact body and is marked as not determined."
        )
    if found.changed and found.plain_parameters.margin <= 0.0:
        yield "The best fit is physically impossible; the nearest possible body is reported."
    if not uncertainty.determined[:4].any():
        yield (
            "Not even the mass is determined: the motion is too small or too slow, the runs are too short, or the "
            "payload is too light. Design an excitation with `armload design`, and record more periods."
        )
    elif uncertainty.undetermined_names:
        yield "Not determined by these data: " + ", ".join(uncertainty.undetermined_names) + "."


def _on_blows(run: Motion, struck: NDArray[np.bool_]) -> Iterator[str]:
    """The excluded part of the motion."""
    if struck.any():
        when = ", ".join(f"{moment:.1f}" for moment in run.time_s[struck & ~np.roll(struck, 1)])
        yield (
            f"{np.count_nonzero(struck) * run.interval_s:.1f} s of the motion were left out, from {when} s on: "
            "several joints have large residuals there at once, as after an impact on the arm."
        )


def _on_calibrated_arm(plain: PayloadEstimate, arm: KnownArm | None) -> Iterator[str]:
    """Friction far outside its variation in the calibration, and joints that fit far worse than there."""
    if arm is None:
        return
    run = plain.runs - 1
    change, covariance = plain.friction(run)[:2], plain.friction_covariance(run)
    yield from friction_notes(standard_deviations(change, covariance, arm.drift[:2]))
    if (strange := _noisier_joints(plain, arm)).any():
        yield (
            f"The torque of {numbered_joints(strange)} fits more than {ArmFit.noisier:.0f} times worse than in the "
            f"calibration: something pushed or held the arm, rows are too far apart, or a gain changed. {_DOUBTFUL} "
            "Record the runs again, without contact and at 50 Hz or more."
        )


def misfits(found: Identification, arm: KnownArm | None) -> bool:
    """Whether a payload does not explain the torque, or far worse than the calibration's runs were."""
    return any(misfit_notes(found)) or (arm is not None and bool(_noisier_joints(found.plain, arm).any()))


def _noisier_joints(plain: PayloadEstimate, arm: KnownArm) -> NDArray[np.bool_]:
    """(n,) True for joints that fit far worse than in the calibration."""
    return np.asarray(plain.noise_nm > ArmFit.noisier * arm.noise_nm)


def _on_arm(signal: LoadSignal, arm: BodyFit | None) -> Iterator[str]:
    """Joints of the unloaded run whose torque is not explained by the arm's links and positive friction."""
    if arm is None:
        return
    strange = strange_joints(signal, arm, PayloadFit.loud, ArmFit.driven_share_noted)
    if strange.any():
        yield (
            f"The unloaded run's torque of {numbered_joints(strange)} is not that of this arm's links and friction: "
            "check the joint order of positions and currents, and that the configuration belongs to this arm."
        )


def misfit_notes(found: Identification) -> Iterator[str]:
    """Joints whose torque difference is not explained by a payload, or all of them together."""
    # At rest and at reversals static friction can take any value.
    signal, noise_nm = found.signal, found.plain.noise_nm
    moving = signal.loaded.reversal_weight[signal.valid]
    torque, left = (moving * values[signal.valid] for values in (signal.torque_nm, found.residual_nm))
    measured = np.mean((torque / noise_nm) ** 2)
    misfit = np.mean((left / noise_nm) ** 2)
    if misfit > PayloadFit.poor_share * measured:
        yield (
            f"A payload explains only {100.0 * (1.0 - misfit / measured):.0f} % of the torque difference: it is very "
            "light, or columns, joint order or configuration do not belong to this arm."
        )
        return
    size, rest = np.sqrt(np.mean(torque**2, axis=0)), np.sqrt(np.mean(left**2, axis=0))
    strange = (size > PayloadFit.loud * signal.averaged_noise_nm) & (rest > PayloadFit.poor_share * size)
    if strange.any():
        yield (
            f"A payload does not explain the torque difference of {numbered_joints(strange)}: friction changed (warm "
            "gears, a dragging brake), a hose pulls, or the order of joints or the configuration is not this arm's."
        )


def change_notes(found: Identification, loaded: Run, unloaded: Run | None = None) -> Iterator[str]:
    """A note on each run during which the payload changed, or something pushed the arm, whichever explains it better.

    A run that was reduced to its average period while it was read, or that was interrupted within its periods, is not
    tested. Of two runs without periods, a change is attributed to the loaded one.

    Args:
        found: The payload, assumed constant.
        loaded: The loaded run.
        unloaded: The unloaded run, if there is one.
    """
    signal, levels = found.signal, PayloadChangeLevels
    runs = [("loaded", loaded, signal.loaded, found.plain.theta)]
    if unloaded is not None and signal.unloaded.periods > 1:
        runs.append(("unloaded", unloaded, signal.unloaded, np.zeros_like(found.plain.theta)))
    for name, run, motion, theta in runs:
        change, push = events_during(run, motion, found.plain.posterior, found.plain.arm, levels.edge_s)
        pushed = push is not None and push.statistic > max(levels.push, 0.0 if change is None else change.statistic)
        event = push if pushed else change
        if event is None:
            continue
        rows = run.recording
        start_s = 0.0 if rows.source.between_s is None else rows.source.between_s[0]
        at_s = start_s + motion.began_s - rows.time_s[0] + event.at_s
        if pushed:
            yield (
                f"About {at_s:.0f} s after the start of the {name} run's recording, its torque differs for some "
                f"seconds from that of its other periods, as by a force of {np.linalg.norm(event.change):.0f} N on the "
                f"flange: a push, a cable that catches, or a signal that fails. {_DOUBTFUL} Record the run again, "
                "without contact."
            )
        elif event.statistic > levels.statistic:
            before_s, after_s = at_s - levels.apart_s, at_s + levels.apart_s
            yield (
                f"The payload changed during the {name} run, about {at_s:.0f} s after the start of its recording, "
                f"{_by_how_much(theta, event)}. The result is a mean over the run. To identify the parts, use "
                f"`--between {start_s:.0f}s {before_s:.0f}s` and "
                f"`--between {after_s:.0f}s {start_s + rows.time_s[-1] - rows.time_s[0]:.0f}s`."
            )


def _by_how_much(theta: FloatArray, found: Event) -> str:
    """The change of the mass, and that of the centre of mass as far as it is significant."""
    half_width = NORMAL_HALF_WIDTH * found.deviation
    digits = max(1 - int(np.floor(np.log10(half_width[0]))), 0)
    text = f"by {found.change[0]:+z.{digits}f} +- {half_width[0]:.{digits}f} kg"
    mass_kg = float(theta[0])
    after_kg = mass_kg + float(found.change[0])
    if min(mass_kg, after_kg) <= DETERMINED_SHARE * max(mass_kg, after_kg):
        return text
    moved_m = (theta[1:4] + found.change[1:]) / after_kg - theta[1:4] / mass_kg
    if (np.abs(moved_m) * after_kg <= half_width[1:]).all():
        return text
    return f"{text}; its centre of mass moved by {', '.join(f'{1e3 * part:+z.0f}' for part in moved_m)} mm"
