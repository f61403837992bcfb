"""The torque that a robot file leaves for a motion, by `[body]` or torque shares; shipped excitations keep to it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_controller.session.commissioning import checked_excitations


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
