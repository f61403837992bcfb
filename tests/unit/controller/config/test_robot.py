"""Robot files: the shipped ones load, errors are reported with file, key, value and remedy."""

import re
import tomllib
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.robot import load_robot, shipped_robots
from armload_controller.control_errors import ConfigurationError

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


def test_scaling_of_the_current_path_is_consistent():
    """The rated torque of every er50 drive is rated current times torque constant times gear ratio."""
    values = tomllib.loads((CONFIGS / "er50.toml").read_text())
    for joint in values["joints"]:
        drive = joint["drive"]
        gain = joint["gear_ratio"] * joint["torque_constant_nm_a"]
        assert drive["rated_torque_nm"] == pytest.approx(gain * drive["rated_current_a"])
        assert joint["torque_max_nm"] == pytest.approx(3 * drive["rated_torque_nm"])
        assert drive["counts_per_axis_turn"] == 2**17 * joint["gear_ratio"]
