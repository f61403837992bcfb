"""Checks that reject faulty recordings before they lead to a wrong payload."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.gain_errors import GainFit
from armload_identification.estimation.payload_estimate import PayloadEstimate
from armload_identification.estimation.uncertainty import NORMAL_HALF_WIDTH
from armload_identification.identification_errors import EstimationError, NoPayloadMass, RecordingError
from armload_identification.model.chain import Chain
from armload_identification.model.payload import DETERMINED_SHARE
from armload_identification.model.regressor import payload_regressor
from armload_identification.recording.recording import Recording
from armload_identification.recording.reduction.place_in_period import whole_periods
from armload_identification.recording.reduction.repeated_values import RepeatedValues, repeated_values
from armload_identification.signals.joint_torque import Transmission, joint_torque, reported_effort
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.verdict.decision_levels import Correlations, JointContradiction, RunLevels
from armload_identification.verdict.joint_words import numbered_joints
from armload_identification.verdict.recording_checks.effort_mismatch import require_same_effort
from armload_identification.verdict.recording_checks.joint_scales import JointScales, joint_scales


def check_pair(loaded: Recording, unloaded: Recording, transmission: Transmission) -> None:
    """Raise for recordings that are mixed up or have an impossible torque.

    Over a run that ends where it began, friction dissipates energy, so that the motors' total work is positive;
    otherwise a sign is wrong.

    Raises:
        RecordingError: the same file twice, exchanged labels, torque in one and current in the other, a constant, stuck
            or saturated torque column, or a wrong sign.
    """
    if loaded.source.sha256 == unloaded.source.sha256:
        raise RecordingError(
            f"{loaded.source.path} and {unloaded.source.path} are the same recording. "
            "Give one run with and one run without the payload."
        )
    labels = (loaded.source.run().get("load"), unloaded.source.run().get("load"))
    if labels[0] == "unloaded" != labels[1] or labels[1] == "loaded":
        raise RecordingError(
            f"{loaded.source.path} was recorded as '{labels[0]}' and {unloaded.source.path} as '{labels[1]}'. "
            "Exchange the two files."
        )
    require_same_effort(loaded, unloaded)
    for run in (loaded, unloaded):
        check_run(run, transmission)


def check_run(run: Recording, transmission: Transmission) -> None:
    """Raise for a run with a torque column that is constant, stuck for a part of it, saturated, or of the wrong sign.

    Raises:
        RecordingError: naming the joint and the remedy.
    """
    _refuse_long_means(run)
    _refuse_velocity(run)
    torque = joint_torque(run, transmission)
    measured = reported_effort(run)
    moves = np.ptp(run.position_rad, axis=0) > RunLevels.evident_travel_rad
    still = np.flatnonzero(moves & (np.ptp(measured, axis=0) == 0.0))
    if still.size:
        raise RecordingError(
            f"{run.source.path}: joint {still[0] + 1} moves, but its current or torque is constant at "
            f"{measured[0, still[0]]:g}. Check the mapping of its 6077 or 6078, or the column map."
        )
    repeats = repeated_values(measured, run.position_rad) if run.repeats is None else run.repeats
    _refuse_saturation(run, repeats, moves)
    _refuse_stuck(run, repeats, moves)
    rows = _closed_part(run)
    step = np.diff(run.position_rad[rows], axis=0)
    work = 0.5 * (torque[rows][1:] + torque[rows][:-1]) * step
    turned_over = np.sum(np.abs(work), axis=0)
    # Only their sum: a single joint can receive any amount of energy from the others over a cycle.
    if moves.any() and work.sum() < RunLevels.fed_energy * turned_over.sum():
        joints = numbered_joints(moves & (work.sum(axis=0) < 0.0))
        raise RecordingError(
            f"{run.source.path}: the motors of {joints} absorb energy overall, although friction should "
            "dissipate it. The sign of the current or torque is flipped: correct it in the configuration or the log."
        )


def _refuse_long_means(run: Recording) -> None:
    """Raise for a run so long that its means attenuate the motion: at f, by (pi f T)^2 / 6 of the amplitude."""
    if run.repeats is None or run.average is not None:
        return
    mean_s = float(np.median(np.diff(run.time_s)))
    velocity = np.diff(run.position_rad, axis=0) / mean_s
    change = np.mean(np.diff(velocity, axis=0) ** 2)
    lost = float(change / max(float(np.mean(velocity**2)), np.finfo(float).tiny)) / 24.0
    if lost > RunLevels.lost_to_means:
        hours = (run.time_s[-1] - run.time_s[0]) / 3600.0
        raise RecordingError(
            f"{run.source.path}: {hours:.1f} h without a known excitation were reduced to means over "
            f"{1e3 * mean_s:.0f} ms, which reduces the motion's amplitude by about {100.0 * lost:.0f} %. Select a part "
            "of it with `between_s=`, such as its first 600 s."
        )


def _refuse_velocity(run: Recording) -> None:
    """Raise for a velocity that is not the derivative of the position, or is so in degrees.

    It is integrated over parts of the run and compared with the change of position, which noise hardly affects.
    """
    if run.velocity_rad_s is None or run.average is not None:
        return
    velocity = np.nan_to_num(run.velocity_rad_s)
    step_s = np.diff(run.time_s)[:, None]
    whole = step_s < RunLevels.gap * np.median(step_s)
    steps = np.diff(run.position_rad, axis=0), 0.5 * (velocity[1:] + velocity[:-1]) * step_s
    starts = np.arange(0, len(step_s), max(len(step_s) // RunLevels.velocity_parts, 1))
    change, expected = (np.add.reduceat(whole * step, starts, axis=0) for step in steps)
    change, expected = change - change.mean(axis=0), expected - expected.mean(axis=0)
    size = np.sqrt(np.sum(change**2, axis=0) * np.sum(expected**2, axis=0))
    moves = (np.ptp(run.position_rad, axis=0) > RunLevels.evident_travel_rad) & (size > 0.0)
    strange = moves & (np.sum(change * expected, axis=0) < Correlations.derivative * size)
    if strange.any():
        raise RecordingError(
            f"{run.source.path}: the velocity of {numbered_joints(strange)} is not the derivative "
            "of its position. Columns of position and velocity are exchanged, in another joint order, or of "
            "another sign: correct the column map."
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.sum(change**2, axis=0) / np.sum(change * expected, axis=0)
    follows = moves & (np.sum(change * expected, axis=0) > Correlations.same * size)
    for what, factor in (("positions", 180.0 / np.pi), ("velocities", np.pi / 180.0)):
        degrees = follows & (np.abs(np.log(np.where(follows, times, 1.0) / factor)) < RunLevels.degree_within)
        if degrees.any():
            joint = int(np.flatnonzero(degrees)[0])
            raise RecordingError(
                f"{run.source.path}: joint {joint + 1} moves {times[joint]:.3g} times as fast as its velocity "
                f"indicates. Its {what} look like degrees: convert them to radians."
            )


def _refuse_stuck(run: Recording, repeats: RepeatedValues, moves: NDArray[np.bool_]) -> None:
    """Raise for a run in which a joint moves back and forth while its torque stays the same: friction would change."""
    range_rad = np.ptp(run.position_rad, axis=0)
    stuck = moves & (repeats.turned_rad > np.maximum(RunLevels.evident_travel_rad, RunLevels.stuck_share * range_rad))
    for joint in np.flatnonzero(stuck):
        raise RecordingError(
            f"{run.source.path}: joint {joint + 1} moves back and forth by {repeats.turned_rad[joint]:.2g} rad, but "
            f"its current or torque stays at {repeats.turned_at[joint]:.4g} for {repeats.turned_for[joint]:.0f} "
            "samples in a row: an old value was recorded repeatedly. Record the run again, or select a part without it "
            "with `between_s=`."
        )


def _refuse_saturation(run: Recording, repeats: RepeatedValues, moves: NDArray[np.bool_]) -> None:
    """Raise for a run in which a moving joint's torque stays at its greatest value, longer than at any other."""
    by_chance = np.maximum(RunLevels.saturated_repeats, RunLevels.saturated_over_others * repeats.elsewhere)
    stays = repeats.at_bound >= by_chance
    for joint in np.flatnonzero(moves & stays):
        raise RecordingError(
            f"{run.source.path}: joint {joint + 1} stays at its maximum of {repeats.bound[joint]:.4g} for "
            f"{repeats.at_bound[joint] + 1:.0f} samples in a row: the drive or the measurement is saturated, so the "
            "true torque is unknown. Record a slower run, or raise the drive's current limit."
        )


