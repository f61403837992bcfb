"""Design of an excitation: the Fourier coefficients that tell most about a payload within the joints' limits.

    minimise  criterion(q, dq, ddq)                                       Chen 2016, eq. (7)
    subject to  q_min <= q <= q_max,  |dq| <= dq_max,  |ddq| <= ddq_max   at every time

Each start is random, seeded, and goes through an augmented Lagrangian on a grid of the period; SciPy's L-BFGS-B
solves the inner problems, with the criterion's derivative from `information` and the constraints' in closed form.
The linear algebra is held to one thread: with more, the last digits and so the end of a start depend on how many
there are, and threads that wait for each other over matrices of ten rows took six times as long on a busy machine.
What little the grid leaves over is taken away at the end by shrinking each joint's motion until its bounds,
which hold between the samples too, are strictly within the limits. The best start wins.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from threadpoolctl import threadpool_limits

from armload_identification.chain import Chain
from armload_identification.errors import ExcitationError
from armload_identification.fourier import CRITERIA, Excitation, FourierTrajectory, fourier_basis
from armload_identification.information import Criterion, a_optimal, condition_number
from armload_identification.payload import InertialParameters

FloatArray = NDArray[np.float64]

_SAMPLES_PER_HARMONIC = 20
_ROUNDS = 6
_ITERATIONS_PER_ROUND = 50
_MEMORY = 20
_SMALLEST_GAIN = 1e-9
_FIRST_PENALTY = 0.3  # soft at first: a start may cross a limit on its way to a better optimum
_PENALTY_GROWTH = 3.0
_INSIDE = 1.0 - 1e-6  # share of each limit that the finished motion uses at most


@dataclass(frozen=True, eq=False, slots=True)
class ExcitationLimits:
    """What each of n joints may do.

    Attributes:
        position_min_rad: (n,) least position.
        position_max_rad: (n,) greatest position.
        velocity_max_rad_s: (n,) greatest speed.
        acceleration_max_rad_s2: (n,) greatest acceleration.

    Raises:
        ExcitationError: shapes differ, a range is empty, or a limit is not a finite number above 0.
    """

    position_min_rad: FloatArray
    position_max_rad: FloatArray
    velocity_max_rad_s: FloatArray
    acceleration_max_rad_s2: FloatArray

    def __post_init__(self) -> None:
        shape = np.shape(self.position_min_rad)
        for name in ("position_min_rad", "position_max_rad", "velocity_max_rad_s", "acceleration_max_rad_s2"):
            array = np.array(getattr(self, name), dtype=np.float64)
            if array.shape != shape or array.ndim != 1 or not np.all(np.isfinite(array)):
                raise ExcitationError(f"{name} is {array.tolist()}; expected {shape} finite numbers")
            object.__setattr__(self, name, array)
        for i in range(shape[0]):
            low, high = self.position_min_rad[i], self.position_max_rad[i]
            speed, acceleration = self.velocity_max_rad_s[i], self.acceleration_max_rad_s2[i]
            if not low < high:
                raise ExcitationError(f"joint {i + 1}: positions from {low} to {high} rad; expected min < max")
            if not (speed > 0.0 and acceleration > 0.0):
                raise ExcitationError(
                    f"joint {i + 1}: speed {speed} rad/s, acceleration {acceleration} rad/s2; expected both above 0"
                )

    def reduced(self, position_margin_rad: float, rate_share: float) -> ExcitationLimits:
        """Tighter limits, to leave room for the ramps and the servo.

        Args:
            position_margin_rad: Taken off at both ends of every range.
            rate_share: Share of speed and acceleration that is kept, above 0 and at most 1.

        Raises:
            ExcitationError: nothing is left of a range, or the share is out of range.
        """
        if not (0.0 < rate_share <= 1.0 and position_margin_rad >= 0.0):
            raise ExcitationError(
                f"margin {position_margin_rad} rad, share {rate_share}; expected at least 0, and above 0 up to 1"
            )
        return ExcitationLimits(
            self.position_min_rad + position_margin_rad,
            self.position_max_rad - position_margin_rad,
            self.velocity_max_rad_s * rate_share,
            self.acceleration_max_rad_s2 * rate_share,
        )


@dataclass(frozen=True, eq=False, slots=True)
class LimitMargins:
    """How much room a motion leaves, at any time; each (n,), positive inside.

    Attributes:
        position_rad: To the nearer of the two position limits.
        velocity_rad_s: To the speed limit.
        acceleration_rad_s2: To the acceleration limit.
    """

    position_rad: FloatArray
    velocity_rad_s: FloatArray
    acceleration_rad_s2: FloatArray

    @property
    def smallest(self) -> float:
        """The smallest of all; above 0 where the motion is strictly feasible."""
        return float(min(m.min() for m in (self.position_rad, self.velocity_rad_s, self.acceleration_rad_s2)))


@dataclass(frozen=True, eq=False, slots=True)
class DesignResult:
    """A designed excitation.

    Attributes:
        trajectory: One period.
        criterion: "a-optimal" or "condition-number".
        cost: The criterion. A-optimal: sum of the squared relative standard deviations after one period at 100 Hz.
        condition_number: cond(Phi) of the trajectory in SI units, over what the arm can show.
        rank: Directions of the ten that the arm can show; below ten some parameters stay undetermined.
        margins: Room to every limit.
        restart_costs: (restarts,) the criterion of each start's result, inf where it shows too little.
        history: Criterion per iteration of the start that won; the early ones may be outside the limits.
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
        return Excitation(self.trajectory, periods, record)


