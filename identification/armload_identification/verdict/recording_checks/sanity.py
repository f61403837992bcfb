"""Checks that reject faulty recordings before they lead to a wrong payload."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.gain_columns import GainFit
from armload_identification.estimation.least_squares import Estimate, estimate_reweighted
from armload_identification.identification_errors import EstimationError, NoPayloadMass, RecordingError
from armload_identification.recording.recording import Recording
from armload_identification.recording.reduction.place_in_period import whole_periods
from armload_identification.recording.reduction.repeated_values import RepeatedValues, repeated_values
from armload_identification.signals.joint_torque import Transmission, joint_torque, reported_effort
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.verdict.joint_words import numbered_joints
from armload_identification.verdict.recording_checks.effort_mismatch import require_same_effort
from armload_identification.verdict.recording_checks.joint_scales import JointScales, joint_scales

_MOVES_RAD: Final = 0.05
_LOST_TO_MEANS: Final = 0.01
"""Share of the motion's amplitude."""
_FEEDS_ENERGY: Final = -0.03
"""Least ratio of the work of all joints to their total energy exchange: friction makes the work positive."""
_EXPLAINED: Final = 0.9
_OPPOSED: Final = -0.8
_CLEAR: Final = 5.0
_FACTOR: Final = 3.0
_IMPLAUSIBLE: Final = float(np.log(_FACTOR))
"""Logarithm of the greatest error of a nominal gain, either way: beyond it, no payload can be trusted."""
_CERTAINLY: Final = 2.0
"""Half widths of the 95 % interval by which a joint's scale must be beyond that factor."""
_EVIDENT: Final = 0.1
"""Share of a joint's friction from which the payload's torque is evidence about its gain."""
_IMPLIED: Final = 20.0
"""Standard deviations, for white noise, of a joint's torque as implied by the others, from which it is evidence. Sound
joints of er50, prbt and the UR10e measure 0.89 to 1.06 of what the others imply."""
_EXACT: Final = 1e-6
_SHARE: Final = 0.75
"""Share of the implied torque from which a joint whose gain is not fitted is accepted."""
_PARTS: Final = 200
_GAP: Final = 5.0
"""Multiple of the usual interval from which the velocity between two samples is unknown."""
_DERIVATIVE: Final = 0.5
"""Least correlation of a change of position with the integral of its velocity; 0.9999 on the UR10e."""
_FOLLOWS: Final = 0.9
_ABOUT: Final = 0.2
"""Logarithm of the ratio of position to velocity within which it is that of a degree to a radian."""
_FAR: Final = 0.1
"""Share of its range of motion that no joint moves back and forth with the same torque: at most 1e-4 on er50, prbt and
the UR10e with torques in steps of 1 % of the greatest possible one, and 0.025 in steps of a fifth of the run's."""
_STAYS: Final = 7
"""A signal with noise does not repeat its greatest value this often in succession by chance."""
_RATHER_THAN_CHANCE: Final = 3
"""The repetition must also be longer by this factor than that of any other value, for signals of coarse resolution."""


