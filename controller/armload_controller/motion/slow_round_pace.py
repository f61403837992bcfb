"""The pace of a slow round: a path run at a rate that varies along it, so that no point of the arm exceeds a speed.

The slowness w = du/ds is a cubic B-spline over the path's own phase s, with the path's period; its coefficients are
raised until it is nowhere below the slowness that the speed of the arm's points requires. The new phase u is its
integral, and

    q(u) = q(s(u))      ds/du = 1/w      d2s/du2 = -w'/w^3      d3s/du3 = (3 w'^2 - w w'')/w^5

with w' = dw/ds. At any rate of u up to 1, s moves at most at ds/du. The derivatives of s to time,

    |ds/dt| <= g      |d2s/dt2| <= S_2 + g alpha      |d3s/dt3| <= S_3 + 3 S_2 alpha + g beta

with g, S_2, S_3 the greatest derivatives of s to u, and alpha, beta the limits of phase u, are kept within the limits
of the path's phase. So everything checked for the path also holds in the slow round.

Between samples, h apart: w'' is linear between two knots and therefore greatest at an end of the interval; |w'| is at
most |w''| h / 2 above its samples, and w at most |w''| h^2 / 8 below.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from armload_controller.motion.paths import PLANNED_SHARE, PhaseLimits
from armload_identification.excitation.fourier import FourierState, FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import SpeedLimit
from armload_identification.float_array import FloatArray

REDUCED_SPEED_M_S = 0.25
"""Speed limit for every point of the arm and of what it carries on approaches and slow rounds: reduced speed of
ISO 10218-1."""
PLANNED_SPEED_M_S = PLANNED_SHARE * REDUCED_SPEED_M_S
SLOW_RATE = 0.25
"""Greatest rate of the first round of a new path or with a new load."""
_SAMPLES = 2048
"""Samples of a period at which the speed of the arm's points is computed."""
_MOST_KNOTS, _FEWEST_KNOTS = 256, 8
_SHARE = 0.5
"""Share of the phase's acceleration and jerk that a varying pace may use; the rest is for ramps, pauses and stops."""
_ROUNDS = 50
"""Greatest number of times that coefficients are raised; four are usual."""
_RAISED_FURTHER = 1.0 + 1e-6
_MOST_STEPS = 60
"""Three or four are usual; halving alone would need 47 for `_SETTLED`."""
_SETTLED = 1e-14
_BASIS = np.array([[1.0, 4.0, 1.0, 0.0], [-3.0, 0.0, 3.0, 0.0], [3.0, -6.0, 3.0, 0.0], [-1.0, 3.0, -3.0, 1.0]]) / 6.0
"""Contribution of the four neighbouring coefficients (columns) to each power (row) of the position between two
knots."""


