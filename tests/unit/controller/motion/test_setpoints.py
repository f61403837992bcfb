"""Plans: onto the path, along it, to rest on it."""

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.motion.joint_limits import MotionLimits, check_setpoints
from armload_controller.motion.paths import InfeasibleMotion, LinePath, bound_phase
from armload_controller.motion.phase import Segment
from armload_controller.motion.setpoints import (
    RuckigFollower,
    plan_approach,
    plan_measured,
    plan_slow,
)
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, SpeedLimit
from armload_identification.model.chain import Chain
from tests.planned_leg import plan_leg

N = 3
CYCLE_S = 0.004
LIMITS = MotionLimits(
    joint_names=("a", "b", "c"),
    position_min_rad=np.full(N, -2.0),
    position_max_rad=np.full(N, 2.0),
    velocity_max_rad_s=np.array([2.0, 2.0, 3.0]),
    acceleration_max_rad_s2=np.array([6.0, 6.0, 9.0]),
    jerk_max_rad_s3=np.array([600.0, 600.0, 900.0]),
    following_error_rad=np.full(N, 0.1),
)
START = np.array([0.5, -0.5, 1.0])
SMALL = Chain.from_origins(
    np.array([[0.0, 0.0, 0.1]] * N),
    np.zeros((N, 3)),
    np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
    np.eye(4),
    np.array([0.0, 0.0, -9.81]),
)
SMALL_POINTS = ArmPoints(SMALL, np.zeros(3))
"""Points of an arm so small that none is ever fast."""


@pytest.fixture
def excitation():
    rng = np.random.default_rng(7)
    sin, cos = rng.normal(size=(2, N, 4)) * 0.01
    return Excitation(FourierTrajectory(0.5, np.array([0.1, -0.2, 0.3]), sin, cos), 2)


@pytest.fixture
def plan(excitation):
    return plan_leg(plan_measured(excitation, LIMITS, CYCLE_S), CYCLE_S)


def approach():
    return plan_leg(
        plan_approach(LinePath.within(START, np.zeros(N), LIMITS, SpeedLimit(SMALL_POINTS, 0.25)), LIMITS), CYCLE_S
    )


def test_segments_come_in_order_and_periods_are_whole(plan, excitation):
    order = [s for i, s in enumerate(plan.segment) if i == 0 or s is not plan.segment[i - 1]]
    assert order == [Segment.RAMP_UP, Segment.PERIODS, Segment.RAMP_DOWN]
    assert plan.segment.count(Segment.PERIODS) == round(excitation.periods * excitation.trajectory.period_s / CYCLE_S)


def test_plan_respects_every_limit(plan):
    check_setpoints(plan.position_rad, plan.velocity_rad_s, plan.acceleration_rad_s2, LIMITS)


def test_plan_is_one_motion_from_rest_to_rest(plan):
    """Velocity is the derivative of position, acceleration of velocity, across every seam."""
    position = np.vstack([plan.position_rad[:1], plan.position_rad])
    velocity = np.vstack([np.zeros(N), plan.velocity_rad_s])
    step = np.diff(position, axis=0) / CYCLE_S
    assert np.abs(step - (velocity[1:] + velocity[:-1]) / 2).max() < 1e-3
    assert np.abs(np.diff(velocity, axis=0)).max() <= LIMITS.acceleration_max_rad_s2.max() * CYCLE_S
    assert np.abs(plan.velocity_rad_s[-1]).max() < 1e-9


def test_measured_periods_lie_on_the_excitation(plan, excitation):
    rows = [i for i, s in enumerate(plan.segment) if s is Segment.PERIODS]
    state = excitation.trajectory.evaluate(plan.phase_s[rows])
    np.testing.assert_allclose(plan.position_rad[rows], state.position_rad, atol=1e-12)
    np.testing.assert_allclose(plan.velocity_rad_s[rows], state.velocity_rad_s, atol=1e-12)
    np.testing.assert_allclose(plan.phase_s[rows], np.arange(1, len(rows) + 1) * CYCLE_S, atol=1e-9)


