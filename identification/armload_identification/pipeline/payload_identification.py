"""Identify a payload: from a loaded and an unloaded recording to parameters with honest intervals.

recordings -> torque difference -> weighted least squares -> intervals -> physically possible set
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from armload_core.arrays import FloatArray
from armload_identification.estimation.blows import struck_samples
from armload_identification.estimation.estimator_names import Estimator
from armload_identification.estimation.estimators import fit_payload
from armload_identification.estimation.friction_columns import FrictionDifference, unloaded_body
from armload_identification.estimation.known_arm import KnownArm
from armload_identification.estimation.least_squares import Estimate
from armload_identification.estimation.mass_center_covariance import mass_center_covariance
from armload_identification.estimation.physical_consistency import PhysicalEstimate, make_physical
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.estimation.servo_sag import on_one_motion
from armload_identification.estimation.uncertainty import Uncertainty, quantify, shifts_by
from armload_identification.identification_errors import EstimationError, ModelError
from armload_identification.model.chain import Chain
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import InertialParameters, PayloadResult, Provenance
from armload_identification.model.regressor import payload_regressor
from armload_identification.recording.recording import Recording, RecordingSource, check_joints, hashes_by_name
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import LoadSignal, load_signal, without_body
from armload_identification.signals.motion import motion_of
from armload_identification.signals.robust_scale import deviation_by_median
from armload_identification.verdict.friction_validity import friction_change, friction_notes
from armload_identification.verdict.operator_notes import notes_on
from armload_identification.verdict.raw_residual import raw_residual_rms
from armload_identification.verdict.sanity import check_pair, check_run, check_signs, explain_negative_mass

FLANGE: Final = "flange"


@dataclass(frozen=True, eq=False)
class Identification:
    """A payload identified from two recordings, and everything that a report shows of it.

    All parameters are in the chain's flange frame.

    Attributes:
        plain: The weighted least squares estimate as it is, possible or not, with covariance of white
            residuals, condition number, rank, singular values and weights.
        physical: The physically possible estimate; this is what is reported and written.
        friction: Friction that was fitted with it; None where the estimator has none.
        uncertainty: Values, robust 95 % intervals and what is determined, about the physical estimate.
        mass_center: Covariance of mass and centre of mass, for comparison with another identification.
        signal: Measured torque difference over time, raw and smoothed, with the motion it belongs to, the noise
            per joint, the smoothing loss and how the two runs were laid over each other.
        predicted_nm: (K, n) torque that the physical estimate predicts at the samples of `signal`, friction
            that was fitted with it included.
        residual_rms_nm: (n,) RMS of the raw single-sample torque difference minus prediction, comparable to
            `signal.noise_nm`.
        sources: Of the loaded and, where there is one, the unloaded recording.
        notes: What the operator should know, one sentence each.
    """

    plain: Estimate
    friction: FrictionDifference | None
    physical: PhysicalEstimate
    uncertainty: Uncertainty
    mass_center: MassCenterCovariance
    signal: LoadSignal
    predicted_nm: FloatArray
    residual_rms_nm: FloatArray
    sources: tuple[RecordingSource, ...]
    notes: tuple[str, ...]

    @property
    def plain_parameters(self) -> InertialParameters:
        """The plain estimate's ten parameters; no body need have them."""
        return InertialParameters(self.plain.theta[:10])

    @property
    def parameters(self) -> InertialParameters:
        """The physically possible parameters."""
        return self.physical.parameters


