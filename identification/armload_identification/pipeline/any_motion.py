"""A payload from one run of any motion on a calibrated arm, from the entire run or window by window."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from armload_identification.estimation.disturbances import Disturbances
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.estimation.payload_from_posterior import estimate_of, model_doubts
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.estimation.payload_problem import PayloadProblem, single_problem
from armload_identification.estimation.prior_knowledge import Prior
from armload_identification.estimation.solve import solve
from armload_identification.identification_errors import EstimationError, RecordingError
from armload_identification.model.chain import Chain
from armload_identification.model.payload import DETERMINED_SHARE
from armload_identification.model.regressor import PARAMETERS, payload_regressor
from armload_identification.pipeline.estimator_constants import FLOOR_KG, FLOOR_SHARE
from armload_identification.pipeline.identification_result import (
    Identification,
    added_friction,
    completed,
    payload_signal,
)
from armload_identification.pipeline.operator_notes import disturbance_notes, notes_on
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.motion import Motion
from armload_identification.signals.recorded_run import Run
from armload_identification.verdict.recording_checks.motion_quality import MotionQuality
from armload_identification.verdict.recording_checks.nothing_mounted import refuse_nothing
from armload_identification.verdict.recording_checks.usable_runs import usable_runs

SHORTEST_WINDOW_S: Final = 2.0


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
    run: Run,
    motion: Motion,
    problem: PayloadProblem,
    transmission: Transmission,
    arm: KnownArm,
    prior: Prior | None = None,
) -> Identification:
    """The payload in a run of any motion on a calibrated arm, or in a part of it.

    Args:
        run: The whole run.
        motion: Motion and torque of it or of a part.
        problem: The payload in that.
        transmission: Calibrated gains, and coupling.
        arm: The calibrated empty arm.
        prior: What is known of the payload beforehand.

    Raises:
        EstimationError: a motion that does not determine the payload's mass, naming the missing motion; NothingMounted
            if it proves that there is no payload.
    """
    name = str(run.recording.source.path)
    quality = MotionQuality.of(motion, arm.body)
    quality.require_enough(name)
    problem.require_rows(name)
    posterior = solve(problem.knowing(prior), rough=True)
    plain = estimate_of(posterior, problem, prior, arm.errors).doubting(model_doubts(posterior, arm))
    mass_kg, floor_kg = float(plain.theta[0]), float(np.hypot(FLOOR_KG, FLOOR_SHARE * plain.theta[0]))
    random_kg = replace(plain, shifts=np.zeros((0, PARAMETERS))).half_width_kg
    regressor = payload_regressor(problem.layout.chain, *motion.states)
    refuse_nothing(plain, regressor, motion.torque_nm, FLOOR_KG, f"{name}: ")
    if mass_kg <= 0.0 or random_kg > DETERMINED_SHARE * mass_kg:
        raise quality.undetermined(name, mass_kg, float(np.hypot(plain.half_width_kg, NORMAL_HALF_WIDTH * FLOOR_KG)))
    disturbances = Disturbances.of(posterior, problem.layout.chain, arm.body, arm.errors)
    plain = plain.doubting(*disturbances.doubts())
    plain = replace(plain, shifts=np.vstack([plain.shifts, floor_kg / mass_kg * plain.theta]))
    signal = payload_signal(plain, motion, transmission)
    gains = transmission.gains(from_torque=run.from_torque)
    result = completed(plain, None, signal, added_friction(plain, signal), gains, run)
    return result.with_notes(*disturbance_notes(disturbances, "the calibration"), *notes_on(result, gains, arm))


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
        transmission: Calibrated gains, and coupling.
        arm: The calibrated empty arm.
        every_s: Length of a window.

    Returns:
        Complete windows from the first movement on; one with insufficient motion contains the reason.

    Raises:
        RecordingError: a recording that does not fit the arm, is invalid, or is shorter than a window.
    """
    (whole,) = usable_runs([loaded], chain.n, transmission, arm.effort)
    if loaded.average is not None:
        raise RecordingError(
            f"{loaded.source.path}: a run of this length along an excitation is reduced to its average period while it "
            "is read, which has no windows. Select a part of it."
        )
    with threadpool_limits(1):
        motion = whole.over_time
        problem = single_problem(motion, chain, transmission.coupling, arm)
        windows = []
        lasts_s = float(motion.time_s[-1]) + motion.interval_s
        for number in range(int(lasts_s / every_s)):
            start_s, end_s = number * every_s, (number + 1) * every_s
            part = motion.part(start_s, end_s), problem.between(start_s, end_s)
            try:
                windows.append(Window(start_s, end_s, identify_alone(whole, *part, transmission, arm), ""))
            except EstimationError as refusal:
                windows.append(Window(start_s, end_s, None, str(refusal).removeprefix(f"{loaded.source.path}: ")))
    if not windows:
        raise RecordingError(
            f"{loaded.source.path}: the arm moves for {lasts_s:.1f} s, expected at least one window of "
            f"{every_s:g} s. Use shorter windows."
        )
    return tuple(windows)
