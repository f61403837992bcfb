"""A payload from one run of any motion, as a whole or window by window, on an arm that is calibrated."""

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
from armload_identification.estimation.uncertainty import DETERMINED_SHARE, quantify
from armload_identification.identification_errors import EstimationError, RecordingError
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters
from armload_identification.pipeline.identification import Fit, Identification, completed, without_blows
from armload_identification.recording.recording import Recording, check_joints
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import LoadSignal
from armload_identification.signals.motion import motion_of, motion_over_time
from armload_identification.verdict.friction_validity import friction_notes, standard_deviations
from armload_identification.verdict.motion_quality import MotionQuality
from armload_identification.verdict.sanity import check_run

FLOOR_KG: Final = 0.010
FLOOR_SHARE: Final = 0.001
"""What no calibrated arm's mass is more certain than, one standard deviation: the servo gives way, encoders err."""
SHORTEST_WINDOW_S: Final = 2.0
_LASTING: Final = 0.5
"""Of what the model leaves of a joint beyond the calibration's noise, the part that may be a share of its torque
throughout the run. On simulated arms with elastic joints and gears of two efficiencies 69 to 97 % of intervals hold
without it, 96 % or more with it."""


@dataclass(frozen=True, eq=False)
class Window:
    """What an arm carried during a part of a run.

    Attributes:
        start_s: Since the first movement.
        end_s: Likewise.
        found: The payload; None where the motion does not show it.
        refusal: Why there is none; empty where there is one.
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
        chain: The arm, as level as its calibration says.
        transmission: Calibrated gains, and coupling.
        arm: The empty arm by its calibration.
        prior: What is known of the payload beforehand.

    Raises:
        RecordingError: a recording that cannot be right.
        EstimationError: a motion that does not show what the payload weighs, saying which motion is missing.
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
    """Identify what an arm carries in one window of a run after the other.

    Args:
        loaded: A run of any motion.
        chain: The arm, as level as its calibration says.
        transmission: Calibrated gains, and coupling.
        arm: The empty arm by its calibration.
        every_s: Length of a window.

    Returns:
        Whole windows from the first movement on; one with insufficient motion contains the reason.

    Raises:
        RecordingError: a recording that does not fit the arm, cannot be right, or is shorter than a window.
    """
    check_joints(loaded, chain.n)
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
    width = float(quantify(fit, plain).half_width_95[0]) if plain.mass_kg != 0.0 else np.inf
    if plain.mass_kg <= 0.0 or width > DETERMINED_SHARE * plain.mass_kg:
        raise quality.undetermined(name, plain.mass_kg, width)
    floor = float(np.hypot(FLOOR_KG, FLOOR_SHARE * plain.mass_kg)) / plain.mass_kg
    changes = fit.theta[10 : 10 + 2 * chain.n].reshape(2, -1)
    own = ArmFriction.of(arm.fit.model, signal.states.velocity_rad_s, changes)
    said = friction_notes(standard_deviations(changes, friction_covariance(fit, chain.n), arm.drift[:2]))
    # Gains and body err together: what is left of one run has the errors of both.
    doubts = np.concatenate(
        [
            arm.doubts(signal.states, signal.interval_s, signal.loaded.torque_nm),
            _model_doubts(signal, fit, arm),
            floor * (regressor @ plain.theta)[None],
        ]
    )
    return completed(
        signal, regressor, fit, friction, doubts, None, (loaded,), transmission, None, own, struck, said, prior=prior
    )


def _model_doubts(signal: LoadSignal, fit: Estimate, arm: KnownArm) -> FloatArray:
    """(n, K, n) torque of one standard deviation of what the model itself is off by on each joint.

    None of an average period: its rows did not go through a window, and have noise that the calibration's have not.
    """
    if signal.periodic:
        return np.zeros((0, *signal.torque_nm.shape))
    torque = signal.loaded.torque_nm
    level = np.sqrt(np.mean(torque[signal.valid] ** 2, axis=0))
    left = np.sqrt(np.maximum(fit.weight_1_nm**-2.0 - arm.noise_nm**2, 0.0))
    share = np.divide(_LASTING * left, level, out=np.zeros_like(level), where=level > 0.0)
    return np.asarray((share * torque)[None] * np.eye(level.size)[:, None, :])
