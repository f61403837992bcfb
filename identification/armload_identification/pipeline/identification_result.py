"""Result of an identification: a fit, its physically possible body, intervals and notes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.arm_friction import ArmFriction
from armload_identification.estimation.empty_arm.impacts import struck_samples
from armload_identification.estimation.empty_arm.unloaded_arm import BodyFit
from armload_identification.estimation.friction_columns import FrictionDifference
from armload_identification.estimation.gain_columns import GainFit
from armload_identification.estimation.least_squares import Estimate, Prior
from armload_identification.estimation.mass_center_covariance import GainShare, mass_center_covariance
from armload_identification.estimation.physical_consistency import PhysicalEstimate, make_physical
from armload_identification.estimation.uncertainty import Uncertainty, quantify, shifts_by, shifts_by_knowledge
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import InertialParameters
from armload_identification.recording.recording import Recording, RecordingSource
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.signals.robust_scale import deviation_by_median
from armload_identification.verdict.operator_notes import notes_on
from armload_identification.verdict.recording_checks.raw_residual import raw_residual_rms

Fit = tuple[Estimate, FrictionDifference | None]


@dataclass(frozen=True, eq=False)
class Identification:
    """A payload identified from one or two recordings, with all data for a report.

    All parameters are in the chain's flange frame.

    Attributes:
        plain: The weighted least squares estimate, physically possible or not, with covariance for white residuals,
            condition number, rank, singular values and weights.
        physical: The physically possible estimate, which is reported and written.
        friction: The friction fitted with it; None if the estimator fits none.
        gains: The nominal gains as fitted; None if gains were not fitted.
        uncertainty: Values, robust 95 % intervals and determined values, about the physical estimate.
        mass_center: Covariance of mass and centre of mass, for comparison with another identification.
        signal: Measured torque difference over time, with fitted gains if there are any, raw and smoothed, with its
            motion, noise per joint, smoothing loss and alignment of the two runs.
        predicted_nm: (K, n) torque predicted by the physical estimate at the samples of `signal`, fitted friction
            included.
        residual_rms_nm: (n,) RMS of the raw single-sample torque difference minus prediction, comparable to
            `signal.noise_nm`.
        arm_friction: Friction of the arm itself: of the unloaded run if there is one, else of the loaded one.
        sources: Sources of the loaded and, if there is one, the unloaded recording.
        notes: Notes to the operator.
    """

    plain: Estimate
    friction: FrictionDifference | None
    gains: GainFit | None
    physical: PhysicalEstimate
    uncertainty: Uncertainty
    mass_center: MassCenterCovariance
    signal: LoadSignal
    predicted_nm: FloatArray
    residual_rms_nm: FloatArray
    arm_friction: ArmFriction
    sources: tuple[RecordingSource, ...]
    notes: tuple[str, ...]

    @property
    def plain_parameters(self) -> InertialParameters:
        """The plain estimate's ten parameters, which may be physically impossible."""
        return InertialParameters(self.plain.theta[:10])

    @property
    def parameters(self) -> InertialParameters:
        """The physically possible parameters."""
        return self.physical.parameters


