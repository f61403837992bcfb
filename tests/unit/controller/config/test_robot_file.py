"""A robot file: keys that are wrong, missing, unknown or contradictory are named with file, value and remedy."""

import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError


@pytest.mark.parametrize(
    ("old", "new", "key", "words"),
    [
        ("velocity_max_rad_s = 2.0", "velocity_max_rads = 2.0", "joints[1].velocity_max_rad_s", "required"),
        ("jerk_max_rad_s3 = 600.0", "", "joints[1].jerk_max_rad_s3", "required"),
        ("torque_max_nm = 3240", 'torque_max_nm = "strong"', "joints[1].torque_max_nm", "number"),
        ("torque_max_nm = 3240", "torque_max_nm = nan", "joints[1].torque_max_nm", "finite"),
        ("position_min_rad = -2.9", "position_min_rad = 3.0", "joints[1]", "exchange them"),
        ("node_id = 2 ", "node_id = 1 ", "joints.drive.node_id", "different"),
        ("node_id = 2 ", "node_id = 128 ", "joints[2].drive.node_id", "127"),
        ('mode = "csp"', 'mode = "pp"', "joints[1].drive.mode", "'csp' or 'ip'"),
        ("rated_current_a = 10.0", "", "joints[1].drive.rated_current_a", "needs its scale"),
        ("cycle_hz = 250.0", "cycle_hz = 900.0", "bus.cycle_hz", "this fits: cycle_hz = 250"),
        (
            "rated_payload_kg = 16.0",
            "rated_payload_kg = 16e3",
            "robot.rated_payload_kg",
            "in grams this would be 16 kg",
        ),
        ("mass_kg = 9.814", "mass_kg = 40.0", "expected_payload.mass_kg", "rated_payload_kg = 16"),
        (
            "center_of_mass_m = [0.0, 0.102, 0.1]",
            "center_of_mass_m = [0.0, 30.0, 0.1]",
            "expected_payload",
            "less mass or a shorter lever",
        ),
        ("ixx = 0.249244744", "ixx = -0.2", "expected_payload", "no mass distribution"),
        (
            "[expected_payload]",
            "[expected_payload]\nenvelope_radius_m = 0.0",
            "expected_payload.envelope_radius_m",
            "than 0",
        ),
        (
            "[expected_payload]",
            "[expected_payload]\nenvelope_radius_m = 0.15",
            "expected_payload.envelope_radius_m",
            "0.161",
        ),
        (
            "[payload_set.gripper]",
            "[payload_set.gripper]\nenvelope_radius_m = 0.2",
            "payload_set.gripper.envelope_radius_m",
            "unknown",
        ),
        ('convention = "modified-dh"', 'convention = "joint-origins"', "kinematics", "origins"),
        ("    [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],\n", "", "transmission.coupling", "6 rows of 6"),
        ('payload = "paper"', 'payload = "crate"', "simulation.payload", "paper"),
        ("[robot]", "[robot", "", "not valid TOML"),
        ("torque_constant_nm_a = 0.9 ", "", "joints[1].torque_constant_nm_a", "missing"),
        ("start_position_rad = [0.0,", "start_position_rad = [5.0,", "simulation.start_position_rad", "-2.9 and 2.9"),
        ("gear_ratio = 120.0", "gear_ratio = 0.008", "joints[1].gear_ratio", "the inverse of this value is 125"),
        ("position_min_rad = -2.9", "position_min_rad = -166", "joints[1].position_min_rad", "would be -2.8972 rad"),
        ("position_max_rad = 2.9", "position_max_rad = 166", "joints[1].position_max_rad", "would be 2.8972 rad"),
        ("velocity_max_rad_s = 2.0", "velocity_max_rad_s = 120", "joints[1].velocity_max_rad_s", "2.0944 rad/s"),
        ("alpha_rad = 3.141592653589793", "alpha_rad = 180", "kinematics.rows[1].alpha_rad", "would be 3.1416 rad"),
        ("theta_rad = -1.5707963267948966", "theta_rad = -90", "kinematics.rows[2].theta_rad", "-1.5708 rad"),
        (
            "rpy_rad = [0.0, 0.0, 0.0] }  # the frame",
            "rpy_rad = [0, 45, 0] } #",
            "kinematics.flange.rpy_rad[2]",
            "0.785",
        ),
        ('validation = "er50_validation.toml"', 'validation = "nope.toml"', "excitation.validation", "armload design"),
    ],
)
def test_what_is_wrong_is_named(edited, old, new, key, words):
    path = edited(old, new)
    with pytest.raises(ConfigurationError) as caught:
        load_robot(path)
    error = caught.value
    assert error.file == path
    assert error.key == key
    assert words in str(error)
    assert str(error).startswith(f"{path}: {key}")


def test_unknown_key_proposes_the_nearest(edited):
    path = edited("has_brake = true", "has_brake = true\nhas_brakes = true")
    with pytest.raises(ConfigurationError, match="did you mean has_brake") as caught:
        load_robot(path)
    assert caught.value.key == "joints[1].drive.has_brakes"


def test_a_missing_key_names_the_one_that_stands_in_its_place(edited):
    path = edited("jerk_max_rad_s3 = 600.0", "jerk_max_rad_s2 = 600.0")
    with pytest.raises(ConfigurationError, match=r"required; jerk_max_rad_s2 is an unknown key: rename it$") as caught:
        load_robot(path)
    assert caught.value.key == "joints[1].jerk_max_rad_s3"


def test_a_key_behind_the_wrong_header_names_its_table(edited):
    path = edited("has_brake = true", "has_brake = true\narm_torque_share = 0.3")
    with pytest.raises(ConfigurationError, match=r"it belongs to joints$") as caught:
        load_robot(path)
    assert caught.value.key == "joints[1].drive.arm_torque_share"


@pytest.mark.parametrize(
    "content", ["a = " + "[" * 100_000, "robot = " + "9" * 1_000_000, "robot = 0x" + "f" * 1_000_000, "joints = 3"]
)
def test_a_hostile_file_is_one_sentence(tmp_path, content):
    path = tmp_path / "arm.toml"
    path.write_text(content)
    with pytest.raises(ConfigurationError) as caught:
        load_robot(str(path))
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


def test_a_file_that_is_no_utf_8_is_one_sentence(tmp_path):
    path = tmp_path / "arm.toml"
    path.write_bytes(b'[robot]\nname = "\xe4"')
    with pytest.raises(ConfigurationError, match=r"arm\.toml: cannot be read: not UTF-8, .* at byte 16"):
        load_robot(str(path))
