"""The limits of a short motion about a pose, and what no motion can determine."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.analysis.robot_excitation import design_envelope
from armload_controller.analysis.robot_wiggle import DesignedWiggle, WiggleRequest
from armload_controller.analysis.robot_wiggle import _center_pose as center_pose
from armload_controller.analysis.robot_wiggle import _limits_about as limits_about
from armload_controller.analysis.robot_wiggle import _require_gains as require_gains
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_identification.excitation.fourier import FourierTrajectory
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


# What is told of a design ----------------------------------------------------------------------------------------


class Points:
    """Points of the arm, the fastest at 0.25 m/s."""

    def greatest_on(self, trajectory):
        return np.array([0.1, 0.25, 0.2])


@pytest.fixture
def designed():
    """A motion of two joints by 0.1 rad and 0.2 rad about a pose, and some number of periods."""

    def designed(periods=3):
        trajectory = FourierTrajectory(0.5, np.array([1.0, 2.0]), np.array([[0.1], [0.2]]), np.zeros((2, 1)))
        payloads = SimpleNamespace(
            expected=SimpleNamespace(mass_kg=4.0), assumed_envelopes=("the gripper is a sphere",)
        )
        arm = SimpleNamespace(
            name="er50", joint_names=("base", "elbow"), payloads=payloads, limits=SimpleNamespace(points=Points())
        )
        wiggle = SimpleNamespace(half_width_kg=0.05, trajectory=trajectory, periods=periods, seed=1, tried=2)
        leg = SimpleNamespace(start_s=1.0, end_s=9.5)
        path = SimpleNamespace(measured=SimpleNamespace(leg=leg), slow_round_s=61.4)
        return DesignedWiggle(arm, np.array([0.9, 2.0]), wiggle, None, path, "")

    return designed


def test_the_figures_of_a_design(designed):
    found = designed()
    assert (found.share, found.measured_s, found.speed_m_s) == (0.0125, 8.5, 0.25)
    np.testing.assert_allclose(found.amplitude_rad, [0.2, 0.2], rtol=1e-4)
    document = found.to_dict()
    assert {key: document[key] for key in ("robot", "expected_kg", "half_width_95_kg", "period_s", "periods")} == {
        **{"robot": "er50", "expected_kg": 4.0, "half_width_95_kg": 0.05, "period_s": 2.0, "periods": 3}
    }
    assert {key: document[key] for key in ("measured_s", "slow_round_s", "speed_m_s")} == {
        **{"measured_s": 8.5, "slow_round_s": 61.4, "speed_m_s": 0.25}
    }
    assert document["joints"] == [
        {"name": "base", "at_rad": 0.9, "amplitude_rad": pytest.approx(0.2, rel=1e-4)},
        {"name": "elbow", "at_rad": 2.0, "amplitude_rad": pytest.approx(0.2, rel=1e-4)},
    ]


@pytest.mark.parametrize(("periods", "words"), [(1, "1 period of 2 s"), (3, "3 periods of 2 s")])
def test_the_lines_about_a_design(designed, periods, words):
    first, second, third, last = str(designed(periods)).splitlines()
    assert first == f"{words}, 8.5 s with ramps, determine 4 kg to within 0.05 kg, 1.2 % (95 %, without drift)"
    assert second == "joints move by 11.5, 11.5 degrees about [0.9, 2.0] rad"
    assert "no point of the arm is faster than 0.25 m/s; the preceding slow round takes 61 s at" in third
    assert last == "the gripper is a sphere"