@dataclass(frozen=True, eq=False)
class Pace:
    """A periodic slowness, and the new phase that it defines on a path.

    Attributes:
        period_s: Period of the path.
        slowness: (K,) coefficients of the spline; the k-th has its greatest weight at knot k + 2.
    """

    period_s: float
    slowness: FloatArray
    _powers: FloatArray = field(init=False, repr=False)
    _rows: list[list[float]] = field(init=False, repr=False)
    _begins_s: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        powers = (_BASIS @ np.stack([np.roll(self.slowness, 3 - m) for m in range(4)])).T
        whole = powers @ (1.0 / np.arange(1, 5)) * self._knot_s
        object.__setattr__(self, "_powers", powers)
        object.__setattr__(self, "_rows", powers.tolist())
        object.__setattr__(self, "_begins_s", np.concatenate([[0.0], np.cumsum(whole)]))

    @property
    def lasts_s(self) -> float:
        """Duration of a period at full rate."""
        return float(self._begins_s[-1])

    def bounds(self, samples: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Least slowness, and greatest magnitudes of its derivatives, between each sample of a period and the next.

        Args:
            samples: Number of samples; a multiple of the number of knots.

        Returns:
            (samples,) each: w, |w'| and |w''|.
        """
        knots = len(self.slowness)
        x = np.arange(samples // knots + 1) / (samples // knots)
        p0, p1, p2, p3 = self._powers.T[:, :, None]
        step_s = self.period_s / samples
        w = p0 + x * (p1 + x * (p2 + x * p3))
        slope = np.abs(p1 + x * (2.0 * p2 + x * 3.0 * p3)) / self._knot_s
        bend = np.abs(2.0 * p2 + 6.0 * x * p3) / self._knot_s**2
        second = np.maximum(bend[:, 1:], bend[:, :-1])
        first = np.maximum(slope[:, 1:], slope[:, :-1]) + second * step_s / 2.0
        least = np.minimum(w[:, 1:], w[:, :-1]) - second * step_s**2 / 8.0
        return least.ravel(), first.ravel(), second.ravel()

    @property
    def rates(self) -> tuple[float, float, float]:
        """Bounds of the derivatives of the path's phase: g, S_2 and S_3."""
        w, first, second = self.bounds(_SAMPLES)
        return (
            float((1.0 / w).max()),
            float((first / w**3).max()),
            float((3.0 * first**2 / w**5 + second / w**4).max()),
        )

    def within(self, bounds: PhaseLimits) -> PhaseLimits | None:
        """Limits of the new phase that keep the path's phase within its bounds; None if the pace alone exceeds them."""
        g, second, third = self.rates
        if second > _SHARE * bounds.acceleration_1_s:
            return None
        acceleration = (bounds.acceleration_1_s - second) / g
        varying = third + 3.0 * second * acceleration
        if varying > _SHARE * bounds.jerk_1_s2:
            return None
        return PhaseLimits(acceleration, (bounds.jerk_1_s2 - varying) / g)

    def phase_of(self, path_s: float) -> float:
        """The new phase that belongs to a phase of the path."""
        turns, rest = divmod(path_s, self.period_s)
        knot = min(int(rest / self._knot_s), len(self.slowness) - 1)
        x = rest / self._knot_s - knot
        within = self._knot_s * float(self._powers[knot] @ (x ** np.arange(1, 5) / np.arange(1, 5)))
        return float(turns * self.lasts_s + self._begins_s[knot] + within)

    def evaluate(self, phase_s: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """The path's phase, and its first three derivatives to the new phase.

        Args:
            phase_s: (N,) new phases, or a single one.
        """
        turns = np.floor(phase_s / self.lasts_s)
        rest = np.asarray(phase_s - turns * self.lasts_s)
        knot = np.clip(np.searchsorted(self._begins_s, rest, side="right") - 1, 0, len(self.slowness) - 1)
        into = np.clip(rest - self._begins_s[knot], 0.0, None)
        places = [self._place(*each) for each in zip(knot.ravel().tolist(), into.ravel().tolist(), strict=True)]
        x = np.array(places).reshape(rest.shape)
        p0, p1, p2, p3 = np.moveaxis(self._powers[knot], -1, 0)
        w = p0 + x * (p1 + x * (p2 + x * p3))
        slope = (p1 + x * (2.0 * p2 + x * 3.0 * p3)) / self._knot_s
        bend = (2.0 * p2 + 6.0 * x * p3) / self._knot_s**2
        path_s = turns * self.period_s + (knot + x) * self._knot_s
        return path_s, 1.0 / w, -slope / w**3, (3.0 * slope**2 - w * bend) / w**5

    def _place(self, knot: int, into_s: float) -> float:
        """Position between a knot (0) and the next (1) that is reached `into_s` of the new phase after the knot.

        The integral of the slowness is monotonic: Newton's method, with bisection if a step leaves the bracket. A loop
        over plain floats: the cycle evaluates one, for which arrays take thirty times as long.
        """
        p0, p1, p2, p3 = self._rows[knot]
        wanted = into_s / self._knot_s
        x = wanted / (p0 + p1 / 2.0 + p2 / 3.0 + p3 / 4.0)
        least, most = 0.0, 1.0
        for _ in range(_MOST_STEPS):
            excess = x * (p0 + x * (p1 / 2.0 + x * (p2 / 3.0 + x * p3 / 4.0))) - wanted
            if excess < 0.0:
                least = x
            else:
                most = x
            before, x = x, x - excess / (p0 + x * (p1 + x * (p2 + x * p3)))
            if not least <= x <= most:
                x = 0.5 * (least + most)
            if abs(x - before) < _SETTLED:
                break
        return x

    @property
    def _knot_s(self) -> float:
        return self.period_s / len(self.slowness)


@dataclass(frozen=True, eq=False)
class PacedPath:
    """A path over a new phase that is stretched where the arm would be fast.

    Attributes:
        path: The path over its own phase.
        pace: Relation of the two phases.
    """

    path: FourierTrajectory
    pace: Pace

    def evaluate(self, t_s: ArrayLike) -> FourierState:
        """Position and derivatives to the new phase; (n,) for one phase, (N, n) for N."""
        s, first, second, third = self.pace.evaluate(np.asarray(t_s, dtype=np.float64))
        q, v, a, j = self.path.evaluate(s)
        g, h, k = (np.asarray(derivative)[..., None] for derivative in (first, second, third))
        return FourierState(q, v * g, a * g**2 + v * h, j * g**3 + 3.0 * a * g * h + v * k)


def reduced_pace(path: FourierTrajectory, bounds: PhaseLimits, speed: SpeedLimit) -> tuple[PacedPath, PhaseLimits]:
    """The fastest pace found at which no point exceeds `PLANNED_SHARE` of a speed, nor the rate `SLOW_RATE`.

    Args:
        speed: Limit of the speed of the arm's points and of what it carries.

    Returns:
        The path at that pace, and the limits of its phase.
    """
    fastest = speed.points.greatest_in_period(path, _SAMPLES).max(axis=1)
    needed = np.maximum(1.0 / SLOW_RATE, fastest / (PLANNED_SHARE * speed.speed_m_s))
    knots = _MOST_KNOTS
    while knots >= _FEWEST_KNOTS:
        pace = _pace_above(needed, path.period_s, knots)
        phase = None if pace is None else pace.within(bounds)
        if pace is not None and phase is not None:
            return PacedPath(path, pace), phase
        knots //= 2
    constant = Pace(path.period_s, np.full(_FEWEST_KNOTS, needed.max()))
    g = constant.rates[0]
    return PacedPath(path, constant), PhaseLimits(bounds.acceleration_1_s / g, bounds.jerk_1_s2 / g)


def _pace_above(needed: FloatArray, period_s: float, knots: int) -> Pace | None:
    """A pace with at least the required slowness (samples,); None if raising its coefficients does not converge."""
    slowness = np.roll(needed[:: len(needed) // knots], -2)
    for _ in range(_ROUNDS):
        pace = Pace(period_s, slowness)
        missing = (needed / pace.bounds(len(needed))[0]).reshape(knots, -1).max(axis=1)
        if missing.max() <= 1.0:
            return pace
        # The middle two of the four coefficients of an interval have most of the weight.
        raised = np.maximum(np.roll(missing, -1), np.roll(missing, -2))
        slowness = slowness * np.maximum(raised * _RAISED_FURTHER, 1.0)
    return None
