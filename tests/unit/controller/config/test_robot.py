"""Robot files: the shipped ones load, errors are reported with file, key, value and remedy."""

import re
import tomllib
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.robot import load_robot, shipped_robots
from armload_controller.control_errors import ConfigurationError
from armload_identification.files.payload_file import write_payload

CONFIGS = Path(str(resources.files("armload_configs")))


def test_three_robots_ship():
    assert shipped_robots() == ("er50", "prbt", "ur10e")


@pytest.mark.parametrize("name", ["er50", "prbt", "ur10e"])
def test_shipped_robots_load(name):
    robot = load_robot(name)
    assert robot.name == name
    assert robot.n == robot.chain.n == 6
    assert robot.drives.transmission.gain_nm_a.shape == (6,)


@pytest.mark.parametrize("name", ["er50", "prbt"])
def test_arms_on_a_bus_have_drives_excitations_and_a_twin(name):
    robot = load_robot(name)
    assert len(robot.drives.settings.drives) == 6
    assert set(robot.excitations) == {"identification", "validation"}
    assert robot.simulation.plant_spec(robot.simulation.payload_name).payload is not None
    assert robot.simulation.plant_spec(None).payload is None


def test_er50_flange_hangs_where_the_paper_has_its_payload():
    chain = load_robot("er50").chain
    poses = chain.forward(np.zeros(6))
    in_frame_3 = np.linalg.inv(poses[2]) @ poses[6]
    np.testing.assert_allclose(in_frame_3[:3, 3], [0.13, 0.84, 0.0], atol=1e-12)
    robot = load_robot("er50")
    payload = robot.simulation.payload("paper").transformed(in_frame_3)
    np.testing.assert_allclose(payload.center_of_mass_m, [0.13, 0.94, -0.102], atol=1e-9)
    # Table 2 of the paper, with the opposite sign of the products of inertia
    expected = [9.814, 9.814 * 0.13, 9.814 * 0.94, 9.814 * -0.102, 9.023, 0.353, 9.014, -1.222, 0.133, 0.967]
    np.testing.assert_allclose(payload.theta, expected, atol=2e-6)


@pytest.mark.parametrize("name", ["er50", "prbt"])
def test_limits_hold_the_excitations(name):
    robot = load_robot(name)
    limits = robot.limits.motion
    for excitation in robot.excitations.values():
        bounds = excitation.trajectory.bounds()
        assert (bounds.position_min_rad > limits.position_min_rad).all()
        assert (bounds.position_max_rad < limits.position_max_rad).all()
        assert (bounds.velocity_max_rad_s < limits.velocity_max_rad_s).all()


def test_every_assumed_number_is_marked():
    """All of er50 is assumed but the D-H rows of joints 1 to 3, the payload and their noise."""
    published = ("mass_kg", "center_of_mass_m", "inertia_kg_m2", "torque_noise_nm", "rated_payload_kg", "gravity_m_s2")
    administrative = ("seed", "bitrate", "start_position_rad", "flange", "rows", "coupling")
    rows = 0
    for line in (CONFIGS / "er50.toml").read_text().splitlines():
        if "alpha_rad" in line:
            rows += 1
            assert ("# assumed" in line) == (rows > 3), line
            continue
        key = line.split("=")[0].strip()
        if "=" not in line or line.startswith("#") or not re.search(r"\d", line.split("=", 1)[1]):
            continue
        if (
            key in published + administrative
            or "name" in key
            or line.startswith(("identification", "validation", "description", "channel"))
        ):
            continue
        assert "# assumed" in line, line


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


def test_a_real_arm_needs_to_know_what_it_may_carry():
    robot = load_robot("prbt")
    unloaded = robot.with_tables(heaviest_payload=None, expected_payload=None)
    with pytest.raises(ConfigurationError, match="real arm may have to carry") as caught:
        unloaded.strength.require_stated()
    assert caught.value.key == "heaviest_payload"
    robot.strength.require_stated()


def test_parts_are_made_once():
    robot = load_robot("er50")
    assert robot.chain is robot.chain
    assert robot.drives.settings is robot.drives.settings
    assert robot.obstacles is robot.obstacles
    faster = robot.with_bus(cycle_hz=100.0)
    assert faster.drives.settings.cycle_s == 0.01
    assert robot.drives.settings.cycle_s == 0.004


def test_unknown_robot_names_the_shipped_ones():
    with pytest.raises(ConfigurationError, match="er50, prbt, ur10e"):
        load_robot("nonsense")


def test_overrides_are_checked_like_the_file():
    robot = load_robot("er50")
    assert robot.with_bus(cycle_hz=50.0, channel="can7").bus.cycle_hz == 50.0
    assert robot.with_bus(cycle_hz=50.0).drives.settings.cycle_s == pytest.approx(0.02)
    with pytest.raises(ConfigurationError, match=r"bus\.cycle_hz"):
        robot.with_bus(cycle_hz=900.0)
    with pytest.raises(ConfigurationError, match=r"command line: bus\.bitrate"):
        robot.with_bus(bitrate=5)


def test_a_robot_known_from_logs_has_no_bus():
    with pytest.raises(ConfigurationError, match="armload identify"):
        _ = load_robot("ur10e").drives.settings


def test_two_runs_do_not_share_their_noise():
    robot = load_robot("er50")
    assert robot.simulation.plant_spec(None, run=0).seed != robot.simulation.plant_spec(None, run=1).seed


def test_scaling_of_the_current_path_is_consistent():
    """The rated torque of every er50 drive is rated current times torque constant times gear ratio."""
    values = tomllib.loads((CONFIGS / "er50.toml").read_text())
    for joint in values["joints"]:
        drive = joint["drive"]
        gain = joint["gear_ratio"] * joint["torque_constant_nm_a"]
        assert drive["rated_torque_nm"] == pytest.approx(gain * drive["rated_current_a"])
        assert joint["torque_max_nm"] == pytest.approx(3 * drive["rated_torque_nm"])
        assert drive["counts_per_axis_turn"] == 2**17 * joint["gear_ratio"]


def test_a_drive_that_gives_less_than_its_joint_takes_bounds_what_is_added(edited):
    robot = load_robot(edited("max_torque_permille = 2500", "max_torque_permille = 1000", "prbt"))
    assert robot.limits.added_torque_max_nm[0] == pytest.approx(148.0)
    assert robot.limits.added_torque_max_nm[1] == pytest.approx(370.0)
    assert robot.limits.torque_max_nm[0] == 370.0


def test_a_twin_carries_a_body_of_its_own_file_or_of_a_payload_file(make_subject, tmp_path):
    simulation = load_robot("er50").simulation
    own = simulation.payload("paper")
    np.testing.assert_allclose(simulation.mounted("paper").mass_kg, own.mass_kg)
    payload = make_subject().payload
    write_payload(tmp_path / "found.toml", payload)
    mounted = simulation.mounted(str(tmp_path / "found.toml"))
    assert mounted.mass_kg == pytest.approx(payload.model.mass_kg)
    np.testing.assert_allclose(mounted.center_of_mass_m, payload.model.center_of_mass_m, rtol=1e-6)
    np.testing.assert_allclose(mounted.inertia_kg_m2, payload.model.inertia_about_com, rtol=1e-6)
    with pytest.raises(ConfigurationError, match=r"expected one of .*paper.*path of a payload file"):
        simulation.mounted("papers")
