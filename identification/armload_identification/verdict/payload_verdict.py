"""Verdict on a payload by a second identification."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import InertialParameters, PayloadResult
from armload_identification.verdict.agreement import Agreement, KnownMassCenter, LengthNeeded, Outcome
from armload_identification.verdict.recording_checks.joint_scales import JointScales


@dataclass(frozen=True, eq=False, slots=True)
class PayloadVerdict:
    """The verdict on a payload.

    Attributes:
        agreement: Statistic and outcome.
        of_payload: Every joint's measured torque as a multiple of the prediction with the payload in question.
        of_measured: The same with the measured payload; a deviation here contradicts the other joints.
        length: Length of all runs that would detect an error equal to the tolerance.
        own_run: Whether the payload was identified from this run, which can contradict it but not confirm it.
        scale_verified: Whether something weighed verifies the scale of the torque, which both identifications share.
    """

    agreement: Agreement
    of_payload: JointScales
    of_measured: JointScales
    length: LengthNeeded
    own_run: bool = False
    scale_verified: bool = True

    @property
    def outcome(self) -> Outcome:
        """Right, wrong, cannot tell."""
        outcome = self.agreement.outcome
        return Outcome.CANNOT_TELL if self.own_run and outcome is Outcome.RIGHT else outcome


def known_payload(result: PayloadResult) -> KnownMassCenter:
    """Mass and centre of mass of a payload file; the covariance from its intervals if the file has none."""
    covariance = result.mass_center
    if covariance is None:
        covariance = MassCenterCovariance.from_intervals(result.interval_95[:4], result.model.mass_kg)
    return KnownMassCenter(result.model, covariance)


def with_gains(known: KnownMassCenter, gain: FloatArray, covariance: FloatArray) -> KnownMassCenter:
    """The same payload with other gains, (n,) N m/A, and the (n, n) covariance of their logarithms.

    Mass and centre of mass change along the slopes of the payload's file; the inertia about the centre of mass is kept.

    Raises:
        ModelError: no gains were used, or those of another number of axes.
    """
    was = known.covariance
    if was.gain_nm_a.shape != gain.shape:
        raise ModelError(
            f"the payload's file has the gains of {was.gain_nm_a.size} axes, the calibration has {gain.size}; identify "
            "the payload again with the calibration"
        )
    moved = was.gain_slope @ np.log(gain / was.gain_nm_a)
    body = known.parameters
    center = body.center_of_mass_m + moved[1:]
    mass_kg = body.mass_kg + float(moved[0])
    parameters = InertialParameters.from_center_of_mass(mass_kg, center, body.inertia_about_com)
    return KnownMassCenter(parameters, replace(was, gain_nm_a=gain, gain_covariance=covariance))
