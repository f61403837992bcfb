"""Validate a payload: identify it again from other runs, and judge the difference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import NoPayloadMass, NothingMounted
from armload_identification.model.chain import Chain
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import PayloadResult
from armload_identification.model.regressor import payload_regressor
from armload_identification.pipeline.identification_result import Identification
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.recording.recording import Recording, RecordingSource
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.verdict.agreement import KnownMassCenter, compare_known, length_needed
from armload_identification.verdict.payload_verdict import PayloadVerdict, known_payload, remedy_for
from armload_identification.verdict.recording_checks.joint_scales import joint_scales
from armload_identification.verdict.tolerance import Tolerance


@dataclass(frozen=True, eq=False)
class Validation:
    """A payload judged by a second pair of runs.

    Attributes:
        verdict: Right, wrong or cannot tell, and why.
        measured: The payload identified from only the second pair.
        predicted_nm: (K, n) torque predicted with the payload in question at the samples of `signal`, with the friction
            from the second pair.
        residual_rms_nm: (n,) RMS of the raw single-sample torque difference minus that prediction, comparable to
            `signal.noise_nm`.
        torque_in_band_nm: (n,) RMS of the smoothed torque difference: the motion's band.
        left_in_band_nm: (n,) RMS of the smoothed torque difference minus the prediction.
    """

    verdict: PayloadVerdict
    measured: Identification
    predicted_nm: FloatArray
    residual_rms_nm: FloatArray
    torque_in_band_nm: FloatArray
    left_in_band_nm: FloatArray

    @property
    def signal(self) -> LoadSignal:
        """The measured torque difference of the second pair."""
        return self.measured.signal

    @property
    def sources(self) -> tuple[RecordingSource, ...]:
        """Sources of the second pair."""
        return self.measured.sources


def validate_runs(
    pair: tuple[Recording, Recording],
    chain: Chain,
    transmission: Transmission,
    payload: PayloadResult,
    tolerance: Tolerance | None = None,
    *,
    arm: KnownArm | None = None,
) -> Validation:
    """Judge a payload by a pair of runs that it was not identified from.

    Nominal gains are fitted with a payload. The second pair is identified with the gains from the first one, so that
    their remaining errors affect both in the same way and the verdict concerns the payload.

    Args:
        pair: Run with the payload, and run of the same motion without it.
        chain: The arm; the payload is in its flange frame.
        transmission: Gains and coupling.
        payload: The payload to be judged.
        tolerance: Tolerated error; 2 % of its mass and 10 mm if not given.
        arm: The calibrated empty arm, with its gains in `transmission` and its tilt in `chain`.

    Returns:
        The verdict, and the underlying signals.

    Raises:
        RecordingError: recordings that do not fit the arm or each other, or are invalid.
        EstimationError: no payload explains the runs.
    """
    gains = transmission if arm is not None else gains_to_compare_by(payload.mass_center, transmission)
    try:
        measured = identify_runs(*pair, chain, gains, arm=arm)
    except NothingMounted as empty:
        text = f"the payload cannot be judged by {pair[0].source.path}: in this run, {empty.statement}"
        raise NoPayloadMass(text, empty.mass_kg, empty.half_width_kg) from empty
    return judge(measured, chain, known_payload(payload), tolerance or Tolerance())


def gains_to_compare_by(judged: MassCenterCovariance | None, transmission: Transmission) -> Transmission:
    """The gains for identifying a payload again: those of the first identification, unless calibrated ones are known.

    Args:
        judged: Covariance of the payload in question, if its file contains it.
        transmission: The arm's transmission.
    """
    if judged is None or judged.gain_nm_a.shape != transmission.gain_nm_a.shape or transmission.calibrated.any():
        return transmission
    return transmission.held_at(judged.gain_nm_a, judged.gain_covariance)


def judge(measured: Identification, chain: Chain, judged: KnownMassCenter, tolerance: Tolerance) -> Validation:
    """Judge a payload by an identification from other runs.

    Args:
        judged: The payload in question.
        tolerance: Tolerated error.

    Returns:
        The verdict, and the underlying signals.
    """
    signal, states = measured.signal, measured.signal.loaded.states
    again = KnownMassCenter(measured.parameters, measured.mass_center)
    agreement = compare_known(judged, again, tolerance)
    regressor = payload_regressor(chain, *states)
    load = regressor @ judged.parameters.theta
    friction = measured.friction_nm
    predicted = load + friction
    length = length_needed(judged, again, tolerance)
    return Validation(
        verdict=PayloadVerdict(
            agreement=agreement,
            of_payload=joint_scales(signal, load, friction),
            of_measured=joint_scales(signal, regressor @ measured.parameters.theta, friction),
            remedy=remedy_for(agreement, length, measured.plain, measured.parameters, states.position_rad),
        ),
        measured=measured,
        predicted_nm=predicted,
        residual_rms_nm=signal.raw_residual_rms(predicted),
        torque_in_band_nm=np.sqrt(np.mean(signal.torque_nm[signal.valid] ** 2, axis=0)),
        left_in_band_nm=np.sqrt(np.mean((signal.torque_nm - predicted)[signal.valid] ** 2, axis=0)),
    )
