"""The second gate: whether a pair of runs contradicts the payload that explains it best.

Nothing mounted is decided first, and mistakes in the columns before anything that would be only their consequence.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.contradicted_gains import GainFit
from armload_identification.estimation.empty_arm.arm_friction import ArmFriction
from armload_identification.estimation.payload_from_posterior import PayloadEstimate
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import EstimationError, NoPayloadMass, NothingMounted, RecordingError
from armload_identification.model.body_model import BodyModel
from armload_identification.model.payload import DETERMINED_SHARE
from armload_identification.model.regressor import payload_regressor
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.verdict.decision_levels import Correlations, FalseAlarms, JointContradiction
from armload_identification.verdict.joint_words import numbered_joints
from armload_identification.verdict.recording_checks.column_mistakes import RunColumns
from armload_identification.verdict.recording_checks.joint_scales import JointScales, joint_scales
from armload_identification.verdict.recording_checks.nothing_mounted import is_slight, refuse_nothing


@dataclass(frozen=True, eq=False)
class FittedPair:
    """A payload and the pair of runs that it was fitted to.

    Attributes:
        plain: The payload.
        gains: The fitted gains; None if they were not fitted.
        signal: The torque difference with the assumed gains.
        adjusted: The same with the estimated ones.
        added_friction_nm: (K, n) friction that the payload adds.
        body: The arm, from a calibration or from the unloaded run.
    """

    plain: PayloadEstimate
    gains: GainFit | None
    signal: LoadSignal
    adjusted: LoadSignal
    added_friction_nm: FloatArray
    body: BodyModel

    @cached_property
    def regressor(self) -> FloatArray:
        """(K, n, 10) columns of the payload."""
        return payload_regressor(self.plain.arm.layout.chain, *self.signal.loaded.states)

    @cached_property
    def friction_nm(self) -> FloatArray:
        """(n,) friction with the assumed gains, at half of the greatest speed.

        A short run cannot tell Coulomb friction from the rest.
        """
        return np.abs(ArmFriction.of(self.body, self.signal.unloaded.states.velocity_rad_s).torque_nm)

    @cached_property
    def slight(self) -> bool:
        """Whether a payload of these runs is so light that its torque says nothing about the joints'."""
        return is_slight(self.plain, self.plain.half_width_kg, self.regressor, self.signal.unloaded.torque_nm)

    @property
    def determined(self) -> bool:
        """Whether the mass is determined."""
        return self.plain.half_width_kg <= DETERMINED_SHARE * abs(float(self.plain.theta[0]))


def refuse_contradictions(fit: FittedPair, columns: RunColumns) -> None:
    """Raise for a payload that its runs contradict.

    Raises:
        NothingMounted: the runs prove that there is no payload.
        RecordingError: columns are exchanged or of the wrong sign.
        EstimationError: one of `CONTRADICTIONS`.
    """
    try:
        for check in CONTRADICTIONS:
            check(fit)
    except EstimationError as error:
        if not isinstance(error, NothingMounted):
            columns.require_right()
        raise


def _refuse_nothing(fit: FittedPair) -> None:
    refuse_nothing(fit.plain, fit.regressor, fit.signal.unloaded.torque_nm)


def _refuse_impossible_gain(fit: FittedPair) -> None:
    """Raise if the other joints imply a gain that no nominal gain is wrong by."""
    if fit.gains is None or fit.slight:
        return
    size = np.where(fit.gains.contradicted, np.abs(fit.gains.log_gain), 0.0)
    joint = int(np.argmax(size))
    if size[joint] > np.log(JointContradiction.gain_factor):
        raise _contradiction_error(np.arange(size.size) == joint)


