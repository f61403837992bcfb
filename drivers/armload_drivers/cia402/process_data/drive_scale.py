"""The scale that a drive reports, checked against the configuration. Pure.

    counts per axis turn = 608F increments per motor turn x gear ratio          (no 6092)
    counts per axis turn = 6092 feed per shaft turn                             (6092 in use)
    axis rated torque    = 6076 motor rated torque x gear ratio

The gear ratio is 6091. Many drives leave it at 1 : 1 and do not account for the gear behind their motor; then the
joint's gear ratio may apply. If the configuration gives a scale, it must agree with one of the two interpretations; if
it gives none and the two differ, nothing is guessed. A feed of 1 per turn is the reset value of drives that do not use
6092, and not a position unit.

References:
    CiA 402-2, 7 (factor group).
"""

from __future__ import annotations

import math
from dataclasses import replace

from msgspec import Struct

from armload_drivers.cia402.arm_settings import DriveSettings, EffortFeedback
from armload_drivers.driver_errors import CommandError

SCALE_TOLERANCE = 1e-3
"""Relative difference of a position scale that is attributed to rounding."""
RATING_TOLERANCE = 1e-2
"""Relative difference of a rated current or torque that is attributed to rounding."""


class ReportedScale(Struct, frozen=True):
    """The scale that a drive reports; None for values not reported.

    Attributes:
        increments_per_motor_turn: 608F.
        gear_ratio: 6091, motor turns per shaft turn.
        feed_per_shaft_turn: 6092.
        rated_torque_nm: 6076, of the motor.
        rated_current_a: 6075, of the motor.
    """

    increments_per_motor_turn: float | None
    gear_ratio: float | None
    feed_per_shaft_turn: float | None
    rated_torque_nm: float | None
    rated_current_a: float | None


def resolve(drive: DriveSettings, reported: ReportedScale) -> DriveSettings:
    """Settings with every scale filled in.

    Args:
        drive: The configured drive.
        reported: The scale that it reports.

    Raises:
        CommandError: the two contradict each other, or neither gives a scale; names the scale and the remedy.
    """
    gears = _gears(drive, reported)
    feed = reported.feed_per_shaft_turn
    feed_in_use = feed is not None and feed > 1.0
    turns = _products(feed if feed_in_use else reported.increments_per_motor_turn, [1.0] if feed_in_use else gears)
    counts_per_rad = _agree(
        "position units per rad (608F, 6091, 6092)",
        "counts_per_axis_turn",
        [turn / (2 * math.pi) for turn in turns],
        drive.counts_per_rad,
        SCALE_TOLERANCE,
    )
    torque_nm = _agree(
        "rated torque in N m (6076, 6091)",
        "rated_torque_nm",
        _products(reported.rated_torque_nm, gears),
        drive.rated_torque_nm,
        RATING_TOLERANCE,
    )
    current_a = drive.rated_current_a
    if drive.feedback is EffortFeedback.CURRENT and (current_a is not None or drive.vendor_effort is None):
        current_a = _agree(
            "rated current in A (6075)",
            "rated_current_a",
            _products(reported.rated_current_a, [1.0]),
            current_a,
            RATING_TOLERANCE,
        )
    return replace(drive, counts_per_rad=counts_per_rad, rated_torque_nm=torque_nm, rated_current_a=current_a)


def _gears(drive: DriveSettings, reported: ReportedScale) -> list[float]:
    """Candidate gear ratios for converting the drive's motor-side values to the axis."""
    if reported.gear_ratio is not None and reported.gear_ratio != 1.0:
        return [reported.gear_ratio]
    return [1.0] if drive.gear_ratio in {None, 1.0} else [1.0, float(drive.gear_ratio or 1.0)]


def _products(value: float | None, gears: list[float]) -> list[float]:
    """A value multiplied by each gear ratio; empty if the drive reports none."""
    return [] if not value else [value * gear for gear in gears]


def _agree(what: str, key: str, reported: list[float], configured: float | None, tolerance: float) -> float:
    """The configured value if it agrees with the drive's, or the drive's if none is configured."""
    shown = " or ".join(f"{value:.6g}" for value in reported)
    if configured is not None:
        if reported and not any(math.isclose(value, configured, rel_tol=tolerance) for value in reported):
            raise CommandError(
                f"the drive reports {what} = {shown}, the configuration {configured:.6g}: one of them is wrong, and "
                "the arm would move by the wrong amount"
            )
        return configured
    if len(reported) == 1:
        return reported[0]
    if reported:
        raise CommandError(
            f"the drive reports {what} = {shown}, depending on the side of the gear: give {key} in the configuration"
        )
    raise CommandError(f"neither the drive nor the configuration gives {what}: give {key} in the configuration")
