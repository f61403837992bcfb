"""`[workspace]`, `[body]` and the torque shares of a robot file: the shipped ones, and refusal of wrong ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_controller.motion.joint_limits import LimitViolation
from armload_controller.session.commissioning import checked_excitations


def test_er50_stands_a_metre_above_the_floor_on_a_pedestal():
    workspace = load_robot("er50").workspace
    assert {"floor", "pedestal", "link 1 to tool"} <= set(workspace.names)
    stretched = np.array([[0.0, 1.5707963, -1.5707963 + 0.176, 0.0, 0.0, 0.0]])
    floor = workspace.clearances(stretched)[0, [name == "floor" for name in workspace.names]]
    centre = workspace.centres(stretched[0])[:, 2]
    assert floor.min() == pytest.approx(
        min(c + 1.0 - s.radius_m for c, s in zip(centre, workspace.spheres, strict=True))
    )


def test_er50_keeps_a_stated_share_of_its_torque_for_itself():
    arm = load_robot("er50")
    limits = arm.envelope(0.1, 0.7, 0.8).torque
    share = np.array([0.35, 0.45, 0.35, 0.2, 0.2, 0.2])
    np.testing.assert_allclose(limits.available_nm, 0.8 * (1.0 - share) * arm.limits.torque_max_nm)
    assert limits.payload.mass_kg == 16.0
    assert not limits.body.links.any()


def test_prbt_knows_its_body_from_its_maker_and_not_from_the_simulation():
    arm = load_robot("prbt")
    limits = arm.envelope(0.1, 0.7, 0.8).torque
    np.testing.assert_allclose(limits.body.links[:, 0], [7.1, 1.7, 4.8, 0.9, 2.6, 0.02])
    np.testing.assert_allclose(limits.available_nm, 0.8 * arm.limits.torque_max_nm - [11.0, 10.0, 4.5, 3.8, 3.5, 7.0])
    assert limits.payload.mass_kg == 6.0


def test_the_rotors_of_a_body_turn_with_the_axes_that_the_transmission_couples(edited):
    rows = np.eye(6)
    rows[5, 4] = 0.25
    robot = load_robot(edited("[robot]", f"[transmission]\ncoupling = {rows.tolist()}\n\n[robot]", "prbt"))
    alone, coupled = load_robot("prbt").strength, robot.strength
    to_axis, rotors = np.linalg.inv(rows), alone.arm_body.rotor_inertia_kg_m2
    np.testing.assert_allclose(coupled.arm_body.rotor_mass_kg_m2, to_axis.T @ np.diag(rotors) @ to_axis)
    np.testing.assert_array_equal(alone.arm_body.rotor_mass_kg_m2, np.diag(rotors))
    pushed = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 20.0])
    middle = [
        np.mean(strength.expected_torque(loaded=False).bounds_nm(np.zeros(6), np.zeros(6), pushed), axis=0)
        for strength in (coupled, alone)
    ]
    np.testing.assert_allclose(middle[0] - middle[1], [0.0, 0.0, 0.0, 0.0, -0.25 * 20.0 * rotors[5], 0.0], atol=1e-9)


def test_what_drives_allow_the_axes_limits_a_motion_where_it_is_less_than_the_joints_can_ask_for(edited):
    assert load_robot("prbt").motion_constraints.axis_torque is None
    rows = np.eye(6)
    rows[5, 4] = 0.25
    coupled = load_robot(edited("[robot]", f"[transmission]\ncoupling = {rows.tolist()}\n\n[robot]", "prbt"))
    axes, joints = coupled.motion_constraints.axis_torque, coupled.motion_constraints.torque
    most = coupled.limits.torque_max_nm
    # Axis 5 also turns joint 6, by a quarter, and its drive allows no more than joint 5 needs by itself.
    taken = np.array([11.0, 10.0, 4.5, 3.8, 3.5 + 0.25 * 7.0, 7.0])
    np.testing.assert_allclose(axes.available_nm, most - taken, rtol=1e-3)
    np.testing.assert_array_equal(axes.coupling, rows)
    assert joints.coupling is None


def test_a_drive_that_allows_less_than_friction_takes_is_refused(edited):
    weak = load_robot(edited("max_torque_permille = 2512", "max_torque_permille = 500", "prbt"))
    with pytest.raises(ConfigurationError, match=r"joints\[6\]\.drive\.max_torque_permille.*500.* 4 N m.* 7 N m"):
        _ = weak.motion_constraints


def test_without_a_simulation_the_envelope_is_the_same(edited):
    arm = load_robot("prbt")
    text = Path(edited("[robot]", "[robot]", "prbt"))
    text.write_text(text.read_text().split("# The simulated arm")[0])
    alone = load_robot(str(text)).envelope(0.1, 0.7, 0.8)
    np.testing.assert_array_equal(alone.torque.available_nm, arm.envelope(0.1, 0.7, 0.8).torque.available_nm)


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


def test_what_the_file_says_the_arm_carries_keeps_reduced_speed(edited):
    plain = load_robot("prbt")
    carried = plain.controlled_points.carried
    assert [sphere.name for sphere in carried] == ["tool", "expected payload", "heaviest payload"]
    water_m = [(3.0 * mass_kg / (4.0 * np.pi * 1000.0)) ** (1.0 / 3.0) for mass_kg in (3.0, 6.0)]
    np.testing.assert_allclose([sphere.radius_m for sphere in carried], [0.11, *water_m])
    np.testing.assert_array_equal([s.center_m for s in carried], [[0.02, -0.01, 0.08]] + 2 * [[0.03, -0.02, 0.08]])
    np.testing.assert_array_equal(plain.motion_constraints.reduced_speed.points.names[-3:], [s.name for s in carried])
    expected, heaviest = plain.payloads.assumed_envelopes
    assert all(word in expected for word in ("[expected_payload]", "0.089 m", "density of water", "envelope_radius_m"))
    assert "[heaviest_payload]" in heaviest
    stated = load_robot(edited("[heaviest_payload]", "[heaviest_payload]\nenvelope_radius_m = 0.25", "prbt"))
    assert stated.controlled_points.carried[-1].radius_m == 0.25
    assert stated.payloads.assumed_envelopes == (expected,)


def test_a_payload_of_less_than_water_is_as_large_as_its_inertia_requires():
    robot = load_robot("er50")
    expected, _ = robot.payloads.assumed_envelopes
    assert all(word in expected for word in ("0.161 m", "its inertia"))
    assert robot.payloads.envelopes[0].radius_m == pytest.approx(np.sqrt(0.510776288 / (2.0 * 9.814)))
    assert load_robot("ur10e").payloads.envelopes == ()


def test_a_robot_without_a_workspace_has_nothing_in_its_way():
    arm = load_robot("ur10e")
    assert not arm.has_workspace
    assert arm.workspace.names == ()


def test_planes_boxes_and_cells_become_obstacles(edited):
    more = """[workspace]
