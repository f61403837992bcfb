"""A first robot file: it contains the data of a URDF, a bus, a description and answers, and lists what is missing."""

import numpy as np
import pinocchio as pin
import pytest

from armload_controller.config.chain_from_urdf import read_urdf_arm
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_controller.new_robot.arm_draft import draft_of_urdf
from armload_controller.new_robot.arm_interview import interviewed
from armload_controller.new_robot.drive_drafts import nodes_described
from armload_controller.new_robot.payload_draft import cube, tool_sphere
from armload_controller.new_robot.workspace_draft import workspace_of_urdf
from armload_drivers.cia402.eds_parser import parse_description
from armload_identification.model.chain import pose_from_xyz_rpy, rpy_rad
from armload_identification.model.dynamics import ArmDynamics
from tests.drive_descriptions import eds, maker_drive
from tests.five_joints import NAMES, URDF, joint
from tests.urdf_simulation import PinocchioArm


def test_the_file_is_the_arm(drafted):
    arm, file, path = drafted()
    robot = load_robot(str(path))
    reference = PinocchioArm(arm.file, NAMES, "base", "hand")
    for q in np.random.default_rng(0).uniform(-2.0, 2.0, (5, 5)):
        np.testing.assert_allclose(robot.chain.forward(q)[-1], reference.flange_pose(q), atol=1e-9, rtol=0.0)
    assert (file.holes, robot.joint_names) == ([], NAMES)
    limits = robot.limits.motion
    np.testing.assert_array_equal(limits.position_max_rad, np.full(5, 2.5))
    np.testing.assert_array_equal(limits.velocity_max_rad_s, np.full(5, 2.0))
    np.testing.assert_array_equal(robot.limits.torque_max_nm, np.full(5, 80.0))
    np.testing.assert_array_equal(robot.strength.arm_body.coulomb_nm, np.full(5, 1.5))
    assert robot.payloads.expected.mass_kg == 2.0
    assert robot.obstacles.meshes is not None


def test_links_hold_what_is_fixed_to_them_and_what_is_below_with_joints_at_zero(drafted):
    arm, _, path = drafted()
    body = load_robot(str(path)).strength.arm_body
    reference = PinocchioArm(arm.file, NAMES, "base", "hand")
    rng = np.random.default_rng(1)
    data = reference.model.createData()
    for _ in range(3):
        q, dq, ddq = rng.normal(size=(3, 5))
        moved = np.zeros((2, reference.model.nv))
        order = [reference.model.joints[reference.model.getJointId(name)].idx_v for name in NAMES]
        moved[0, order], moved[1, order] = dq, ddq
        expected = pin.rnea(reference.model, data, reference.configuration(q), moved[0], moved[1])[order]
        found = ArmDynamics(arm.chain, body).torque(q[None], dq[None], ddq[None])[0]
        np.testing.assert_allclose(found, expected, atol=1e-5)


def test_spheres_hold_the_links(drafted):
    _, _, path = drafted()
    workspace = load_robot(str(path)).workspace
    corners = np.array([[x, y, z] for x in (0.0, 0.4) for y in (-0.04, 0.04) for z in (-0.04, 0.04)])
    edge = np.array([[x, 0.04, 0.04] for x in np.linspace(0.0, 0.4, 41)])
    for link in (2, 3):
        spheres = [s for s in workspace.spheres if s.link == link]
        assert len(spheres) > 1
        for point in np.concatenate([corners, edge]):
            assert any(np.linalg.norm(point - s.center_m) <= s.radius_m for s in spheres)
    assert {s.link for s in workspace.spheres} == set(range(7))


def floor_of(path):
    (floor,) = load_robot(str(path)).workspace.half_spaces
    return floor.offset_m, floor.links


def test_what_is_next_to_the_base_is_not_kept_above_the_floor_and_this_is_listed(drafted):
    _, file, path = drafted()
    assert floor_of(path) == (0.0, (1, 2, 3, 4, 5, 6))
    assert not any("not kept above" in sentence for sentence in file.unchecked)
    _, file, path = drafted(URDF.replace('xyz="0 0 0.25"', 'xyz="0 0 0.05"'))
    assert floor_of(path) == (0.0, (2, 3, 4, 5, 6))
    assert any(sentence.startswith("link 1: not kept above that floor") for sentence in file.unchecked)


