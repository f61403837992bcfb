"""Arms from URDFs: the chain agrees with Pinocchio's, and unsuitable URDFs are refused with the cause."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from armload_controller.config.chain_from_urdf import read_urdf_arm
from armload_controller.config.robot import load_robot
from armload_controller.control_errors import ConfigurationError
from armload_identification.identification_errors import RecordingError
from armload_identification.model.chain import pose_from_xyz_rpy
from armload_identification.recording.recording import Recording


def joint(name, kind, parent, child, inside="", xyz="0.1 -0.2 0.3", rpy="0.4 -0.5 0.6"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/>{inside}</joint>'
    )


LIMIT = '<axis xyz="0 0.6 0.8"/><limit lower="-2" upper="1.5" velocity="3" effort="50"/>'
INERTIAL = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def urdf(*joints, links=()):
    named = {part.split('"')[1] for text in joints for part in text.split("link=")[1:]} | set(links)
    bodies = "".join(f'<link name="{name}">{INERTIAL}</link>' for name in sorted(named))
    return f'<?xml version="1.0"?><robot name="arm">{bodies}{"".join(joints)}</robot>'


def plain(*more):
    """Five joints, two fixed links between them and two at the end."""
    return urdf(
        joint("mount", "fixed", "world", "base"),
        joint("a", "revolute", "base", "l1", LIMIT),
        joint("b", "continuous", "l1", "l2", '<axis xyz="0 1 0"/>'),
        joint("between", "fixed", "l2", "l2b"),
        joint("c", "revolute", "l2b", "l3", LIMIT + '<dynamics damping="0.7" friction="1.2"/>'),
        joint("d", "revolute", "l3", "l4", LIMIT),
        joint("e", "revolute", "l4", "l5", '<limit lower="-1" upper="1" velocity="2" effort="9"/>'),
        joint("end", "fixed", "l5", "tool0"),
        *more,
    )


@pytest.fixture
def written(tmp_path):
    def written(text):
        path = tmp_path / "arm.urdf"
        path.write_text(text)
        return path

    return written


def require_pinocchios(path, arm):
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    rng = np.random.default_rng(0)
    for _ in range(20):
        q = rng.uniform(-3.0, 3.0, len(arm.joint_names))
        full = pin.neutral(model)
        for name, angle in zip(arm.joint_names, q, strict=True):
            which = model.joints[model.getJointId(name)]
            full[which.idx_q : which.idx_q + which.nq] = [angle] if which.nq == 1 else [np.cos(angle), np.sin(angle)]
        pin.framesForwardKinematics(model, data, full)
        base, flange = (data.oMf[model.getFrameId(link)] for link in (arm.base, arm.flange))
        np.testing.assert_allclose(arm.chain.forward(q)[-1], (base.inverse() * flange).homogeneous, atol=1e-9, rtol=0.0)


def test_the_chain_is_pinocchios_and_fixed_joints_are_folded(written):
    path = written(plain())
    arm = read_urdf_arm(path)
    assert (arm.name, arm.base, arm.flange) == ("arm", "world", "tool0")
    assert arm.joint_names == ("a", "b", "c", "d", "e")
    assert arm.other_joints == ()
    require_pinocchios(path, arm)
    require_pinocchios(path, read_urdf_arm(path, "base", "l5"))


def test_limits_and_friction_are_taken_where_they_are_given(written):
    arm = read_urdf_arm(written(plain()))
    nan, inf = np.nan, np.inf
    np.testing.assert_array_equal(arm.position_min_rad, [-2, -inf, -2, -2, -1])
    np.testing.assert_array_equal(arm.position_max_rad, [1.5, inf, 1.5, 1.5, 1])
    np.testing.assert_array_equal(arm.velocity_max_rad_s, [3, nan, 3, 3, 2])
    np.testing.assert_array_equal(arm.torque_max_nm, [50, nan, 50, 50, 9])
    np.testing.assert_array_equal(arm.viscous_nm_s_rad, [nan, nan, 0.7, nan, nan])
    np.testing.assert_array_equal(arm.coulomb_nm, [nan, nan, 1.2, nan, nan])


def test_a_range_of_nothing_is_no_range(written):
    arm = read_urdf_arm(written(plain().replace('lower="-2" upper="1.5"', 'lower="0" upper="0"', 1)))
    assert np.isnan([arm.position_min_rad[0], arm.position_max_rad[0]]).all()
    np.testing.assert_array_equal(arm.position_max_rad[2:], [1.5, 1.5, 1])


def test_an_axis_that_is_not_given_is_x(written):
    arm = read_urdf_arm(written(plain()))
    np.testing.assert_array_equal(arm.chain.axis[-1], [1.0, 0.0, 0.0])


def test_a_gripper_is_left_out_and_named(written):
    fingers = (
        joint("finger", "prismatic", "tool0", "left", LIMIT),
        joint("finger2", "prismatic", "tool0", "right", LIMIT + '<mimic joint="finger"/>'),
    )
    arm = read_urdf_arm(written(plain(*fingers)))
    assert arm.flange == "tool0"
    assert arm.other_joints == ("finger", "finger2")


def test_several_flanges_are_listed(written):
    path = written(plain(joint("end2", "fixed", "l5", "camera")).replace("tool0", "plate"))
    with pytest.raises(ConfigurationError, match=r"`flange=` is missing: name the link .*: camera, l5, plate$"):
        read_urdf_arm(path)
    assert read_urdf_arm(path, flange="camera").flange == "camera"


def test_two_arms_are_listed(written):
    second = [joint(f"r{i}", "revolute", "base" if i == 0 else f"r{i - 1}_link", f"r{i}_link", LIMIT) for i in range(4)]
    path = written(plain(*second))
    with pytest.raises(ConfigurationError, match=r"carries the payload: .*(r3_link.*tool0|tool0.*r3_link)"):
        read_urdf_arm(path)
    assert read_urdf_arm(path, flange="r3_link").joint_names == ("r0", "r1", "r2", "r3")


@pytest.mark.parametrize(
    ("old", "new", "error"),
    [
        ('name="c" type="revolute"', 'name="c" type="prismatic"', "joint c, type is 'prismatic': revolute, continuous"),
        ('name="c" type="revolute"', 'name="c" type="floating"', "joint c, type is 'floating': revolute, continuous"),
        ('<dynamics damping="0.7"', '<mimic joint="a"/><dynamics damping="0.7"', "joint c, mimic is 'a': a joint with"),
        ('name="c" type="revolute"', 'name="c" type="fixed"', None),
    ],
)
def test_what_cannot_be_in_a_chain_is_refused_by_name(written, old, new, error):
    text = plain()
    assert old in text
    path = written(text.replace(old, new))
    if error is None:
        assert read_urdf_arm(path, "world", "tool0").joint_names == ("a", "b", "d", "e")
        return
    with pytest.raises(ConfigurationError, match=error):
        read_urdf_arm(path, "world", "tool0")


def test_too_few_and_too_many_joints_are_refused(written):
    def row(n):
        return urdf(*(joint(f"j{i}", "revolute", f"l{i}", f"l{i + 1}", LIMIT) for i in range(n)))

    with pytest.raises(ConfigurationError, match="at least 4 revolute joints in a row from 'l0'"):
        read_urdf_arm(written(row(3)))
    with pytest.raises(ConfigurationError, match=r"joints from l0 to l3 is 'j0, j1, j2': 4 to 16"):
        read_urdf_arm(written(row(3)), "l0", "l3")
    with pytest.raises(ConfigurationError, match="4 to 16"):
        read_urdf_arm(written(row(17)))
    path = written(row(16))
    require_pinocchios(path, read_urdf_arm(path))


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("no xml", "XML is .*: a URDF; expand a xacro file first"),
        ("<sdf/>", "root element is 'sdf': <robot>"),
        (
            '<robot xmlns:xacro="http://ros.org/wiki/xacro"><xacro:include filename="a"/></robot>',
            "xacro is 'include': no macros; expand them",
        ),
        ("<robot/>", r"root link is \[\]"),
        ('<robot><joint type="fixed"/></robot>', "joint 1, name is missing"),
        ('<robot><joint name="j" type="fixed"/></robot>', "joint j, parent is missing"),
        (
            plain().replace('xyz="0 0.6 0.8"', 'xyz="0 one 0.8"', 1),
            "axis xyz is '0 one 0.8': 3 finite numbers",
        ),
        (plain().replace('xyz="0 0.6 0.8"', 'xyz="0 0 0"', 1), "axis of joint 1"),
        (plain().replace('upper="1.5"', 'upper="nan"', 1), "joint a, limit upper is 'nan': a finite number"),
        (plain(joint("twice", "fixed", "l1", "l4")), "joint twice, child is 'l4': a link without a parent"),
        (
            plain().replace('<parent link="l1"/>', '<parent link="l9"/>'),
            "joint b, link is 'l9': one of the <link> elements",
        ),
    ],
)
def test_a_file_that_is_no_arm_names_the_place(written, text, error):
    with pytest.raises(ConfigurationError, match=error):
        read_urdf_arm(written(text))


def test_links_that_do_not_exist_or_lie_elsewhere(written, tmp_path):
    path = written(plain())
    with pytest.raises(ConfigurationError, match="`flange=` is 'tool1': one of its links: base, l1"):
        read_urdf_arm(path, flange="tool1")
    with pytest.raises(ConfigurationError, match="`base=` is 'floor': one of its links"):
        read_urdf_arm(path, base="floor")
    with pytest.raises(ConfigurationError, match="`flange=` is 'l1': a link below 'l3'; above it are base, world"):
        read_urdf_arm(path, base="l3", flange="l1")
    with pytest.raises(ConfigurationError, match="No such file or directory: expected a URDF"):
        read_urdf_arm(tmp_path / "missing.urdf")


def test_a_ring_of_links_has_no_end(written):
    ring = urdf(
        joint("a", "revolute", "l0", "l1", LIMIT), joint("b", "revolute", "l1", "l0", LIMIT), links=("elsewhere",)
    )
    with pytest.raises(ConfigurationError, match="`flange=` is 'l1'"):
        read_urdf_arm(written(ring), flange="l1")


def test_the_urdf_of_the_measured_arm_agrees_with_its_shipped_configuration(shared_data):
    path = shared_data / "ur10e" / "ur10e.urdf"
    arm, shipped = read_urdf_arm(path), load_robot("ur10e").chain
    assert arm.flange == "tool0"
    require_pinocchios(path, arm)
    for q in np.random.default_rng(1).uniform(-3.0, 3.0, (10, 6)):
        np.testing.assert_allclose(arm.chain.forward(q)[-1], shipped.forward(q)[-1], atol=1e-6, rtol=0.0)


def run_of(n, names=(), **measured):
    """A recording of n joints that move a little."""
    time_s = 0.01 * np.arange(200.0)
    position = 0.1 * np.sin(time_s[:, None] + np.arange(n))
    values = {key: scale * np.cos(time_s[:, None] + np.arange(n)) for key, scale in measured.items()}
    return Recording.from_arrays(time_s, position, joint_names=names, **values)


def test_a_recording_becomes_the_arms_own_by_the_names_of_its_joints(written):
    arm = read_urdf_arm(written(plain()))
    own = arm.own(run_of(6, ["d", "x", "a", "c", "b", "e"], torque_nm=2.0))
    assert own.joint_names == arm.joint_names
    assert own.source.ignored_joints == ("x",)
    assert arm.own(run_of(5, torque_nm=2.0)).n == 5
    with pytest.raises(RecordingError, match="no joint named d; the recording has a, b, c, e, f"):
        arm.own(run_of(5, ["a", "b", "c", "e", "f"], torque_nm=2.0))
    with pytest.raises(RecordingError, match="has 6 joints, the robot 5"):
        arm.own(run_of(6, torque_nm=2.0))


def test_motor_currents_are_no_torque_of_a_urdfs_joints(written):
    with pytest.raises(
        RecordingError, match=r"only motor currents, and a URDF has no torque constants\. Create a robot"
    ):
        read_urdf_arm(written(plain())).own(run_of(5, current_a=2.0))


def test_gravity_is_that_of_the_root_whatever_the_base(written):
    arm = read_urdf_arm(written(plain()), "base")
    down = pose_from_xyz_rpy((0.1, -0.2, 0.3), (0.4, -0.5, 0.6))[:3, :3].T @ [0.0, 0.0, -9.81]
    np.testing.assert_allclose(arm.chain.gravity_m_s2, down, atol=1e-12)
    np.testing.assert_array_equal(read_urdf_arm(written(plain())).chain.gravity_m_s2, [0.0, 0.0, -9.81])


def test_a_robot_of_which_no_motor_is_known_takes_torques_and_refuses_currents(edited):
    text = Path(edited("name", "name", robot="ur10e", count=0)).read_text()
    lines = [line for line in text.splitlines() if not line.startswith(("gear_ratio", "torque_constant_nm_a"))]
    path = Path(edited("name", "name", robot="ur10e", count=0))
    path.write_text("\n".join(lines))
    robot = load_robot(str(path))
    assert robot.own(run_of(6, torque_nm=2.0)).n == 6
    with pytest.raises(
        ConfigurationError, match=r"joints\[1\].torque_constant_nm_a is missing: required, with gear_ratio"
    ):
        robot.own(run_of(6, current_a=2.0))
    load_robot("ur10e").own(run_of(6, current_a=2.0))
    with pytest.raises(RecordingError, match="times its greatest torque"):
        robot.own(run_of(6, torque_nm=1e6))


def test_torques_that_no_joint_can_give_are_refused(written):
    with pytest.raises(RecordingError, match=r"e reaches 1.9e\+05 N m, 21142 times its greatest torque, 9 N m"):
        read_urdf_arm(written(plain())).own(run_of(5, torque_nm=2e5))


def test_other_starts_and_joints_that_slide_are_named(tmp_path):
    """The error said only to choose another start."""
    kinds = ["prismatic", *["revolute"] * 5]
    joints = "".join(
        f'<joint name="j{i}" type="{kind}"><parent link="l{i}"/><child link="l{i + 1}"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for i, kind in enumerate(kinds)
    )
    path = tmp_path / "rail.urdf"
    path.write_text(
        f'<robot name="a">{"".join(f"<link name={chr(34)}l{i}{chr(34)}/>" for i in range(7))}{joints}</robot>'
    )
    with pytest.raises(ConfigurationError, match=r"`base=`: l1; prismatic joints are not supported: j0"):
        read_urdf_arm(path)
    assert read_urdf_arm(path, base="l1").n == 5


@pytest.mark.parametrize(
    ("name", "joints"),
    [
        *((name, 5) for name in ("jointGripper", "gripper", "RHand", "l_finger_joint")),
        *((name, 6) for name in ("RightGripperYaw", "joint_6", "shandy")),
    ],
)
def test_a_jaw_is_no_axis_of_the_arm(written, name, joints):
    """A revolute jaw at the end was the arm's last joint; one chosen as the flange still is."""
    row = [joint(f"j{i}", "revolute", f"l{i}", f"l{i + 1}", LIMIT) for i in range(5)]
    path = written(urdf(*row, joint(name, "revolute", "l5", "l6", LIMIT)))
    assert read_urdf_arm(path).n == joints
    assert read_urdf_arm(path, flange="l6").n == 6


@pytest.mark.parametrize(("base", "flange"), [("l5", "l6"), ("l2", "l1"), (None, "l6")])
def test_starts_and_sliding_joints_are_listed_whatever_is_chosen(written, base, flange):
    row = [joint(f"j{i}", "revolute" if i else "prismatic", f"l{i}", f"l{i + 1}", LIMIT) for i in range(6)]
    with pytest.raises(ConfigurationError, match=r"`base=`: l1; prismatic joints are not supported: j0"):
        read_urdf_arm(written(urdf(*row)), base, flange)