def _closed_part(run: Recording) -> NDArray[np.intp]:
    """Rows of a closed motion: whole periods, else the entire run; none if it does not end where it began."""
    if run.phase_s is not None and run.excitation is not None:
        inside = np.flatnonzero(np.isfinite(run.phase_s))
        length_s = whole_periods(run) * run.excitation.trajectory.period_s
        return inside[run.phase_s[inside] <= run.phase_s[inside[:1]] + length_s] if length_s else inside[:0]
    if (np.abs(run.position_rad[-1] - run.position_rad[0]) < RunLevels.evident_travel_rad).all():
        return np.arange(run.time_s.size)
    return np.empty(0, dtype=np.intp)


def require_consistent(
    plain: PayloadEstimate, gains: GainFit | None, signal: LoadSignal, chain: Chain, friction_nm: FloatArray
) -> None:
    """Raise for a payload that contradicts a joint, or has no mass.

    Args:
        plain: The payload.
        gains: The fitted gains; None if they were not fitted.
        signal: The torque difference with the assumed gains.
        chain: The arm.
        friction_nm: (n,) Coulomb friction as measured, with the same gains.

    Raises:
        RecordingError: a joint measures about the opposite of what the others imply.
        EstimationError: a joint measures less than a third of what the others imply, without fitted gains less than
            three quarters; or there is no mass.
    """
    regressor = payload_regressor(chain, *signal.states)
    _check_gains(gains)
    variance, _ = plain.spread(np.eye(1, plain.theta.size))
    half_width_kg = NORMAL_HALF_WIDTH * float(np.sqrt(variance[0]))
    fitted = gains is not None
    trusted = fitted and half_width_kg <= DETERMINED_SHARE * abs(plain.theta[0])
    _check_against_others(plain, signal, regressor, friction_nm, gains_fitted=fitted, trusted=trusted)
    if plain.theta[0] <= 0.0:
        raise explain_negative_mass(float(plain.theta[0]), half_width_kg)


