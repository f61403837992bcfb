"""Limits of the joints, of following errors and of speeds, as a robot file states them."""

from __future__ import annotations

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.motion.joint_limits import LimitViolation
from armload_controller.session.commissioning import checked_excitations


def test_the_following_error_limits_the_speed_where_the_lag_is_known(edited):
    assert load_robot("er50").limits.excitation.velocity_max_rad_s[5] == pytest.approx(0.2 / 0.045)
    slow = load_robot(edited("following_error_rad = 0.2", "following_error_rad = 0.02", "er50", count=1))
    assert slow.limits.excitation.velocity_max_rad_s[0] == pytest.approx(0.02 / 0.045)
    unknown = load_robot(edited("following_lag_s = 0.045", "#", "er50", count=6))
    np.testing.assert_array_equal(unknown.limits.excitation.velocity_max_rad_s, [2.0, 2.0, 2.4, 4.0, 4.0, 5.0])


def test_tool_and_speed_limit_of_a_file_are_what_motions_are_checked_against(edited):
    plain = load_robot("prbt")
    assert plain.limits.points.names[-1] == "tool centre point"
    assert plain.motion_constraints.speed is None
    added = "[tool]\nxyz_m = [0.0, 0.01, 0.2]\n\n[limits]\ntcp_speed_m_s = 0.5\n\n[workspace]"
    arm = load_robot(edited("[workspace]", added, "prbt"))
    constraints = arm.motion_constraints
    np.testing.assert_array_equal(constraints.points.tool_m, [0.0, 0.01, 0.2])
    assert constraints.speed.speed_m_s == arm.envelope(0.1, 0.7, 0.8).speed.speed_m_s == 0.5
    assert constraints.robot_sha256 == arm.sha256 != plain.sha256
    with pytest.raises(LimitViolation, match=r"speed .* m/s is beyond the limit of 0\.5000 m/s"):
        checked_excitations(arm, ["identification"])


def test_a_drive_that_gives_less_than_its_joint_takes_bounds_what_is_added(edited):
    robot = load_robot(edited("max_torque_permille = 2500", "max_torque_permille = 1000", "prbt"))
    assert robot.limits.added_torque_max_nm[0] == pytest.approx(148.0)
    assert robot.limits.added_torque_max_nm[1] == pytest.approx(370.0)
    assert robot.limits.torque_max_nm[0] == 370.0
