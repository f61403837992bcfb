"""Detection of recordings with impossible magnitudes: wrong units, torques at the motor, another arm.

They are compared with the arm's file: its ranges, the torque of its joints, and, if known, its links. The torque due to
the links' weight is then known within tens of per cent, and wrong units cause far greater errors.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import EstimationError, RecordingError
from armload_identification.model.chain import Chain
from armload_identification.model.dynamics import ArmBody, ArmDynamics
from armload_identification.recording.recording import Recording

_ROWS: Final = 500
_DEGREE: Final = 180.0 / np.pi
_TOO_STRONG: Final = 20.0
"""Multiple of a joint's greatest torque that no drive reaches even briefly; wrong units cause a factor of 1000."""
_WIDE: Final = 3.0
"""Multiple of a joint's range that no motion reaches: the angles are in another unit."""
_OUTSIDE_RAD: Final = 0.2
_TOO_FAST: Final = 3.0
"""Multiple of a joint's greatest speed that it does not reach while all other joints keep to theirs; at most 0.88 on
er50, prbt and the UR10e. Degrees cause a factor of 57."""
_WITHIN: Final = 1.2
_SPEED_OVER_S: Final = 0.1
"""Encoder noise does not count as speed over this time."""
_HEAVY: Final = 0.02
"""Share of the greatest torque from which the links' weight is visible in a joint's torque."""
_FOLLOWS: Final = 0.6
"""Correlation from which a torque is due to the links, whatever its scale."""
_FOLLOWS_CLOSELY: Final = 0.9
"""The same for all but the most loaded joint: friction of a wrist can resemble a weight in a short run."""
_WEAK, _STRONG = 0.1, 10.0
"""Ratios of measured to expected torque beyond which the unit, or the side of the gear, is wrong."""
_MILLI: Final = (300.0, 3000.0)
_TOO_HEAVY, _TOO_LIGHT = 3.0, 1e-3
"""Multiples of the rated payload beyond which a mass is not one that the arm carries, or that its torques show."""


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
        chain: The arm.
        torque_nm: (N, n) joint torque of the run; None without any.
        arm: Its possible magnitudes.

    Raises:
        RecordingError: naming joint, value, the arm's limit, and the likely unit.
    """
    every = slice(None, None, max(1, run.size // _ROWS))
    position = run.position_rad[every]
    _refuse_positions(run, position, arm)
    _refuse_speeds(run, arm)
    if torque_nm is None:
        return
    torque = torque_nm[every]
    _refuse_strength(run, torque, arm)
    if arm.body is not None:
        _refuse_scale(run, position, torque, chain, arm, arm.body)


def _refuse_positions(run: Recording, position: FloatArray, arm: ArmMagnitudes) -> None:
    """Raise for positions beyond the joints' ranges."""
    low, high = np.nanmin(position, axis=0), np.nanmax(position, axis=0)
    with np.errstate(invalid="ignore"):
        beyond = np.maximum(arm.position_min_rad - low, high - arm.position_max_rad)
        width = arm.position_max_rad - arm.position_min_rad
        reach = np.maximum(np.abs(low), np.abs(high))
        bound = np.maximum(np.abs(arm.position_min_rad), np.abs(arm.position_max_rad))
        wide = (reach > _WIDE * bound) | (high - low > _WIDE * width)
        degrees = wide & (reach / _DEGREE < bound + _OUTSIDE_RAD)
    for joint in np.flatnonzero(degrees | (beyond > np.maximum(_OUTSIDE_RAD, 0.1 * np.nan_to_num(width, posinf=0.0)))):
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
    window = max(round(_SPEED_OVER_S / interval_s), 1)
    if run.size <= window:
        return
    moved = np.abs(run.position_rad[window:] - run.position_rad[:-window])
    speed = np.percentile(moved / (run.time_s[window:] - run.time_s[:-window])[:, None], 99.0, axis=0)
    times = speed / arm.velocity_max_rad_s
    fast = times > _TOO_FAST
    # Where the others exceed them too, the limits are those of a slow test, not of the arm.
    if not fast.any() or not (times[~fast] <= _WITHIN).any() or (times[~fast] > _WITHIN).any():
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
        times = np.nanpercentile(np.abs(torque), 99.0, axis=0) / arm.torque_max_nm
    if not (times > _TOO_STRONG).any():
        return
    joint = int(np.nanargmax(times))
    raise RecordingError(
        f"{run.source.path}: {arm.joint_names[joint]} reaches {times[joint] * arm.torque_max_nm[joint]:.3g} N m, "
        f"{times[joint]:.0f} times its greatest torque, {arm.torque_max_nm[joint]:.3g} N m. Currents look like "
        "milliampere, or torques like N mm: convert them to A or N m, or correct gear_ratio and torque_constant_nm_a."
    )


def _refuse_scale(
    run: Recording, position: FloatArray, torque: FloatArray, chain: Chain, arm: ArmMagnitudes, body: ArmBody
) -> None:
    """Raise for torques that are proportional to the links' weight at a wrong scale, the most loaded joint first."""
    still = np.zeros_like(position)
    expected = ArmDynamics(chain, body).torque(np.nan_to_num(position), still, still)
    swing, measured = expected - expected.mean(axis=0), torque - np.nanmean(torque, axis=0)
    size = np.sqrt(np.mean(swing**2, axis=0))
    visible = (size > _HEAVY * np.nan_to_num(arm.torque_max_nm, nan=0.0)) & (size > _HEAVY * size.max())
    for place, joint in enumerate(np.argsort(-size)):
        good = np.isfinite(measured[:, joint])
        one, other = measured[good, joint], swing[good, joint]
        along, least = float(one @ other), _FOLLOWS if place == 0 else _FOLLOWS_CLOSELY
        if not visible[joint] or not along > least * float(np.sqrt((one @ one) * (other @ other))):
            continue
        scale = along / float(other @ other)
        if not _WEAK <= scale <= _STRONG:
            raise _wrong_scale(run, arm.joint_names[joint], scale)


def _wrong_scale(run: Recording, joint: str, scale: float) -> RecordingError:
    """The error for a torque that is proportional to the links' weight at a wrong scale."""
    guess = "Is this a recording of this arm, in N m or A?"
    if scale < _WEAK:
        guess = (
            "The torques look like those of the motors, on the input side of the gears: multiply them by the gear "
            "ratio, or correct gear_ratio and torque_constant_nm_a."
        )
    elif _MILLI[0] <= scale <= _MILLI[1]:
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
    if low_kg > _TOO_HEAVY * rated_kg:
        size, units = f"{mass_kg / rated_kg:.2g} times", "N mm or milliampere, gear ratios applied twice"
    elif high_kg < _TOO_LIGHT * rated_kg:
        size, units = f"{100.0 * mass_kg / rated_kg:.1g} % of", "torques of the motors, gear ratios not applied"
    else:
        return
    raise EstimationError(
        f"the mass would be {mass_kg:.3g} kg, {size} the rated payload of {arm}, {rated_kg:g} kg. Check units "
        f"({units}), gear_ratio, torque_constant_nm_a, the order and signs of the joints, and that recordings, robot "
        "file and calibration are of this arm."
    )
