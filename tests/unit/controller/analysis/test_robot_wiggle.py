"""The limits of a short motion about a pose, and what no motion can determine."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.analysis.robot_excitation import design_envelope
from armload_controller.analysis.robot_wiggle import WiggleRequest
from armload_controller.analysis.robot_wiggle import _center_pose as center_pose
from armload_controller.analysis.robot_wiggle import _limits_about as limits_about
from armload_controller.analysis.robot_wiggle import _require_gains as require_gains
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_identification.identification_errors import ExcitationError

AT = np.array([0.1, 0.2, -0.3, 0.4, 0.5, 0.6])


@pytest.fixture(scope="module")
def robot():
    return load_robot("prbt")


def known(*deviations, correlation=0.0, weighed=True):
    """A calibration whose gains are known so well."""
    deviation = np.array(deviations)
    covariance = np.outer(deviation, deviation) * (correlation + (1.0 - correlation) * np.eye(len(deviation)))
    return SimpleNamespace(n=len(deviation), covariance=covariance, scale_weighed=weighed)


@pytest.mark.parametrize(("share", "possible"), [(0.0197, True), (0.0195, False)])
def test_the_gain_of_one_joint_limits_its_mass(share, possible):
    """One joint with 1 %: 1.96 % at best."""
    if possible:
        require_gains(known(0.01), share)
    else:
        with pytest.raises(
            ExcitationError, match=r"mass to 1.9 % .* known to 2 % only.*more runs with weighed payloads"
        ):
            require_gains(known(0.01), share)


def test_joints_with_independent_gains_help_each_other_and_dependent_ones_do_not():
    four = [0.01] * 4
    require_gains(known(*four), 0.0099)
    with pytest.raises(ExcitationError):
        require_gains(known(*four), 0.0097)
    with pytest.raises(ExcitationError):
        require_gains(known(*four, correlation=0.999), 0.019)


def test_without_a_weighed_payload_that_is_the_remedy():
    with pytest.raises(ExcitationError, match="a weighed payload"):
        require_gains(known(0.05, weighed=False), 0.01)


def test_the_pose_is_the_one_given_or_the_middle_of_the_excitation(robot):
    np.testing.assert_array_equal(center_pose(robot, tuple(AT)), AT)
    middle = robot.excitations["identification"].trajectory.offset_rad
    np.testing.assert_array_equal(center_pose(robot, ()), middle)
    for wrong in (AT[:5], [*AT[:5], np.nan]):
        with pytest.raises(ConfigurationError, match="expected 6 positions in rad"):
            center_pose(robot, wrong)
    with pytest.raises(ConfigurationError, match=r"as .* has no excitation"):
        center_pose(SimpleNamespace(n=6, excitations={}, file="my.toml"), ())


def test_joints_stay_in_a_box_about_the_pose_and_in_their_range(robot):
    whole = design_envelope(robot).joints
    about = limits_about(robot, AT, WiggleRequest(0.25, 0.02)).joints
    np.testing.assert_allclose(about.position_min_rad, np.maximum(AT - 0.25, whole.position_min_rad))
    np.testing.assert_allclose(about.position_max_rad, np.minimum(AT + 0.25, whole.position_max_rad))
    wide = limits_about(robot, AT, WiggleRequest(10.0, 0.02)).joints
    np.testing.assert_array_equal(wide.position_min_rad, whole.position_min_rad)
    np.testing.assert_array_equal(wide.position_max_rad, whole.position_max_rad)


@pytest.mark.parametrize("side", ["position_min_rad", "position_max_rad"])
def test_a_pose_at_the_margin_of_a_joint_is_refused_by_name(robot, side):
    at = AT.copy()
    at[2] = getattr(design_envelope(robot).joints, side)[2]
    with pytest.raises(ExcitationError, match=rf"{robot.joint_names[2]} is at {at[2]:.3f} rad; expected between"):
        limits_about(robot, at, WiggleRequest(0.25, 0.02))


def test_a_speed_limit_is_the_lower_one(robot, edited):
    request = WiggleRequest(0.25, 0.02, speed_m_s=0.3)
    assert limits_about(robot, AT, WiggleRequest(0.25, 0.02)).speed is None
    assert limits_about(robot, AT, request).speed.speed_m_s == 0.3
    for stated, used in ((0.2, 0.2), (0.4, 0.3)):
        own = load_robot(edited("[workspace]", f"[limits]\ntcp_speed_m_s = {stated}\n\n[workspace]", "prbt"))
        assert limits_about(own, AT, request).speed.speed_m_s == used
