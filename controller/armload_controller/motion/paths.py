"""Paths: joint positions over one parameter, the phase, and what the phase may do so that no joint exceeds a limit.

Every motion is a path q(s) and a phase rate r = ds/dt. Ramps, pauses, overrides and stops change the rate alone,
so that the arm is never anywhere but on a path that was checked:

    dq/dt   = q'(s) r
    d2q/dt2 = q''(s) r^2 + q'(s) dr/dt

A slow round has a path of its own, over a phase that lasts longer where the arm would be fast: see `pace`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from armload_controller.control_errors import ControlError
from armload_controller.motion.joint_limits import MotionLimits
from armload_core.arrays import FloatArray
from armload_identification.excitation.fourier import FourierBounds, FourierState, FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints

REDUCED_SPEED_M_S = 0.25
"""What no point of the arm exceeds on approaches and slow rounds: reduced speed of ISO 10218-1."""
PLANNED_SPEED_M_S = 0.98 * REDUCED_SPEED_M_S
"""What they are planned with; a servo may overshoot its setpoints."""
APPROACH_SHARE = 0.25
"""Share of the velocity, acceleration and jerk limits that the way onto a path uses."""
RAMP_ACCELERATION_SHARE = 0.95
"""Share of a joint's acceleration limit that path and ramp together use."""
_LINE_SAMPLES = 512
"""Samples of a straight line at which the speed of the arm's points is computed."""
SHORTEST_RAMP_S = 0.5
"""A phase ramp lasts at least about this long, however strong the arm."""


class InfeasibleMotion(ControlError):
    """Ruckig finds no motion between two states within the limits."""


class BlockedWay(ControlError):
    """The way from where the arm is to where its path begins is not free, or asks too much of a joint."""


@dataclass(frozen=True, slots=True)
class PhaseLimits:
    """Bounds of the phase's second and third derivative; its first is at most 1, backwards it never goes."""

    acceleration_1_s: float
    jerk_1_s2: float


@dataclass(frozen=True, eq=False)
class LinePath:
    """Straight in joint space from one position to another, all joints at once.

    Attributes:
        start_rad: (n,) where the phase is 0.
        goal_rad: (n,) where it is `duration_s`.
        duration_s: Time at the full rate.
    """

    start_rad: FloatArray
    goal_rad: FloatArray
    duration_s: float

    @classmethod
    def within(cls, start_rad: FloatArray, goal_rad: FloatArray, limits: MotionLimits, points: ArmPoints) -> LinePath:
        """The line whose full rate is the greatest that `APPROACH_SHARE` and `PLANNED_SPEED_M_S` allow.

        Args:
            start_rad: (n,) where it begins.
            goal_rad: (n,) where it ends.
            limits: Of the joints.
            points: Of the arm, none of which is to be fast.
        """
        way = goal_rad - start_rad
        duration_s = float((np.abs(way) / (APPROACH_SHARE * limits.velocity_max_rad_s)).max())
        fastest_m_s = cls(start_rad, goal_rad, duration_s).greatest_speed_m_s(points)
        return cls(start_rad, goal_rad, duration_s * max(1.0, fastest_m_s / PLANNED_SPEED_M_S))

    def greatest_speed_m_s(self, points: ArmPoints) -> float:
        """What no point of the arm exceeds at the full rate, between samples too."""
        rates = np.zeros((4, len(self.start_rad)))
        rates[0] = np.abs(self.goal_rad - self.start_rad) / self.duration_s

        def motion(times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
            state = self.evaluate(times_s)
            return state.position_rad, state.velocity_rad_s

        return float(points.greatest_between(motion, rates, self.duration_s, _LINE_SAMPLES).max())

    def bounds(self) -> FourierBounds:
        """Range and greatest derivatives to the phase, each (n,)."""
        speed = np.abs(self.goal_rad - self.start_rad) / self.duration_s
        low, high = np.minimum(self.start_rad, self.goal_rad), np.maximum(self.start_rad, self.goal_rad)
        return FourierBounds(low, high, speed, np.zeros_like(speed), np.zeros_like(speed))

    def phase_limits(self, limits: MotionLimits) -> PhaseLimits:
        """What the phase may do so that every joint keeps to its share of the limits."""
        speed = np.abs(self.goal_rad - self.start_rad) / self.duration_s
        moving = speed > 0
        return PhaseLimits(
            float((APPROACH_SHARE * limits.acceleration_max_rad_s2[moving] / speed[moving]).min()),
            float((APPROACH_SHARE * limits.jerk_max_rad_s3[moving] / speed[moving]).min()),
        )

    def evaluate(self, t_s: ArrayLike) -> FourierState:
        """Position and derivatives; (n,) for one phase, (N, n) for N."""
        phase = np.asarray(t_s, dtype=np.float64)[..., None]
        speed = (self.goal_rad - self.start_rad) / self.duration_s
        nothing = np.zeros(phase.shape[:-1] + speed.shape)
        return FourierState(self.start_rad + speed * phase, speed + nothing, nothing, nothing)


class Path(Protocol):
    """Joint positions over the phase."""

    def evaluate(self, t_s: ArrayLike, /) -> FourierState:
        """Position and derivatives to the phase; (n,) for one phase, (N, n) for N."""


def bound_phase(path: FourierTrajectory, limits: MotionLimits) -> PhaseLimits:
    """Phase acceleration and jerk that keep every joint within its limits, anywhere on the path.

        |q''| r^2 + |q'| |dr/dt| <= a_max           |q'''| + 3 |q''| |dr/dt| + |q'| |d2r/dt2| <= j_max

    with the path's greatest derivatives, between samples too, and r <= 1.

    Raises:
        InfeasibleMotion: the path itself uses up a joint's acceleration or jerk.
    """
    greatest = path.bounds()
    v, a, j = greatest.velocity_max_rad_s, greatest.acceleration_max_rad_s2, greatest.jerk_max_rad_s3
    moving = v > 0
    if not moving.any():
        return PhaseLimits(1 / SHORTEST_RAMP_S, 1 / SHORTEST_RAMP_S**2)
    spare = RAMP_ACCELERATION_SHARE * limits.acceleration_max_rad_s2 - a
    acceleration = min(1 / SHORTEST_RAMP_S, float((spare[moving] / v[moving]).min()))
    spare_jerk = limits.jerk_max_rad_s3 - j - 3 * a * max(acceleration, 0.0)
    jerk = min(4 / SHORTEST_RAMP_S**2, float((spare_jerk[moving] / v[moving]).min()))
    if acceleration <= 0 or jerk <= 0:
        joint = limits.joint_names[int(np.argmin(np.where(moving, spare, np.inf)))]
        raise InfeasibleMotion(
            f"{joint}: the excitation leaves no acceleration for its run-in: design it with at most 90 % of "
            "the joint's acceleration_max_rad_s2"
        )
    return PhaseLimits(acceleration, jerk)
