"""Paths: joint positions over one parameter, the phase, and the limits of the phase that keep all joint limits.

Every motion is a path q(s) and a phase rate r = ds/dt. Ramps, pauses, overrides and stops change only the rate, so
that the arm never leaves a checked path:

    dq/dt   = q'(s) r
    d2q/dt2 = q''(s) r^2 + q'(s) dr/dt

A slow round has its own phase, which is stretched where the arm would be fast: see `slow_round_pace`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from armload_controller.control_errors import ControlError
from armload_controller.motion.joint_limits import MotionLimits
from armload_identification.excitation.fourier import FourierBounds, FourierState, FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, SpeedLimit
from armload_identification.float_array import FloatArray

PLANNED_SHARE = 0.98
"""Share of a speed limit that approaches and slow rounds are planned with: a servo may overshoot its setpoints."""
APPROACH_SHARE = 0.25
"""Share of the velocity, acceleration and jerk limits that an approach uses."""
RAMP_ACCELERATION_SHARE = 0.95
"""Share of a joint's acceleration limit that path and ramp together use."""
_LINE_SAMPLES = 512
"""Samples of a straight line at which the speed of the arm's points is computed."""
SHORTEST_RAMP_S = 0.5
"""Approximate minimum duration of a phase ramp, even for a strong arm."""


class InfeasibleMotion(ControlError):
    """Ruckig finds no motion between two states within the limits."""


class BlockedWay(ControlError):
    """The approach from the arm's position to the start of its path is not free, or too demanding for a joint."""


@dataclass(frozen=True, slots=True)
class PhaseLimits:
    """Bounds of the phase's second and third derivatives; the first is always between 0 and 1."""

    acceleration_1_s: float
    jerk_1_s2: float


@dataclass(frozen=True, eq=False)
class LinePath:
    """A straight line in joint space, all joints moving simultaneously.

    Attributes:
        start_rad: (n,) position at phase 0.
        goal_rad: (n,) position at phase `duration_s`.
        duration_s: Duration at full rate.
    """

    start_rad: FloatArray
    goal_rad: FloatArray
    duration_s: float

    @classmethod
    def within(cls, start_rad: FloatArray, goal_rad: FloatArray, limits: MotionLimits, speed: SpeedLimit) -> LinePath:
        """The fastest line that `APPROACH_SHARE` and `PLANNED_SHARE` allow.

        Args:
            start_rad: (n,) start position.
            goal_rad: (n,) goal position.
            limits: Limits of the joints.
            speed: Limit of the speed of the arm's points and of what it carries.
        """
        way = goal_rad - start_rad
        duration_s = float((np.abs(way) / (APPROACH_SHARE * limits.velocity_max_rad_s)).max())
        fastest_m_s = cls(start_rad, goal_rad, duration_s).greatest_speed_m_s(speed.points)
        return cls(start_rad, goal_rad, duration_s * max(1.0, fastest_m_s / (PLANNED_SHARE * speed.speed_m_s)))

    def greatest_speed_m_s(self, points: ArmPoints) -> float:
        """Bound on the speed of all points at full rate, also between samples."""
        rates = np.zeros((4, len(self.start_rad)))
        rates[0] = np.abs(self.goal_rad - self.start_rad) / self.duration_s
        return float(points.greatest_between(self.evaluate, rates, self.duration_s, _LINE_SAMPLES).max())

    def bounds(self) -> FourierBounds:
        """Range and greatest derivatives to the phase, each (n,)."""
        speed = np.abs(self.goal_rad - self.start_rad) / self.duration_s
        low, high = np.minimum(self.start_rad, self.goal_rad), np.maximum(self.start_rad, self.goal_rad)
        return FourierBounds(low, high, speed, np.zeros_like(speed), np.zeros_like(speed))

    def phase_limits(self, limits: MotionLimits) -> PhaseLimits:
        """Limits of the phase that keep every joint within its share of the limits."""
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
    """Phase acceleration and jerk that keep every joint within its limits everywhere on the path.

        |q''| r^2 + |q'| |dr/dt| <= a_max           |q'''| + 3 |q''| |dr/dt| + |q'| |d2r/dt2| <= j_max

    with the path's greatest derivatives, also between samples, and r <= 1.

    Raises:
        InfeasibleMotion: the path leaves a joint no acceleration or jerk for the ramp up.
    """
    greatest = path.bounds()
    v, a, j = greatest.velocity_max_rad_s, greatest.acceleration_max_rad_s2, greatest.jerk_max_rad_s3
    moving = v > 0
    if not moving.any():
        return PhaseLimits(1 / SHORTEST_RAMP_S, 1 / SHORTEST_RAMP_S**2)
    spare = RAMP_ACCELERATION_SHARE * limits.acceleration_max_rad_s2 - a
    acceleration = min(1 / SHORTEST_RAMP_S, float((spare[moving] / v[moving]).min()))
    if acceleration <= 0:
        joint = limits.joint_names[int(np.argmin(np.where(moving, spare, np.inf)))]
        raise InfeasibleMotion(
            f"{joint}: the excitation leaves no acceleration for its ramp up: design it with at most 90 % of "
            "the joint's acceleration_max_rad_s2"
        )
    spare_jerk = limits.jerk_max_rad_s3 - j - 3 * a * acceleration
    jerk = min(4 / SHORTEST_RAMP_S**2, float((spare_jerk[moving] / v[moving]).min()))
    if jerk <= 0:
        worst = int(np.argmin(np.where(moving, spare_jerk, np.inf)))
        allowed = limits.jerk_max_rad_s3[worst]
        raise InfeasibleMotion(
            f"{limits.joint_names[worst]}: the excitation leaves no jerk for its ramp up: it would take "
            f"{allowed - spare_jerk[worst]:.4g} of the joint's jerk_max_rad_s3 of {allowed:.4g}: design a slower one"
        )
    return PhaseLimits(acceleration, jerk)
