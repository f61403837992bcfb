"""The checks of a path's joints and speed, valid at every phase and under all ramps, pauses, overrides and stops.

With V, A, J the greatest derivatives of the path to its phase, a phase rate r from 0 to 1 and, from `PhaseLimits`,
|dr/dt| <= alpha and |d2r/dt2| <= beta, no joint ever exceeds

    velocity V        acceleration A + V alpha        jerk J + 3 A alpha + V beta        following error V lag

Torque without friction is linear in the phase acceleration and in r^2, so its greatest value is at r = 0 or 1 and
dr/dt = +-alpha; viscous friction is bounded by a function that is linear in r^2 too.
The speed of a point of the arm is linear in r. Collisions are checked by `obstacles`.
"""

from __future__ import annotations

import numpy as np

from armload_controller.motion.joint_limits import RELATIVE_TOLERANCE, LimitViolation, check_setpoints
from armload_controller.motion.motion_constraints import MotionConstraints
from armload_controller.motion.paths import LinePath, PhaseLimits
from armload_controller.motion.phase import Leg
from armload_identification.excitation.fourier import FourierBounds, FourierState, FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, SpeedLimit
from armload_identification.excitation.torque_limits import TorqueLimits
from armload_identification.float_array import FloatArray

RAMP_SAMPLES = 1024
"""Samples of a period, for each harmonic, at which the torque of ramps is computed."""
SPEED_SAMPLES = 2048
"""Samples of a leg at which the speed of the arm's points is computed."""
LINE_STEP_RAD = 0.01
"""Greatest travel of any joint between two samples of a straight line."""


def require_joint_limits(reach: FourierBounds, phase: PhaseLimits, constraints: MotionConstraints) -> None:
    """Check a path's range and rates.

    Args:
        reach: Range and greatest derivatives of the path to its phase.
        constraints: Constraints of the arm.

    Raises:
        LimitViolation: naming joint, quantity, value and bound.
    """
    limits = constraints.limits
    v, a, j = reach.velocity_max_rad_s, reach.acceleration_max_rad_s2, reach.jerk_max_rad_s3
    alpha, beta = phase.acceleration_1_s, phase.jerk_1_s2
    for position in (reach.position_min_rad, reach.position_max_rad):
        check_setpoints(position, v, a + v * alpha, limits)
    for quantity, unit, share, bound in (
        ("jerk", "rad/s3", (j + 3.0 * a * alpha + v * beta) / limits.jerk_max_rad_s3, limits.jerk_max_rad_s3),
        ("following error", "rad", v / constraints.following_speed_rad_s, limits.following_error_rad),
    ):
        worst = int(np.argmax(share))
        if not share[worst] <= 1.0 + RELATIVE_TOLERANCE:
            value = float(share[worst] * bound[worst])
            raise LimitViolation(limits.joint_names[worst], quantity, value, float(bound[worst]), unit)


def greatest_speed_m_s(leg: Leg, points: ArmPoints) -> float:
    """Greatest speed of any point of the arm on a leg, from samples."""
    return float(_point_speeds(leg, points).max())


def require_reduced_speed(leg: Leg, limit: SpeedLimit) -> None:
    """Check that no point of the arm or of what it carries exceeds reduced speed on a leg.

    Only samples are checked; between them the planning of such legs keeps the limit, with a margin (`slow_round_pace`,
    `paths`).

    Args:
        limit: Reduced speed, or a lower limit.

    Raises:
        LimitViolation: naming the point and its speed.
    """
    _require_speed(_point_speeds(leg, limit.points), limit.points, limit.speed_m_s)


def require_tcp_speed(path: FourierTrajectory, constraints: MotionConstraints) -> None:
    """Check the Cartesian speed of a path at full rate, also between samples, if the robot's file limits it.

    Raises:
        LimitViolation: naming the point and its speed.
    """
    limit = constraints.speed
    if limit is not None:
        _require_speed(limit.points.greatest_on(path), limit.points, limit.speed_m_s)


def torque_objection(
    path: FourierTrajectory | LinePath, phase: PhaseLimits, constraints: MotionConstraints
) -> str | None:
    """Description of a joint or motor too weak for arm and heaviest payload on a path; None if there is none."""
    names = constraints.limits.joint_names
    for torque, owner in ((constraints.torque, ""), (constraints.axis_torque, "the motor of ")):
        if torque is None:
            continue
        needed = _torque_needed(path, phase, torque)
        share = needed / torque.available_nm
        weakest = int(np.argmax(share))
        if not share[weakest] <= 1.0:
            return (
                f"requires {needed[weakest]:.0f} N m of {owner}{names[weakest]}, which has "
                f"{torque.available_nm[weakest]:.0f} N m available"
            )
    return None


def _torque_needed(path: FourierTrajectory | LinePath, phase: PhaseLimits, torque: TorqueLimits) -> FloatArray:
    """(n,) greatest torque on a path, including its ramps."""
    alpha = phase.acceleration_1_s
    if isinstance(path, LinePath):
        steps = int(np.ceil(np.abs(path.goal_rad - path.start_rad).max() / LINE_STEP_RAD)) + 1
        return _greatest(torque, path.evaluate(np.linspace(0.0, path.duration_s, steps + 1)), alpha)
    samples = RAMP_SAMPLES * path.harmonics
    state = path.evaluate(np.arange(samples) * (path.period_s / samples))
    # At constant rate the bound also holds between samples; ramps vary slowly compared with their spacing.
    steady = _greatest_case(torque, torque.greatest(path))
    return steady + _greatest(torque, state, alpha) - _greatest(torque, state, 0.0)


def _greatest(torque: TorqueLimits, state: FourierState, alpha: float) -> FloatArray:
    """(n,) greatest demand at samples, at rates 0 and 1 and phase accelerations of both signs."""
    q, v, a, _ = state
    still = np.zeros_like(q)
    # At rate r friction is r f <= (1 + r^2) f / 2: half of it at rate 0, all of it at rate 1 bound the rates between.
    friction = 0.5 * torque.friction(v)
    demands = [
        demand.max(axis=0)
        for ramp in (-alpha, alpha)
        for demand in (torque.demand(q, v, a + ramp * v), torque.demand(q, still, ramp * v) + friction)
    ]
    return _greatest_case(torque, np.max(demands, axis=0))


def _greatest_case(torque: TorqueLimits, demand_nm: FloatArray) -> FloatArray:
    """(n,) greatest demand of all cases of load and speed; `demand_nm` is (cases * n,)."""
    return np.asarray(demand_nm.reshape(torque.cases, -1).max(axis=0))


def _point_speeds(leg: Leg, points: ArmPoints) -> FloatArray:
    """(P,) greatest speed of each point on a leg."""
    state = leg.path.evaluate(np.linspace(leg.start_s, leg.end_s, SPEED_SAMPLES))
    return np.asarray(leg.rate * points.speeds(*state[:2]).max(axis=0))


def _require_speed(speed_m_s: FloatArray, points: ArmPoints, bound_m_s: float) -> None:
    """Refuse a point that is too fast."""
    worst = int(np.argmax(speed_m_s))
    if not speed_m_s[worst] <= bound_m_s * (1.0 + RELATIVE_TOLERANCE):
        raise LimitViolation(points.names[worst], "speed", float(speed_m_s[worst]), bound_m_s, "m/s")
