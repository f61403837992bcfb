"""Design of an excitation: the Fourier coefficients that determine a payload best within all limits.

    minimise  criterion(q, dq, ddq)                                             Chen 2016, eq. (7)
    subject to  joints, torque and workspace within `Envelope`, at every time

Each start is random and seeded; the best one wins. Starts are independent of each other, so any executor may run them,
and the result is the same with each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, as_completed
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from armload_core.arrays import FloatArray
from armload_identification.excitation.design_envelope import Envelope
from armload_identification.excitation.design_search import Attempt, PeriodRange, Search
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.excitation.information import Criterion, condition_number
from armload_identification.excitation.limit_margins import LimitMargins
from armload_identification.identification_errors import ExcitationError


@dataclass(frozen=True, eq=False, slots=True)
class DesignResult:
    """A designed excitation.

    Attributes:
        trajectory: One period.
        criterion: Name of the criterion.
        cost: The criterion, as `Criterion.cost` defines it.
        condition_number: cond(Phi) of the trajectory in SI units, over what the arm can show.
        rank: Directions of the ten that the arm can show; below ten some parameters stay undetermined.
        margins: Room to every limit, at any time.
        restart_costs: (restarts,) the criterion of each start's result, inf where it found none within the limits.
        history: Criterion per iteration of the best start; the early ones may be outside the limits.
        seed: What the starts were drawn from.
    """

    trajectory: FourierTrajectory
    criterion: str
    cost: float
    condition_number: float
    rank: int
    margins: LimitMargins
    restart_costs: FloatArray
    history: FloatArray
    seed: int

    def excitation(self, periods: int, command: str, armload_version: str) -> Excitation:
        """The trajectory with its origin, ready to be written.

        Args:
            periods: Whole periods to drive.
            command: What makes this result again.
            armload_version: Version of the program.
        """
        record: dict[str, str | int | float] = {
            "criterion": self.criterion,
            "cost": self.cost,
            "condition_number": self.condition_number,
            "seed": self.seed,
            "restarts": len(self.restart_costs),
            "command": command,
            "armload_version": armload_version,
        }
        return Excitation(self.trajectory, periods, record, tuple(float(c) for c in self.history), self.margins)


def design(
    criterion: Criterion,
    envelope: Envelope,
    *,
    harmonics: int,
    base_frequency_hz: float | PeriodRange,
    seed: int,
    restarts: int,
    executor: Executor | None = None,
    progress: Callable[[int, int, float], None] | None = None,
    objection: Callable[[FourierTrajectory], str | None] | None = None,
) -> DesignResult:
    """Find the motion that determines the payload best within all limits.

    The same arguments give the same result on the same machine, whatever runs the starts.

    Args:
        criterion: What to make small, for the arm that it holds.
        envelope: All limits.
        harmonics: H, at least 1.
        base_frequency_hz: One over the period; or a range, from which the period that determines the payload
            best in the same measuring time is chosen. Faster is better until a limit stops it: speed,
            acceleration, jerk or torque.
        seed: Of the random starts.
        restarts: How many starts.
        executor: Runs the starts, such as a process pool; None runs them here, one after the other.
        progress: Called after each start with starts done, starts in all, best cost so far.
        objection: Says why a motion within the limits must not be driven all the same, such as for the meshes of a
            URDF; the best start without one wins.

    Returns:
        The best motion found, strictly within the limits at every time.

    Raises:
        ExcitationError: arguments that make no sense, or no start ended with a motion that determines anything.

    References:
        Chen 2016, eqs. (6), (7). Nocedal, Wright, Numerical Optimization, 2nd ed. 2006, section 17.4.
    """
    chain = criterion.chain
    if envelope.n != chain.n:
        raise ExcitationError(f"limits of {envelope.n} joints for a chain of {chain.n}")
    periods = base_frequency_hz
    if not isinstance(periods, PeriodRange):
        if not 0.0 < periods < np.inf:
            raise ExcitationError(f"base_frequency_hz is {periods}; expected a number above 0")
        periods = PeriodRange(1.0 / periods, 1.0 / periods, 1.0 / periods)
    if harmonics < 1 or restarts < 1:
        raise ExcitationError(f"harmonics {harmonics}, restarts {restarts}; expected at least 1 of each")
    search = Search(criterion, envelope, harmonics, periods)
    sources = np.random.SeedSequence(seed).spawn(restarts)
    attempts: dict[int, Attempt] = {}
    with threadpool_limits(1):  # here too: threads that share a process would lift each other's limit
        for number, attempt in _attempts(search, sources, executor):
            attempts[number] = attempt
            if progress is not None:
                progress(len(attempts), restarts, min(a.cost for a in attempts.values()))
    ended = [attempts[number] for number in range(restarts)]
    best, trajectory = _best(ended, objection)
    return DesignResult(
        trajectory=trajectory,
        criterion=criterion.name,
        cost=best.cost,
        condition_number=search.cost_of(condition_number(chain), trajectory),
        rank=criterion.rank,
        margins=envelope.margins(trajectory),
        restart_costs=np.array([attempt.cost for attempt in ended]),
        history=best.history,
        seed=seed,
    )


def _best(
    ended: list[Attempt], objection: Callable[[FourierTrajectory], str | None] | None
) -> tuple[Attempt, FourierTrajectory]:
    """The best start's result without an objection."""
    refused = ""
    for attempt in sorted(ended, key=lambda attempt: attempt.score):
        if attempt.trajectory is None or not np.isfinite(attempt.cost):
            break
        said = None if objection is None else objection(attempt.trajectory)
        if said is None:
            return attempt, attempt.trajectory
        refused = refused or f"; the best one within the limits {said}"
    nearest = min(ended, key=lambda attempt: attempt.excess if attempt.problem else np.inf)
    if not refused and nearest.problem:
        refused = f"; the nearest one {nearest.problem}"
    raise ExcitationError(
        f"none of {len(ended)} starts ended with a motion that determines the payload within all limits{refused}; "
        "widen the limits or the workspace, or increase the number of restarts"
    )


def _attempts(
    search: Search, sources: list[np.random.SeedSequence], executor: Executor | None
) -> Iterator[tuple[int, Attempt]]:
    """Number and result of every start, as they come."""
    if executor is None:
        for number, source in enumerate(sources):
            yield number, search.run(source)
        return
    futures = {executor.submit(search.run, source): number for number, source in enumerate(sources)}
    try:
        for future in as_completed(futures):
            yield futures[future], future.result()
    except BrokenExecutor as error:
        raise ExcitationError(
            "a worker process of the design was killed, perhaps for lack of memory; run the design again"
        ) from error
    finally:
        for future in futures:
            future.cancel()
