"""Identify a payload: from a loaded and an unloaded recording to parameters with honest intervals.

recordings -> torque difference -> weighted least squares -> intervals -> physically possible set
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.chain import Chain
from armload_identification.errors import EstimationError, ModelError
from armload_identification.estimate import Estimate, estimate, estimate_reweighted
from armload_identification.load_signal import SCATTER, LoadSignal, load_signal
from armload_identification.payload import InertialParameters, PayloadResult, Provenance
from armload_identification.physical import PhysicalEstimate, make_physical
from armload_identification.recording import Recording, RecordingSource, check_joints
from armload_identification.regressor import payload_regressor
from armload_identification.sanity import check_pair, check_signs, explain_negative_mass
from armload_identification.signals import SMOOTHING_LOSS_LIMIT, Transmission
from armload_identification.uncertainty import Uncertainty, quantify
from armload_identification.validation import raw_residual_rms

FloatArray = NDArray[np.float64]

FLANGE: Final = "flange"
_POOR_FIT: Final = 0.5


@dataclass(frozen=True, eq=False)
class Identification:
    """A payload identified from two recordings, and everything that a report shows of it.

    All parameters are in the chain's flange frame.

    Attributes:
        plain: The weighted least squares estimate as it is, possible or not, with covariance of white
            residuals, condition number, rank, singular values and weights.
        physical: The physically possible estimate; this is what is reported and written.
        uncertainty: Values, robust 95 % intervals and what is determined, about the physical estimate.
        signal: Measured torque difference over time, raw and smoothed, with the motion it belongs to, the noise
            per joint, the smoothing loss and how the two runs were laid over each other.
        predicted_nm: (K, n) torque that the physical estimate predicts at the samples of `signal`.
        residual_rms_nm: (n,) RMS of the raw single-sample torque difference minus prediction, comparable to
            `signal.noise_nm`.
        sources: Of the loaded and the unloaded recording.
        notes: What the operator should know, one sentence each.
    """

    plain: Estimate
    physical: PhysicalEstimate
    uncertainty: Uncertainty
    signal: LoadSignal
    predicted_nm: FloatArray
    residual_rms_nm: FloatArray
    sources: tuple[RecordingSource, RecordingSource]
    notes: tuple[str, ...]

    @property
    def plain_parameters(self) -> InertialParameters:
        """The plain estimate's ten parameters; no body need have them."""
        return InertialParameters(self.plain.theta[:10])

    @property
    def parameters(self) -> InertialParameters:
        """The physically possible parameters."""
        return self.physical.parameters


def identify(loaded: Recording, unloaded: Recording | None, chain: Chain, transmission: Transmission) -> Identification:
    """Identify the payload that one run carried and the other did not.

    Args:
        loaded: Run with the payload.
        unloaded: Run of the same motion without it.
        chain: The arm; the result is in its flange frame.
        transmission: Gains and coupling; used where the recordings hold currents.

    Returns:
        Estimate, physically possible estimate, intervals, and the series behind them.

    Raises:
        RecordingError: recordings that do not fit the arm or each other, or cannot be right.
        EstimationError: no unloaded run, or data that no payload explains.

    References:
        Chen 2016, eqs. (8) to (12); the difference of runs in place of a body model.
    """
    if unloaded is None:
        raise EstimationError(
            "no unloaded recording was given, and the arm's own torque is not known: it is many times the payload's. "
            "Record the same excitation without the payload and give that file as --unloaded."
        )
    if transmission.gain_nm_a.size != chain.n:
        raise ModelError(f"{transmission.gain_nm_a.size} gains for {chain.n} joints; expected one per joint")
    for run in (loaded, unloaded):
        check_joints(run, chain.n)
    check_pair(loaded, unloaded, transmission)
    signal = load_signal(loaded, unloaded, transmission)
    regressor = payload_regressor(chain, signal.position_rad, signal.velocity_rad_s, signal.acceleration_rad_s2)
    fit = _fit(signal, regressor)
    check_signs(signal, regressor, fit)
    plain = InertialParameters(fit.theta[:10])
    if plain.mass_kg <= 0.0:
        width = quantify(fit, signal.valid, plain).half_width_95[0] if plain.mass_kg < 0.0 else np.inf
        raise explain_negative_mass(plain.mass_kg, float(width))
    physical = make_physical(fit)
    uncertainty = quantify(fit, signal.valid, physical.parameters)
    predicted = regressor[:, :, :10] @ physical.parameters.theta
    return Identification(
        plain=fit,
        physical=physical,
        uncertainty=uncertainty,
        signal=signal,
        predicted_nm=predicted,
        residual_rms_nm=raw_residual_rms(signal, predicted),
        sources=(loaded.source, unloaded.source),
        notes=tuple(_notes(loaded, unloaded, signal, fit, physical, uncertainty)),
    )