def design(
    chain: Chain,
    limits: ExcitationLimits,
    *,
    harmonics: int,
    base_frequency_hz: float,
    torque_noise_nm: FloatArray,
    expected_payload: InertialParameters,
    seed: int,
    restarts: int,
    criterion: str = "a-optimal",
    progress: Callable[[int, int, float], None] | None = None,
) -> DesignResult:
    """Find the motion that tells most about the payload within the limits.

    The same arguments give the same result on the same machine.

    Args:
        chain: The arm.
        limits: What its joints may do.
        harmonics: H, at least 1.
        base_frequency_hz: One over the period.
        torque_noise_nm: (n,) noise of one raw torque sample at 100 Hz, for the A-optimal criterion.
        expected_payload: In the flange frame, for the A-optimal criterion.
        seed: Of the random starts.
        restarts: How many starts.
        criterion: "a-optimal" or "condition-number".
        progress: Called after each start with starts done, starts in all, best cost so far.

    Returns:
        The best motion found, strictly within the limits at every time.

    Raises:
        ExcitationError: arguments that make no sense, or no start ended with a motion that determines anything.

    References:
        Chen 2016, eqs. (6), (7). Nocedal, Wright, Numerical Optimization, 2nd ed. 2006, section 17.4.
    """
    if limits.position_min_rad.shape != (chain.n,):
        raise ExcitationError(f"limits of {len(limits.position_min_rad)} joints for a chain of {chain.n}")
    if harmonics < 1 or restarts < 1 or not base_frequency_hz > 0.0:
        raise ExcitationError(
            f"harmonics {harmonics}, restarts {restarts}, base_frequency_hz {base_frequency_hz}; "
            "expected at least 1, at least 1, above 0"
        )
    if criterion not in CRITERIA:
        raise ExcitationError(f"criterion is {criterion!r}; expected one of {', '.join(CRITERIA)}")
    paper = condition_number(chain)
    chosen = a_optimal(chain, torque_noise_nm, expected_payload) if criterion == "a-optimal" else paper
    problem = _Problem(chosen, limits, harmonics, base_frequency_hz)
    attempts: list[_Attempt] = []
    with threadpool_limits(1):
        for source in np.random.SeedSequence(seed).spawn(restarts):
            attempts.append(problem.solve(np.random.default_rng(source)))
            if progress is not None:
                progress(len(attempts), restarts, min(a.cost for a in attempts))
    best = min(attempts, key=lambda a: a.cost)
    if not np.isfinite(best.cost):
        raise ExcitationError(
            f"none of {restarts} starts ended with a motion that determines the payload; widen the limits"
        )
    return DesignResult(
        trajectory=best.trajectory,
        criterion=criterion,
        cost=best.cost,
        condition_number=problem.cost_of(paper, best.trajectory),
        rank=chosen.rank,
        margins=margins(best.trajectory, limits),
        restart_costs=np.array([a.cost for a in attempts]),
        history=np.array(best.history),
        seed=seed,
    )


