"""One start of an excitation's design: from a random motion to an optimised one within every limit.

The method is an augmented Lagrangian on a grid over the period; SciPy's L-BFGS-B solves the inner problems, with the
derivative of the criterion from `information` and of the limits from `design_envelope`. The excess between the grid's
samples is computed after every round and reserved in the next. The small rest is removed at the end by reducing the
amplitude, until every limit is guaranteed, also between the samples.

The linear algebra uses one thread: with more, the last digits, and thus the result of a start, depend on their number;
and threads that wait for each other over matrices of ten rows took six times as long on a busy machine.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from typing import TYPE_CHECKING

import numpy as np
from threadpoolctl import threadpool_limits

from armload_identification.excitation.design_envelope import Envelope
from armload_identification.excitation.fourier import FourierTrajectory, fourier_basis
from armload_identification.excitation.geometry.cartesian_speed import SpeedLimit
from armload_identification.excitation.information import Criterion
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ExcitationError

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

_ORDERS = 4  # position, velocity, acceleration, jerk
_SAMPLES_PER_HARMONIC = 24
_LEAST_ROUNDS = 6
_MOST_ROUNDS = 10
_ITERATIONS_PER_ROUND = 150
_MEMORY = 20
_SMALLEST_GAIN = 1e-9
_DRAWS = 400
_DRAW_PENALTY = 1.0
_DRAWN_OFFSET = 0.5  # share of half a joint's range
_SMALLEST_DRAW = 0.2  # a large initial motion may span an obstacle, a small one grows around it
_FIRST_PENALTY = 0.3  # soft at first: a start may cross a limit on its way to a better optimum
_PENALTY_GROWTH = 3.0
_RESERVE_FROM_ROUND = 3
_SHRINKABLE_EXCESS = 1e-3  # greatest excess that a smaller amplitude can remove at little cost
_LIMIT_MARGIN = 1e-6  # relative margin to every limit
_SMALLEST_SHARE = 0.5
_ROUNDING = 1e-9


@dataclass(frozen=True, slots=True)
class PeriodRange:
    """Periods to choose from; a single one if both ends and the step are that period.

    Attributes:
        step_s: The period is a multiple of this, such as the bus cycle.

    Raises:
        ExcitationError: not 0 < shortest <= longest, or not 0 < step <= longest.
    """

    shortest_s: float
    longest_s: float
    step_s: float

    def __post_init__(self) -> None:
        if not 0.0 < self.shortest_s <= self.longest_s < np.inf or not 0.0 < self.step_s <= self.longest_s:
            raise ExcitationError(
                f"periods from {self.shortest_s} to {self.longest_s} s in steps of {self.step_s} s; "
                "expected 0 < shortest <= longest, and a step above 0 and at most the longest"
            )


@dataclass(frozen=True, eq=False, slots=True)
class SlowRound:
    """A round of the path at reduced speed, before the periods.

    Attributes:
        limit: Speed limit of the arm's points.
        rate: Greatest rate at which the path is followed.
        measured_s: Duration of the periods after it.
    """

    limit: SpeedLimit
    rate: float
    measured_s: float


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """What is searched, and from how many starts.

    Attributes:
        harmonics: H, at least 1.
        periods: The range of periods from which the one that best determines the payload in a given measuring time is
            chosen. Faster is better until a limit is reached: speed, acceleration, jerk or torque.
        seed: Seed of the random starts.
        restarts: Number of starts, at least 1.
        slow: The slow round before the periods; motions are then compared by the criterion times the duration of a run.

    Raises:
        ExcitationError: a number that is not above 0.
    """

    harmonics: int
    periods: PeriodRange
    seed: int
    restarts: int
    slow: SlowRound | None = None

    def __post_init__(self) -> None:
        if self.harmonics < 1 or self.restarts < 1:
            raise ExcitationError(f"harmonics {self.harmonics}, restarts {self.restarts}; expected at least 1 of each")


@dataclass(frozen=True, eq=False, slots=True)
class Attempt:
    """Result of one start.

    Attributes:
        cost: The criterion of one period; inf if no motion within the limits was found.
        score: The criterion for a measuring time that is the same for all periods, times the duration of a run, by
            which starts are compared.
        trajectory: The motion, or None.
        history: (I,) criterion after each iteration; early iterations may exceed the limits.
        excess: Greatest relative excess over a limit, if no motion within the limits was found.
        problem: The limit that is exceeded, in words.
    """

    cost: float
    score: float
    trajectory: FourierTrajectory | None
    history: FloatArray
    excess: float = 0.0
    problem: str = ""


class Search:
    """The problem that every start solves; not changed by a start, and picklable for other processes.

    The variables x (n, 2 H + 1) are scaled: an offset of 1 is half the joint's range, and so is a coefficient of 1,
    unless that amplitude would by itself exceed the speed limit. One more variable u = ln(f / f_0) is the base
    frequency f, free within its range: the k-th derivative grows with exp(k u). Motions are compared by the criterion
    for a given measuring time: faster is better until a limit is reached.
    """

    def __init__(self, criterion: Criterion, envelope: Envelope, settings: SearchSettings) -> None:
        harmonics, periods = settings.harmonics, settings.periods
        self._criterion = criterion
        self._envelope = envelope
        self._harmonics = harmonics
        self._slow = settings.slow
        self._step_s = periods.step_s
        self._reference_s = float(np.sqrt(periods.shortest_s * periods.longest_s))
        self._half_span = 0.5 * float(np.log(periods.longest_s / periods.shortest_s))
        samples = _SAMPLES_PER_HARMONIC * harmonics
        times_s = np.arange(samples) * (self._reference_s / samples)
        frequency_hz = 1.0 / self._reference_s
        self._basis = fourier_basis(frequency_hz, harmonics, times_s)
        omega = 2.0 * np.pi * frequency_hz * np.arange(1, harmonics + 1)
        joints = envelope.joints
        half = 0.5 * (joints.position_max_rad - joints.position_min_rad)
        reach = np.minimum(half[:, None], joints.velocity_max_rad_s[:, None] / np.concatenate([omega, omega]))
        self._middle = 0.5 * (joints.position_max_rad + joints.position_min_rad)
        self._scale = np.column_stack([half, reach])

    def run(self, source: np.random.SeedSequence) -> Attempt:
        """One start.

        Args:
            source: Seed of its random numbers; the same seed gives the same attempt in any process.
        """
        with threadpool_limits(1):
            return self._optimised_start(np.random.default_rng(source))

    def _optimised_start(self, rng: np.random.Generator) -> Attempt:
        x = self._best_random_motion(rng)
        multipliers = np.zeros((self._basis.shape[1], self._envelope.rows))
        reserve = np.zeros(self._envelope.rows)
        penalty = _FIRST_PENALTY
        history: list[float] = []
        for finished in range(1, _MOST_ROUNDS + 1):
            x = self._minimised(x, multipliers, reserve, penalty, history)
            excess = self._envelope.excess(self._states(x))
            if finished >= _RESERVE_FROM_ROUND:
                worst = self._envelope.worst(self._trajectory(x))
                if finished >= _LEAST_ROUNDS and worst.max() <= _SHRINKABLE_EXCESS:
                    break
                reserve = np.maximum(0.0, worst - excess.max(axis=0))
            multipliers = np.maximum(0.0, multipliers + penalty * (excess + reserve))
            penalty *= _PENALTY_GROWTH
        trajectory, worst = self._shrunk_within_limits(self._with_period_in_steps(self._begun_nearby(x)))
        if worst.max() > -_LIMIT_MARGIN:
            problem = self._envelope.most_exceeded(worst)
            return Attempt(np.inf, np.inf, None, np.array(history), float(worst.max()), problem)
        cost = self.cost_of(self._criterion, trajectory)
        equally_long = self.cost_of(self._criterion, trajectory, self._reference_s)
        state = trajectory.period(self._basis.shape[1])
        lasts_s = self._duration(np.stack(state[:2]), trajectory.period_s)[0]
        return Attempt(cost, equally_long * lasts_s, trajectory, np.array(history) * (cost / equally_long))

    def cost_of(self, criterion: Criterion, trajectory: FourierTrajectory, measured_s: float | None = None) -> float:
        """A criterion of a trajectory for a measuring time, one period if not given, on the grid of the search."""
        state = trajectory.period(self._basis.shape[1])
        return criterion.cost(*state[:3], trajectory.period_s if measured_s is None else measured_s)

    def _best_random_motion(self, rng: np.random.Generator) -> FloatArray:
        """The best of many random motions: informative, and not far outside the limits."""
        n, width = self._scale.shape
        best, least = np.zeros(n * width + 1), np.inf
        for _ in range(_DRAWS):
            size = rng.uniform(_SMALLEST_DRAW, 1.0)
            x = rng.normal(size=(n, width)) * (size / np.sqrt(2.0 * self._harmonics))
            x[:, 0] = rng.uniform(-_DRAWN_OFFSET, _DRAWN_OFFSET, n)
            drawn = np.append(x.ravel(), self._half_span * rng.uniform(-1.0, 1.0))
            states = self._states(drawn)
            cost = self._criterion.cost(states[0], states[1], states[2], self._reference_s)
            outside = np.maximum(0.0, self._envelope.excess(states))
            value = float(np.log(cost) + 0.5 * _DRAW_PENALTY * np.sum(outside**2))
            if value < least:
                best, least = drawn, value
        return best

    def _minimised(
        self, x: FloatArray, multipliers: FloatArray, reserve: FloatArray, penalty: float, history: list[float]
    ) -> FloatArray:
        """The minimum of the augmented Lagrangian for fixed multipliers."""
        from scipy.optimize import minimize

        latest = np.inf

        def lagrangian(trial: FloatArray) -> tuple[float, FloatArray]:
            nonlocal latest
            value, gradient, latest = self._lagrangian(trial, multipliers, reserve, penalty)
            return value, gradient

        def iterated(intermediate_result: OptimizeResult) -> None:
            history.append(latest)

        bounds = np.full((len(x), 2), (-np.inf, np.inf))
        bounds[-1] = (-self._half_span, self._half_span)
        options = {"maxcor": _MEMORY, "maxiter": _ITERATIONS_PER_ROUND, "ftol": _SMALLEST_GAIN, "gtol": 0.0}
        found = minimize(lagrangian, x, jac=True, method="L-BFGS-B", bounds=bounds, callback=iterated, options=options)
        return np.asarray(found.x)

    def _lagrangian(
        self, x: FloatArray, multipliers: FloatArray, reserve: FloatArray, penalty: float
    ) -> tuple[float, FloatArray, float]:
        """Augmented Lagrangian of log(cost), its gradient by x, and the cost."""
        states = self._states(x)
        cost, slope = self._criterion.cost_and_slope(states[0], states[1], states[2], self._reference_s)
        if not np.isfinite(cost):
            return np.inf, np.zeros_like(x), cost
        active = np.maximum(0.0, multipliers + penalty * (self._envelope.excess(states) + reserve))
        lasts_s, slowly_s, slower_s = self._duration(states, self._reference_s / float(np.exp(x[-1])))
        value = np.log(cost * lasts_s) + (np.sum(active**2) - np.sum(multipliers**2)) / (2.0 * penalty)
        total = self._envelope.slope(active, states)
        total[:3] += slope / cost
        total[:2] += slower_s / lasts_s
        orders = np.arange(_ORDERS)
        by_coefficient = np.tensordot(total * np.exp(orders * x[-1])[:, None, None], self._basis, ((0, 1), (0, 1)))
        by_frequency = orders @ np.einsum("kij,kij->k", total, states) - slowly_s / lasts_s
        return float(value), np.append((by_coefficient * self._scale).ravel(), by_frequency), cost

    def _duration(self, states: FloatArray, period_s: float) -> tuple[float, float, FloatArray]:
        """Duration of a run and of its slow round, and (2, N, n) their slope by positions and velocities."""
        if self._slow is None:
            return 1.0, 0.0, np.zeros((2, *states.shape[1:]))
        limit, least = self._slow.limit, 1.0 / self._slow.rate
        points = limit.points.moving(states[0], states[1])
        speeds = points.speeds
        fastest = speeds.max(axis=1) / limit.speed_m_s
        decisive = (np.arange(speeds.shape[1]) == speeds.argmax(axis=1)[:, None]) & (fastest > least)[:, None]
        slowly_s = period_s * float(np.mean(np.maximum(fastest, least)))
        weight = decisive * (period_s / (len(speeds) * limit.speed_m_s))
        return self._slow.measured_s + slowly_s, slowly_s, points.slope(weight)

    def _states(self, x: FloatArray) -> FloatArray:
        """(4, N, n) position, velocity, acceleration and jerk on the grid."""
        coefficients = (x[:-1].reshape(self._scale.shape) * self._scale).T
        states = np.exp(np.arange(_ORDERS) * x[-1])[:, None, None] * (self._basis @ coefficients)
        states[0] += self._middle
        return np.asarray(states)

    def _trajectory(self, x: FloatArray) -> FourierTrajectory:
        coefficients = x[:-1].reshape(self._scale.shape) * self._scale
        offset, sine, cosine = np.split(coefficients, [1, 1 + self._harmonics], axis=1)
        frequency_hz = float(np.exp(x[-1])) / self._reference_s
        return FourierTrajectory(frequency_hz, offset[:, 0] + self._middle, sine, cosine)

    def _begun_nearby(self, x: FloatArray) -> FourierTrajectory:
        """The motion, begun where the way from the middle of the ranges is short and without whole turns of a joint.

        That costs no information, and what approaches it at reduced speed takes less time.
        """
        trajectory = self._trajectory(x)
        if self._slow is None:
            return trajectory
        turns = np.round((trajectory.offset_rad - self._middle) / (2.0 * np.pi))
        nearer = replace(trajectory, offset_rad=trajectory.offset_rad - 2.0 * np.pi * turns)
        if np.any(self._envelope.worst(nearer) > np.maximum(self._envelope.worst(trajectory), 0.0)):
            nearer = trajectory
        at = nearer.period(self._basis.shape[1]).position_rad
        nearest = int(self._slow.limit.points.speeds(at, at - self._middle).max(axis=1).argmin())
        angle = 2.0 * np.pi * nearest / len(at) * np.arange(1, self._harmonics + 1)
        sine, cosine = nearer.sin_rad, nearer.cos_rad
        return replace(
            nearer,
            sin_rad=sine * np.cos(angle) - cosine * np.sin(angle),
            cos_rad=sine * np.sin(angle) + cosine * np.cos(angle),
        )

    def _with_period_in_steps(self, trajectory: FourierTrajectory) -> FourierTrajectory:
        """The same path with the next longer period that is a multiple of the step, which violates no further limit."""
        steps = ceil(trajectory.period_s / self._step_s * (1.0 - _ROUNDING))
        return replace(trajectory, base_frequency_hz=1.0 / (steps * self._step_s))

    def _shrunk_within_limits(self, trajectory: FourierTrajectory) -> tuple[FourierTrajectory, FloatArray]:
        """The motion with its amplitude reduced by as little as all limits require, and the remaining excess."""
        less = 0.0
        while True:
            share = 1.0 - less
            smaller = replace(trajectory, sin_rad=share * trajectory.sin_rad, cos_rad=share * trajectory.cos_rad)
            worst = self._envelope.worst(smaller)
            greatest = float(worst.max())
            less += max(1e-4, 0.5 * less, min(greatest, 0.02))
            if greatest <= -_LIMIT_MARGIN or less > 1.0 - _SMALLEST_SHARE:
                return smaller, worst
