"""Detection of recordings with impossible magnitudes: wrong units, torques at the motor, another arm.

They are compared with the arm's file: its ranges, the torque of its joints, and, if known, its links. The torque due to
the links' weight is then known within tens of per cent, and wrong units cause far greater errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError, RecordingError
from armload_identification.model.chain import Chain
from armload_identification.model.dynamics import ArmBody, ArmDynamics
from armload_identification.recording.recording import Recording
from armload_identification.signals.motion import Motion
from armload_identification.verdict.decision_levels import ArmFit, Correlations, Magnitudes


@dataclass(frozen=True, eq=False)
class ArmMagnitudes:
    """Possible magnitudes of an arm of n joints, as far as known.

    Attributes:
        joint_names: Names of the joints, from the base to the flange.
        position_min_rad: (n,) least position; NaN or -inf if unknown.
        position_max_rad: (n,) greatest position; NaN or inf if unknown.
        velocity_max_rad_s: (n,) greatest speed; NaN if unknown.
        torque_max_nm: (n,) greatest torque; NaN if unknown.
        body: Its links; None if unknown.
    """

    joint_names: tuple[str, ...]
    position_min_rad: FloatArray
    position_max_rad: FloatArray
    velocity_max_rad_s: FloatArray
    torque_max_nm: FloatArray
    body: ArmBody | None


def require_possible(run: Recording, chain: Chain, torque_nm: FloatArray | None, arm: ArmMagnitudes) -> None:
    """Raise for a run that cannot be of this arm.

    Args:
        run: The run, with the arm's joints.
        torque_nm: (N, n) joint torque of the run; None without any.
        arm: Its possible magnitudes.

    Raises:
        RecordingError: naming joint, value, the arm's limit, and the likely unit.
    """
    every = slice(None, None, max(1, run.size // ArmFit.rows))
    position = run.position_rad[every]
    _refuse_positions(run, position, arm)
    _refuse_speeds(run, arm)
    if torque_nm is None:
        return
    torque = torque_nm[every]
    _refuse_strength(run, torque, arm)
    _refuse_scale(run, position, torque, chain, arm)


def _refuse_positions(run: Recording, position: FloatArray, arm: ArmMagnitudes) -> None:
    """Raise for positions beyond the joints' ranges."""
    low, high = np.nanmin(position, axis=0), np.nanmax(position, axis=0)
    with np.errstate(invalid="ignore"):
        beyond = np.maximum(arm.position_min_rad - low, high - arm.position_max_rad)
        width = arm.position_max_rad - arm.position_min_rad
        reach = np.maximum(np.abs(low), np.abs(high))
        bound = np.maximum(np.abs(arm.position_min_rad), np.abs(arm.position_max_rad))
        wide = (reach > Magnitudes.beyond * bound) | (high - low > Magnitudes.beyond * width)
        degrees = wide & (np.radians(reach) < bound + Magnitudes.outside_rad)
    allowed = np.maximum(Magnitudes.outside_rad, Magnitudes.outside_share * np.nan_to_num(width, posinf=0.0))
    for joint in np.flatnonzero(degrees | (beyond > allowed)):
        question = (
            "The positions look like degrees: convert them, or add the unit to the column names of a table (q1_deg)."
            if degrees[joint]
            else (
                "Is this a recording of another arm, or with a different joint order or zero position? Give the file "
                "of the arm that it was recorded on, or correct the range."
            )
        )
        raise RecordingError(
            f"{run.source.path}: {arm.joint_names[joint]} goes from {low[joint]:.3g} to {high[joint]:.3g}, its range "
            f"is {arm.position_min_rad[joint]:.3g} to {arm.position_max_rad[joint]:.3g} rad. {question}"
        )


def _refuse_speeds(run: Recording, arm: ArmMagnitudes) -> None:
    """Raise for joints in degrees whose angles are so small that they could be radians."""
    interval_s = float(np.median(np.diff(run.time_s)))
    window = max(round(Magnitudes.speed_over_s / interval_s), 1)
    if run.size <= window:
        return
    moved = np.abs(run.position_rad[window:] - run.position_rad[:-window])
    speed = np.percentile(moved / (run.time_s[window:] - run.time_s[:-window])[:, None], Magnitudes.percentile, axis=0)
    times = speed / arm.velocity_max_rad_s
    fast = times > Magnitudes.beyond
    # Where the others exceed them too, the limits are those of a slow test, not of the arm.
    others = times[~fast]
    limits_hold = (others <= Magnitudes.other_speeds).any() and not (others > Magnitudes.other_speeds).any()
    if not fast.any() or not limits_hold:
        return
    joint = int(np.flatnonzero(fast)[0])
    raise RecordingError(
        f"{run.source.path}: {arm.joint_names[joint]} reaches {speed[joint]:.3g} rad/s, {times[joint]:.2g} times its "
        f"greatest speed, {arm.velocity_max_rad_s[joint]:.3g} rad/s, and the other joints are within theirs. Its "
        "positions look like degrees: convert them, or add the unit to the column names of a table "
        f"(q{joint + 1}_deg); if they are radians, correct its speed limit."
    )