def identify(
    loaded: Recording,
    unloaded: Recording | None,
    chain: Chain,
    transmission: Transmission,
    *,
    estimator: Estimator = Estimator.FRICTION,
    known: KnownPayload | None = None,
    arm: KnownArm | None = None,
) -> Identification:
    """Identify the payload that one run carried and the other did not.

    Args:
        loaded: Run with the payload.
        unloaded: Run of the same motion without it; None where the arm is known instead.
        chain: The arm; the result is in its flange frame.
        transmission: Gains and coupling; used where the recordings hold currents.
        estimator: How the payload is fitted.
        known: What is known of it beforehand.
        arm: The empty arm by a calibration, whose gains `transmission` has and whose level `chain` has: in place of the
            unloaded run, or beside it for what that run says of the arm less well.

    Returns:
        Estimate, physically possible estimate, intervals, and the series behind them.

    Raises:
        RecordingError: recordings that do not fit the arm or each other, or cannot be right.
        EstimationError: neither unloaded run nor a known arm, or data that no payload explains.

    References:
        Chen 2016, eqs. (8) to (12); the difference of runs in place of a body model, where there is an unloaded run.
    """
    if transmission.gain_nm_a.size != chain.n:
        raise ModelError(f"{transmission.gain_nm_a.size} gains for {chain.n} joints; expected one per joint")
    # Matrices of a few dozen columns: threads would wait for each other, on a busy machine for minutes.
    with threadpool_limits(1):
        return _identified(loaded, unloaded, chain, transmission, estimator, known, arm)


def _identified(
    loaded: Recording,
    unloaded: Recording | None,
    chain: Chain,
    transmission: Transmission,
    estimator: Estimator,
    known: KnownPayload | None,
    known_arm: KnownArm | None,
) -> Identification:
    """What `identify` does."""
    runs = (loaded,) if unloaded is None else (loaded, unloaded)
    for run in runs:
        check_joints(run, chain.n)
    signal = _signal(loaded, unloaded, chain, transmission, known_arm)
    prior = None if known is None else known.prior()
    empty = unloaded_body(signal, chain, transmission.coupling) if known_arm is None else known_arm.fit
    # Of one run the known arm was taken away, and all its errors are among the doubts.
    arm = None if unloaded is None else empty
    body = empty.model
    if unloaded is not None:
        signal = on_one_motion(signal.with_delay(body.torque_delay_s), chain, body)
    regressor = payload_regressor(chain, *signal.states)
    fit, friction = fit_payload(signal, regressor, chain, body, estimator, prior, arm)
    # Measured on the UR10e: with a calibrated arm this corrects the mass; with one pair's gains it corrects the mass
    # too, but drives the two mountings' centres apart, from 1.8 to 2.2 mm. So it is done where gains are known well.
    struck = _struck(signal, fit) if known_arm is not None else np.zeros_like(signal.valid)
    if struck.any():
        signal = replace(signal, loaded=replace(signal.loaded, valid=signal.loaded.valid & ~struck))
        fit, friction = fit_payload(signal, regressor, chain, body, estimator, prior, arm)
    check_signs(signal, regressor, fit)
    plain = InertialParameters(fit.theta[:10])
    if plain.mass_kg <= 0.0:
        width = quantify(fit, plain).half_width_95[0] if plain.mass_kg < 0.0 else np.inf
        raise explain_negative_mass(plain.mass_kg, float(width))
    physical = make_physical(fit)
    own_doubts = np.zeros((0, *signal.torque_nm.shape)) if friction is None else friction.doubts_nm
    gains = transmission if loaded.torque_nm is None or transmission.torque_calibrated else None
    if known_arm is not None and unloaded is None:
        # Gains and body err together: what is left of one run has the errors of both.
        arm_doubts = known_arm.doubts(signal.states, signal.interval_s, signal.loaded.torque_nm)
        own_doubts, gains = np.concatenate([own_doubts, arm_doubts]), None
    doubts = np.concatenate([_gain_doubts(gains, signal), own_doubts])
    uncertainty = quantify(fit, physical.parameters, shifts_by(fit, doubts))
    predicted = regressor @ physical.parameters.theta
    if friction is not None:
        predicted = predicted + friction.torque_nm
    return Identification(
        plain=fit,
        friction=friction,
        physical=physical,
        uncertainty=uncertainty,
        mass_center=mass_center_covariance(fit, physical.parameters, own_doubts, signal.torque_nm, gains),
        signal=signal,
        predicted_nm=predicted,
        residual_rms_nm=raw_residual_rms(signal, predicted),
        sources=tuple(run.source for run in runs),
        notes=(
            *notes_on(runs, transmission, signal, arm, fit, friction, physical, uncertainty),
            *_on_blows(signal, struck),
            *(() if known_arm is None else _on_friction(known_arm, chain, signal, unloaded, physical.parameters)),
        ),
    )