inside = { min_m = [-1.0, -1.1, -0.1], max_m = [1.0, 1.1, 1.5] }
half_spaces = [{ name = "wall", normal = [0.0, -3.0, 0.0], offset_m = -0.8, links = [5, "tool"] }]
boxes = [{ name = "table", xyz_m = [0.9, 0.0, 0.0], rpy_rad = [0.0, 0.0, 0.3], size_m = [0.4, 0.4, 0.4] }]
"""
    workspace = load_robot(edited("[workspace]\n", more, "prbt")).workspace
    assert {"inside, -x", "inside, +z", "wall", "table", "floor"} <= set(workspace.names)
    q = np.zeros((1, 6))
    height = workspace.centres(q[0])[:, 2]
    found = workspace.clearances(q)[0, [name == "inside, +z" for name in workspace.names]]
    moving = [(z, s.radius_m) for z, s in zip(height, workspace.spheres, strict=True) if s.link > 0]
    assert found.min() == pytest.approx(min(1.5 - z - radius for z, radius in moving))
    assert workspace.names.count("wall") == 2
    assert workspace.half_spaces[-1].normal.tolist() == [0.0, -1.0, 0.0]


@pytest.mark.parametrize(
    ("robot", "old", "new", "key", "words"),
    [
        ("prbt", 'link = "tool"', 'link = "gripper"', "workspace.spheres[12].link", "tool"),
        ("prbt", 'link = "tool"', "link = 5", "workspace.spheres", "link = tool"),
        ("prbt", "link = 3,", "link = 2,", "workspace.spheres", "link = 3"),
        ("prbt", "link = 6,", "link = 7,", "workspace.spheres[11].link", '0 (the base) to 6, or "tool"'),
        ("prbt", "[0, 4]", "[0, 9]", "workspace.apart[1]", '"tool"'),
        ("prbt", "[0, 4]", "[0, 4, 5]", "workspace.apart[1]", "2 items"),
        ("prbt", "radius_m = 0.12", "radius_m = 0.0", "workspace.spheres[1].radius_m", "greater than 0"),
        ("prbt", "keep_m = 0.02", "", "workspace.keep_m", "required"),
        ("prbt", "keep_m = 0.02", "keep_m = -1.0", "workspace.keep_m", "0"),
        ("prbt", "floor_height_m", "floor_m", "workspace.floor_m", "did you mean floor_height_m"),
        ("er50", "size_m = [0.6, 0.6, 0.6]", "size_m = [0.6, 0.0, 0.6]", "workspace.boxes[1].size_m[2]", "greater"),
        ("er50", 'links = [2, 3, 4, 5, 6, "tool"]', "links = [8]", "workspace.boxes[1].links", '"tool"'),
        ("er50", 'links = [2, 3, 4, 5, 6, "tool"]', "links = [0]", "workspace", "'pedestal' has no effect"),
        ("prbt", "[[body.links]]\nmass_kg = 0.02", "[[skip]]\nmass_kg = 0.02", "skip", "unknown"),
        ("prbt", "coulomb_nm = 7.0\nviscous", "coulomb_nm = 21.0\nviscous", "body.links[6].coulomb_nm", "20.1"),
        ("prbt", "coulomb_nm = 7.0\nviscous", "viscous", "body.links[6].coulomb_nm", "required"),
        (
            "prbt",
            "torque_max_nm = 370.0",
            "torque_max_nm = 370.0\narm_torque_share = 0.5",
            "joints[1].arm_torque_share",
            "not both",
        ),
        ("er50", "arm_torque_share = 0.35", "arm_torque_share = 1.0", "joints[1].arm_torque_share", "less than 1"),
        ("er50", "mass_kg = 16.0", "mass_kg = 17.0", "heaviest_payload.mass_kg", "rated_payload_kg = 16"),
        ("er50", "mass_kg = 3.0 ", "mass_kg = 30.0 ", "payload_set.gripper.mass_kg", "rated_payload_kg = 16"),
        (
            "er50",
            "gravity_m_s2 = [0.0, 0.0, -9.81]",
            "gravity_m_s2 = [0.0, 0.0, 0.0]",
            "workspace.floor_height_m",
            "vertical",
        ),
    ],
)
def test_what_is_wrong_is_named(edited, robot, old, new, key, words):
    with pytest.raises(ConfigurationError) as caught:
        load_robot(edited(old, new, robot))
    assert caught.value.key == key
    assert words in str(caught.value)


def test_a_missing_body_is_named_when_it_is_needed(edited):
    path = edited("arm_torque_share = 0.35", "#", "er50", count=2)
    arm = load_robot(path)  # optional for an arm without excitation design
    with pytest.raises(ConfigurationError, match=r"joints\[1\]\.arm_torque_share.*or a \[body\]"):
        arm.envelope(0.1, 0.7, 0.8)


def test_friction_that_leaves_no_torque_to_move_with_is_named(edited):
    arm = load_robot(edited("coulomb_nm = 7.0\nviscous", "coulomb_nm = 17.0\nviscous", "prbt"))
    with pytest.raises(ConfigurationError, match=r"body\.links\[6\]\.coulomb_nm.*less than the 16\.08 N m"):
        arm.envelope(0.1, 0.7, 0.8)


@pytest.mark.parametrize("robot", ["er50", "prbt"])
@pytest.mark.parametrize("role", ["identification", "validation"])
def test_the_shipped_excitations_may_be_driven(robot, role):
    checked_excitations(load_robot(robot), [role])


@pytest.mark.parametrize(
    ("robot", "old", "new", "words"),
    [
        ("er50", "floor_height_m = -1.0", "floor_height_m = -0.5", "of 'floor'"),
        ("prbt", "torque_max_nm = 20.1", "torque_max_nm = 12.0", "N m of prbt_joint_6, which has 5 N m available"),
        ("er50", "torque_max_nm = 4788", "torque_max_nm = 400", "N m of joint_2, which has 220 N m available"),
    ],
)
def test_an_excitation_of_another_cell_or_arm_is_not_driven(edited, robot, old, new, words):
    arm = load_robot(edited(old, new, robot))
    with pytest.raises(ConfigurationError, match=r"excitation\.identification") as caught:
        checked_excitations(arm, ["identification"])
    assert words in str(caught.value)


def test_an_arm_without_stated_strength_is_checked_against_its_obstacles_alone(edited):
    checked_excitations(load_robot(edited("arm_torque_share = 0.35", "#", "er50", count=2)), ["identification"])
