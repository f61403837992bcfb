"""A first robot file: it contains the data of a URDF, a bus, a description and answers, and lists what is missing."""

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from armload_controller.config.chain_from_urdf import read_urdf_arm
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_controller.new_robot.arm_draft import draft_of_urdf
from armload_controller.new_robot.arm_interview import interviewed
from armload_controller.new_robot.draft_text import draft_file
from armload_controller.new_robot.drive_drafts import BusDraft, drives_found, nodes_described
from armload_controller.new_robot.payload_draft import tool_sphere
from armload_controller.new_robot.workspace_draft import workspace_of_urdf
from armload_drivers.bring_up.inspection import FoundNode
from armload_drivers.cia402.arm_settings import Identity
from armload_drivers.cia402.eds_parser import parse_description
from armload_drivers.simulation.drives.drive_eds import drive_eds
from armload_identification.model.chain import pose_from_xyz_rpy, rpy_rad
from armload_identification.model.dynamics import ArmDynamics
from tests.drive_descriptions import eds, maker_drive
from tests.urdf_simulation import PinocchioArm

NAMES = ("j1", "j2", "j3", "j4", "j5")
BALL = '<collision><geometry><sphere radius="{}"/></geometry></collision>'
BOX = '<collision><origin xyz="0.2 0 0"/><geometry><box size="0.4 0.08 0.08"/></geometry></collision>'


def _link(name, mass, shape=""):
    return (
        f'<link name="{name}"><inertial><origin xyz="0.1 0 0.02" rpy="0.3 0 0.2"/><mass value="{mass}"/>'
        f'<inertia ixx="0.02" iyy="0.03" izz="0.025" ixy="0.001" ixz="0" iyz="0"/></inertial>{shape}</link>'
    )


def _joint(name, kind, parent, child, xyz, rpy="0 0 0", limit='lower="-2" upper="2.5" velocity="2" effort="80"'):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="0 0 1"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><limit {limit}/><dynamics damping="0.5" friction="1.5"/></joint>'
    )


URDF = "".join(
    [
        '<robot name="five">',
        _link("base", 9, BALL.format(0.1)),
        _link("l1", 5, BALL.format(0.08)),
        _link("l2", 4, BOX),
        _link("l3", 3, BOX),
        _link("l4", 1, BALL.format(0.05)),
        _link("l5", 0.5),
        _link("hand", 0.7, BALL.format(0.04)),
        _link("finger", 0.1),
        _joint("j1", "revolute", "base", "l1", "0 0 0.25"),
        _joint("j2", "revolute", "l1", "l2", "0 0.1 0", "1.5708 0 0"),
        _joint("j3", "revolute", "l2", "l3", "0.4 0 0"),
        _joint("j4", "revolute", "l3", "l4", "0.42 0 0", "0 1.5708 0"),
        _joint("j5", "revolute", "l4", "l5", "0 0 0.1"),
        _joint("wrist", "fixed", "l5", "hand", "0 0 0.06", "0 0.4 0"),
        _joint("squeeze", "prismatic", "hand", "finger", "0 0 0.05"),
        "</robot>",
    ]
)


@pytest.fixture
def drafted(tmp_path):
    """Writes the URDF and the file drafted from it."""

    def drafted(text=URDF, payload_kg=2.0, bus=None):
        (tmp_path / "five.urdf").write_text(text)
        arm = read_urdf_arm(tmp_path / "five.urdf", flange="hand")
        draft = draft_of_urdf(arm)
        workspace = workspace_of_urdf(arm, draft, tool_sphere(arm.n, payload_kg))
        file = draft_file(draft, payload_kg, replace(workspace, urdf="five.urdf"), bus)
        (tmp_path / "five.toml").write_text(file.text)
        return arm, file, tmp_path / "five.toml"

    return drafted


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
    stand = '<link name="ground"/>' + _joint("stand", "fixed", "ground", "base", "0 0 0.7")
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