def _signal(
    loaded: Recording, unloaded: Recording | None, chain: Chain, transmission: Transmission, arm: KnownArm | None
) -> LoadSignal:
    """Torque of the payload by the difference of runs, or by that of run and known arm."""
    if unloaded is not None:
        check_pair(loaded, unloaded, transmission)
        return load_signal(loaded, unloaded, transmission)
    if arm is None:
        raise EstimationError(
            "no unloaded recording was given, and the arm's own torque is not known: it is many times the payload's. "
            "Record the same excitation without the payload and give that file as --unloaded, or calibrate the arm "
            "once with `armload calibrate` and give that file as --calibration."
        )
    check_run(loaded, transmission)
    body = arm.fit.model
    motion = motion_of(loaded, transmission).with_delay(body.torque_delay_s)
    empty = body.torque(chain, *motion.states)
    return without_body(motion, empty)


def _gain_doubts(gains: Transmission | None, signal: LoadSignal) -> FloatArray:
    """(k, K, n) torque of one standard deviation of each independent error of the gains; none without any."""
    return np.zeros((0, *signal.torque_nm.shape)) if gains is None else gains.gain_doubts(signal.torque_nm)


def _struck(signal: LoadSignal, fit: Estimate) -> NDArray[np.bool_]:
    """(K,) samples about a blow to the arm."""
    weighted = fit.residual_nm * fit.sample_weight
    spread = deviation_by_median(weighted[signal.valid])
    size = np.divide(weighted, spread, out=np.zeros_like(weighted), where=spread > 0.0)
    return struck_samples(size, signal.time_s)


def _on_friction(
    arm: KnownArm, chain: Chain, signal: LoadSignal, unloaded: Recording | None, payload: InertialParameters
) -> tuple[str, ...]:
    """Whether the arm still is as it was calibrated, by the unloaded run or by the only one."""
    run = signal.loaded if unloaded is None else signal.unloaded
    body, states = arm.fit.model, run.states
    carried = None if unloaded is not None else payload_regressor(chain, *states) @ payload.theta
    left = run.torque_nm - body.torque(chain, *states, carried)
    return friction_notes(friction_change(arm, states.velocity_rad_s, left, run.valid, run.interval_s))


def _on_blows(signal: LoadSignal, struck: NDArray[np.bool_]) -> list[str]:
    """What was left out of the motion."""
    if not struck.any():
        return []
    when = ", ".join(f"{moment:.1f}" for moment in signal.time_s[struck & ~np.roll(struck, 1)])
    return [
        f"{np.count_nonzero(struck) * signal.interval_s:.1f} s of the motion were left out, from {when} s on: "
        "several joints are far off there at once, as after a blow to the arm."
    ]


def payload_result(
    result: Identification,
    armload_version: str,
    configuration_sha256: str,
    calibration_sha256: Mapping[str, str] | None = None,
    frame: str = FLANGE,
) -> PayloadResult:
    """The content of a payload file.

    Args:
        result: What was identified.
        armload_version: Version of the program.
        configuration_sha256: Hash of the robot's configuration.
        calibration_sha256: File name and hash of the arm's calibration, where there is one.
        frame: Name of the frame that the chain's flange is.

    Returns:
        The content; what is not determined has no interval and no number but in the model.
    """
    known = result.uncertainty.determined
    return PayloadResult(
        frame=frame,
        model=result.parameters,
        determined=known,
        interval_95=np.where(known[:, None], result.uncertainty.interval_95, np.nan),
        residual_rms_nm=result.residual_rms_nm,
        noise_nm=result.signal.noise_nm,
        mass_center=result.mass_center,
        provenance=Provenance(
            armload_version=armload_version,
            configuration_sha256=configuration_sha256,
            recordings_sha256=hashes_by_name(result.sources),
            calibration_sha256=dict(calibration_sha256 or {}),
        ),
    )