def _refuse_contradicting_joint(fit: FittedPair) -> None:
    """Raise if a joint's sign or scale contradicts all others.

    A joint that reports a small share of its torque also has a small share of its noise. It is then fitted perfectly
    and determines the payload, and it is the others that remain unexplained, or, if its share is more than half, none.
    Fitted gains correct a share above a third; if the payload is determined with them, the joints are compared only if
    one of them is unexplained.

    Raises:
        RecordingError: a joint measures about the opposite of what the others imply.
        EstimationError: a joint measures less than a third of what the others imply, without fitted gains less than
            three quarters.
    """
    plain, signal, regressor = fit.plain, fit.signal, fit.regressor
    measured = signal.torque_nm[signal.valid]
    rest = measured - regressor[signal.valid] @ plain.theta
    power, left = (np.mean(torque**2, axis=0) for torque in (measured, rest))
    noise_nm = signal.averaged_noise_nm / np.sqrt(len(measured))
    loud = np.sqrt(power) > JointContradiction.clear_deviations * noise_nm
    suspect = signal.loaded.moves & loud & (left > JointContradiction.unexplained * power)
    if fit.slight or (fit.gains is not None and fit.determined and not suspect.any()):
        return
    implied_nm = np.zeros_like(signal.torque_nm)
    for joint in np.flatnonzero(signal.loaded.moves & loud).tolist():
        # A joint almost free of noise decides the noise of the others: fit these again if one is unexplained.
        others, covariance, rank = plain.without(joint, afresh=bool(suspect.any()))
        if rank < others.size:
            continue
        if suspect[joint]:
            _refuse_opposite(signal, regressor, others, joint)
        own = regressor[:, joint]
        if _is_evidence(own[signal.valid], others, covariance, fit.friction_nm[joint]):
            implied_nm[:, joint] = own @ others
    # A wrong joint contaminates what the others imply of each other, but not what they imply of it.
    scales = joint_scales(signal, implied_nm, np.zeros_like(implied_nm))
    _refuse_small(scales, gains_fitted=fit.gains is not None)


def _refuse_no_mass(fit: FittedPair) -> None:
    """Raise for a mass that is not positive."""
    mass_kg, half_width_kg = float(fit.plain.theta[0]), fit.plain.half_width_kg
    if mass_kg > 0.0:
        return
    estimate = f"{mass_kg:.3g} kg +- {half_width_kg:.2g} kg"
    if abs(mass_kg) <= half_width_kg:
        text = (
            f"the two runs do not differ by a payload: the estimated mass is {estimate}. Check that the payload was "
            "mounted in the loaded run."
        )
    else:
        text = (
            f"the estimated mass is negative, {estimate}. If the loaded and the unloaded recording are exchanged: "
            "exchange them; else check gravity, joint order and signs in the configuration and the log."
        )
    raise NoPayloadMass(text, mass_kg, half_width_kg)


def _refuse_strange_scales(fit: FittedPair) -> None:
    """Raise if the measured torque on a joint is not nearly that of a payload whose mass is determined."""
    if fit.slight or not fit.determined:
        return
    signal = fit.adjusted
    payload_nm = payload_regressor(fit.plain.arm.layout.chain, *signal.loaded.states) @ fit.plain.theta
    size_nm = np.sqrt(np.mean(payload_nm[signal.valid] ** 2, axis=0))
    scales = joint_scales(signal, payload_nm, fit.added_friction_nm)
    check_scales(scales, size_nm, fit.friction_nm, signal.loaded.moves)


def check_scales(
    scales: JointScales, payload_nm: FloatArray, friction_nm: FloatArray, moves: NDArray[np.bool_]
) -> None:
    """Raise if the torque on a joint is many times that of the payload, or opposite to it.

    A gain that is wrong by orders of magnitude is not found as a gain: the joint is then either excluded as noise, or,
    being almost free of noise, determines the payload alone.

    Args:
        scales: Ratio of measured to predicted payload torque of the joints.
        payload_nm: (n,) RMS of the predicted one.
        friction_nm: (n,) Coulomb friction as measured, with the same gain. Where it is many times the payload's torque,
            its errors determine the ratio: 0.3 kg on a joint of prbt that it loads with a hundredth of its friction.
        moves: (n,) False for joints at rest: static friction may carry the payload's torque.

    Raises:
        EstimationError: naming the joints and the possible causes.
    """
    greatest, certain = JointContradiction.gain_factor, FalseAlarms.certain_half_widths * scales.half_width_95
    with np.errstate(invalid="ignore"):
        evident = payload_nm >= JointContradiction.of_friction * friction_nm
        beyond = moves & evident & ((scales.scale - certain > greatest) | (scales.scale + certain < 1.0 / greatest))
    if beyond.any():
        within = np.abs(scales.scale - 1.0) + certain < greatest - 1.0
        # A joint almost free of noise determines the payload alone: then it is the others that seem wrong.
        alone = within.any() and np.count_nonzero(beyond) > np.count_nonzero(within)
        above = not alone and bool((scales.scale[beyond] > 1.0).all())
        raise _contradiction_error(within if alone else beyond, above=above)


