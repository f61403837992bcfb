"""A URDF as ROBOT: ROS 2 bags of an arm that has a URDF but no robot file; the torque is Pinocchio's."""

import re

import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from armload_identification.files.payload_file import read_payload
from tests.urdf_simulation import PinocchioArm

START_NS = 1_700_000_000_000_000_000
NAMES = [f"j{i}" for i in range(1, 7)]
MASS_KG, CENTER_M = 1.5, [0.03, -0.02, 0.06]


def _joint(name, kind, parent, child, xyz="0 0 0", rpy="0 0 0"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="0 0 1"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><limit lower="-2.5" upper="2.5" velocity="2" effort="100"/></joint>'
    )


URDF = (
    '<robot name="six">'
    + "".join(
        f'<link name="{name}"><inertial><origin xyz="0 0 0.1"/><mass value="{mass}"/>'
        '<inertia ixx="0.02" iyy="0.02" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        for name, mass in zip(["base", "l1", "l2", "l3", "l4", "l5", "l6"], [9, 5, 6, 4, 2, 1, 0.5], strict=True)
    )
    + '<link name="tool0"/><link name="left"/>'
    + _joint("j1", "revolute", "base", "l1", "0 0 0.3")
    + _joint("j2", "revolute", "l1", "l2", "0 0 0", "1.5708 0 0")
    + _joint("j3", "revolute", "l2", "l3", "0.4 0 0")
    + _joint("j4", "continuous", "l3", "l4", "0.1 0 0", "1.5708 0 0")
    + _joint("j5", "revolute", "l4", "l5", "0 0 0.4", "-1.5708 0 0")
    + _joint("j6", "revolute", "l5", "l6", "0 0 0", "1.5708 0 0")
    + _joint("end", "fixed", "l6", "tool0", "0 0 0.1")
    + _joint("finger", "prismatic", "tool0", "left")
    + "</robot>"
)


def record(path, run, names, columns, plugin):
    """A bag of JointState messages with the joints in another order, and a finger."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    state, head, stamp = (
        store.types[f"{package}/msg/{name}"]
        for package, name in (
            ("sensor_msgs", "JointState"),
            ("std_msgs", "Header"),
            ("builtin_interfaces", "Time"),
        )
    )
    with Writer(path, version=8, storage_plugin=plugin) as writer:
        connection = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for k, time_s in enumerate(run.time_s):
            when_ns = START_NS + round(1e9 * time_s)
            position, effort = (np.append(values[k], 0.0)[columns] for values in (run.position_rad, run.torque_nm))
            header = head(stamp(when_ns // 10**9, when_ns % 10**9), "")
            message = state(header, list(names), position, np.zeros(0), effort)
            writer.write(connection, when_ns, store.serialize_cdr(message, state.__msgtype__))


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    """A URDF and two bags of it, one in each storage format."""
    folder = tmp_path_factory.mktemp("urdf")
    (folder / "six.urdf").write_text(URDF)
    arm = PinocchioArm(folder / "six.urdf", NAMES, "base", "tool0")
    lower, upper, speed = np.full(6, -2.5), np.full(6, 2.5), np.full(6, 2.0)
    runs = arm.runs(lower, upper, speed, MASS_KG, CENTER_M, 0.002 * np.eye(3), seed=1)
    columns = [6, 2, 0, 5, 1, 4, 3]
    names = [[*NAMES, "finger"][i] for i in columns]
    for load, run, plugin in zip(("loaded", "unloaded"), runs, StoragePlugin, strict=True):
        record(folder / load, run, names, columns, plugin)
    return folder


def test_one_bag_alone_lacks_the_other_run(armload, desk):
    result = armload("identify", desk / "six.urdf", "--loaded", desk / "loaded")
    assert re.search("unloaded|calibrat", str(result.exception))


def pair(desk):
    return "--loaded", desk / "loaded", "--unloaded", desk / "unloaded"


@pytest.mark.long
def test_a_payload_is_found_with_joints_by_name(armload, desk):
    out = desk / "payload.toml"
    result = armload("identify", desk / "six.urdf", *pair(desk), "--output", out)
    assert result.exit_code == 0, result.output
    assert "not part of this arm: finger" in result.output
    found = read_payload(out)
    assert found.model.mass_kg == pytest.approx(MASS_KG, rel=0.005)
    np.testing.assert_allclose(found.model.center_of_mass_m, CENTER_M, atol=0.003)
    judged = armload("validate", desk / "six.urdf", out, *pair(desk))
    # The same runs agree, of course, and confirm nothing.
    assert judged.exit_code == 4, judged.output
    assert "cannot confirm it" in judged.output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["er50", "--flange", "tool0"], "select the arm in a URDF; ROBOT 'er50' is none"),
        (["none.urdf"], "none.urdf: no such file, and no shipped robot"),
        (["six.urdf", "--flange", "hand"], "`flange=` is 'hand'.*one of its links: base.*tool0"),
    ],
)
def test_what_is_given_makes_one_arm(armload, desk, monkeypatch, words, message):
    monkeypatch.chdir(desk)
    monkeypatch.setenv("COLUMNS", "300")
    result = armload("identify", *words, *pair(desk))
    assert result.exit_code != 0
    assert re.search(message, result.output + str(result.exception), re.DOTALL)


def test_other_commands_say_what_a_urdf_lacks(armload, desk):
    result = armload("commission", desk / "six.urdf")
    assert "make a robot file of it with `armload init`" in str(result.exception)
