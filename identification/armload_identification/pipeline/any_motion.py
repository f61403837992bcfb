"""A payload from one run of any motion on a calibrated arm, from the entire run or window by window."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from armload_core.arrays import FloatArray
from armload_identification.estimation.empty_arm.arm_friction import ArmFriction
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.estimation.empty_arm.known_arm_fit import fit_on_known_arm, friction_covariance
from armload_identification.estimation.empty_arm.known_arm_signal import KnownArmSignal
from armload_identification.estimation.least_squares import Estimate, Prior
from armload_identification.estimation.uncertainty import NORMAL_HALF_WIDTH, quantify, shifts_by
from armload_identification.identification_errors import EstimationError, RecordingError
from armload_identification.model.chain import Chain
from armload_identification.model.payload import DETERMINED_SHARE, InertialParameters
from armload_identification.pipeline.identification_result import Fit, Identification, completed, without_blows
from armload_identification.recording.recording import Recording, check_joints
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.signals.motion import motion_of, motion_over_time
from armload_identification.verdict.recording_checks.effort_mismatch import require_effort
from armload_identification.verdict.recording_checks.friction_validity import friction_notes, standard_deviations
from armload_identification.verdict.recording_checks.motion_quality import MotionQuality
from armload_identification.verdict.recording_checks.sanity import check_run

FLOOR_KG: Final = 0.010
FLOOR_SHARE: Final = 0.001
"""Least standard deviation of a mass on a calibrated arm, absolute and relative: servo sag, encoder errors."""
SHORTEST_WINDOW_S: Final = 2.0
_LASTING: Final = 0.5
"""Part of a joint's residual in excess of the calibration's noise that may be proportional to its torque throughout the
run. On simulated arms with elastic joints and gears of two efficiencies, 69 to 97 % of intervals hold without it, 96 %
or more with it."""


@dataclass(frozen=True, eq=False)
class Window:
    """Payload of an arm during a part of a run.

    Attributes:
        start_s: Start of the window since the first movement.
        end_s: End of the window since the first movement.
        found: The payload; None if the motion does not determine it.
        refusal: Why there is no payload; empty if there is one.
    """

    start_s: float
    end_s: float
    found: Identification | None
    refusal: str


def identify_alone(
    loaded: Recording, chain: Chain, transmission: Transmission, arm: KnownArm, prior: Prior | None
) -> Identification:
    """Identify a payload from one run.

    Args:
        loaded: A run of any motion.
        chain: The arm, with the tilt of its calibration.
        transmission: Calibrated gains, and coupling.
        arm: The calibrated empty arm.
        prior: Prior knowledge of the payload.

    Raises:
        RecordingError: an invalid recording.
        EstimationError: a motion that does not determine the payload's mass, naming the missing motion.
    """
    check_run(loaded, transmission)
    seen = KnownArmSignal.of(motion_of(loaded, transmission), chain, arm)
    return _on_known_arm(seen, loaded, chain, transmission, arm, prior)


def identify_windows(
    loaded: Recording,
    chain: Chain,
    transmission: Transmission,
    arm: KnownArm,
    every_s: float,
) -> tuple[Window, ...]:
    """Identify an arm's payload in successive windows of a run.

    Args:
        loaded: A run of any motion.
        chain: The arm, with the tilt of its calibration.
        transmission: Calibrated gains, and coupling.
        arm: The calibrated empty arm.
        every_s: Length of a window.

    Returns:
        Complete windows from the first movement on; one with insufficient motion contains the reason.

    Raises:
        RecordingError: a recording that does not fit the arm, is invalid, or is shorter than a window.
    """
    check_joints(loaded, chain.n)
    require_effort(loaded, arm.effort)
    if loaded.average is not None:
        raise RecordingError(
            f"{loaded.source.path}: a run of this length along an excitation is reduced to its average period while it "
            "is read, which has no windows. Select a part of it."
        )
    check_run(loaded, transmission)
    with threadpool_limits(1):
        motion = motion_over_time(loaded, transmission)
        seen = KnownArmSignal.of(motion, chain, arm)
        windows = []
        lasts_s = float(motion.time_s[-1]) + motion.interval_s
        for number in range(int(lasts_s / every_s)):
            start_s, end_s = number * every_s, (number + 1) * every_s
            try:
                found = _on_known_arm(seen.part(start_s, end_s), loaded, chain, transmission, arm, None)
            except EstimationError as problem:
                windows.append(Window(start_s, end_s, None, str(problem).removeprefix(f"{loaded.source.path}: ")))
                continue
            windows.append(Window(start_s, end_s, found, ""))
    if not windows:
        raise RecordingError(
            f"{loaded.source.path}: the arm moves for {lasts_s:.1f} s, expected at least one window of "
            f"{every_s:g} s. Use shorter windows."
        )
    return tuple(windows)


def _on_known_arm(
    seen: KnownArmSignal,
    loaded: Recording,
    chain: Chain,
    transmission: Transmission,
    arm: KnownArm,
    prior: Prior | None,
) -> Identification:
    """A payload from one run of any motion."""
    name = str(loaded.source.path)
    quality = MotionQuality.of(seen.signal.loaded, arm.fit.model)
    quality.require_enough(name)
    regressor = seen.regressor

    def fit_to(run: LoadSignal) -> Fit:
        return fit_on_known_arm(replace(seen, signal=run), chain, arm, prior)

    signal, fit, friction, struck = without_blows(seen.signal, fit_to)
    plain = InertialParameters(fit.theta[:10])
    # Measured minus predicted torque has the correlated errors of gains and body.
    doubts = np.concatenate(
        [
            arm.doubts(signal.states, signal.interval_s, signal.loaded.torque_nm),
            _model_doubts(signal, fit, arm),
        ]
    )
    width = float(quantify(fit, plain).half_width_95[0]) if plain.mass_kg != 0.0 else np.inf
    if plain.mass_kg <= 0.0 or width > DETERMINED_SHARE * plain.mass_kg:
        if plain.mass_kg != 0.0:
            width = float(quantify(fit, plain, shifts_by(fit, doubts)).half_width_95[0])
        raise quality.undetermined(name, plain.mass_kg, float(np.hypot(width, NORMAL_HALF_WIDTH * FLOOR_KG)))
    floor = float(np.hypot(FLOOR_KG, FLOOR_SHARE * plain.mass_kg)) / plain.mass_kg
    changes = fit.theta[10 : 10 + 2 * chain.n].reshape(2, -1)
    own = ArmFriction.of(arm.fit.model, signal.states.velocity_rad_s, changes)
    said = friction_notes(standard_deviations(changes, friction_covariance(fit, chain.n), arm.drift[:2]))
    doubts = np.concatenate([doubts, floor * (regressor @ plain.theta)[None]])
    return completed(
        signal, regressor, fit, friction, doubts, None, (loaded,), transmission, None, own, struck, said, prior=prior
    )


def _model_doubts(signal: LoadSignal, fit: Estimate, arm: KnownArm) -> FloatArray:
    """(n, K, n) torque of one standard deviation of the model's own error on each joint.

    Empty for an average period: its rows were not averaged over a window, and have more noise than the calibration's.
    """
    if signal.periodic:
        return np.zeros((0, *signal.torque_nm.shape))
    torque = signal.loaded.torque_nm
    level = np.sqrt(np.mean(torque[signal.valid] ** 2, axis=0))
    left = np.sqrt(np.maximum(fit.weight_1_nm**-2.0 - arm.noise_nm**2, 0.0))
    share = np.divide(_LASTING * left, level, out=np.zeros_like(level), where=level > 0.0)
    return np.asarray((share * torque)[None] * np.eye(level.size)[:, None, :])