def _refuse_strength(run: Recording, torque: FloatArray, arm: ArmMagnitudes) -> None:
    """Raise for torques that no joint can provide."""
    with np.errstate(invalid="ignore"):
        times = np.nanpercentile(np.abs(torque), Magnitudes.percentile, axis=0) / arm.torque_max_nm
    if not (times > Magnitudes.strongest).any():
        return
    joint = int(np.nanargmax(times))
    raise RecordingError(
        f"{run.source.path}: {arm.joint_names[joint]} reaches {times[joint] * arm.torque_max_nm[joint]:.3g} N m, "
        f"{times[joint]:.0f} times its greatest torque, {arm.torque_max_nm[joint]:.3g} N m. Currents look like "
        "milliampere, or torques like N mm: convert them to A or N m, or correct gear_ratio and torque_constant_nm_a."
    )


def scale_notes(run: Motion, chain: Chain, arm: ArmMagnitudes) -> Iterator[str]:
    """A note on an unloaded run whose torque is not that of the links' weight, as with another unit on all joints."""
    place, joint, scale = next(_weight_scales(run.states.position_rad, run.torque_nm, chain, arm), (0, 0, 1.0))
    if place == 0 and not Magnitudes.low_scale < scale < Magnitudes.high_scale:
        yield (
            f"Without the payload, the torque of {arm.joint_names[joint]} is {scale:.2g} times that of the links' "
            "weight by the robot's file. If those masses are right and no tool was mounted, the torque has another "
            "scale or unit (N m?) on all joints, and the mass is wrong by the same factor. A weighed payload shows it: "
            "`armload calibrate`."
        )


def _refuse_scale(run: Recording, position: FloatArray, torque: FloatArray, chain: Chain, arm: ArmMagnitudes) -> None:
    """Raise for torques that are proportional to the links' weight at a wrong scale, the most loaded joint first."""
    for _, joint, scale in _weight_scales(position, torque, chain, arm):
        if abs(np.log(scale)) > np.log(Magnitudes.wrong_scale):
            raise _wrong_scale(run, arm.joint_names[joint], scale)


def _weight_scales(
    position: FloatArray, torque: FloatArray, chain: Chain, arm: ArmMagnitudes
) -> Iterator[tuple[int, int, float]]:
    """Place, joint and scale of torques that are proportional to the links' weight, the most loaded joint first.

    Beside the joint's own Coulomb and viscous friction, which resembles a weight where a run has few reversals.
    """
    if arm.body is None or len(position) <= torque.shape[1]:
        return
    still = np.zeros_like(position)
    expected = ArmDynamics(chain, arm.body).torque(np.nan_to_num(position), still, still)
    size, rate = expected.std(axis=0), np.gradient(position, axis=0)
    greatest = np.maximum(np.nan_to_num(arm.torque_max_nm, nan=0.0), size.max())
    visible = size > Magnitudes.weight_share * greatest
    for place, joint in enumerate(np.argsort(-size).tolist()):
        friction = np.column_stack([np.sign(rate[:, joint]), rate[:, joint], np.ones(len(rate))])
        good = np.isfinite(torque[:, joint]) & np.isfinite(friction).all(axis=1)
        both = np.column_stack([torque[:, joint], expected[:, joint]])[good]
        one, other = (both - friction[good] @ np.linalg.lstsq(friction[good], both)[0]).T
        along, least = float(one @ other), Correlations.weight if place == 0 else Correlations.same
        if visible[joint] and along > least * float(np.sqrt((one @ one) * (other @ other))):
            yield place, joint, along / float(other @ other)


def _wrong_scale(run: Recording, joint: str, scale: float) -> RecordingError:
    """The error for a torque that is proportional to the links' weight at a wrong scale."""
    guess = "Is this a recording of this arm, in N m or A?"
    if scale < 1.0:
        guess = (
            "The torques look like those of the motors, on the input side of the gears: multiply them by the gear "
            "ratio, or correct gear_ratio and torque_constant_nm_a, or the links if their file has g or mm."
        )
    elif 1.0 / Magnitudes.milli_within <= scale / 1000.0 <= Magnitudes.milli_within:
        guess = "Torques look like N mm, or currents like milliampere: convert them to N m or A."
    return RecordingError(
        f"{run.source.path}: the torque of {joint} is {scale:.2g} times the torque of the links' weight. {guess}"
    )


def require_possible_mass(mass_kg: float, interval_kg: FloatArray, rated_kg: float, arm: str) -> None:
    """Raise for a mass that an arm cannot carry, or is far too small to be measured with it.

    Args:
        mass_kg: The identified mass.
        interval_kg: (2,) its 95 % interval; NaN if it is not determined.
        rated_kg: The arm's rated payload.
        arm: Name of the arm, for messages.

    Raises:
        EstimationError: naming the mass, the rated payload and the likely causes.
    """
    low_kg, high_kg = interval_kg
    if low_kg > Magnitudes.beyond * rated_kg:
        size, units = f"{mass_kg / rated_kg:.2g} times", "N mm or milliampere, gear ratios applied twice"
    elif high_kg < Magnitudes.lightest_share * rated_kg:
        size, units = f"{100.0 * mass_kg / rated_kg:.1g} % of", "torques of the motors, gear ratios not applied"
    else:
        return
    raise EstimationError(
        f"the mass would be {mass_kg:.3g} kg, {size} the rated payload of {arm}, {rated_kg:g} kg. Check units "
        f"({units}), gear_ratio, torque_constant_nm_a, the order and signs of the joints, and that recordings, robot "
        "file and calibration are of this arm."
    )
