"""Identify a payload: from a loaded and an unloaded recording to parameters with intervals.

recordings -> runs -> rows -> one solve over terms -> possible body -> intervals -> notes
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
from armload_identification.estimation.empty_arm.unloaded_arm import fit_body
from armload_identification.estimation.gain_errors import GainFit, fit_gains
from armload_identification.estimation.payload_estimate import estimate_of
from armload_identification.estimation.payload_problem import pair_problem
from armload_identification.estimation.prior_knowledge import KnownPayload, Prior
from armload_identification.estimation.solve import solve
from armload_identification.identification_errors import EstimationError, ModelError
from armload_identification.model.chain import Chain
from armload_identification.model.payload import PayloadResult, Provenance
from armload_identification.model.regressor import payload_regressor
from armload_identification.pipeline.any_motion import identify_alone
from armload_identification.pipeline.constant_payload import change_notes
from armload_identification.pipeline.identification_result import Identification, completed, pair_signal
from armload_identification.pipeline.mass_center_ranges import within_ranges
from armload_identification.pipeline.operator_notes import misfit_notes, notes_on
from armload_identification.pipeline.weighed_mass import CONTRADICTS, note_on_mass
from armload_identification.recording.recording import Recording, check_joints, hashes_by_name
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import load_signal, slow_round_signal
from armload_identification.verdict.recording_checks.column_mistakes import looks_wrong, refuse_wrong_columns
from armload_identification.verdict.recording_checks.effort_mismatch import require_effort
from armload_identification.verdict.recording_checks.joint_scales import joint_scales
from armload_identification.verdict.recording_checks.nothing_mounted import refuse_nothing
from armload_identification.verdict.recording_checks.sanity import check_pair, check_scales, require_consistent

FLANGE: Final = "flange"


def identify(
    loaded: Recording,
    unloaded: Recording | None,
    chain: Chain,
    transmission: Transmission,
    *,
    known: KnownPayload | None = None,
    arm: KnownArm | None = None,
) -> Identification:
    """Identify the payload of a loaded run, from the difference to an unloaded run or with a calibrated arm.

    Args:
        loaded: Run with the payload.
        unloaded: Run of the same motion without it; None if `arm` is given instead.
        chain: The arm; the result is in its flange frame.
        transmission: Gains and coupling; gains are used for currents, and for reported torque if calibrated.
        known: Prior knowledge of the payload.
        arm: The calibrated empty arm, with its gains in `transmission` and its tilt in `chain`: instead of the unloaded
            run, or in addition to it, as it is more accurate than the arm from that run.

    Returns:
        Estimate, physically possible estimate, intervals, and the underlying signals.

    Raises:
        ModelError: the number of gains differs from the number of joints.
        RecordingError: recordings that do not fit the arm or each other, or are invalid.
        EstimationError: neither an unloaded run nor a known arm, data that no payload explains, or that contradict
            the prior knowledge, a weighed mass included; NothingMounted if the runs prove that there is no payload.

    References:
        Chen 2016, eqs. (8) to (12); with the difference of runs instead of a body model if there is an unloaded run.
    """
    if transmission.gain_nm_a.size != chain.n:
        raise ModelError(f"{transmission.gain_nm_a.size} gains for {chain.n} joints; expected one per joint")
    # One thread: with matrices of a few dozen columns threads only wait for each other, for minutes on a busy machine.
    with threadpool_limits(1):
        identified = _by_prior(loaded, unloaded, chain, transmission, arm)
        if known is None:
            found = identified(None)
            return found.with_notes(*change_notes(found, loaded, unloaded, chain, transmission))
        if known.symmetric:
            _require_symmetric(identified(replace(known, symmetric=False).prior()))
        note = note_on_mass(known, identified)
        found = within_ranges(identified(known.prior()), known, identified)
        notes = [note] if note else []
        return found.with_notes(*notes, *change_notes(found, loaded, unloaded, chain, transmission))


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
    arm: KnownArm | None,
) -> Callable[[Prior | None], Identification]:
    """`identify` as a function of the prior; what does not depend on it is computed once."""
    runs = (loaded,) if unloaded is None else (loaded, unloaded)
    for run in runs:
        check_joints(run, chain.n)
        if arm is not None:
            require_effort(run, arm.effort)
    if unloaded is not None:
        return _by_difference(loaded, unloaded, chain, transmission, arm)
    if arm is None:
        raise EstimationError(
            "no unloaded recording was given, and the arm's own torque, which is many times the payload's, is "
            "unknown. Record the same excitation without the payload and give that file as `unloaded=`, or "
            "calibrate the arm once with `armload calibrate` and give that file as `calibration=`."
        )
    return lambda prior: identify_alone(loaded, chain, transmission, arm, prior)


def _by_difference(
    loaded: Recording, unloaded: Recording, chain: Chain, transmission: Transmission, arm: KnownArm | None
) -> Callable[[Prior | None], Identification]:
    """The payload of a pair as a function of the prior."""
    check_pair(loaded, unloaded, transmission)
    signal = load_signal(loaded, unloaded, transmission)
    body = fit_body([signal.empty_arm], chain, transmission.coupling) if arm is None else arm.fit

    @cache
    def require_right_columns() -> None:
        refuse_wrong_columns(signal, loaded, unloaded, chain, transmission.coupling)

    if looks_wrong(signal, body if arm is None else None):
        require_right_columns()
    gains = transmission.gains(from_torque=loaded.torque_nm is not None)
    slow = slow_round_signal(loaded, unloaded, transmission) if signal.periodic else None
    problem = pair_problem(signal, chain, transmission.coupling, arm, slow)
    errors = gains.errors if arm is None else arm.errors
    # At half of the greatest speed: a short run cannot tell Coulomb friction from the rest.
    friction_nm = np.abs(ArmFriction.of(body.model, signal.unloaded.states.velocity_rad_s).torque_nm)

    def identified(prior: Prior | None) -> Identification:
        fitted: GainFit | None = None
        if arm is None and gains.fitted:
            posterior, fitted = fit_gains(problem, gains, prior)
        else:
            posterior = solve(problem.knowing(prior), rough=True)
        plain = estimate_of(posterior, problem, chain, prior, errors, gears=fitted is not None)
        refuse_nothing(plain, payload_regressor(chain, *signal.states), signal.unloaded.torque_nm)
        try:
            require_consistent(plain, fitted, signal, chain, friction_nm)
        except EstimationError:
            # The cause may be a mistake in the columns, of which that error would be only a consequence.
            require_right_columns()
            raise
        result = completed(
            plain, fitted, pair_signal(plain, signal, chain, transmission), chain, transmission, loaded, unloaded
        )
        if result.uncertainty.determined[0]:
            _require_plausible_scales(result, chain, friction_nm)
        if misfit_notes(result):
            require_right_columns()
        return result.with_notes(*notes_on(result, (loaded, unloaded), transmission, arm, None if arm else body))

    return identified


def _require_plausible_scales(found: Identification, chain: Chain, friction_nm: FloatArray) -> None:
    """Raise if the payload's torque on a joint is many times that of the payload, or opposite to it."""
    signal = found.signal
    payload_nm = payload_regressor(chain, *signal.states) @ found.plain.theta
    size_nm = np.sqrt(np.mean(payload_nm[signal.valid] ** 2, axis=0))
    scales = joint_scales(signal, payload_nm, found.friction_nm)
    check_scales(scales, size_nm, friction_nm, signal.loaded.moves)


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