def check_pair(loaded: Recording, unloaded: Recording, transmission: Transmission) -> None:
    """Raise for recordings that are mixed up or have an impossible torque.

    Over a run that ends where it began, friction dissipates energy, so that the motors' total work is positive;
    otherwise a sign is wrong.

    Args:
        loaded: Run with the payload.
        unloaded: Run without it.
        transmission: Gains and coupling.

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
    if labels[0] == "unloaded" or labels[1] == "loaded":
        raise RecordingError(
            f"{loaded.source.path} was recorded as '{labels[0]}' and {unloaded.source.path} as '{labels[1]}'. "
            "Exchange the two files."
        )
    require_same_effort(loaded, unloaded)
    for run in (loaded, unloaded):
        check_run(run, transmission)


def check_run(run: Recording, transmission: Transmission) -> None:
    """Raise for a run with a torque column that is constant, stuck for a part of it, saturated, or of the wrong sign.

    Args:
        run: The run.
        transmission: Gains and coupling.

    Raises:
        RecordingError: naming the joint and the remedy.
    """
    _refuse_long_means(run)
    _refuse_velocity(run)
    torque = joint_torque(run, transmission)
    measured = reported_effort(run)
    moves = np.ptp(run.position_rad, axis=0) > _MOVES_RAD
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
    if moves.any() and work.sum() < _FEEDS_ENERGY * turned_over.sum():
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
    lost = float(change / max(float(np.mean(velocity**2)), 1e-300)) / 24.0
    if lost > _LOST_TO_MEANS:
        hours = (run.time_s[-1] - run.time_s[0]) / 3600.0
        raise RecordingError(
            f"{run.source.path}: {hours:.1f} h without a known excitation were reduced to means over "
            f"{1e3 * mean_s:.0f} ms, which reduces the motion's amplitude by about {100.0 * lost:.0f} %. Select a part "
            "of it, such as --between 0s 600s."
        )


def _refuse_velocity(run: Recording) -> None:
    """Raise for a velocity that is not the derivative of the position, or is so in degrees.

    It is integrated over parts of the run and compared with the change of position, which noise hardly affects.
    """
    if run.velocity_rad_s is None or run.average is not None:
        return
    velocity = np.nan_to_num(run.velocity_rad_s)
    step_s = np.diff(run.time_s)[:, None]
    whole = step_s < _GAP * np.median(step_s)
    steps = np.diff(run.position_rad, axis=0), 0.5 * (velocity[1:] + velocity[:-1]) * step_s
    starts = np.arange(0, len(step_s), max(len(step_s) // _PARTS, 1))
    change, expected = (np.add.reduceat(whole * step, starts, axis=0) for step in steps)
    change, expected = change - change.mean(axis=0), expected - expected.mean(axis=0)
    size = np.sqrt(np.sum(change**2, axis=0) * np.sum(expected**2, axis=0))
    moves = (np.ptp(run.position_rad, axis=0) > _MOVES_RAD) & (size > 0.0)
    strange = moves & (np.sum(change * expected, axis=0) < _DERIVATIVE * size)
    if strange.any():
        raise RecordingError(
            f"{run.source.path}: the velocity of {numbered_joints(strange)} is not the derivative "
            "of its position. Columns of position and velocity are exchanged, in another joint order, or of "
            "another sign: correct the column map."
        )
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.sum(change**2, axis=0) / np.sum(change * expected, axis=0)
    follows = moves & (np.sum(change * expected, axis=0) > _FOLLOWS * size)
    for what, factor in (("positions", 180.0 / np.pi), ("velocities", np.pi / 180.0)):
        degrees = follows & (np.abs(np.log(np.where(follows, times, 1.0) / factor)) < _ABOUT)
        if degrees.any():
            joint = int(np.flatnonzero(degrees)[0])
            raise RecordingError(
                f"{run.source.path}: joint {joint + 1} moves {times[joint]:.3g} times as fast as its velocity "
                f"indicates. Its {what} look like degrees: convert them to radians."
            )


def _refuse_stuck(run: Recording, repeats: RepeatedValues, moves: NDArray[np.bool_]) -> None:
    """Raise for a run in which a joint moves back and forth while its torque stays the same: friction would change."""
    stuck = moves & (repeats.turned_rad > np.maximum(_MOVES_RAD, _FAR * np.ptp(run.position_rad, axis=0)))
    for joint in np.flatnonzero(stuck):
        raise RecordingError(
            f"{run.source.path}: joint {joint + 1} moves back and forth by {repeats.turned_rad[joint]:.2g} rad, but "
            f"its current or torque stays at {repeats.turned_at[joint]:.4g} for {repeats.turned_for[joint]:.0f} "
            "samples in a row: an old value was recorded repeatedly. Record the run again, or select a part without it "
            "with --between."
        )


def _refuse_saturation(run: Recording, repeats: RepeatedValues, moves: NDArray[np.bool_]) -> None:
    """Raise for a run in which a moving joint's torque stays at its greatest value, longer than at any other."""
    stays = (repeats.at_bound >= _STAYS) & (repeats.at_bound >= _RATHER_THAN_CHANCE * repeats.elsewhere)
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
    if (np.abs(run.position_rad[-1] - run.position_rad[0]) < _MOVES_RAD).all():
        return np.arange(run.time_s.size)
    return np.empty(0, dtype=np.intp)


