"""What an identification gives: a fit, its possible body, intervals and notes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.arm_friction import ArmFriction
from armload_identification.estimation.empty_arm.blows import struck_samples
from armload_identification.estimation.empty_arm.body_fit import BodyFit
from armload_identification.estimation.friction_columns import FrictionDifference
from armload_identification.estimation.gain_columns import COMMON_DEVIATION, GainFit
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
from armload_identification.verdict.raw_residual import raw_residual_rms

Fit = tuple[Estimate, FrictionDifference | None]


@dataclass(frozen=True, eq=False)
class Identification:
    """A payload identified from one or two recordings, and everything that a report shows of it.

    All parameters are in the chain's flange frame.

    Attributes:
        plain: The weighted least squares estimate as it is, possible or not, with covariance of white
            residuals, condition number, rank, singular values and weights.
        physical: The physically possible estimate; this is what is reported and written.
        friction: Friction that was fitted with it; None where the estimator has none.
        gains: What the data say of nominal gains; None where gains were taken as they are.
        uncertainty: Values, robust 95 % intervals and what is determined, about the physical estimate.
        mass_center: Covariance of mass and centre of mass, for comparison with another identification.
        signal: Measured torque difference over time, by the gains that were fitted where there are such, raw and
            smoothed, with the motion it belongs to, the noise per joint, the smoothing loss and how the two runs were
            laid over each other.
        predicted_nm: (K, n) torque that the physical estimate predicts at the samples of `signal`, friction
            that was fitted with it included.
        residual_rms_nm: (n,) RMS of the raw single-sample torque difference minus prediction, comparable to
            `signal.noise_nm`.
        arm_friction: Friction of the arm itself: of the unloaded run where there is one, else of the loaded one.
        sources: Of the loaded and, where there is one, the unloaded recording.
        notes: What the operator should know, one sentence each.
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
        """The plain estimate's ten parameters; no body need have them."""
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
    """The possible body, intervals and notes of a fit.

    Args:
        signal: What was fitted.
        regressor: (K, n, 10) of the payload.
        fit: The plain estimate.
        friction: Friction that was fitted with it.
        doubts_nm: (k, K, n) torque of one standard deviation of each systematic error but the gains'.
        gains: Gains that err for themselves; None where there are none, or their errors are among the doubts.
        runs: The loaded and, where there is one, the unloaded recording.
        transmission: Gains and coupling.
        arm: The body fitted to the unloaded run, or None.
        arm_friction: Of the arm itself.
        struck: (K,) samples left out as blows.
        arm_notes: What the runs say of the calibrated arm.
        fitted_gains: Gains that were fitted with the payload, in place of their errors.
        prior: What was known of the payload beforehand.
    """
    physical = make_physical(fit)
    taken_as_they_are = gains if fitted_gains is None else None
    shifts = shifts_by(fit, np.concatenate([_gain_doubts(taken_as_they_are, signal), doubts_nm]))
    shifts = np.vstack([shifts, shifts_by_knowledge(fit, prior)])
    if fitted_gains is not None:
        shifts = np.vstack([shifts, COMMON_DEVIATION * fitted_gains.slope.sum(axis=1)])
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
            *notes_on(runs, transmission, signal, arm, fit, friction, fitted_gains, physical, uncertainty),
            *_on_blows(signal, struck),
            *arm_notes,
        ),
    )


def without_blows(
    signal: LoadSignal, fit_to: Callable[[LoadSignal], Fit]
) -> tuple[LoadSignal, Estimate, FrictionDifference | None, NDArray[np.bool_]]:
    """Fit, and fit again without the samples about blows to the arm where there are any.

    Args:
        signal: What is fitted.
        fit_to: How.

    Returns:
        The signal without these samples, the fit, its friction, and (K,) the samples left out.
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
    """(K,) samples about a blow to the arm."""
    weighted = fit.residual_nm * fit.sample_weight
    spread = deviation_by_median(weighted[signal.valid])
    size = np.divide(weighted, spread, out=np.zeros_like(weighted), where=spread > 0.0)
    return struck_samples(size, signal.time_s)


def _on_blows(signal: LoadSignal, struck: NDArray[np.bool_]) -> list[str]:
    """What was left out of the motion."""
    if not struck.any():
        return []
    when = ", ".join(f"{moment:.1f}" for moment in signal.time_s[struck & ~np.roll(struck, 1)])
    return [
        f"{np.count_nonzero(struck) * signal.interval_s:.1f} s of the motion were left out, from {when} s on: "
        "several joints have large residuals there at once, as after an impact on the arm."
    ]
