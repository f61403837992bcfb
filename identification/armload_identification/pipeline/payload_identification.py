"""Identify a payload: from a loaded and an unloaded recording to parameters with intervals.

recordings -> torque difference -> weighted least squares -> intervals -> physically possible set
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.arm_friction import ArmFriction
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.estimation.empty_arm.unloaded_arm import BodyFit
from armload_identification.estimation.estimator_names import Estimator
from armload_identification.estimation.estimators import fit_payload
from armload_identification.estimation.friction_columns import unloaded_body
from armload_identification.estimation.gain_columns import GainFit
from armload_identification.estimation.least_squares import Prior
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.estimation.sampled_torque import sampling_doubt
from armload_identification.estimation.servo_sag import on_one_motion
from armload_identification.estimation.uncertainty import quantify, shifts_by
from armload_identification.identification_errors import EstimationError, ModelError
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters, PayloadResult, Provenance
from armload_identification.model.regressor import payload_regressor
from armload_identification.pipeline.any_motion import identify_alone
from armload_identification.pipeline.identification_result import Fit, Identification, completed, without_blows
from armload_identification.pipeline.mass_center_ranges import within_ranges
from armload_identification.pipeline.weighed_mass import CONTRADICTS, note_on_mass
from armload_identification.recording.recording import Recording, check_joints, hashes_by_name
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import LoadSignal, load_signal
from armload_identification.signals.motion import Motion
from armload_identification.verdict.operator_notes import misfit_notes
from armload_identification.verdict.recording_checks.column_mistakes import looks_wrong, refuse_wrong_columns
from armload_identification.verdict.recording_checks.effort_mismatch import require_effort
from armload_identification.verdict.recording_checks.friction_validity import (
    friction_change,
    friction_notes,
    standard_deviations,
)
from armload_identification.verdict.recording_checks.joint_scales import joint_scales
from armload_identification.verdict.recording_checks.sanity import (
    check_against_others,
    check_gains,
    check_pair,
    check_scales,
    explain_negative_mass,
)

FLANGE: Final = "flange"


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
    """Identify the payload of a loaded run, from the difference to an unloaded run or with a calibrated arm.

    Args:
        loaded: Run with the payload.
        unloaded: Run of the same motion without it; None if `arm` is given instead.
        chain: The arm; the result is in its flange frame.
        transmission: Gains and coupling; gains are used for currents, and for reported torque if calibrated.
        estimator: How the payload is fitted.
        known: Prior knowledge of the payload.
        arm: The calibrated empty arm, with its gains in `transmission` and its tilt in `chain`: instead of the unloaded
            run, or in addition to it, as it is more accurate than the arm from that run.

    Returns:
        Estimate, physically possible estimate, intervals, and the underlying signals.

    Raises:
        ModelError: the number of gains differs from the number of joints.
        RecordingError: recordings that do not fit the arm or each other, or are invalid.
        EstimationError: neither an unloaded run nor a known arm, data that no payload explains, or that contradict
            the prior knowledge, a weighed mass included.

    References:
        Chen 2016, eqs. (8) to (12); with the difference of runs instead of a body model if there is an unloaded run.
    """
    if transmission.gain_nm_a.size != chain.n:
        raise ModelError(f"{transmission.gain_nm_a.size} gains for {chain.n} joints; expected one per joint")
    # One thread: with matrices of a few dozen columns threads only wait for each other, for minutes on a busy machine.
    with threadpool_limits(1):
        identified = _by_prior(loaded, unloaded, chain, transmission, estimator, arm)
        if known is None:
            return identified(None)
        if known.symmetric:
            _require_symmetric(identified(replace(known, symmetric=False).prior()))
        note = note_on_mass(known, identified)
        found = within_ranges(identified(known.prior()), known, identified)
        return replace(found, notes=(note, *found.notes)) if note else found


def _require_symmetric(found: Identification) -> None:
    """Raise if the data contradict a symmetry about the flange axis."""
    center, half_width = found.uncertainty.values[1:3], found.uncertainty.half_width_95[1:3]
    if (np.abs(center) > CONTRADICTS * half_width).any():
        raise EstimationError(
            "the payload was declared symmetric about the flange axis, but from the data its centre of mass lies "
            f"{1e3 * center[0]:+z.1f} and {1e3 * center[1]:+z.1f} mm off that axis (95 %: "
            f"+-{1e3 * half_width[0]:.1f} and {1e3 * half_width[1]:.1f} mm). Omit the symmetry, or check the flange "
            "frame."
        )


def _by_prior(
    loaded: Recording,
    unloaded: Recording | None,
    chain: Chain,
    transmission: Transmission,
    estimator: Estimator,
    known_arm: KnownArm | None,
) -> Callable[[Prior | None], Identification]:
    """`identify` as a function of the prior; what does not depend on it is computed once."""
    runs = (loaded,) if unloaded is None else (loaded, unloaded)
    for run in runs:
        check_joints(run, chain.n)
        if known_arm is not None:
            require_effort(run, known_arm.effort)
    if unloaded is None:
        if known_arm is None:
            raise EstimationError(
                "no unloaded recording was given, and the arm's own torque, which is many times the payload's, is "
                "unknown. Record the same excitation without the payload and give that file as `unloaded=`, or "
                "calibrate the arm once with `armload calibrate` and give that file as `calibration=`."
            )
        if estimator is not Estimator.FRICTION:
            raise EstimationError(
                f"the estimator '{estimator}' requires the difference of two runs, but there is only one run, with a "
                "calibration. Omit `estimator=`, or give an unloaded recording."
            )
        return lambda prior: identify_alone(loaded, chain, transmission, known_arm, prior)
    check_pair(loaded, unloaded, transmission)
    signal = load_signal(loaded, unloaded, transmission)
    arm = unloaded_body(signal, chain, transmission.coupling) if known_arm is None else known_arm.fit

    @cache
    def require_right_columns() -> None:
        refuse_wrong_columns(signal, loaded, unloaded, chain, transmission.coupling)

    if looks_wrong(signal, arm if known_arm is None else None):
        require_right_columns()

    def identified(prior: Prior | None) -> Identification:
        try:
            found = _from_difference(signal, loaded, unloaded, chain, transmission, estimator, prior, known_arm, arm)
        except EstimationError:
            # The cause may be a mistake in the columns, of which that error would be only a consequence.
            require_right_columns()
            raise
        if misfit_notes(found.signal, found.plain):
            require_right_columns()
        return found

    return identified


def _from_difference(
    signal: LoadSignal,
    loaded: Recording,
    unloaded: Recording,
    chain: Chain,
    transmission: Transmission,
    estimator: Estimator,
    prior: Prior | None,
    known_arm: KnownArm | None,
    arm: BodyFit,
) -> Identification:
    """The payload of a pair, from its torque difference and the body of the arm."""
    runs = (loaded, unloaded)
    body = arm.model
    signal = on_one_motion(signal.with_delay(body.torque_delay_s), chain, body)
    regressor = payload_regressor(chain, *signal.states)

    gains = transmission if loaded.torque_nm is None or transmission.torque_calibrated else None
    fitted_gains: GainFit | None = None

    def fit_to(difference: LoadSignal) -> Fit:
        found = fit_payload(difference, regressor, chain, body, estimator, prior, arm)
        return found.estimate, found.friction

    # Measured on the UR10e: with a calibrated arm, excluding blows corrects the mass; with one pair's gains it does so
    # too, but increases the distance of the two mountings' centres from 1.8 to 2.2 mm. Hence only with known gains.
    if known_arm is None:
        nominal = None if gains is None or gains.calibrated.any() else gains
        found = fit_payload(signal, regressor, chain, body, estimator, prior, arm, nominal)
        signal, fit, friction, fitted_gains = found.signal, found.estimate, found.friction, found.gains
        check_gains(fitted_gains)
        struck = np.zeros_like(signal.valid)
    else:
        signal, fit, friction, struck = without_blows(signal, fit_to)
    coulomb_nm = np.abs(body.coulomb_nm)
    check_against_others(signal, regressor, fit, coulomb_nm, gains_fitted=fitted_gains is not None)
    plain = InertialParameters(fit.theta[:10])
    doubts = sampling_doubt(chain, signal.states, fit.theta[:10], signal.interval_s)
    if friction is not None:
        doubts = np.concatenate([friction.doubts_nm, doubts])
    if plain.mass_kg <= 0.0:
        width = quantify(fit, plain, shifts_by(fit, doubts)).half_width_95[0] if plain.mass_kg < 0.0 else np.inf
        raise explain_negative_mass(plain.mass_kg, float(width))
    said: tuple[str, ...] = ()
    own = ArmFriction.of(body, signal.unloaded.states.velocity_rad_s)
    if known_arm is not None:
        change, covariance = _friction_change(known_arm, chain, signal.unloaded)
        said = friction_notes(standard_deviations(change, covariance, known_arm.drift[:2]))
        own = ArmFriction.of(body, signal.unloaded.states.velocity_rad_s, change)
    result = completed(
        signal, regressor, fit, friction, doubts, gains, runs, transmission, arm, own, struck, said, fitted_gains, prior
    )
    if result.uncertainty.determined[0]:
        friction_nm = np.zeros_like(signal.torque_nm) if friction is None else friction.torque_nm
        payload_nm = regressor @ plain.theta
        size_nm = np.sqrt(np.mean(payload_nm[signal.valid] ** 2, axis=0))
        scales = joint_scales(signal, payload_nm, friction_nm)
        check_scales(scales, size_nm, coulomb_nm, signal.loaded.moves)
    return result


def _friction_change(arm: KnownArm, chain: Chain, run: Motion) -> tuple[FloatArray, FloatArray]:
    """Difference of the unloaded run's friction from the calibrated arm's, as `friction_change`."""
    left = run.torque_nm - arm.fit.model.torque(chain, *run.states)
    return friction_change(arm, run.states.velocity_rad_s, left, run.valid, run.interval_s)


def payload_result(
    result: Identification,
    armload_version: str,
    configuration_sha256: str,
    calibration_sha256: Mapping[str, str] | None = None,
    frame: str = FLANGE,
    robot: str = "",
    kinematics_sha256: str = "",
) -> PayloadResult:
    """The content of a payload file.

    Args:
        result: The identification.
        armload_version: Version of the program.
        configuration_sha256: Hash of the robot's configuration.
        calibration_sha256: File name and hash of the arm's calibration, if there is one.
        frame: Name of the chain's flange frame.
        robot: Name of the arm, if known.
        kinematics_sha256: Hash of its kinematics, if known.

    Returns:
        The content; undetermined values have no interval, and no number except in the model.
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
        known_range=result.uncertainty.limits,
        provenance=Provenance(
            armload_version=armload_version,
            configuration_sha256=configuration_sha256,
            recordings_sha256=hashes_by_name(result.sources),
            calibration_sha256=dict(calibration_sha256 or {}),
            robot=robot,
            kinematics_sha256=kinematics_sha256,
        ),
    )