def _check_against_others(
    plain: PayloadEstimate,
    signal: LoadSignal,
    regressor: FloatArray,
    friction_nm: FloatArray,
    *,
    gains_fitted: bool,
    trusted: bool,
) -> None:
    """Raise if a joint's sign or scale contradicts all others.

    A joint that reports a small share of its torque also has a small share of its noise. It is then fitted perfectly
    and determines the payload, and it is the others that remain unexplained, or, if its share is more than half, none.
    Fitted gains correct a share above a third; if the payload is determined with them (`trusted`), the joints are
    compared only if one of them is unexplained.
    """
    measured = signal.torque_nm[signal.valid]
    rest = measured - regressor[signal.valid] @ plain.theta
    power, left = (np.mean(torque**2, axis=0) for torque in (measured, rest))
    noise_nm = signal.averaged_noise_nm / np.sqrt(len(measured))
    loud = np.sqrt(power) > JointContradiction.clear_deviations * noise_nm
    suspect = signal.loaded.moves & loud & (left > JointContradiction.unexplained * power)
    if trusted and not suspect.any():
        return
    shares = []
    for joint in np.flatnonzero(signal.loaded.moves & loud).tolist():
        # A joint almost free of noise decides the noise of the others: fit these again if one is unexplained.
        others, covariance, rank = (plain.fitted_without if suspect.any() else plain.without)(joint)
        if rank < others.size:
            continue
        if suspect[joint]:
            _refuse_opposite(signal, regressor, others, joint)
        share = _share_of_implied(signal, regressor, others, covariance, joint, friction_nm[joint])
        if share is not None and np.isfinite(share.half_width_95):
            shares.append(share)
    if shares:
        # A wrong joint contaminates what the others imply of each other, but not what they imply of it.
        _refuse_small(max(shares, key=lambda share: share.off), signal.loaded.n, gains_fitted=gains_fitted)


@dataclass(frozen=True)
class _ImpliedShare:
    """Ratio of the payload torque that a joint, from 0, measures to the one that the other joints imply."""

    joint: int
    scale: float
    half_width_95: float

    @property
    def off(self) -> float:
        """Deviation from 1 in half widths."""
        return abs(self.scale - 1.0) / max(self.half_width_95, JointContradiction.exact)


def _refuse_opposite(signal: LoadSignal, regressor: FloatArray, others: FloatArray, joint: int) -> None:
    """Raise if a joint measures about the opposite of what the others imply."""
    implied, measured = regressor[signal.valid][:, joint] @ others, signal.torque_nm[signal.valid][:, joint]
    size = np.sqrt(np.mean(implied**2)) * np.sqrt(np.mean(measured**2))
    if size > 0.0 and np.mean(implied * measured) < Correlations.opposed * size:
        raise RecordingError(
            f"joint {joint + 1} measures the opposite of the payload torque that the other joints imply. "
            "The sign of its current or torque is flipped: correct it in the configuration or the log."
        )


def _share_of_implied(
    signal: LoadSignal,
    regressor: FloatArray,
    others: FloatArray,
    covariance: FloatArray,
    joint: int,
    friction_nm: float,
) -> _ImpliedShare | None:
    """The share that a joint measures of what the others imply; None if that is too small or too uncertain."""
    own = regressor[signal.valid][:, joint]
    implied_nm = np.sqrt(np.mean((own @ others) ** 2))
    doubt_nm = np.sqrt(np.mean(np.einsum("ki,ij,kj->k", own, covariance, own)))
    least_nm = max(JointContradiction.implied_deviations * doubt_nm, JointContradiction.of_friction * friction_nm)
    if implied_nm <= least_nm:
        return None
    only = np.arange(regressor.shape[1]) == joint
    scales = joint_scales(signal, np.where(only, regressor @ others, 0.0), np.zeros_like(signal.torque_nm))
    return _ImpliedShare(joint, float(scales.scale[joint]), float(scales.half_width_95[joint]))