def check_against_others(
    signal: LoadSignal, regressor: FloatArray, fit: Estimate, friction_nm: FloatArray, *, gains_fitted: bool
) -> None:
    """Raise if a joint's sign or scale contradicts all others.

    A joint that reports a small share of its torque also has a small share of its noise. It is then fitted perfectly
    and determines the payload, and it is the others that remain unexplained, or, if its share is more than half, none.
    Fitted gains correct a share above a third; then the joints are compared only if one of them is unexplained.

    Args:
        signal: The torque difference.
        regressor: (K, n, 10) Phi.
        fit: The fit to all joints.
        friction_nm: (n,) Coulomb friction as measured, with the same gains.
        gains_fitted: Whether the drive gains were fitted with the payload.

    Raises:
        RecordingError: a joint measures about the opposite of what the others imply.
        EstimationError: a joint measures less than a third of what the others imply; without fitted gains, less than
            three quarters.
    """
    measured = signal.torque_nm[signal.valid]
    loud = np.sqrt(np.mean(measured**2, axis=0)) > _CLEAR * signal.averaged_noise_nm / np.sqrt(len(measured))
    left = np.mean(fit.residual_nm[signal.valid] ** 2, axis=0) > (1.0 - _EXPLAINED) * np.mean(measured**2, axis=0)
    suspect = signal.loaded.moves & loud & left
    if gains_fitted and not suspect.any():
        return
    shares = []
    for joint in np.flatnonzero(signal.loaded.moves & loud).tolist():
        others = _fit_without(signal, regressor, joint)
        if others.rank < regressor.shape[2]:
            continue
        if suspect[joint]:
            _refuse_opposite(signal, regressor, others, joint)
        share = _share_of_implied(signal, regressor, others, joint, friction_nm[joint])
        if share is not None and np.isfinite(share.half_width_95):
            shares.append(share)
    if shares:
        # A wrong joint contaminates what the others imply of each other, but not what they imply of it.
        _refuse_small(max(shares, key=lambda share: share.off), signal.loaded.n, gains_fitted=gains_fitted)


@dataclass(frozen=True)
class _Share:
    """Ratio of the payload torque that a joint measures to the one that the other joints imply.

    Attributes:
        joint: The joint, from 0.
        scale: The ratio.
        half_width_95: Half width of its 95 % interval.
    """

    joint: int
    scale: float
    half_width_95: float

    @property
    def off(self) -> float:
        """Deviation from 1 in half widths."""
        return abs(self.scale - 1.0) / max(self.half_width_95, _EXACT)


def _fit_without(signal: LoadSignal, regressor: FloatArray, joint: int) -> Estimate:
    """The payload by all joints but one."""
    others = np.arange(regressor.shape[1]) != joint
    return estimate_reweighted(
        regressor[:, others], signal.torque_nm[:, others], signal.valid, signal.averaged_noise_nm[others]
    )


def _refuse_opposite(signal: LoadSignal, regressor: FloatArray, others: Estimate, joint: int) -> None:
    """Raise if a joint measures about the opposite of what the others imply."""
    implied, measured = regressor[signal.valid][:, joint] @ others.theta, signal.torque_nm[signal.valid][:, joint]
    size = np.sqrt(np.mean(implied**2)) * np.sqrt(np.mean(measured**2))
    if size > 0.0 and np.mean(implied * measured) < _OPPOSED * size:
        raise RecordingError(
            f"joint {joint + 1} measures the opposite of the payload torque that the other joints imply. "
            "The sign of its current or torque is flipped: correct it in the configuration or the log."
        )


