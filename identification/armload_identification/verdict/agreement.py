"""Agreement of two results for mass and centre of mass: the statistic for all verdicts on a payload.

    d = [m, c]_measured - [m, c]_judged,        C = C_measured + C_judged + C_gains + diag(5 g, 1 mm, 1 mm, 1 mm)^2

If both were obtained with the same gains or calibration, C_gains contains only the difference of the effects of its
errors on the two. With nu degrees of freedom the payload differs if

    (d^T C^-1 d / 4) (nu - 3) / nu > F_0.99(4, nu - 3)

(Hotelling). A significant difference may be unimportant, and an insignificant one too large. There are therefore three
outcomes, for a tolerance of mass and centre of mass:

- right: the 95 % interval of the difference lies within the tolerance; or the two do not differ, and an error equal to
  the tolerance would have been detected with a probability of 95 %.
- wrong: they differ, and not demonstrably within the tolerance.
- cannot tell: they do not differ, but an error beyond the tolerance could have gone undetected.

References:
    Hotelling, Annals of Mathematical Statistics 2(3), 1931.
    Krishnamoorthy, Yu, Statistics and Probability Letters 66(2), 2004, eq. (8): nu of a sum of covariances.
    Schuirmann, Journal of Pharmacokinetics and Biopharmaceutics 15(6), 1987: equivalence by intervals.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from typing import Final

import numpy as np

from armload_identification.estimation.payload_intervals import student_half_width
from armload_identification.float_array import FloatArray
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import InertialParameters
from armload_identification.verdict.decision_levels import AgreementLevels, FalseAlarms
from armload_identification.verdict.tolerance import Tolerance

FLOOR: Final = np.array([AgreementLevels.floor_kg, *3 * [AgreementLevels.floor_m]])
"""(4,) standard deviation in kg and m of errors that no covariance contains."""
_SIZE: Final = FLOOR.size


class Outcome(StrEnum):
    """The verdict on a payload."""

    RIGHT = "right"
    WRONG = "wrong"
    CANNOT_TELL = "cannot tell"


@dataclass(frozen=True, eq=False, slots=True)
class KnownMassCenter:
    """Mass and centre of mass, and how precisely they are known.

    Attributes:
        parameters: The payload.
        covariance: Covariance of its mass and centre of mass.
    """

    parameters: InertialParameters
    covariance: MassCenterCovariance


@dataclass(frozen=True, eq=False)
class Agreement:
    """Comparison of a payload with an independent measurement.

    Attributes:
        outcome: Right, wrong, cannot tell.
        difference: (4,) measured minus judged mass in kg and centre of mass in m.
        statistic: The F statistic.
        critical: The value that it exceeds by chance in one of a hundred comparisons.
        half_width_95: (4,) half widths of the 95 % intervals of the difference.
        judged: The payload in question.
        tolerance_kg: Tolerance of the mass.
        tolerance_m: Tolerance of the centre of mass.
        noticeable_kg: Error of only the mass that would be detected with a probability of 95 %.
        noticeable_m: The same for the centre of mass, in its least certain direction.
        weakest: (3,) that direction, a unit vector.
    """

    outcome: Outcome
    difference: FloatArray
    statistic: float
    critical: float
    half_width_95: FloatArray
    judged: InertialParameters
    tolerance_kg: float
    tolerance_m: float
    noticeable_kg: float
    noticeable_m: float
    weakest: FloatArray

    @property
    def differs(self) -> bool:
        """Whether the two differ significantly, with 1 % of false alarms."""
        return self.statistic > self.critical


@dataclass(frozen=True, slots=True)
class LengthNeeded:
    """Length of the runs that is required to detect an error equal to the tolerance.

    Attributes:
        factor: Multiple of the present length, at least 1; inf if no length suffices.
        gains_limit: Whether no length suffices because of the gains; otherwise the tolerance is too close to the floor.
    """

    factor: float
    gains_limit: bool


def compare_known(judged: KnownMassCenter, measured: KnownMassCenter, tolerance: Tolerance) -> Agreement:
    """Outcome and statistics of a payload judged by an independent measurement of it."""
    difference = (measured.parameters.values - judged.parameters.values)[:4]
    gains = _held(judged.covariance, measured.covariance)
    covariance, freedom = _difference_covariance(judged.covariance, measured.covariance, gains)
    free = _denominator_freedom(freedom)
    square = float(difference @ np.linalg.solve(covariance, difference))
    statistic = square / _SIZE * free / (free + _SIZE - 1.0)
    critical = _critical_and_detectable(freedom)[0]
    noticeable_kg, noticeable_m, weakest = _noticeable_errors(covariance, freedom)
    tolerance_kg = tolerance.mass_share * judged.parameters.mass_kg
    quantile = float(student_half_width(freedom))
    width = quantile * np.sqrt(np.diag(covariance))
    reach_m = np.linalg.norm(difference[1:]) + quantile * np.sqrt(np.linalg.eigvalsh(covariance[1:, 1:])[-1])
    within = abs(difference[0]) + width[0] <= tolerance_kg and reach_m <= tolerance.center_m
    sharp = noticeable_kg <= tolerance_kg and noticeable_m <= tolerance.center_m
    if within or (sharp and statistic <= critical):
        outcome = Outcome.RIGHT
    else:
        outcome = Outcome.WRONG if statistic > critical else Outcome.CANNOT_TELL
    return Agreement(
        outcome=outcome,
        difference=difference,
        statistic=statistic,
        critical=critical,
        half_width_95=width,
        judged=judged.parameters,
        tolerance_kg=tolerance_kg,
        tolerance_m=tolerance.center_m,
        noticeable_kg=noticeable_kg,
        noticeable_m=noticeable_m,
        weakest=weakest,
    )


def length_needed(judged: KnownMassCenter, measured: KnownMassCenter, tolerance: Tolerance) -> LengthNeeded:
    """Length of the runs that is required to detect an error equal to the tolerance."""
    from scipy.optimize import brentq

    tolerance_kg = tolerance.mass_share * judged.parameters.mass_kg
    gains = _held(judged.covariance, measured.covariance)

    def excess(log_factor: float, of_gains: FloatArray) -> float:
        """Relative excess over its tolerance of the worse of the two noticeable errors."""
        longer = float(np.exp(log_factor))
        kg, m, _ = _noticeable_errors(*_difference_covariance(judged.covariance, measured.covariance, of_gains, longer))
        return float(max(kg / tolerance_kg, m / tolerance.center_m) - 1.0)

    longest = float(np.log(AgreementLevels.longest_factor))
    if excess(0.0, gains) <= 0.0:
        return LengthNeeded(1.0, gains_limit=False)
    if excess(longest, gains) > 0.0:
        return LengthNeeded(float("inf"), gains_limit=excess(longest, np.zeros_like(gains)) <= 0.0)
    log_factor = brentq(excess, 0.0, longest, args=(gains,))
    return LengthNeeded(float(np.exp(log_factor)), gains_limit=False)


def _held(one: MassCenterCovariance, other: MassCenterCovariance) -> FloatArray:
    """(4, 4) the share of gains and calibration in the covariance of the difference."""
    return np.asarray(one.minus(other).total - one.measured - other.measured)


def _difference_covariance(
    one: MassCenterCovariance, other: MassCenterCovariance, of_gains: FloatArray, longer: float = 1.0
) -> tuple[FloatArray, float]:
    """Covariance of the difference and its degrees of freedom for runs `longer` times as long."""
    parts = [(known.measured / longer, known.freedom * longer) for known in (one, other)]
    total = parts[0][0] + parts[1][0] + of_gains + np.diag(FLOOR**2)
    scatter = 0.0
    for part, freedom in parts:
        share = np.linalg.solve(total, part)
        scatter += float(np.trace(share @ share) + np.trace(share) ** 2) / freedom
    freedom = (_SIZE + _SIZE**2) / max(scatter, AgreementLevels.least_scatter)
    return total, freedom


def _denominator_freedom(freedom: float) -> float:
    """Degrees of freedom of the denominator of F."""
    return max(freedom, AgreementLevels.fewest_freedom) - _SIZE + 1.0


def _noticeable_errors(covariance: FloatArray, freedom: float) -> tuple[float, float, FloatArray]:
    """Smallest errors detected with `FalseAlarms.power`: of mass and centre, and the latter's weakest direction."""
    size = _critical_and_detectable(freedom)[1]
    precision = np.linalg.inv(covariance)
    power, axes = np.linalg.eigh(precision[1:, 1:])
    return size / np.sqrt(precision[0, 0]), size / np.sqrt(power[0]), np.asarray(axes[:, 0])


@lru_cache(maxsize=64)
def _critical_and_detectable(freedom: float) -> tuple[float, float]:
    """The critical F, and the length in standard deviations of a difference that exceeds it with `power`."""
    from scipy.special import fdtri, ncfdtrinc

    free = _denominator_freedom(freedom)
    critical = float(fdtri(_SIZE, free, 1.0 - FalseAlarms.probability))
    return critical, float(np.sqrt(ncfdtrinc(_SIZE, free, 1.0 - FalseAlarms.power, critical)))
