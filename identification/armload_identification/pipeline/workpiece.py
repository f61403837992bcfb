"""What is in a tool: the whole minus the tool, with both covariances.

    theta_w = theta_whole - theta_tool,   cov(m, m c) = cov_whole + cov_tool

for mass and first moments, which are linear in theta. Drive gains and a calibration that both were identified with
count once, with the difference of the slopes; drifts since the calibration, which differ from day to day, count twice.
Mass and centre of mass of the workpiece follow to first order. Its inertia about its own centre of mass is the
difference of two much greater ones, whose covariances payload files do not contain: it is not determined, and the model
has the nearest possible one.

An unloaded run that both have in common makes the intervals wider than necessary, not narrower.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from armload_identification.estimation.payload_intervals import student_half_width
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError
from armload_identification.model.mass_center import MassCenterCovariance, moments_slope
from armload_identification.model.payload import DETERMINED_SHARE, InertialParameters, PayloadResult, value_scale
from armload_identification.verdict.payload_verdict import known_payload

_THINNEST_M: Final = 0.01
"""Radius of gyration that the model has at least in each direction; a payload's inertia about its centre then has no
visible torque."""


@dataclass(frozen=True, eq=False)
class Workpiece:
    """What a tool carries.

    Attributes:
        model: Its body, in the frame of both; the inertia is a possible one, not a measurement.
        mass_center: Covariance of its mass and centre of mass.
        half_width_95: (4,) half widths of their 95 % intervals in kg and m, whether they are determined or not.
    """

    model: InertialParameters
    mass_center: MassCenterCovariance
    half_width_95: FloatArray

    @staticmethod
    def of(whole: PayloadResult, tool: PayloadResult, gain_drift: float = 0.0) -> Workpiece:
        """The whole minus the tool, both identified on the same arm.

        Args:
            whole: The tool with what it carries.
            gain_drift: Standard deviation of the drift that all gains have in common on a day: each has its own.

        Raises:
            EstimationError: the difference has no mass.
        """
        theta = whole.model.theta - tool.model.theta
        if theta[0] <= 0.0:
            raise EstimationError(
                f"the whole weighs {whole.model.mass_kg:.3g} kg, the tool alone {tool.model.mass_kg:.3g} kg: nothing "
                "is left for a workpiece. Check that the tool's payload is of this arm, and that the loaded run "
                "carried both."
            )
        center = theta[1:4] / theta[0]
        back: FloatArray = np.asarray(np.linalg.inv(moments_slope(theta[0], center)), dtype=float)
        parts = [_expressed(result, back) for result in (whole, tool)]
        drifted = gain_drift * np.stack([part.gain_slope.sum(axis=1) for part in parts])
        covariance = parts[0].minus(parts[1])
        covariance = replace(covariance, measured=covariance.measured + drifted.T @ drifted)
        total = covariance.total
        # after Satterthwaite; the gains' share is taken as known
        scatter = sum(np.diag(part.measured) ** 2 / part.freedom for part in parts)
        freedom = np.diag(total) ** 2 / np.maximum(scatter, np.finfo(np.float64).tiny)
        half_width = student_half_width(freedom) * np.sqrt(np.diag(total))
        return Workpiece(_possible(theta, center), covariance, half_width)

    def result(self, whole: PayloadResult) -> PayloadResult:
        """The content of a payload file; residual, noise and provenance are those of the whole."""
        half_width = np.concatenate([self.half_width_95, np.full(6, np.inf)])
        determined = half_width <= DETERMINED_SHARE * value_scale(self.model.mass_kg)
        interval = self.model.values[:, None] + half_width[:, None] * np.array([-1.0, 1.0])
        return replace(
            whole,
            model=self.model,
            determined=determined,
            interval_95=np.where(determined[:, None], interval, np.nan),
            mass_center=self.mass_center,
            known_range=None,
        )


def _expressed(result: PayloadResult, back: FloatArray) -> MassCenterCovariance:
    """A payload's covariance as that of the workpiece's [m, c], by its (4, 4) change per change of [m, m c]."""
    known = known_payload(result).covariance
    turn = back @ moments_slope(result.model.mass_kg, result.model.center_of_mass_m)
    return replace(
        known,
        measured=turn @ known.measured @ turn.T,
        gain_slope=turn @ known.gain_slope,
        calibration_slope=turn @ known.calibration_slope,
    )


def _possible(theta: FloatArray, center_m: FloatArray) -> InertialParameters:
    """A possible body with this mass and centre of mass: second moments below a bound are raised to it."""
    mass_kg = float(theta[0])
    pseudo = InertialParameters(theta).pseudo_inertia
    moments, axes = np.linalg.eigh(pseudo[:3, :3] - mass_kg * np.outer(center_m, center_m))
    raised = (axes * np.maximum(moments, mass_kg * _THINNEST_M**2)) @ axes.T
    pseudo[:3, :3] = raised + mass_kg * np.outer(center_m, center_m)
    return InertialParameters.from_pseudo_inertia(pseudo)