def test_the_floor_is_at_the_root_of_an_arm_that_begins_above_it(tmp_path):
    stand = '<link name="ground"/>' + joint("stand", "fixed", "ground", "base", "0 0 0.7")
    (tmp_path / "five.urdf").write_text(URDF.replace('<robot name="five">', f'<robot name="five">{stand}'))
    arm = read_urdf_arm(tmp_path / "five.urdf", "base", "hand")
    workspace = workspace_of_urdf(arm, draft_of_urdf(arm), tool_sphere(arm.n, 1.0))
    assert workspace.floor_m == -0.7
    assert "not the root of the URDF" in workspace.why_no_meshes


def test_what_is_not_given_is_a_hole_with_its_place(drafted):
    text = URDF.replace('velocity="2" effort="80"', 'velocity="0"', 1)
    _, file, path = drafted(text)
    assert file.holes == ["joints[1].torque_max_nm", "joints[1].torque_noise_nm"]
    with pytest.raises(ConfigurationError, match=r"joints\[1\].torque_max_nm is 'FILL IN': expected a number"):
        load_robot(str(path))


def test_a_speed_that_is_not_given_is_slow_and_listed(drafted):
    _, file, path = drafted(URDF.replace('velocity="2"', 'velocity="0"', 1))
    assert not file.holes
    limits = load_robot(str(path)).limits.motion
    assert [limits.velocity_max_rad_s[0], limits.acceleration_max_rad_s2[0]] == [1.0, 2.0]
    assert "j1: a greatest speed of 1 rad/s" in file.unchecked


def test_friction_that_is_not_given_or_is_most_of_the_torque_is_assumed_and_listed(drafted):
    _, file, path = drafted()
    assert not any(sentence.startswith("friction:") for sentence in file.unchecked)
    for given in ("0", "79"):
        _, file, path = drafted(URDF.replace('friction="1.5"', f'friction="{given}"', 1))
        first, *others = load_robot(str(path)).strength.arm_body.coulomb_nm
        assert 1.5 < first < 40.0
        assert set(others) == {1.5}
        assert any(sentence.startswith("friction:") for sentence in file.unchecked)


def test_a_joint_that_turns_without_end_gets_one_turn_and_is_listed(drafted):
    _, file, path = drafted(URDF.replace('name="j4" type="revolute"', 'name="j4" type="continuous"'))
    assert load_robot(str(path)).limits.motion.position_max_rad[3] == 3.14159
    assert any("j4: continuous" in sentence for sentence in file.unchecked)


def test_without_a_payload_the_file_has_a_hole_and_says_so(drafted):
    _, file, _ = drafted(payload_kg=None)
    assert file.holes == ["robot.rated_payload_kg"]
    assert any("--payload-kg" in sentence for sentence in file.unchecked)


@pytest.mark.parametrize("rpy", [(0.3, -0.4, 2.0), (0.3, np.pi / 2, 0.0), (0.0, -np.pi / 2, 1.0), (np.pi, 0.0, 0.1)])
def test_angles_make_the_rotation_again(rpy):
    rotation = pose_from_xyz_rpy((0, 0, 0), rpy)[:3, :3]
    np.testing.assert_allclose(pose_from_xyz_rpy((0, 0, 0), rpy_rad(rotation))[:3, :3], rotation, atol=1e-12)


@pytest.mark.parametrize(
    ("without", "modes", "mode"),
    [((), "0x40", "ip"), ((), "0", "csp"), ([0x60B2, 0x60C2], "", "ip"), ([0x60B2, 0x60C1, 0x60C2], "", None)],
)
def test_of_a_description_without_a_value_of_6502_the_objects_decide(without, modes, mode):
    text = eds(maker_drive(without, {"6502": {"DefaultValue": modes}}), vendor=7)
    (drive,) = nodes_described(parse_description(text.encode(), "own.eds"), 1)
    assert drive.mode == mode


def answers(*lines):
    given = iter(lines)
    said = []
    return interviewed(lambda question: next(given), said.append), said


