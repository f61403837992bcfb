"""Straight lines and the limits of a phase, by hand: shares of the joints' limits, and what a ramp needs."""

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.motion.joint_limits import MotionLimits
from armload_controller.motion.paths import InfeasibleMotion, LinePath, bound_phase
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, SpeedLimit
from armload_identification.model.chain import Chain

LIMITS = MotionLimits(
    joint_names=("a", "b", "c"),
    position_min_rad=np.full(3, -2.0),
    position_max_rad=np.full(3, 2.0),
    velocity_max_rad_s=np.array([2.0, 2.0, 3.0]),
    acceleration_max_rad_s2=np.array([6.0, 6.0, 9.0]),
    jerk_max_rad_s3=np.array([600.0, 600.0, 900.0]),
    following_error_rad=np.full(3, 0.1),
)
LEVER = Chain.from_origins(
    np.zeros((3, 3)), np.zeros((3, 3)), np.eye(3)[::-1], np.eye(4) + 0.4 * np.eye(4, 4, 3)[[2, 1, 0, 3]], (0, 0, -9.81)
)
"""Three axes z, y and x in one point, and the flange 0.4 m from it along z."""


def line(goal, speed_m_s=10.0):
    points = ArmPoints(LEVER, np.zeros(3))
    return LinePath.within(np.zeros(3), np.array(goal), LIMITS, SpeedLimit(points, speed_m_s))


@pytest.mark.parametrize(
    ("goal", "duration_s"), [((1.0, 0.0, 0.0), 2.0), ((1.0, -1.2, 0.3), 2.4), ((0.0, 0.1, -1.5), 2.0)]
)
def test_a_line_takes_as_long_as_a_quarter_of_a_speed_needs(goal, duration_s):
    assert line(goal).duration_s == pytest.approx(duration_s)


def test_a_line_is_as_slow_as_98_percent_of_the_speed_of_the_flange():
    """Joint b moves the flange at 0.4 m and, in 2 s for 1 rad, 0.5 rad/s: 0.2 m/s."""
    assert line((0.0, 1.0, 0.0), 0.05).duration_s == pytest.approx(2.0 * 0.2 / (0.98 * 0.05), rel=1e-3)
    assert line((0.0, 1.0, 0.0), 0.21).duration_s == pytest.approx(2.0)


def test_a_line_is_straight_with_a_quarter_of_acceleration_and_jerk():
    found = line((1.0, 0.0, -0.3))
    bounds = found.bounds()
    np.testing.assert_allclose([bounds.position_min_rad, bounds.position_max_rad], [[0, 0, -0.3], [1, 0, 0]])
    np.testing.assert_allclose(bounds.velocity_max_rad_s, [0.5, 0.0, 0.15])
    assert not bounds.acceleration_max_rad_s2.any()
    assert not bounds.jerk_max_rad_s3.any()
    phase = found.phase_limits(LIMITS)
    assert (phase.acceleration_1_s, phase.jerk_1_s2) == pytest.approx((0.25 * 6.0 / 0.5, 0.25 * 600.0 / 0.5))
    steep = line((0.1, 0.0, -1.5)).phase_limits(LIMITS)
    assert (steep.acceleration_1_s, steep.jerk_1_s2) == pytest.approx((0.25 * 9.0 / 0.75, 0.25 * 900.0 / 0.75))
    state = found.evaluate(np.array([0.0, 1.0, 2.0]))
    np.testing.assert_allclose(state.position_rad, [[0, 0, 0], [0.5, 0, -0.15], [1, 0, -0.3]])
    np.testing.assert_allclose(state.velocity_rad_s, [[0.5, 0, -0.15]] * 3)
    assert not state.acceleration_rad_s2.any()
    assert not state.jerk_rad_s3.any()
    assert found.evaluate(1.0).position_rad.shape == (3,)


def excitation(size):
    return FourierTrajectory(0.5, np.zeros(3), np.outer([1.0, 0.0, 0.4], [size]), np.zeros((3, 1)))


def test_a_ramp_takes_half_a_second_even_if_the_joints_could_do_it_faster():
    still, weak = bound_phase(excitation(0.0), LIMITS), bound_phase(excitation(1e-3), LIMITS)
    assert (still.acceleration_1_s, still.jerk_1_s2) == (2.0, 4.0)
    assert (weak.acceleration_1_s, weak.jerk_1_s2) == (2.0, 16.0)


def test_a_ramp_gets_what_the_path_leaves_of_95_percent_of_the_acceleration_and_of_the_jerk():
    path = excitation(0.45)
    greatest = path.bounds()
    v, a, j = greatest.velocity_max_rad_s[0], greatest.acceleration_max_rad_s2[0], greatest.jerk_max_rad_s3[0]
    strong = replace(LIMITS, acceleration_max_rad_s2=np.array([a + 1.0, 50.0, 50.0]) / 0.95)
    found = bound_phase(path, replace(strong, jerk_max_rad_s3=np.array([j + 3.0 * a / v + 5.0, 600.0, 900.0])))
    assert found.acceleration_1_s == pytest.approx(1.0 / v)
    assert found.jerk_1_s2 == pytest.approx(5.0 / v)


def test_a_path_that_leaves_nothing_for_a_ramp_is_refused_with_its_joint():
    path = excitation(0.45)
    greatest = path.bounds()
    a, j = greatest.acceleration_max_rad_s2, greatest.jerk_max_rad_s3
    with pytest.raises(InfeasibleMotion, match=r"^a: the excitation leaves no acceleration"):
        bound_phase(path, replace(LIMITS, acceleration_max_rad_s2=np.array([a[0] / 0.951, 50.0, 50.0])))
    with pytest.raises(InfeasibleMotion, match=r"^c: the excitation leaves no acceleration"):
        bound_phase(path, replace(LIMITS, acceleration_max_rad_s2=np.array([50.0, 50.0, a[2] / 0.951])))
    with pytest.raises(InfeasibleMotion, match=r"^c: the excitation leaves no jerk .* jerk_max_rad_s3 of"):
        bound_phase(path, replace(LIMITS, jerk_max_rad_s3=np.array([600.0, 600.0, j[2]])))