def test_ruckig_passes_a_feasible_plan_through_unchanged(plan):
    follower = RuckigFollower(plan.position_rad[0], LIMITS, CYCLE_S)
    worst = 0.0
    for i in range(len(plan)):
        position, _, _ = follower.follow(plan.position_rad[i], plan.velocity_rad_s[i], plan.acceleration_rad_s2[i])
        worst = max(worst, np.abs(position - plan.position_rad[i]).max())
    assert worst < 1e-8


def test_ruckig_turns_a_jump_into_a_limited_motion():
    follower = RuckigFollower(np.zeros(N), LIMITS, CYCLE_S)
    velocities = []
    for _ in range(600):
        position, velocity, acceleration = follower.follow(np.full(N, 0.5), np.zeros(N), np.zeros(N))
        check_setpoints(position, velocity, acceleration, LIMITS)
        velocities.append(velocity)
    np.testing.assert_allclose(position, 0.5, atol=1e-9)
    assert np.abs(np.diff(velocities, 2, axis=0)).max() <= 900 * CYCLE_S**2 * 1.001


def test_the_slow_round_ends_at_rest_where_the_measured_ramp_begins(excitation):
    measured_leg = plan_measured(excitation, LIMITS, CYCLE_S)
    leg = plan_slow(excitation, measured_leg, SpeedLimit(SMALL_POINTS, 0.25))
    slow, measured = plan_leg(leg, CYCLE_S), plan_leg(measured_leg, CYCLE_S)
    assert set(slow.segment) == {Segment.SLOW}
    np.testing.assert_allclose(slow.position_rad[[0, -1]], measured.position_rad[[0, 0]], atol=1e-9)
    assert np.abs(slow.velocity_rad_s[[0, -1]]).max() < 1e-9
    assert 0.999 < slow.phase_rate.max() <= 1.0
    assert slow.phase_rate.min() >= -1e-9
    assert slow.phase_s[-1] - slow.phase_s[0] == pytest.approx(4.0 * excitation.trajectory.period_s)


def test_the_approach_is_straight_and_at_a_quarter_of_the_limits():
    plan = approach()
    along = plan.position_rad @ START / (START @ START)
    np.testing.assert_allclose(plan.position_rad, along[:, None] * START, atol=1e-12)
    quarter = [LIMITS.velocity_max_rad_s, LIMITS.acceleration_max_rad_s2]
    for motion, limit in zip((plan.velocity_rad_s, plan.acceleration_rad_s2), quarter, strict=True):
        assert (np.abs(motion) / limit).max() == pytest.approx(0.25, abs=0.01)


def test_excitation_that_uses_up_the_acceleration_is_refused(excitation):
    peak = np.abs(excitation.trajectory.evaluate(np.linspace(0, 2, 512)).acceleration_rad_s2).max(axis=0)
    tight = replace(LIMITS, acceleration_max_rad_s2=np.array([peak[0], 6.0, 9.0]))
    with pytest.raises(InfeasibleMotion, match=r"^a: the excitation leaves no acceleration for its ramp up"):
        bound_phase(excitation.trajectory, tight)


def test_excitation_that_uses_up_the_jerk_is_refused_for_the_jerk_of_that_joint(excitation):
    """Joint a has the least spare acceleration, and plenty of it."""
    greatest = excitation.trajectory.bounds()
    tight = replace(
        LIMITS,
        acceleration_max_rad_s2=greatest.acceleration_max_rad_s2 * np.array([2.0, 20.0, 20.0]),
        jerk_max_rad_s3=greatest.jerk_max_rad_s3 * np.array([20.0, 20.0, 1.01]),
    )
    with pytest.raises(InfeasibleMotion, match=r"^c: the excitation leaves no jerk for its ramp up: .* jerk_max"):
        bound_phase(excitation.trajectory, tight)


def test_period_that_is_no_whole_number_of_cycles_is_refused(excitation):
    with pytest.raises(InfeasibleMotion, match="whole number of cycles"):
        plan_measured(excitation, LIMITS, 0.0043)
