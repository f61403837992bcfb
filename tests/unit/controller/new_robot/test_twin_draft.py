"""The tables of a simulated twin, read as TOML: the links are those given, everything else follows from the limits."""

import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.new_robot.twin_draft import body_lines, twin_bus, twin_drive, twin_simulation
from armload_identification.model.payload import InertialParameters

COUNTS_PER_TURN, PEAK_OF_RATED, ROTOR_SHARE = 1_048_576, 3, 0.05

pytestmark = pytest.mark.pure

ARM = SimpleNamespace(
    torque_max_nm=np.array([90.0, 30.0]),
    velocity_max_rad_s=np.array([3.0, 6.28]),
    viscous_nm_s_rad=np.array([2.5, np.nan]),
)
BODY = InertialParameters.from_center_of_mass(
    2.5, [0.1, -0.2, 0.05], [[0.03, 0.001, 0.002], [0.001, 0.04, 0.003], [0.002, 0.003, 0.05]]
)


def read(lines):
    return tomllib.loads("\n".join(lines))


def test_a_body_is_given_by_mass_centre_and_inertia_about_it():
    body = read(body_lines(BODY))
    assert body["mass_kg"] == 2.5
    assert body["center_of_mass_m"] == [0.1, -0.2, 0.05]
    inertia = body["inertia_kg_m2"]
    expected = {"ixx": 0.03, "iyy": 0.04, "izz": 0.05, "ixy": 0.001, "ixz": 0.002, "iyz": 0.003}
    assert inertia == pytest.approx(expected)


def test_drives_peak_at_the_joints_greatest_torque():
    for joint, torque_nm in enumerate(ARM.torque_max_nm):
        drive = read(twin_drive(ARM, joint))["joints"]["drive"]
        assert drive["node_id"] == joint + 1
        assert drive["rated_torque_nm"] * drive["max_torque_permille"] == pytest.approx(1000.0 * torque_nm)
        assert drive["rated_torque_nm"] * PEAK_OF_RATED == pytest.approx(torque_nm)
        assert drive["counts_per_axis_turn"] == COUNTS_PER_TURN
        assert drive["following_error_rad"] > drive["following_lag_s"] * ARM.velocity_max_rad_s[joint]
        assert (drive["mode"], drive["feedback"], drive["has_brake"]) == ("csp", "torque", True)


def test_the_bus_is_inside_the_process():
    bus = read(twin_bus("six"))["bus"]
    assert bus["interface"] == "virtual"
    assert "six" in bus["channel"]


def test_the_arm_has_its_links_and_friction_and_rotors_of_a_share_of_its_torque():
    table = read(twin_simulation(ARM, [BODY, BODY], BODY, np.array([0.5, -0.25]), [4.0, 1.5], np.array([10.0, 20.0])))
    simulation = table["simulation"]
    assert simulation["start_position_rad"] == [0.5, -0.25]
    assert simulation["payloads"][simulation["payload"]]["mass_kg"] == 2.5
    first, second = simulation["joints"]
    assert first["link"]["center_of_mass_m"] == [0.1, -0.2, 0.05]
    assert (first["coulomb_nm"], second["coulomb_nm"]) == (4.0, 1.5)
    assert (first["viscous_nm_s_rad"], second["viscous_nm_s_rad"]) == (2.5, 0.0)
    for joint, torque_nm, acceleration in ((first, 90.0, 10.0), (second, 30.0, 20.0)):
        assert joint["reflected_rotor_inertia_kg_m2"] * acceleration == pytest.approx(ROTOR_SHARE * torque_nm)
        assert 0.0 < joint["stribeck_nm"] < joint["coulomb_nm"]
    assert first["stribeck_nm"] / second["stribeck_nm"] == pytest.approx(4.0 / 1.5)


def test_a_fast_joints_window_leaves_a_fifth_beyond_its_lag():
    """Of 0.05 s: 0.314 rad at 6.28 rad/s; a slow joint has 0.2 rad."""
    found = [read(twin_drive(ARM, joint))["joints"]["drive"]["following_error_rad"] for joint in range(2)]
    assert found == [0.2, 0.3768]


def test_what_is_assumed_of_a_twin():
    first = read(twin_simulation(ARM, [BODY], BODY, np.zeros(2), [4.0], np.array([10.0])))["simulation"]["joints"][0]
    assert first["stribeck_nm"] == pytest.approx(0.8), "a fifth of Coulomb's"
    assert (first["stribeck_velocity_rad_s"], first["load_friction"]) == (0.02, 0.05)
    assert (first["torque_ripple_nm"], first["ripple_per_motor_turn"]) == (0.0, 2)
    drive = read(twin_drive(ARM, 0))["joints"]["drive"]
    assert (drive["max_torque_permille"], drive["following_lag_s"]) == (3000, 0.05)
