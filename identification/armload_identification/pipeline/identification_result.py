"""Result of an identification: an estimate, its physically possible body, intervals and notes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.arm_terms import GAIN
from armload_identification.estimation.contradicted_gains import GainFit
from armload_identification.estimation.empty_arm.arm_friction import ArmFriction
from armload_identification.estimation.payload_from_posterior import PayloadEstimate
from armload_identification.estimation.payload_intervals import Uncertainty, quantify
from armload_identification.estimation.physical_consistency import make_physical
from armload_identification.float_array import FloatArray
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import FLANGE, InertialParameters, PayloadResult, Provenance, derived
from armload_identification.model.regressor import payload_regressor
from armload_identification.model.smooth_sign import smooth_sign
from armload_identification.recording.recording import RecordingSource, hashes_by_name
from armload_identification.signals.joint_torque import Gains, Transmission
from armload_identification.signals.load_signal import LoadSignal, without_body
from armload_identification.signals.motion import Motion
from armload_identification.signals.recorded_run import Run


@dataclass(frozen=True, eq=False)
class Identification:
    """A payload identified from one or two recordings, with all data for a report.

    All parameters are in the chain's flange frame.

    Attributes:
        plain: The estimate, physically possible or not, with everything that was estimated with it.
        parameters: The physically possible estimate, which is reported and written.
        gains: The nominal gains as fitted; None if gains were not fitted.
        uncertainty: Values, 95 % intervals and determined values, about the physical estimate.
        mass_center: Covariance of mass and centre of mass, for comparison with another identification.
        signal: Measured torque difference over time, with fitted gains if there are any, raw and smoothed, with its
            motion, noise per joint, smoothing loss and alignment of the two runs.
        friction_nm: (K, n) friction of the loaded run beyond that of the unloaded run or the calibrated arm.
        predicted_nm: (K, n) torque predicted by the physical estimate at the samples of `signal`, with that friction.
        residual_nm: (K, n) smoothed torque difference minus the plain estimate's prediction.
        struck: (K,) True for samples excluded as blows.
        residual_rms_nm: (n,) RMS of the raw single-sample torque difference minus prediction, comparable to
            `signal.noise_nm`.
        arm_friction: Friction of the arm itself: of the unloaded run if there is one, else of the loaded one.
        sources: Sources of the loaded and, if there is one, the unloaded recording.
        notes: Notes to the operator.
        scale_verified: Whether something weighed verifies the scale that all gains have in common.
    """

    plain: PayloadEstimate
    gains: GainFit | None
    parameters: InertialParameters
    uncertainty: Uncertainty
    mass_center: MassCenterCovariance
    signal: LoadSignal
    friction_nm: FloatArray
    predicted_nm: FloatArray
    residual_nm: FloatArray
    struck: NDArray[np.bool_]
    residual_rms_nm: FloatArray
    arm_friction: ArmFriction
    sources: tuple[RecordingSource, ...]
    notes: tuple[str, ...] = ()
    scale_verified: bool = False

    @property
    def plain_parameters(self) -> InertialParameters:
        """The plain estimate's ten parameters, which may be physically impossible."""
        return InertialParameters(self.plain.theta)

    @property
    def changed(self) -> bool:
        """Whether the plain estimate had less margin than is written, or undetermined directions."""
        return bool((self.parameters.theta != self.plain.theta).any())

    def with_notes(self, *notes: str) -> Identification:
        """The same result with further notes, before the others."""
        return replace(self, notes=(*notes, *self.notes))


def payload_signal(plain: PayloadEstimate, of: LoadSignal | Motion, transmission: Transmission) -> LoadSignal:
    """The signal of a pair on the loaded run's motion, or of a run minus the arm, with estimated gains and delay."""
    body, chain = plain.body(plain.runs - 1), plain.arm.layout.chain
    times = transmission.changed_by(-plain.posterior.value(GAIN))

    def moved(run: Motion) -> Motion:
        return run.with_torque_times(times).with_delay(body.torque_delay_s)

    if isinstance(of, LoadSignal):
        return of.of_both(moved).on_one_motion(chain, body)
    run = moved(of)
    return without_body(run, body.torque(chain, *run.states))


def completed(
    plain: PayloadEstimate,
    gains: GainFit | None,
    signal: LoadSignal,
    friction_nm: FloatArray,
    used: Gains,
    *runs: Run,
) -> Identification:
    """Complete an estimate with its physically possible body and intervals.

    Args:
        gains: Gains that were fitted with the payload.
        signal: The signal on the loaded run's motion, with the estimated gains.
        friction_nm: (K, n) friction of the loaded run beyond that of the arm that was subtracted (`added_friction`).
        used: The gains that the runs' torques were computed with.
        runs: The loaded and, if there is one, the unloaded run.
    """
    parameters = make_physical(plain)
    regressor = payload_regressor(plain.arm.layout.chain, *signal.loaded.states)
    predicted_nm = regressor @ parameters.theta + friction_nm
    value = used.value if gains is None else used.value * np.exp(gains.log_gain)
    slope = derived(parameters)[1][:4]
    state = plain.posterior.groups[0]
    row = np.minimum(np.searchsorted(state.group.time_s, signal.loaded.time_s), state.struck.size - 1)
    return Identification(
        plain=plain,
        gains=gains,
        parameters=parameters,
        uncertainty=quantify(plain, parameters),
        mass_center=plain.mass_center(slope, parameters.mass_kg, value),
        signal=signal,
        friction_nm=friction_nm,
        predicted_nm=predicted_nm,
        residual_nm=signal.torque_nm - regressor @ plain.theta - friction_nm,
        struck=state.struck[row],
        residual_rms_nm=signal.raw_residual_rms(predicted_nm),
        arm_friction=ArmFriction.of(plain.body(plain.runs - 1), signal.unloaded.states.velocity_rad_s),
        sources=tuple(run.recording.source for run in runs),
    )


def payload_result(result: Identification, made: Provenance) -> PayloadResult:
    """The content of a payload file; undetermined values have no interval, and no number except in the model.

    Args:
        made: By which program, for which robot and with which calibration; the recordings are added.
    """
    known = result.uncertainty.determined
    return PayloadResult(
        frame=FLANGE,
        model=result.parameters,
        determined=known,
        interval_95=np.where(known[:, None], result.uncertainty.interval_95, np.nan),
        residual_rms_nm=result.residual_rms_nm,
        noise_nm=result.signal.noise_nm,
        mass_center=result.mass_center,
        known_range=result.uncertainty.limits,
        provenance=replace(made, recordings_sha256=hashes_by_name(result.sources)),
    )


def added_friction(plain: PayloadEstimate, signal: LoadSignal) -> FloatArray:
    """(K, n) friction of the loaded run beyond that of the arm that was subtracted, at the samples of a signal."""
    body, chain, velocity = plain.body(0), plain.arm.layout.chain, signal.loaded.states.velocity_rad_s
    direction = smooth_sign(velocity, body.reversal_speed_rad_s)
    payload_nm = payload_regressor(chain, *signal.loaded.states) @ plain.theta
    of_load = body.added_friction(body.link_torque(chain, *signal.loaded.states), payload_nm, velocity)
    coulomb, viscous, offset = plain.friction(0) - plain.friction(plain.runs - 1)
    return np.asarray(of_load + direction * coulomb + velocity * viscous + offset)
