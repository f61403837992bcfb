"""The shortest motion about one configuration that determines a payload's mass: a few degrees in every joint.

Each joint's motion is a Fourier series whose amplitude is set by the nearest limit, so that only its shape is searched:
many shapes are drawn for each period, and the best one is varied. The number of periods is the least that suffices.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from threadpoolctl import threadpool_limits

from armload_identification.excitation.design_envelope import Envelope
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ExcitationError

PERIODS_S: Final = (2.0, 3.0, 4.0, 6.0, 8.0)
LONGEST_S: Final = 60.0
_FASTEST_HZ: Final = 1.2
"""Greatest frequency of the highest harmonic; faster motion is smoothed away with the noise."""
_MOST_HARMONICS: Final = 6
_JUDGED_S: Final = 10.0
"""Length of the motion by which shapes are compared."""
_DRAWS: Final = 60
_VARIATIONS: Final = 120
_VARIED: Final = 0.4
_MOST_SMALLER: Final = 3
_INSIDE: Final = 0.98
_SAMPLES: Final = 48
"""Samples per harmonic."""
_SHRINKING: Final = 0.9
_MOST_SHRINKING: Final = 25


@dataclass(frozen=True, eq=False)
class Wiggle:
    """A motion that determines a mass.

    Attributes:
        trajectory: One period.
        periods: Number of periods.
        half_width_kg: Expected half width of the mass's 95 % interval.
        tried: Number of evaluated motions with this period.
        seed: Seed of the random shapes.
    """

    trajectory: FourierTrajectory
    periods: int
    half_width_kg: float
    tried: int
    seed: int

    @property
    def lasts_s(self) -> float:
        """Duration of all periods, without ramps."""
        return self.periods * self.trajectory.period_s


@dataclass(frozen=True, eq=False)
class WiggleSearch:
    """Where and how to move.

    Attributes:
        half_widths_kg: Half widths of the mass's 95 % interval, of a motion and (p,) numbers of its periods.
        envelope: All limits; the ranges of the joints are those about the configuration.
        at_rad: (n,) the configuration.
        step_s: The period is a multiple of this.
        objection: Returns why a motion within the limits must not be driven, or None.
    """

    half_widths_kg: Callable[[FourierTrajectory, FloatArray], FloatArray]
    envelope: Envelope
    at_rad: FloatArray
    step_s: float
    objection: Callable[[FourierTrajectory], str | None]

    def shortest(self, wanted_kg: float, seed: int, progress: Callable[[int, int], None]) -> Wiggle:
        """The shortest motion about the configuration.

        Args:
            wanted_kg: Required half width of the mass's 95 % interval.
            seed: Seed; the same seed gives the same motion.
            progress: Called with the number of periods evaluated and their total.

        Raises:
            ExcitationError: no motion within the limits, or none of at most a minute that determines the mass as
                required.
        """
        found: list[Wiggle] = []
        best_kg, refused = np.inf, ""
        with threadpool_limits(1):
            for number, about_s in enumerate(PERIODS_S, 1):
                progress(number - 1, len(PERIODS_S))
                period_s = max(round(about_s / self.step_s), 1) * self.step_s
                if found and period_s >= min(one.lasts_s for one in found):
                    continue
                shape = _Shapes(self, period_s, np.random.default_rng([seed, number]))
                trajectory = shape.best()
                said = None if trajectory is None else self.objection(trajectory)
                refused = refused or said or ""
                if trajectory is not None and said is None:
                    counts = np.arange(1, int(LONGEST_S / period_s) + 1)
                    widths = self.half_widths_kg(trajectory, counts.astype(float))
                    best_kg = min(best_kg, float(widths[-1]))
                    for enough in np.flatnonzero(widths <= wanted_kg)[:1]:
                        found.append(Wiggle(trajectory, int(counts[enough]), float(widths[enough]), shape.tried, seed))
            progress(len(PERIODS_S), len(PERIODS_S))
        if found:
            return min(found, key=lambda one: one.lasts_s)
        if not np.isfinite(best_kg):
            why = f"; {refused}" if refused else ""
            raise ExcitationError(
                f"no motion about this position respects all limits{why}. Choose another position or a smaller "
                "amplitude"
            )
        raise ExcitationError(
            f"no motion of at most {LONGEST_S:g} s within these limits determines the mass to {wanted_kg:.3g} kg "
            f"(95 %); the best one determines it to {best_kg:.3g} kg. Allow a larger amplitude or more speed, relax "
            "the requirement, or calibrate the arm with more runs"
        )


class _Shapes:
    """Motions of one period about one configuration."""

    def __init__(self, search: WiggleSearch, period_s: float, rng: np.random.Generator) -> None:
        self._half_widths_kg, self._envelope = search.half_widths_kg, search.envelope
        self._at, self._rng = search.at_rad, rng
        self._period_s = period_s
        self._harmonics = int(np.clip(round(_FASTEST_HZ * period_s), 1, _MOST_HARMONICS))
        self._times_s = np.arange(_SAMPLES * self._harmonics) * (period_s / (_SAMPLES * self._harmonics))
        joints = self._envelope.joints
        away = np.minimum(joints.position_max_rad - self._at, self._at - joints.position_min_rad)
        rates = joints.velocity_max_rad_s, joints.acceleration_max_rad_s2, joints.jerk_max_rad_s3
        self._room = np.stack([away, *rates])
        self._judged = np.array([max(round(_JUDGED_S / period_s), 1)], dtype=np.float64)
        self.tried = 0

    def best(self) -> FourierTrajectory | None:
        """The best shape found; None if none respects all limits."""
        size = (self._at.size, 2 * self._harmonics)
        best, chosen, least = None, None, np.inf
        for number in range(_DRAWS + _VARIATIONS):
            drawn = self._rng.normal(size=size)
            if number >= _DRAWS:
                if chosen is None:
                    return None
                drawn = chosen + _VARIED * drawn
            drawn = drawn / np.sqrt(np.mean(drawn**2, axis=1, keepdims=True))
            trajectory = self._inside(drawn)
            if trajectory is None:
                continue
            self.tried += 1
            width = float(self._half_widths_kg(trajectory, self._judged)[0])
            if width < least:
                best, chosen, least = trajectory, drawn, width
        return None if best is None else _shrunk_into(best, _INSIDE, _MOST_SHRINKING, self._envelope.worst)

    def _inside(self, drawn: FloatArray) -> FourierTrajectory | None:
        """A shape with the greatest amplitude within its limits."""
        one = self._trajectory(drawn)
        states = np.stack(one.evaluate(self._times_s))
        states[0] -= self._at
        reach = np.abs(states).max(axis=1) / self._room
        whole = self._trajectory((_INSIDE / reach.max(axis=0))[:, None] * drawn)
        return _shrunk_into(whole, _SHRINKING, _MOST_SMALLER, self._at_samples)

    def _at_samples(self, motion: FourierTrajectory) -> FloatArray:
        """Excess over the limits at the samples."""
        return self._envelope.excess(np.stack(motion.evaluate(self._times_s)))

    def _trajectory(self, coefficients: FloatArray) -> FourierTrajectory:
        sine, cosine = np.split(coefficients, 2, axis=1)
        return FourierTrajectory(1.0 / self._period_s, self._at, sine, cosine)


def _shrunk_into(
    motion: FourierTrajectory, factor: float, times: int, excess: Callable[[FourierTrajectory], FloatArray]
) -> FourierTrajectory | None:
    """The motion, its amplitude multiplied by a factor up to so many times, until it exceeds no limit."""
    for power in range(times + 1):
        share = factor**power
        smaller = replace(motion, sin_rad=share * motion.sin_rad, cos_rad=share * motion.cos_rad)
        if excess(smaller).max() <= 0.0:
            return smaller
    return None
