"""Conditions for feeding an estimated payload forward, each with the message for its violation.

The body that is fed is the possible one nearest to the estimate. It is fed while all conditions hold, and dropped as
soon as one fails; those on mass and centre of mass apply to both the estimate and the body:

    no external force on the arm at rest            an external force is not a payload
    mass known to within half its value             so that added torque at least halves the error
    moment known within `MOMENT_SHARE` of that of   the same for the wrist
     the rated payload at 0.1 m
    interval of the mass within the declared range  an unexpected payload is not compensated
     of at most `RATED_SHARE` of the rated payload
    centre of mass at most `REACH_M` away           no tool reaches further
    friction near the calibration's                 else the calibration no longer describes the arm
    body within the intervals of the estimate       else the body does not represent the estimate
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from armload_controller.control_errors import ControlError
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import REFERENCE_LENGTH_M, InertialParameters
from armload_identification.pipeline.recursive_estimator import LivePayload
from armload_identification.verdict.decision_levels import ColdArm
from armload_identification.verdict.recording_checks.friction_validity import standard_deviations

MASS_WITHIN: Final = 0.5
"""Half width of the mass's interval, as a share of the mass."""
MOMENT_SHARE: Final = 0.1
RATED_SHARE: Final = 0.8
"""Share of the robot's rated payload; the rest is for the error of the estimate."""
REACH_M: Final = 0.5
SPHERE_M: Final = 0.05
"""Radius of the sphere that represents the inertia, which working motions hardly reveal."""


class AdaptationRefused(ControlError):
    """The declared range of mass is not possible."""


@dataclass(frozen=True)
class DeclaredMass:
    """The range of mass that the operator expects.

    Attributes:
        least_kg: Lower bound; 0 if the flange may be empty.
        most_kg: Upper bound.
        rated_kg: Rated payload of the robot.

    Raises:
        AdaptationRefused: the range is empty, or exceeds `RATED_SHARE` of the rated payload.
    """

    least_kg: float
    most_kg: float
    rated_kg: float

    def __post_init__(self) -> None:
        if not 0.0 <= self.least_kg < self.most_kg:
            raise AdaptationRefused(
                f"expected mass {self.least_kg:g}..{self.most_kg:g} kg: give a range such as 0..3, the smaller value "
                "first"
            )
        if self.most_kg > self.greatest_kg:
            raise AdaptationRefused(
                f"expected mass up to {self.most_kg:g} kg: adaptive torque is limited to "
                f"{100.0 * RATED_SHARE:.0f} % of the rated {self.rated_kg:g} kg, {self.greatest_kg:g} kg. Identify "
                "such a payload, and use its file for the feed-forward"
            )

    @property
    def greatest_kg(self) -> float:
        """Greatest mass that is fed forward."""
        return RATED_SHARE * self.rated_kg


class AdaptationRules:
    """Checks estimates of one arm.

    Args:
        declared: The expected range of mass.
        calibration: The calibration that the estimates are based on.
    """

    def __init__(self, declared: DeclaredMass, calibration: ArmCalibration, joint_names: Sequence[str]) -> None:
        self._declared, self._joint_names = declared, tuple(joint_names)
        self._drift = calibration.drift[:2]

    def why_not(self, found: LivePayload) -> str | None:
        """Why an estimate must not be fed forward; None if it may be."""
        if found.contact:
            return "there is an external force on the arm"
        doubt = self._why_not(found.values, found.half_width_95)
        if doubt is not None:
            return doubt
        far = np.flatnonzero(friction_size(found, self._drift) > ColdArm.far_deviations)
        if far.size:
            return f"the friction of {self._joint_names[int(far[0])]} is far from the calibrated value"
        return None

    def why_not_fed(self, found: LivePayload, body: InertialParameters) -> str | None:
        """Why the body of an estimate must not be fed forward; None if it may be.

        Args:
            found: An estimate that satisfies all rules.
            body: The body that would be fed.
        """
        values = mass_and_center(body)
        if not np.all(np.abs(values - found.values) <= found.half_width_95):
            return "no possible body is within the intervals of the estimate"
        return self._why_not(values, found.half_width_95)

    def _why_not(self, values: FloatArray, half_width_95: FloatArray) -> str | None:
        """Why a mass and centre of mass, (4,), must not be fed forward; None if they may be."""
        mass, width = float(values[0]), float(half_width_95[0])
        if not width <= MASS_WITHIN * mass:
            return "the mass is not known well enough"
        declared, apart_m = self._declared, float(half_width_95[1:].max())
        if not mass * apart_m <= MOMENT_SHARE * declared.rated_kg * REFERENCE_LENGTH_M:
            return "the centre of mass is not known well enough"
        if mass - width < declared.least_kg or mass + width > declared.most_kg:
            return f"the mass may lie outside the declared {declared.least_kg:g}..{declared.most_kg:g} kg"
        if not float(np.linalg.norm(values[1:])) <= REACH_M:
            return f"the centre of mass is further than {REACH_M:g} m from the flange"
        return None


def mass_and_center(body: InertialParameters) -> FloatArray:
    """(4,) mass and centre of mass.

    Args:
        body: A body with a mass above 0.
    """
    return np.array([body.mass_kg, *body.center_of_mass_m])


def friction_size(found: LivePayload, drift: FloatArray) -> FloatArray:
    """(n,) size of each joint's change of friction since the calibration, in standard deviations, as for one run.

    Args:
        found: An estimate.
        drift: (2, n) the calibration's drift of Coulomb and viscous friction between runs.
    """
    return standard_deviations(found.friction[:2], found.friction_covariance, drift)


def carried_body(found: LivePayload) -> InertialParameters | None:
    """The body that is fed forward: mass and centre of the possible body nearest to the estimate.

    A coordinate whose interval contains zero is set to zero, and the inertia is that of a small sphere. Takes tens of
    milliseconds.

    Args:
        found: An estimate that satisfies all rules.

    Returns:
        The body; None if the arm may carry nothing.

    Raises:
        EstimationError: no possible body is near the estimate.
    """
    possible = found.possible_body()
    if possible is None:
        return None
    sure = np.abs(found.values[1:]) > found.half_width_95[1:]
    inertia = 0.4 * possible.mass_kg * SPHERE_M**2
    return InertialParameters.from_center_of_mass(
        possible.mass_kg, np.where(sure, possible.center_of_mass_m, 0.0), inertia * np.eye(3)
    )