def node(node_id, drive=True):
    kind = 0x0002_0192 if drive else 0x0000_0191
    return FoundNode(node_id, kind, "", Identity(0x2DC, 7), (1, 7, 8), ("master_lost",) if drive else ())


def test_drives_that_answer_are_taken_in_the_order_of_their_nodes(drafted):
    drives = drives_found([node(3), node(9, drive=False), *map(node, (1, 5, 4, 2))], 5, None)
    _, file, path = drafted(bus=BusDraft(drives, "socketcan", "can1", 500_000, None, "as they answered"))
    text = path.read_text()
    assert re.findall(r"^node_id = (\d)$", text, re.MULTILINE) == list("12345")
    assert text.count("identity = { vendor_id = 0x000002DC, product_code = 0x00000007 }") == 5
    assert text.count('mode = "csp"') == 5
    assert '# accept_missing = ["master_lost"]' in text
    assert "joints[2].drive.has_brake" in file.holes
    with pytest.raises(ConfigurationError, match=r"joints\[1\]\.drive\.\w+ is 'FILL IN'"):
        load_robot(str(path))
    with pytest.raises(ConfigurationError, match=r"--scan is '2 CiA 402 drives \(nodes 1, 3\)': one per joint, 5"):
        drives_found([node(3), node(1)], 5, None)


def test_a_description_gives_objects_and_identity_and_with_the_holes_filled_the_file_is_taken(drafted, arm_settings):
    settings = arm_settings()
    described = parse_description(drive_eds(settings.drives[0], settings.cycle_s).encode(), "own.eds")
    drives = nodes_described(described, 5)
    assert [drive.node_id for drive in drives] == [1, 2, 3, 4, 5]
    assert drives[0].identity == Identity(described.vendor_id, described.product_code)
    _, file, path = drafted(bus=BusDraft(drives, "socketcan", "can0", 1_000_000, None, "from own.eds"))
    filled = path.read_text().replace('has_brake = "FILL IN"', "has_brake = true")
    path.write_text(re.sub(r'max_torque_permille = "FILL IN"', "max_torque_permille = 1000", filled))
    robot = load_robot(str(path))
    assert [drive.node_id for drive in robot.drives.settings.drives] == [1, 2, 3, 4, 5]
    assert {place.split(".")[-1] for place in file.holes} <= {"has_brake", "max_torque_permille"}


@pytest.mark.parametrize(
    ("without", "modes", "mode"),
    [((), "0x40", "ip"), ((), "0", "csp"), ([0x60B2, 0x60C2], "", "ip"), ([0x60B2, 0x60C1, 0x60C2], "", None)],
)
def test_of_a_description_without_a_value_of_6502_the_objects_decide(without, modes, mode):
    text = eds(maker_drive(without, {"6502": {"DefaultValue": modes}}), vendor=7)
    (drive,) = nodes_described(parse_description(text.encode(), "own.eds"), 1)
    assert drive.mode == mode


def test_what_a_description_says_about_sizes_and_a_vendor_alone_is_written(drafted):
    changes = {"60B2": {"DataType": "4"}, "6077": {"DataType": "4"}}
    drives = nodes_described(parse_description(eds(maker_drive(changes=changes), vendor=7).encode(), "own.eds"), 5)
    _, _, path = drafted(bus=BusDraft(drives, "socketcan", "can0", 1_000_000, None, "from own.eds"))
    text = path.read_text()
    for line in ("torque_offset_bits = 32", "effort_bits = 32", "identity = { vendor_id = 0x00000007 }"):
        assert text.count(line) == 5


def test_a_shipped_profile_of_the_vendor_is_a_comment(drafted):
    drives = nodes_described(parse_description(eds(maker_drive(), vendor=0xFB).encode(), "own.eds"), 5)
    _, _, path = drafted(bus=BusDraft(drives, "socketcan", "can0", 1_000_000, None, "from own.eds"))
    assert path.read_text().count('\n# profile = "maxon_epos4" is for maxon EPOS4; other products') == 5


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
