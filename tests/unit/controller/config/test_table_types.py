"""Numbers of a robot file that can only be in another unit: degrees, or an inverse gear ratio."""

import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError


@pytest.mark.parametrize(
    ("old", "new", "key"),
    [
        ("alpha_rad = 3.141592653589793", "alpha_rad = 6.29", "kinematics.rows[1].alpha_rad"),
        ("alpha_rad = 3.141592653589793", "alpha_rad = -6.29", "kinematics.rows[1].alpha_rad"),
        ("position_max_rad = 2.9", "position_max_rad = 25.2", "joints[1].position_max_rad"),
        ("position_min_rad = -2.9", "position_min_rad = -25.2", "joints[1].position_min_rad"),
        ("velocity_max_rad_s = 2.0", "velocity_max_rad_s = 50.1", "joints[1].velocity_max_rad_s"),
        ("velocity_max_rad_s = 2.0", "velocity_max_rad_s = 0.0", "joints[1].velocity_max_rad_s"),
        ("gear_ratio = 120.0", "gear_ratio = 0.99", "joints[1].gear_ratio"),
        ("arm_torque_share = 0.35", "arm_torque_share = -0.01", "joints[1].arm_torque_share"),
        ("xyz_m = [0.0, 0.0, 0.0], rpy_rad", "xyz_m = [0.0, 0.0], rpy_rad", "kinematics.flange.xyz_m"),
        ("gravity_m_s2 = [0.0, 0.0, -9.81]", "gravity_m_s2 = [0.0, 0.0, -9.81, 0.0]", "robot.gravity_m_s2"),
    ],
)
def test_what_lies_beyond_a_range_is_refused(edited, old, new, key):
    with pytest.raises(ConfigurationError) as caught:
        load_robot(edited(old, new))
    assert caught.value.key == key


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("alpha_rad = 3.141592653589793", "alpha_rad = 6.283185307179586"),
        ("alpha_rad = 3.141592653589793", "alpha_rad = -6.2832"),
        ("position_max_rad = 2.9", "position_max_rad = 25.1"),
        ("velocity_max_rad_s = 2.0", "velocity_max_rad_s = 50.0"),
        ("keep_m = 0.03", "keep_m = 0.0"),
        ("arm_torque_share = 0.35", "arm_torque_share = 0.0"),
    ],
)
def test_the_ends_of_a_range_belong_to_it(edited, old, new):
    load_robot(edited(old, new))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("alpha_rad = 3.141592653589793", "alpha_rad = 90", r"at most one turn \(6.283\) .* this would be 1\.5708 rad"),
        ("position_max_rad = 2.9", "position_max_rad = 170", r"at most 4 turns \(25\.1\) .* this would be 2\.9671 rad"),
        ("velocity_max_rad_s = 2.0", "velocity_max_rad_s = 180", r"at most 50; in degrees .* would be 3\.1416 rad/s"),
        ("gear_ratio = 120.0", "gear_ratio = 0.008", r"at least 1; the inverse of this value is 125"),
        ("gear_ratio = 120.0", "gear_ratio = -5.0", r"motor turns per turn of the joint, at least 1$"),
        ("rated_payload_kg = 16.0", "rated_payload_kg = 2500.5", r"at most 2500; in grams this would be 2\.5005 kg"),
    ],
)
def test_a_number_in_another_unit_is_told_in_the_right_one(edited, old, new, said):
    with pytest.raises(ConfigurationError, match=said):
        load_robot(edited(old, new))