def _share_of_implied(
    signal: LoadSignal, regressor: FloatArray, others: Estimate, joint: int, friction_nm: float
) -> _Share | None:
    """The share that a joint measures of what the others imply; None if that is too small or too uncertain."""
    own = regressor[signal.valid][:, joint]
    implied_nm = np.sqrt(np.mean((own @ others.theta) ** 2))
    doubt_nm = np.sqrt(np.mean(np.einsum("ki,ij,kj->k", own, others.covariance, own)))
    if implied_nm <= max(_IMPLIED * doubt_nm, _EVIDENT * friction_nm):
        return None
    only = np.arange(regressor.shape[1]) == joint
    scales = joint_scales(signal, np.where(only, regressor @ others.theta, 0.0), np.zeros_like(signal.torque_nm))
    return _Share(joint, float(scales.scale[joint]), float(scales.half_width_95[joint]))


def _refuse_small(share: _Share, n: int, *, gains_fitted: bool) -> None:
    """Raise if a joint of n certainly measures too small a share; a fitted gain corrects a share above a third."""
    greatest = share.scale + _CERTAINLY * share.half_width_95
    if greatest < 1.0 / _FACTOR:
        raise _contradiction(np.arange(n) == share.joint)
    if greatest < _SHARE and not gains_fitted:
        raise EstimationError(
            f"joint {share.joint + 1} measures {share.scale:.2f} +- {share.half_width_95:.2f} of the payload torque "
            "that the other joints imply, so that mass and centre of mass would be wrong: its rated torque, torque "
            "constant or gear ratio is wrong. Correct the configuration or the log."
        )


def check_gains(gains: GainFit | None) -> None:
    """Raise if the other joints imply a gain that no nominal gain is wrong by.

    Args:
        gains: The gains as fitted; None if they were not.

    Raises:
        EstimationError: naming the joint and the possible causes.
    """
    if gains is None:
        return
    size = np.where(gains.contradicted, np.abs(gains.log_gain), 0.0)
    joint = int(np.argmax(size))
    if size[joint] > _IMPLAUSIBLE:
        raise _contradiction(np.arange(size.size) == joint)


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
    certain = _CERTAINLY * scales.half_width_95
    with np.errstate(invalid="ignore"):
        evident = np.maximum(np.abs(scales.scale), 1.0) * payload_nm > _EVIDENT * friction_nm
        beyond = moves & evident & ((scales.scale - certain > _FACTOR) | (scales.scale + certain < 1.0 / _FACTOR))
    if beyond.any():
        within = np.abs(scales.scale - 1.0) + certain < _FACTOR - 1.0
        # A joint almost free of noise determines the payload alone: then it is the others that seem wrong.
        alone = within.any() and np.count_nonzero(beyond) > np.count_nonzero(within)
        raise _contradiction(within if alone else beyond)


def _contradiction(joints: NDArray[np.bool_]) -> EstimationError:
    """The error for joints whose torque is not that of the payload by far."""
    one = np.count_nonzero(joints) == 1
    its, columns = ("its", "its column is") if one else ("their", "their columns are")
    return EstimationError(
        f"the torque of {numbered_joints(joints)} contradicts the payload that the other joints imply by more than a "
        f"factor of {_FACTOR:.0f}: the sign of {its} current or torque is flipped, {its} torque constant, gear ratio "
        f"or unit is wrong, or {columns} another joint's. Correct the configuration or the log."
    )


def explain_negative_mass(mass_kg: float, half_width_kg: float) -> NoPayloadMass:
    """The error for a mass that is not positive.

    Args:
        mass_kg: Plain estimate, not above 0.
        half_width_kg: Half width of its 95 % interval.
    """
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
