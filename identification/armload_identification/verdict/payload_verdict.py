"""Verdict on a payload by a second identification, and how to detect an error that would go undetected."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from armload_identification.estimation.payload_from_posterior import PayloadEstimate
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import InertialParameters, PayloadResult, derived
from armload_identification.verdict.agreement import Agreement, KnownMassCenter, LengthNeeded, Outcome
from armload_identification.verdict.decision_levels import ArmFit
from armload_identification.verdict.recording_checks.joint_scales import JointScales


@dataclass(frozen=True, eq=False, slots=True)
class Remedy:
    """How an error equal to the tolerance could be detected.

    Attributes:
        length: Required length of all runs.
        mass_joint: Joint, from 0, that best determines the mass.
        center_joint: Joint, from 0, that best determines the weakest direction of the centre of mass.
        level_share: Mean square sine of the angle between that direction and gravity: 1 always level, 0 always upright.
    """

    length: LengthNeeded
    mass_joint: int
    center_joint: int
    level_share: float


@dataclass(frozen=True, eq=False, slots=True)
class PayloadVerdict:
    """The verdict on a payload.

    Attributes:
        agreement: Statistic and outcome.
        of_payload: Every joint's measured torque as a multiple of the prediction with the payload in question.
        of_measured: The same with the measured payload; a deviation here contradicts the other joints.
        remedy: How an error equal to the tolerance could be detected.
        own_run: Whether the payload was identified from this run, which can contradict it but not confirm it.
        scale_verified: Whether something weighed verifies the scale of the torque, which both identifications share.
    """

    agreement: Agreement
    of_payload: JointScales
    of_measured: JointScales
    remedy: Remedy
    own_run: bool = False
    scale_verified: bool = True

    @property
    def outcome(self) -> Outcome:
        """Right, wrong, cannot tell."""
        outcome = self.agreement.outcome
        return Outcome.CANNOT_TELL if self.own_run and outcome is Outcome.RIGHT else outcome


def known_payload(result: PayloadResult) -> KnownMassCenter:
    """Mass and centre of mass of a payload file; the covariance from its intervals if the file has none."""
    known = result.mass_center or MassCenterCovariance.from_intervals(result.interval_95[:4], result.model.mass_kg)
    return KnownMassCenter(result.model, known)


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


def remedy_for(
    agreement: Agreement,
    length: LengthNeeded,
    found: PayloadEstimate,
    parameters: InertialParameters,
    position_rad: FloatArray,
) -> Remedy:
    """How an error equal to the tolerance could be detected; fit and (K, n) motion are the validation's."""
    slope = derived(parameters)[1]
    mass, center = np.zeros(10), np.zeros(10)
    mass[0], center[1:4] = 1.0, agreement.weakest
    # Changes of theta for an error of only the mass, and of only the centre of mass.
    seen = found.seen(np.asarray(np.linalg.solve(slope, np.column_stack([mass, center]))))
    chain = found.arm.layout.chain
    down = chain.gravity_m_s2 / np.linalg.norm(chain.gravity_m_s2)
    poses = position_rad[:: max(1, len(position_rad) // ArmFit.rows)]
    along = down @ chain.forward(poses)[:, -1, :3, :3] @ agreement.weakest
    return Remedy(
        length=length,
        mass_joint=int(np.argmax(seen[:, 0])),
        center_joint=int(np.argmax(seen[:, 1])),
        level_share=float(1.0 - np.mean(np.square(along))),
    )
