"""Identify a payload: from a loaded and an unloaded recording to parameters with intervals.

recordings -> runs -> rows -> one solve over terms -> possible body -> intervals -> notes
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from armload_identification.estimation.contradicted_gains import GainFit, fit_gains
from armload_identification.estimation.disturbances import Disturbances
from armload_identification.estimation.elastic_joints import elastic_torque
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.estimation.payload_from_posterior import estimate_of, model_doubts
from armload_identification.estimation.payload_problem import pair_problem, single_problem
from armload_identification.estimation.prior_knowledge import KnownPayload, Prior
from armload_identification.estimation.run_drift import RunDrift
from armload_identification.estimation.solve import solve
from armload_identification.identification_errors import EstimationError, ModelError, NothingMounted
from armload_identification.model.chain import Chain
from armload_identification.pipeline.any_motion import identify_alone
from armload_identification.pipeline.identification_result import (
    Identification,
    added_friction,
    completed,
    payload_signal,
)
from armload_identification.pipeline.operator_notes import change_notes, disturbance_notes, misfits, notes_on
from armload_identification.pipeline.prior_contradictions import identified_knowing
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import load_signal, slow_round_signal
from armload_identification.signals.recorded_run import Run
from armload_identification.verdict.recording_checks.column_mistakes import RunColumns, require_right_columns
from armload_identification.verdict.recording_checks.pair_contradictions import FittedPair, refuse_contradictions
from armload_identification.verdict.recording_checks.usable_runs import usable_runs


def identify_runs(
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
        recordings = (loaded,) if unloaded is None else (loaded, unloaded)
        runs = usable_runs(recordings, chain.n, transmission, None if arm is None else arm.effort)
        if unloaded is not None:
            identified = _by_difference(runs[0], runs[1], chain, transmission, arm)
        elif arm is not None:
            identified = partial(_alone, runs[0], chain, transmission, arm)
        else:
            raise EstimationError(
                "no unloaded recording was given, and the arm's own torque, which is many times the payload's, is "
                "unknown. Record the same excitation without the payload and give that file as `unloaded=`, or "
                "calibrate the arm once with `armload calibrate` and give that file as `calibration=`."
            )
        found = identified(None) if known is None else identified_knowing(known, identified)
        return found.with_notes(*change_notes(found, *runs))


def _alone(run: Run, chain: Chain, transmission: Transmission, arm: KnownArm, prior: Prior | None) -> Identification:
    """The payload of one run, if its columns are the arm's: they are named before what would be their consequence."""
    motion, coupling = run.motion, transmission.coupling
    try:
        found = identify_alone(run, motion, single_problem(motion, chain, coupling, arm), transmission, arm, prior)
    except EstimationError as error:
        if not isinstance(error, NothingMounted):
            require_right_columns(run, motion, chain, coupling)
        raise
    if misfits(found, arm):
        require_right_columns(run, motion, chain, coupling)
    return found


def _by_difference(
    loaded: Run, unloaded: Run, chain: Chain, transmission: Transmission, arm: KnownArm | None
) -> Callable[[Prior | None], Identification]:
    """The payload of a pair as a function of the prior; what does not depend on it is computed once."""
    signal = load_signal(loaded, unloaded)
    slow = slow_round_signal(loaded, unloaded) if signal.loaded.periodic else None
    columns = RunColumns(signal, (loaded, unloaded), chain, transmission.coupling, arm)
    if not columns.look_right:
        columns.require_right()
    gains = transmission.gains(from_torque=loaded.from_torque)
    problem = pair_problem(signal, chain, transmission.coupling, arm, slow)
    problem.require_rows(str(loaded.recording.source.path))
    errors = gains.errors if arm is None else arm.errors

    def identified(prior: Prior | None) -> Identification:
        fitted: GainFit | None = None
        if arm is None and gains.fitted:
            posterior, fitted = fit_gains(problem, gains, prior)
        else:
            posterior = solve(problem.knowing(prior), rough=True)
        plain = estimate_of(posterior, problem, prior, errors, gears=fitted is not None)
        adjusted = payload_signal(plain, signal, transmission)
        added_nm = added_friction(plain, adjusted)
        refuse_contradictions(FittedPair(plain, fitted, signal, adjusted, added_nm, columns.body), columns)
        drift = RunDrift.of(posterior, arm)
        plain = replace(plain, shifts=np.vstack([plain.shifts, drift.allowed * plain.drifting]))
        if arm is not None:
            plain = plain.doubting(model_doubts(posterior, arm)).doubting(*elastic_torque(posterior, chain, arm.body))
        known = (plain.body(0), None) if arm is None else (arm.body, arm.errors)
        disturbances = Disturbances.of(posterior, problem.layout.chain, *known)
        plain = plain.doubting(*disturbances.doubts())
        result = completed(plain, fitted, adjusted, added_nm, gains, loaded, unloaded)
        if misfits(result, arm) or disturbances.named:
            columns.require_right()
        remarks = *drift.notes(), *disturbance_notes(disturbances, "the unloaded run")
        return result.with_notes(*remarks, *notes_on(result, gains, arm, columns.arm if arm is None else None))

    return identified