def completed(
    signal: LoadSignal,
    regressor: FloatArray,
    fit: Estimate,
    friction: FrictionDifference | None,
    doubts_nm: FloatArray,
    gains: Transmission | None,
    runs: tuple[Recording, ...],
    transmission: Transmission,
    arm: BodyFit | None,
    arm_friction: ArmFriction,
    struck: NDArray[np.bool_],
    arm_notes: tuple[str, ...] = (),
    fitted_gains: GainFit | None = None,
    prior: Prior | None = None,
) -> Identification:
    """Complete a fit with its physically possible body, intervals and notes.

    Args:
        signal: The fitted signal.
        regressor: (K, n, 10) of the payload.
        fit: The plain estimate.
        friction: The friction fitted with it.
        doubts_nm: (k, K, n) torque of one standard deviation of each systematic error except the gains'.
        gains: Gains with independent errors; None without any, or if their errors are in `doubts_nm`.
        runs: The loaded and, if there is one, the unloaded recording.
        transmission: Gains and coupling.
        arm: The body fitted to the unloaded run, or None.
        arm_friction: Friction of the arm itself.
        struck: (K,) True for samples excluded as blows.
        arm_notes: Notes about the calibrated arm.
        fitted_gains: Gains that were fitted with the payload, which replace the errors of `gains`.
        prior: Prior knowledge of the payload.
    """
    physical = make_physical(fit)
    taken_as_they_are = gains if fitted_gains is None else None
    shifts = shifts_by(fit, np.concatenate([_gain_doubts(taken_as_they_are, signal), doubts_nm]))
    shifts = np.vstack([shifts, shifts_by_knowledge(fit, prior)])
    if fitted_gains is not None:
        shifts = np.vstack([shifts, fitted_gains.common_deviation * fitted_gains.slope.sum(axis=1)])
    uncertainty = quantify(fit, physical.parameters, shifts)
    held = fit if fitted_gains is None else fitted_gains.held
    share = None if gains is None else GainShare.of(held, signal.torque_nm, gains, fitted_gains)
    predicted = regressor @ physical.parameters.theta
    if friction is not None:
        predicted = predicted + friction.torque_nm
    return Identification(
        plain=fit,
        friction=friction,
        gains=fitted_gains,
        physical=physical,
        uncertainty=uncertainty,
        mass_center=mass_center_covariance(held, physical.parameters, doubts_nm, share, prior),
        signal=signal,
        predicted_nm=predicted,
        residual_rms_nm=raw_residual_rms(signal, predicted),
        arm_friction=arm_friction,
        sources=tuple(run.source for run in runs),
        notes=(
            *notes_on(runs, transmission, signal, arm, fit, friction, fitted_gains, physical, uncertainty, struck),
            *_on_blows(signal, struck),
            *arm_notes,
        ),
    )


def without_blows(
    signal: LoadSignal, fit_to: Callable[[LoadSignal], Fit]
) -> tuple[LoadSignal, Estimate, FrictionDifference | None, NDArray[np.bool_]]:
    """Fit, and fit again without the samples close to blows to the arm if there are any.

    Args:
        signal: The signal to fit.
        fit_to: Fits a signal.

    Returns:
        The signal without these samples, the fit, its friction, and (K,) True for the excluded samples.
    """
    fit, friction = fit_to(signal)
    struck = _struck(signal, fit)
    if struck.any():
        signal = replace(signal, loaded=replace(signal.loaded, valid=signal.loaded.valid & ~struck))
        fit, friction = fit_to(signal)
    return signal, fit, friction, struck


def _gain_doubts(gains: Transmission | None, signal: LoadSignal) -> FloatArray:
    """(k, K, n) torque of one standard deviation of each independent error of the gains; none without any."""
    return np.zeros((0, *signal.torque_nm.shape)) if gains is None else gains.gain_doubts(signal.torque_nm)


def _struck(signal: LoadSignal, fit: Estimate) -> NDArray[np.bool_]:
    """(K,) True for samples close to a blow to the arm."""
    weighted = fit.residual_nm * fit.sample_weight
    spread = deviation_by_median(weighted[signal.valid])
    size = np.divide(weighted, spread, out=np.zeros_like(weighted), where=spread > 0.0)
    return struck_samples(size, signal.time_s)


def _on_blows(signal: LoadSignal, struck: NDArray[np.bool_]) -> list[str]:
    """A note about the excluded part of the motion."""
    if not struck.any():
        return []
    when = ", ".join(f"{moment:.1f}" for moment in signal.time_s[struck & ~np.roll(struck, 1)])
    return [
        f"{np.count_nonzero(struck) * signal.interval_s:.1f} s of the motion were left out, from {when} s on: "
        "several joints have large residuals there at once, as after an impact on the arm."
    ]
