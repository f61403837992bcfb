"""Whether a payload changed, or something pushed the arm, during a run: terms of the one estimation.

    tau = ... + s(t) Phi(q, dq, ddq) delta,        delta = change of mass and first moments, s = 0 before, 1 after it

Beside all unknowns of the problem, and a friction of each joint that changes evenly during the run, the statistic

    g' S^-1 g,        g gradient, S information of delta

is chi-squared with four degrees of freedom if nothing changed. The greatest over the possible times is judged. In a run
of several periods the average period hides a change; there the run minus its own average period shows it, without any
knowledge of the arm, and s is s minus its mean over the periods, phase by phase. The same run shows a push, a force on
the flange for two seconds, by a statistic with three degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from armload_identification.estimation.arm_rows import ArmRows
from armload_identification.estimation.arm_terms import FRICTION_CHANGE, effort_level
from armload_identification.estimation.payload_problem import PayloadProblem
from armload_identification.estimation.posterior import Posterior
from armload_identification.estimation.problem import Group, Noise, Problem, RunRows
from armload_identification.estimation.solve import solve
from armload_identification.estimation.term_kinds import Joint, Scope, Term
from armload_identification.float_array import FloatArray
from armload_identification.recording.reduction.phase_advance import SETTLING_S, periodic_phase
from armload_identification.signals.motion import Motion
from armload_identification.signals.recorded_run import Run

CHANGING: Final = 4
"""Mass and first moments: a changed inertia about the centre of mass is hardly visible."""
PUSH_S: Final = 2.0
"""How long a push lasts that is tried: of 30 N, it has twice the noise of none; a longer one is found as well."""
_TRIED: Final = 40
"""Times at which something is tried: the statistic of a change between two of them is at most a few percent less."""
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
class Event:
    """The most likely change of a payload, or push, during a run.

    Attributes:
        at_s: When it began, since the start of the run's motion.
        statistic: Its significance, chi-squared.
        change: (4,) of mass and first moments, in kg and kg m; or (3,) force in N in the base frame.
        deviation: Their standard deviations.
    """

    at_s: float
    statistic: float
    change: FloatArray
    deviation: FloatArray


def events_during(
    run: Run, motion: Motion, found: Posterior, arm: PayloadProblem, edge_s: float
) -> tuple[Event | None, Event | None]:
    """The most likely change of the payload and the most likely push; None for what cannot be told.

    Args:
        found: The payload, assumed constant, by what was fitted to the run's motion.
        edge_s: Time at the start and the end in which no change is looked for.
    """
    if motion.periods == 1:
        return change_in(found, edge_s), None
    if run.recording.average is not None or motion.interruptions:
        return None, None
    return events_between_periods(run, arm, edge_s)


def change_in(found: Posterior, edge_s: float) -> Event | None:
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
    times_s = _times(rows.time_s, edge_s, edge_s)
    steps = (rows.time_s >= times_s[:, None]).astype(np.float64)
    return _greatest(found, _of_payload(rows), steps, times_s, slow)


def events_between_periods(whole: Run, arm: PayloadProblem, edge_s: float) -> tuple[Event | None, Event | None]:
    """The most likely change and push in a run of several periods, which may be empty.

    Args:
        whole: The run.
        arm: The problem of its payload, for coupling and speeds.
        edge_s: As of `change_in`.

    Returns:
        Each; None if the run is too short.
    """
    (motion, since_s, period_s), coupling = period_deviation(whole), arm.problem.coupling
    rows = arm.layout.rows(motion, loaded=True)
    elapsed_s = np.interp(rows.time_s, motion.time_s, since_s)
    periods_s = period_s * np.arange(whole.motion.periods)[:, None, None] + elapsed_s % period_s
    any_size = np.full(3 * rows.n, 1.0 / _RIDGE)
    slow = Term(FRICTION_CHANGE, Scope.RUN, Joint(_slow_change), 0.0 * any_size, any_size, "nothing is known of it")
    noise = replace(Noise.unknown(effort_level([rows])), robust=False)  # what happened is what is looked for
    found = solve(Problem([slow], [Group((RunRows(rows),))], noise, coupling), rough=True)
    nothing = np.zeros((0, *rows.effort_nm.shape))

    def most_likely(columns: FloatArray, begin_s: FloatArray, lasts_s: float) -> Event | None:
        def acts(at_s: FloatArray) -> NDArray[np.bool_]:
            return np.asarray((at_s >= begin_s[:, None]) & (at_s < begin_s[:, None] + lasts_s))

        return _greatest(found, columns, acts(elapsed_s) - np.mean(acts(periods_s), axis=0), begin_s, nothing)

    change = most_likely(_of_payload(rows), _times(elapsed_s, edge_s, edge_s), np.inf)
    force = np.moveaxis(-arm.layout.chain.jacobian(rows.position_rad)[:, :3], 1, 0)
    return change, most_likely(force, _times(elapsed_s, 0.0, PUSH_S), PUSH_S)


def _times(elapsed_s: FloatArray, before_s: float, after_s: float) -> FloatArray:
    """Times at which something is tried to begin; none if the run is too short."""
    if not elapsed_s.size or elapsed_s[-1] - elapsed_s[0] < before_s + after_s:
        return np.zeros(0)
    return np.linspace(elapsed_s[0] + before_s, elapsed_s[-1] - after_s, _TRIED)


def _of_payload(rows: ArmRows) -> FloatArray:
    """(4, N, n) joint torque per unit of mass and first moments."""
    return np.asarray(np.moveaxis(rows.payload[:, :, :CHANGING], 2, 0))


def _slow_change(rows: ArmRows, carried_nm: FloatArray) -> tuple[FloatArray, None]:
    """Friction of each joint that changes evenly: Coulomb, viscous and offset."""
    late = (rows.time_s - rows.time_s.mean()) / max(float(np.ptp(rows.time_s)), _RIDGE)
    return late[:, None] * np.stack([rows.direction, rows.velocity_rad_s, np.ones_like(rows.direction)]), None


def _greatest(
    found: Posterior, columns: FloatArray, acts: FloatArray, times_s: FloatArray, slow: FloatArray
) -> Event | None:
    """What acts with the greatest statistic.

    Args:
        columns: (c, N, n) joint torque per unit of what acts.
        acts: (T, N) how it acts if it begins at each of T times.
        times_s: (T,) these.
        slow: (k, N, n) axis torque of what may change beside it.
    """
    if not times_s.size:
        return None
    per_unit, size = np.einsum("ctj,ja->cta", columns, found.problem.coupling), len(columns)
    steps = (acts[:, None, :, None] * per_unit).reshape(-1, *per_unit.shape[1:])
    gradient, information = found.beside(np.concatenate([slow, steps]))
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), _RIDGE))
    gradient, information = scale * gradient, scale[:, None] * information * scale
    own = slice(0, len(slow))
    across = information[:, own] @ np.linalg.pinv(information[own, own], rcond=_RIDGE, hermitian=True)
    gradient, information = gradient - across @ gradient[own], information - across @ information[own]
    best: Event | None = None
    for number, at_s in enumerate(times_s):
        place = slice(len(slow) + size * number, len(slow) + size * (number + 1))
        inverse = np.linalg.pinv(information[place, place], rcond=_RIDGE, hermitian=True)
        change = inverse @ gradient[place]
        statistic = float(gradient[place] @ change)
        if best is None or statistic > best.statistic:
            deviation = np.sqrt(np.maximum(np.diag(inverse), 0.0))
            best = Event(float(at_s), statistic, scale[place] * change, scale[place] * deviation)
    return best