def _refuse_opposite(signal: LoadSignal, regressor: FloatArray, others: FloatArray, joint: int) -> None:
    """Raise if a joint measures about the opposite of what the others imply."""
    implied, measured = regressor[signal.valid][:, joint] @ others, signal.torque_nm[signal.valid][:, joint]
    size = np.sqrt(np.mean(implied**2)) * np.sqrt(np.mean(measured**2))
    if size > 0.0 and np.mean(implied * measured) < Correlations.opposed * size:
        raise RecordingError(
            f"joint {joint + 1} measures the opposite of the payload torque that the other joints imply. "
            "The sign of its current or torque is flipped: correct it in the drive (607E) or recording."
        )


def _is_evidence(own: FloatArray, others: FloatArray, covariance: FloatArray, friction_nm: float) -> bool:
    """Whether the torque that the others imply of a joint, by its (K, 10) columns, is large and certain enough."""
    implied_nm = np.sqrt(np.mean((own @ others) ** 2))
    doubt_nm = np.sqrt(np.mean(np.einsum("ki,ij,kj->k", own, covariance, own)))
    least_nm = max(JointContradiction.implied_deviations * doubt_nm, JointContradiction.of_friction * friction_nm)
    return bool(implied_nm > least_nm)


def _refuse_small(scales: JointScales, *, gains_fitted: bool) -> None:
    """Raise if the joint that is off most certainly measures too small a share of what the others imply.

    A fitted gain corrects a share above a third.
    """
    scale, half_width = scales.scale, scales.half_width_95
    known = np.isfinite(half_width)
    joint = int(np.argmax(np.where(known, np.abs(scale - 1.0) / np.maximum(half_width, np.finfo(float).tiny), -1.0)))
    greatest = scale[joint] + FalseAlarms.certain_half_widths * half_width[joint]
    if known[joint] and greatest < 1.0 / JointContradiction.gain_factor:
        raise _contradiction_error(np.arange(scale.size) == joint)
    if known[joint] and greatest < JointContradiction.least_share and not gains_fitted:
        raise EstimationError(
            f"joint {joint + 1} measures {scale[joint]:.2f} +- {half_width[joint]:.2f} of the payload torque "
            "that the other joints imply: its rated torque, torque constant or gear ratio is wrong, or changed between "
            "the runs. Correct the configuration or the log, or record both runs again."
        )


def _contradiction_error(joints: NDArray[np.bool_], *, above: bool = False) -> EstimationError:
    """The error for joints whose torque is not that of the payload by far; if it is above, others may be too small."""
    one = np.count_nonzero(joints) == 1
    factor = JointContradiction.gain_factor
    its, columns = ("its", "its column is") if one else ("their", "their columns are")
    return EstimationError(
        f"the torque of {numbered_joints(joints)} contradicts the payload that the other joints imply by more than a "
        f"factor of {factor:.0f}: the sign of {its} current or torque is flipped, {its} torque constant, gear ratio "
        f"or unit is wrong, or {columns} another joint's"
        + (", or another joint reports a small part of its torque, and little noise. " if above else ". ")
        + "Correct the configuration, the direction of gravity included, or the log."
    )


CONTRADICTIONS = (
    _refuse_nothing,
    _refuse_impossible_gain,
    _refuse_contradicting_joint,
    _refuse_no_mass,
    _refuse_strange_scales,
)
