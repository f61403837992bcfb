"""Design of an excitation: the Fourier coefficients that best determine a payload within all limits.

    minimise  criterion(q, dq, ddq)                                             Chen 2016, eq. (7)
    subject to  joints, torque and workspace within `Envelope`, at every time

The best of several random, seeded starts is used. Starts are independent, so that any executor can run them with the
same result.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from armload_identification.excitation.design_envelope import Envelope
from armload_identification.excitation.design_search import Attempt, Search, SearchSettings
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.excitation.information import Criterion, condition_number
from armload_identification.excitation.limit_margins import LimitMargins
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ExcitationError


@dataclass(frozen=True, eq=False, slots=True)
class DesignResult:
    """A designed excitation.

    Attributes:
        trajectory: One period.
        criterion: Name of the criterion.
        cost: The criterion, as `Criterion.cost` defines it.
        condition_number: cond(Phi) of the trajectory in SI units, over the identifiable directions.
        rank: Number of identifiable directions; below ten some parameters stay undetermined.
        margins: Margin to every limit, over all times.
        restart_costs: (restarts,) the criterion of each start's result, inf if it found none within the limits.
        history: Criterion per iteration of the best start; early iterations may exceed the limits.
        seed: Seed of the starts.
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
        """The trajectory with its provenance, ready to be written.

        Args:
            periods: Number of periods to drive.
            command: Command that reproduces this result.
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


def optimal_excitation(
    criterion: Criterion,
    envelope: Envelope,
    settings: SearchSettings,
    *,
    executor: Executor | None = None,
    progress: Callable[[int], None] = lambda _finished: None,
    objection: Callable[[FourierTrajectory], str | None] | None = None,
) -> DesignResult:
    """Find the motion that best determines the payload within all limits.

    The same arguments give the same result on the same machine with any executor.

    Args:
        criterion: The cost to minimise, and its arm.
        envelope: All limits.
        settings: Harmonics, period and starts.
        executor: Runs the starts, such as a process pool; None runs them here, one after the other.
        progress: Called after each start, in their order, with the number of starts done.
        objection: Returns why a motion within the limits must not be driven, such as a collision of a URDF's meshes,
            or None; the best start without an objection is used.

    Returns:
        The best motion found, strictly within the limits at all times.

    Raises:
        ExcitationError: limits of another arm, or no start ended with a motion that determines the payload within the
            limits.

    References:
        Chen 2016, eqs. (6), (7). Nocedal, Wright, Numerical Optimization, 2nd ed. 2006, section 17.4.
    """
    chain = criterion.chain
    if envelope.n != chain.n:
        raise ExcitationError(f"limits of {envelope.n} joints for a chain of {chain.n}")
    search = Search(criterion, envelope, settings)
    sources = np.random.SeedSequence(settings.seed).spawn(settings.restarts)
    every = map if executor is None else executor.map
    ended: list[Attempt] = []
    with threadpool_limits(1):  # here too: each of an executor's threads lifts the process's limit when it ends
        try:
            for attempt in every(search.run, sources):
                ended.append(attempt)
                progress(len(ended))
        except BrokenExecutor as error:
            raise ExcitationError(
                "a worker process of the design was killed, perhaps for lack of memory; run the design again"
            ) from error
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
        seed=settings.seed,
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