def margins(trajectory: FourierTrajectory, limits: ExcitationLimits) -> LimitMargins:
    """Room that a trajectory leaves to the limits at any time, between samples too.

    Args:
        trajectory: The motion.
        limits: Of its joints.
    """
    reach = trajectory.bounds()
    below, above = reach.position_min_rad - limits.position_min_rad, limits.position_max_rad - reach.position_max_rad
    return LimitMargins(
        np.minimum(below, above),
        limits.velocity_max_rad_s - reach.velocity_max_rad_s,
        limits.acceleration_max_rad_s2 - reach.acceleration_max_rad_s2,
    )


@dataclass(frozen=True, slots=True)
class _Attempt:
    """Where one start ended."""

    cost: float
    trajectory: FourierTrajectory
    history: list[float]


class _Problem:
    """The optimisation problem of one design; holds no state that a start changes.

    The variables x (n, 2 H + 1) are scaled: an offset of 1 is half the joint's range, a coefficient of 1 alone
    reaches the speed limit.
    """

    def __init__(
        self, criterion: Criterion, limits: ExcitationLimits, harmonics: int, base_frequency_hz: float
    ) -> None:
        self._criterion = criterion
        self._limits = limits
        self._harmonics = harmonics
        self._frequency_hz = base_frequency_hz
        samples = _SAMPLES_PER_HARMONIC * harmonics
        times_s = np.arange(samples) / (samples * base_frequency_hz)
        self._basis = [fourier_basis(base_frequency_hz, harmonics, times_s, order) for order in range(3)]
        omega = 2.0 * np.pi * base_frequency_hz * np.arange(1, harmonics + 1)
        half = 0.5 * (limits.position_max_rad - limits.position_min_rad)
        rates = limits.velocity_max_rad_s[:, None] / np.concatenate([omega, omega])
        self._middle = 0.5 * (limits.position_max_rad + limits.position_min_rad)
        self._scale = np.column_stack([half, rates])
        # every constraint reads |value - centre| <= room
        self._room = np.stack([half, limits.velocity_max_rad_s, limits.acceleration_max_rad_s2])[:, None, :]
        self._centre = np.stack([self._middle, np.zeros_like(half), np.zeros_like(half)])[:, None, :]

    def solve(self, rng: np.random.Generator) -> _Attempt:
        """One start, from a random motion to a feasible optimum."""
        n, width = self._scale.shape
        x = rng.normal(size=(n, width)) / np.sqrt(2.0 * self._harmonics)
        x[:, 0] = rng.uniform(-0.3, 0.3, n)
        multipliers = np.zeros((2, 3, len(self._basis[0]), n))
        penalty = _FIRST_PENALTY
        history: list[float] = []
        for _ in range(_ROUNDS):
            x = self._inner(x, multipliers, penalty, history)
            multipliers = np.maximum(0.0, multipliers + penalty * self._violations(self._states(x)))
            penalty *= _PENALTY_GROWTH
        trajectory = self._shrunk(self._trajectory(x))
        return _Attempt(self.cost_of(self._criterion, trajectory), trajectory, history)

    def _inner(self, x: FloatArray, multipliers: FloatArray, penalty: float, history: list[float]) -> FloatArray:
        """The minimum of the augmented Lagrangian for fixed multipliers."""

        def lagrangian(flat: FloatArray) -> tuple[float, FloatArray]:
            return self._lagrangian(flat, multipliers, penalty, history)

        options = {"maxcor": _MEMORY, "maxiter": _ITERATIONS_PER_ROUND, "ftol": _SMALLEST_GAIN, "gtol": 0.0}
        found = minimize(lagrangian, x.ravel(), jac=True, method="L-BFGS-B", options=options)
        return np.asarray(found.x).reshape(x.shape)

    def cost_of(self, criterion: Criterion, trajectory: FourierTrajectory) -> float:
        """A criterion of a trajectory on the design's grid."""
        coefficients = np.column_stack([trajectory.offset_rad, trajectory.sin_rad, trajectory.cos_rad])
        states = [b @ coefficients.T for b in self._basis]
        return criterion.cost(states[0], states[1], states[2], 1.0 / self._frequency_hz)

    def _lagrangian(
        self, flat: FloatArray, multipliers: FloatArray, penalty: float, history: list[float]
    ) -> tuple[float, FloatArray]:
        """Augmented Lagrangian of log(cost) and its gradient by x."""
        states = self._states(flat.reshape(self._scale.shape))
        cost, slope = self._criterion.cost_and_slope(states[0], states[1], states[2], 1.0 / self._frequency_hz)
        history.append(cost)
        if not np.isfinite(cost):
            return np.inf, np.zeros_like(flat)
        active = np.maximum(0.0, multipliers + penalty * self._violations(states))
        value = np.log(cost) + (np.sum(active**2) - np.sum(multipliers**2)) / (2.0 * penalty)
        slope = slope / cost + (active[0] - active[1]) / self._room
        gradient = sum(slope[order].T @ self._basis[order] for order in range(3)) * self._scale
        return float(value), np.asarray(gradient).ravel()

    def _states(self, x: FloatArray) -> FloatArray:
        """(3, N, n) position, velocity, acceleration on the grid."""
        coefficients = (x * self._scale).T
        states = np.stack([b @ coefficients for b in self._basis])
        states[0] += self._middle
        return states

    def _violations(self, states: FloatArray) -> FloatArray:
        """(2, 3, N, n) how far above and below its room every value is, relative to the room; negative inside."""
        relative = (states - self._centre) / self._room
        return np.stack([relative - 1.0, -relative - 1.0])

    def _trajectory(self, x: FloatArray) -> FourierTrajectory:
        coefficients = x * self._scale
        harmonics = self._harmonics
        return FourierTrajectory(
            self._frequency_hz,
            coefficients[:, 0] + self._middle,
            coefficients[:, 1 : 1 + harmonics],
            coefficients[:, 1 + harmonics :],
        )

    def _shrunk(self, trajectory: FourierTrajectory) -> FourierTrajectory:
        """Each joint's motion made smaller and moved, as far as its limits ask for at any time."""
        reach, limits = trajectory.bounds(), self._limits
        spread = reach.position_max_rad - reach.position_min_rad
        factor = np.minimum.reduce(
            [
                np.ones(trajectory.n),
                _INSIDE * (limits.position_max_rad - limits.position_min_rad) / spread,
                _INSIDE * limits.velocity_max_rad_s / reach.velocity_max_rad_s,
                _INSIDE * limits.acceleration_max_rad_s2 / reach.acceleration_max_rad_s2,
            ]
        )
        low = (reach.position_min_rad - trajectory.offset_rad) * factor
        high = (reach.position_max_rad - trajectory.offset_rad) * factor
        gap = 0.25 * (1.0 - _INSIDE) * (limits.position_max_rad - limits.position_min_rad)
        offset = np.clip(
            trajectory.offset_rad, limits.position_min_rad + gap - low, limits.position_max_rad - gap - high
        )
        return FourierTrajectory(
            trajectory.base_frequency_hz,
            offset,
            trajectory.sin_rad * factor[:, None],
            trajectory.cos_rad * factor[:, None],
        )