def test_answers_make_an_arm_and_what_cannot_be_used_is_asked_again():
    rows = ["0 0 0.4 0", "-1.5708 0.1 0 0", "0 0.6 0 0", "-1.5708 0.1 0.7 0"]
    limits = ["2 -2", "-2 2", "1.5", "-1", "100", *["-2, 2", "", "50"] * 3]
    arm, said = answers("", "3", "4", "d-h", "1", rows[0], "0 0 x 0", *rows[1:], "0 0 0.1 0 0 0", *limits)
    assert (arm.name, arm.n, arm.convention) == ("my_arm", 4, "modified-dh")
    np.testing.assert_allclose(arm.chain.flange[:3, 3], [0.0, 0.0, 0.1])
    np.testing.assert_array_equal(arm.velocity_max_rad_s, [1.5, np.nan, np.nan, np.nan])
    np.testing.assert_array_equal(arm.torque_max_nm, [100.0, 50.0, 50.0, 50.0])
    assert [line.strip().split(":")[0] for line in said if line.startswith("  ")] == [
        "'d-h'",
        "'0 0 x 0'",
        "2 is not below -2",
        "-1",
    ]
    assert arm.rows[1] == "{ alpha_rad = -1.5708, a_m = 0.1, d_m = 0.0, theta_rad = 0.0 }"


def test_an_axis_without_a_direction_is_asked_for_once_more():
    good = ["0 0 0.1 0 0 0 0 0 1"] * 4
    bad = ["0 0 0.1 0 0 0 0 0 0", *good[1:]]
    arm, said = answers("a", "4", "joint-origins", *bad, "", *good, "", *["-1 1", "1", "1"] * 4)
    assert any("try again" in line for line in said)
    np.testing.assert_allclose(arm.chain.forward(np.zeros(4))[-1][:3, 3], [0.0, 0.0, 0.4])


@pytest.mark.parametrize(
    ("change", "touching"),
    [
        (("", ""), ()),
        (("0 0 0.25", "0 0 0.05"), (("base", "l2"),)),
        (("0.4 0 0", "0.05 0 0"), (("l1", "l3"),)),
        (("0.42 0 0", "0.05 0 0"), (("hand", "l3"), ("l2", "l4"))),
    ],
    ids=["all links long", "short shoulder", "short upper arm", "short forearm"],
)
def test_meshes_that_come_near_in_most_poses_may_touch_and_no_others(drafted, change, touching):
    """Two links beside one that is shorter than they are wide; those beside a common joint are no pair anyway."""
    arm, *_ = drafted(URDF.replace(*(f'xyz="{offset}"' for offset in change)) if any(change) else URDF)
    assert workspace_of_urdf(arm, draft_of_urdf(arm), tool_sphere(arm.n, 2.0)).touching == touching


def test_what_is_assumed_of_a_joint_follows_from_its_speed_and_torque(drafted):
    """2 rad/s and 80 N m: full speed after 0.5 s, a hundred times the acceleration per second, half a per cent."""
    _, file, path = drafted()
    limits = load_robot(str(path)).limits.motion
    np.testing.assert_allclose(limits.acceleration_max_rad_s2, 4.0)
    np.testing.assert_allclose(limits.jerk_max_rad_s3, 400.0)
    assert file.text.count("torque_noise_nm = 0.4 ") == 5
    assert "assumed: 0.5 % of torque_max_nm" in file.text


def test_an_unknown_payload_is_a_cube_before_the_flange_and_its_sphere_holds_it():
    body, sphere = cube(2.0), tool_sphere(6, 2.0)
    edge_m = 0.1  # of 2 kg at 2000 kg/m3
    np.testing.assert_allclose(body.center_of_mass_m, [0.0, 0.0, 0.5 * edge_m])
    np.testing.assert_allclose(body.inertia_about_com, 2.0 * edge_m**2 / 6.0 * np.eye(3), atol=1e-15)
    np.testing.assert_allclose(sphere.center_m, body.center_of_mass_m)
    assert 0.5 * np.sqrt(3.0) * edge_m <= sphere.radius_m < edge_m
