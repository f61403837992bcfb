"""Whether a payload changed during a run: a term of the one estimation that begins to act at a time.

    tau = ... + s(t) Phi(q, dq, ddq) delta,        delta = change of mass and first moments, s = 0 before, 1 after it

Beside all unknowns of the problem, and a friction of each joint that changes evenly during the run, the statistic

    g' S^-1 g,        g gradient, S information of delta

is chi-squared with four degrees of freedom if nothing changed. The greatest over the possible times is judged. In a run
of several periods the average period hides a change; there the run minus its own average period shows it, without any
knowledge of the arm, and s is s minus its mean over the periods, phase by phase.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.estimation.arm_rows import ArmRows
from armload_identification.estimation.arm_terms import FRICTION_CHANGE, effort_level
from armload_identification.estimation.payload_problem import PayloadProblem
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.problem import Group, Noise, Problem, RunRows
from armload_identification.estimation.solve import solve
from armload_identification.estimation.term_kinds import Joint, Scope, Term
from armload_identification.recording.reduction.phase_advance import SETTLING_S, periodic_phase
from armload_identification.signals.motion import Motion
from armload_identification.signals.recorded_run import Run

CHANGING: Final = 4
"""Mass and first moments: a changed inertia about the centre of mass is hardly visible."""
_TIMES: Final = 40
"""Times at which a change is tried: the statistic of one between two of them is at most a few percent less."""
_RIDGE: Final = 1e-9


def period_deviation(run: Run) -> tuple[Motion, FloatArray, float]:
    """A run of several whole periods minus its own average period: what differs between its periods.

    Returns:
        The run over time, its torque that minus the average of its phase, valid within the whole periods; (K,) phase
        since the start of the first period, over all periods; and the phase of one period.

    Raises:
        RecordingError: as of its motion.
    """
    average, over_time, moving = run.motion, run.over_time, run.moving_part.recording
    phase, trajectory = periodic_phase(run.recording)
    at_s = np.interp(over_time.time_s + over_time.began_s, moving.time_s, phase)
    samples = len(average.time_s)
    place = at_s / trajectory.period_s * samples % samples
    usual = np.column_stack(
        [np.interp(place, np.arange(samples + 1), np.append(column, column[0])) for column in average.raw_nm.T]
    )
    since_s = at_s - phase[0]
    inside = (since_s >= SETTLING_S) & (since_s < average.periods * trajectory.period_s)
    motion = replace(over_time, raw_nm=over_time.raw_nm - usual, valid=over_time.valid & inside)
    return motion, since_s, trajectory.period_s


@dataclass(frozen=True, eq=False)
class PayloadChange:
    """The most likely change of a payload during a run.

    Attributes:
        at_s: When, since the start of the run's motion.
        statistic: Its significance, chi-squared with four degrees of freedom.
        change: (4,) of mass and first moments, in kg and kg m.
        deviation: (4,) their standard deviations.
    """

    at_s: float
    statistic: float
    change: FloatArray
    deviation: FloatArray


def change_during(
    run: Run, motion: Motion, found: Posterior, arm: PayloadProblem, edge_s: float
) -> PayloadChange | None:
    """The most likely change during a run, by what was fitted to its motion; None if it cannot be told.

    Args:
        found: The payload, assumed constant.
        edge_s: Time at the start and the end in which no change is looked for.
    """
    if motion.periods == 1:
        return change_in(found, edge_s)
    if run.recording.average is not None or motion.interruptions:
        return None
    return change_between_periods(run, arm, edge_s)


def change_in(found: Posterior, edge_s: float) -> PayloadChange | None:
    """The most likely change in a run that is not averaged.

    Args:
        found: The solution of its payload's problem.
        edge_s: Time at the start and the end of the run in which no change is looked for.

    Returns:
        The change; None if the run is too short.
    """
    rows = found.problem.groups[0].runs[0].rows
    slow = np.einsum("mtj,ja->mjta", _slow_change(rows, rows.effort_nm)[0], found.problem.coupling)
    slow = slow.reshape(-1, *rows.effort_nm.shape)
    return _greatest(found, rows, rows.time_s, edge_s, lambda at_s: (rows.time_s >= at_s).astype(np.float64), slow)


def change_between_periods(whole: Run, arm: PayloadProblem, edge_s: float) -> PayloadChange | None:
    """The most likely change in a run of several periods, which may be empty.

    Args:
        whole: The run.
        arm: The problem of its payload, for coupling and speeds.
        edge_s: As of `change_in`.

    Returns:
        The change; None if the run is too short.
    """
    (motion, since_s, period_s), coupling = period_deviation(whole), arm.problem.coupling
    rows = arm.layout.rows(motion, loaded=True)
    elapsed_s = np.interp(rows.time_s, motion.time_s, since_s)
    phase_s = elapsed_s % period_s
    starts_s = period_s * np.arange(whole.motion.periods)[:, None]
    any_size = np.full(3 * rows.n, 1.0 / _RIDGE)
    slow = Term(FRICTION_CHANGE, Scope.RUN, Joint(_slow_change), 0.0 * any_size, any_size, "nothing is known of it")
    found = solve(Problem([slow], [Group((RunRows(rows),))], Noise.unknown(effort_level([rows])), coupling), rough=True)

    def step(at_s: float) -> FloatArray:
        return np.asarray((elapsed_s >= at_s) - np.mean(starts_s + phase_s >= at_s, axis=0))

    return _greatest(found, rows, elapsed_s, edge_s, step, np.zeros((0, *rows.effort_nm.shape)))


def _slow_change(rows: ArmRows, carried_nm: FloatArray) -> tuple[FloatArray, None]:
    """Friction of each joint that changes evenly: Coulomb, viscous and offset."""
    late = (rows.time_s - rows.time_s.mean()) / max(float(np.ptp(rows.time_s)), _RIDGE)
    return late[:, None] * np.stack([rows.direction, rows.velocity_rad_s, np.ones_like(rows.direction)]), None


def _greatest(
    found: Posterior,
    rows: ArmRows,
    elapsed_s: FloatArray,
    edge_s: float,
    step: Callable[[float], FloatArray],
    slow: FloatArray,
) -> PayloadChange | None:
    """The change with the greatest statistic; `step` gives the (N,) s for a time, `slow` is (k, N, n) axis torque."""
    if not elapsed_s.size or elapsed_s[-1] - elapsed_s[0] < 2.0 * edge_s:
        return None
    times_s = np.linspace(elapsed_s[0] + edge_s, elapsed_s[-1] - edge_s, _TIMES)
    per_unit = np.einsum("tjk,ja->kta", rows.payload[:, :, :CHANGING], found.problem.coupling)
    steps = np.stack([step(at_s) for at_s in times_s])
    columns = np.concatenate([slow, (steps[:, None, :, None] * per_unit).reshape(-1, *per_unit.shape[1:])])
    gradient, information = found.beside(columns)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), _RIDGE))
    gradient, information = scale * gradient, scale[:, None] * information * scale
    own = slice(0, len(slow))
    across = information[:, own] @ np.linalg.pinv(information[own, own], rcond=_RIDGE, hermitian=True)
    gradient, information = gradient - across @ gradient[own], information - across @ information[own]
    best: PayloadChange | None = None
    for number, at_s in enumerate(times_s):
        place = slice(len(slow) + CHANGING * number, len(slow) + CHANGING * (number + 1))
        inverse = np.linalg.pinv(information[place, place], rcond=_RIDGE, hermitian=True)
        change = inverse @ gradient[place]
        statistic = float(gradient[place] @ change)
        if best is None or statistic > best.statistic:
            deviation = np.sqrt(np.maximum(np.diag(inverse), 0.0))
            best = PayloadChange(float(at_s), statistic, scale[place] * change, scale[place] * deviation)
    return best