def _refuse_small(share: _ImpliedShare, n: int, *, gains_fitted: bool) -> None:
    """Raise if a joint of n certainly measures too small a share; a fitted gain corrects a share above a third."""
    greatest = share.scale + JointContradiction.certain_half_widths * share.half_width_95
    if greatest < 1.0 / JointContradiction.gain_factor:
        raise _contradiction_error(np.arange(n) == share.joint)
    if greatest < JointContradiction.least_share and not gains_fitted:
        raise EstimationError(
            f"joint {share.joint + 1} measures {share.scale:.2f} +- {share.half_width_95:.2f} of the payload torque "
            "that the other joints imply, so that mass and centre of mass would be wrong: its rated torque, torque "
            "constant or gear ratio is wrong. Correct the configuration or the log."
        )


def _check_gains(gains: GainFit | None) -> None:
    """Raise if the other joints imply a gain that no nominal gain is wrong by; None if gains were not fitted.

    Raises:
        EstimationError: naming the joint and the possible causes.
    """
    if gains is None:
        return
    size = np.where(gains.contradicted, np.abs(gains.log_gain), 0.0)
    joint = int(np.argmax(size))
    if size[joint] > np.log(JointContradiction.gain_factor):
        raise _contradiction_error(np.arange(size.size) == joint)


def check_scales(
    scales: JointScales, payload_nm: FloatArray, friction_nm: FloatArray, moves: NDArray[np.bool_]
) -> None:
    """Raise if the payload's torque on a joint is many times that of the payload, or opposite to it.

    A gain that is wrong by orders of magnitude is not found as a gain: the joint is then either excluded as noise, or,
    being almost free of noise, determines the payload alone.

    Args:
        scales: Ratio of measured to predicted payload torque of the joints.
        payload_nm: (n,) RMS of the predicted one.
        friction_nm: (n,) Coulomb friction as measured, with the same gain. Where it is many times the payload's torque,
            its errors determine the ratio: 0.3 kg on a joint of prbt that it loads with a hundredth of its friction.
        moves: (n,) False for joints at rest: static friction may carry the payload's torque.

    Raises:
        EstimationError: naming the joints and the possible causes.
    """
    greatest, certain = JointContradiction.gain_factor, JointContradiction.certain_half_widths * scales.half_width_95
    with np.errstate(invalid="ignore"):
        evident = payload_nm >= JointContradiction.of_friction * friction_nm
        beyond = moves & evident & ((scales.scale - certain > greatest) | (scales.scale + certain < 1.0 / greatest))
    if beyond.any():
        within = np.abs(scales.scale - 1.0) + certain < greatest - 1.0
        # A joint almost free of noise determines the payload alone: then it is the others that seem wrong.
        alone = within.any() and np.count_nonzero(beyond) > np.count_nonzero(within)
        raise _contradiction_error(
            within if alone else beyond, above=not alone and bool((scales.scale[beyond] > 1.0).all())
        )


def _contradiction_error(joints: NDArray[np.bool_], *, above: bool = False) -> EstimationError:
    """The error for joints whose torque is not that of the payload by far; if it is above, others may be too small."""
    one = np.count_nonzero(joints) == 1
    factor = JointContradiction.gain_factor
    its, columns = ("its", "its column is") if one else ("their", "their columns are")
    return EstimationError(
        f"the torque of {numbered_joints(joints)} contradicts the payload that the other joints imply by more than a "
        f"factor of {factor:.0f}: the sign of {its} current or torque is flipped, {its} torque constant, gear ratio "
        f"or unit is wrong, or {columns} another joint's"
        + (", or another joint reports a small part of its torque, and little noise. " if above else ". ")
        + "Correct the configuration or the log."
    )


def explain_negative_mass(mass_kg: float, half_width_kg: float) -> NoPayloadMass:
    """The error for a mass in kg that is not positive, with the half width of its 95 % interval."""
    if abs(mass_kg) <= half_width_kg:
        return NoPayloadMass(
            f"the two runs do not differ by a payload: the estimated mass is {mass_kg:.3g} kg +- "
            f"{half_width_kg:.2g} kg. Check that the payload was mounted in the loaded run.",
            mass_kg,
            half_width_kg,
        )
    return NoPayloadMass(
        f"the estimated mass is negative, {mass_kg:.3g} kg +- {half_width_kg:.2g} kg. The loaded and the unloaded "
        "recording are exchanged: exchange them.",
        mass_kg,
        half_width_kg,
    )