def payload_result(
    result: Identification, armload_version: str, configuration_sha256: str, frame: str = FLANGE
) -> PayloadResult:
    """The content of a payload file.

    Args:
        result: What was identified.
        armload_version: Version of the program.
        configuration_sha256: Hash of the robot's configuration.
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
        provenance=Provenance(
            armload_version=armload_version,
            configuration_sha256=configuration_sha256,
            recordings_sha256=_hashes(result.sources),
        ),
    )


def _hashes(sources: tuple[RecordingSource, ...]) -> dict[str, str]:
    """Hash by file name, with the folder in front where two files have one name."""
    short = {source.path.name for source in sources}
    if len(short) == len(sources):
        return {source.path.name: source.sha256 for source in sources}
    return {f"{source.path.parent.name}/{source.path.name}": source.sha256 for source in sources}


def _fit(signal: LoadSignal, regressor: FloatArray) -> Estimate:
    """Weights from the scatter between periods, or from the residual where there is one period."""
    solve = estimate if signal.noise_source == SCATTER else estimate_reweighted
    return solve(regressor, signal.torque_nm, signal.valid, signal.averaged_noise_nm)


def _notes(
    loaded: Recording,
    unloaded: Recording,
    signal: LoadSignal,
    fit: Estimate,
    physical: PhysicalEstimate,
    uncertainty: Uncertainty,
) -> list[str]:
    """What the operator should know."""
    notes = []
    for name, run in (("loaded", loaded), ("unloaded", unloaded)):
        source = run.source
        if source.rows_dropped:
            listed = ", ".join(f"{count} {reason}" for reason, count in source.reasons.items())
            notes.append(f"{name} recording: {source.rows_dropped} of {source.rows_read} rows dropped ({listed}).")
        if source.truncated:
            notes.append(f"{name} recording: the file ends early; what came before was used.")
    if loaded.torque_nm is None:
        notes.append("Drive gains are nominal: an error in them is an error of the same size in the result.")
    lossy = np.flatnonzero(signal.smoothing_loss > SMOOTHING_LOSS_LIMIT)
    if lossy.size:
        listed = ", ".join(f"{joint + 1} ({signal.smoothing_loss[joint]:.0%})" for joint in lossy)
        notes.append(
            f"Smoothing took more than {SMOOTHING_LOSS_LIMIT:.0%} of the signal of joint {listed}: "
            "it is mostly noise, or sampled too slowly."
        )
    if (~signal.valid).any():
        notes.append(f"{np.count_nonzero(~signal.valid)} of {signal.valid.size} samples are holes and were not used.")
    if fit.rank < fit.theta.size:
        notes.append(
            f"The motion determines {fit.rank} of {fit.theta.size} directions of the parameters; the rest was "
            "chosen as a compact body and is marked as not determined."
        )
    if physical.changed and physical.plain_margin <= 0.0:
        notes.append("The plain estimate is physically impossible; the nearest possible one is reported.")
    if uncertainty.undetermined_names:
        notes.append("Not determined by these data: " + ", ".join(uncertainty.undetermined_names) + ".")
    measured = np.mean((signal.torque_nm[signal.valid] * fit.weight_1_nm) ** 2)
    left = np.mean((fit.residual_nm[signal.valid] * fit.weight_1_nm) ** 2)
    if left > _POOR_FIT * measured:
        notes.append(
            f"A payload explains only {1.0 - left / measured:.0%} of the torque difference: it is very light, or "
            "columns, joint order or configuration do not belong to this arm."
        )
    return notes
