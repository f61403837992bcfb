"""The elements of a URDF: joints and links, the way up, numbers and poses, and what is no tree."""

from __future__ import annotations

import math
from xml.etree import ElementTree

import numpy as np
import pytest

from armload_controller.config.urdf_tree import is_urdf, read_urdf_tree
from armload_controller.control_errors import ConfigurationError

pytestmark = pytest.mark.pure


def joint(name, parent, child, kind="revolute", inside=""):
    return f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{inside}</joint>'


def robot(*parts, links=("a", "b", "c"), name=' name="arm"'):
    return f"<robot{name}>{''.join(f'<link name={chr(34)}{link}{chr(34)}/>' for link in links)}{''.join(parts)}</robot>"


CHAIN = joint("first", "a", "b"), joint("second", "b", "c", "fixed")


@pytest.fixture
def read(tmp_path):
    """Reads a text as a file."""

    def read(text, name="arm.urdf"):
        (tmp_path / name).write_text(text)
        return read_urdf_tree(tmp_path / name)

    return read


def test_joints_and_links_are_in_the_files_order_and_know_what_is_above_them(read):
    tree = read(robot(*CHAIN))
    assert (tree.name, list(tree.links)) == ("arm", ["a", "b", "c"])
    assert [(j.name, j.kind, j.parent, j.child, j.mimics) for j in tree.joints] == [
        ("first", "revolute", "a", "b", None),
        ("second", "fixed", "b", "c", None),
    ]
    assert tree.above["c"].name == "second"
    assert "a" not in tree.above
    assert [j.name for j in tree.upwards("c")] == ["second", "first"]
    assert list(tree.upwards("a")) == []
    assert read(robot(*CHAIN, name="")).name == "arm", "of the file"
    assert len(tree.sha256) == 64
    assert tree.sha256 != read(robot(*CHAIN) + "\n").sha256


def test_a_ring_has_no_end_but_the_way_up_has(read):
    tree = read(robot(joint("first", "a", "b"), joint("second", "b", "a")))
    assert [j.name for j in tree.upwards("a")] == ["second", "first"]


@pytest.mark.parametrize(
    ("kind", "inside", "turns"),
    [
        ("revolute", "", True),
        ("continuous", "", True),
        ("prismatic", "", False),
        ("fixed", "", False),
        ("", "", False),
        ("revolute", '<mimic joint="x"/>', False),
        ("continuous", "<mimic/>", False),
    ],
)
def test_only_independent_revolute_joints_are_an_arms(read, kind, inside, turns):
    assert read(robot(joint("j", "a", "b", kind, inside))).joints[0].turns is turns


@pytest.mark.parametrize(
    ("name", "grips"),
    [
        ("finger_1", True),
        ("leftGripperJoint", True),
        ("RHand", True),
        ("THUMB", True),
        ("hand_wrist_roll", False),
        ("gripper_yaw", False),
        ("shoulder", False),
        ("handle", False),
        ("joint_7", False),
    ],
)
def test_a_jaw_is_told_by_whole_words(read, name, grips):
    assert read(robot(joint(name, "a", "b"))).joints[0].grips is grips


def test_numbers_are_finite_and_as_many_as_they_must_be(read):
    tree = read(robot(*CHAIN))
    limit = ElementTree.fromstring('<limit lower=" -1.5 " upper="inf" effort="1 2" velocity="fast" xyz="1 2 3"/>')
    assert tree.number("j", "limit", limit, "lower") == -1.5
    assert math.isnan(tree.number("j", "limit", limit, "friction"))
    assert math.isnan(tree.number("j", "limit", None, "lower"))
    for key, text in (("upper", "inf"), ("effort", "1 2"), ("velocity", "fast")):
        with pytest.raises(ConfigurationError, match=f"j, limit {key} is '{text}': a finite number"):
            tree.number("j", "limit", limit, key)
    assert tree.numbers("j", "axis", limit, "xyz", (0.0, 0.0, 0.0)) == (1.0, 2.0, 3.0)
    assert tree.numbers("j", "axis", None, "xyz", (4.0, 5.0, 6.0)) == (4.0, 5.0, 6.0)
    with pytest.raises(ConfigurationError, match=r"j, axis lower is ' -1.5 ': 3 finite numbers"):
        tree.numbers("j", "axis", limit, "lower", (0.0, 0.0, 0.0))


def test_an_origin_is_a_pose_by_fixed_axes_and_the_identity_without_one(read):
    tree = read(robot(*CHAIN))
    np.testing.assert_array_equal(tree.pose("j", ElementTree.fromstring("<joint/>")), np.eye(4))
    element = ElementTree.fromstring(f'<joint><origin xyz="1 2 3" rpy="0 0 {math.pi / 2}"/></joint>')
    pose = tree.pose("j", element)
    np.testing.assert_allclose(pose @ [1.0, 0.0, 0.0, 1.0], [1.0, 3.0, 3.0, 1.0], atol=1e-12)
    only_turned = ElementTree.fromstring(f'<joint><origin rpy="{math.pi / 2} 0 0"/></joint>')
    np.testing.assert_allclose(tree.pose("j", only_turned) @ [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 1.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("no xml", "XML is .*expand a xacro file first"),
        ("<sdf/>", "root element is 'sdf'"),
        ('<robot xmlns:x="http://ros.org/wiki/xacro"><x:if value="1"/></robot>', "xacro is 'if': no macros"),
        (robot('<joint type="fixed"/>'), "joint 1, name is missing"),
        (robot(joint("j", "a", "b"), '<joint name="" type="fixed"/>'), "joint 2, name is missing"),
        (robot('<joint name="j"><child link="a"/></joint>'), "joint j, parent is missing"),
        (robot('<joint name="j"><parent link="a"/><child/></joint>'), "joint j, child is missing"),
        (robot(joint("j", "a", "b"), joint("k", "c", "b")), "joint k, child is 'b': .*j is already its parent"),
        (robot(joint("j", "a", "z")), "joint j, link is 'z': one of the <link> elements"),
        (robot(joint("j", "z", "a")), "joint j, link is 'z': one of the <link> elements"),
    ],
)
def test_what_is_no_tree_of_links_is_refused_by_name(read, text, error):
    with pytest.raises(ConfigurationError, match=error):
        read(text)


def test_a_file_is_a_urdf_if_it_begins_with_a_tag(tmp_path):
    path = tmp_path / "x"
    for content, is_one in (
        (b"<robot/>", True),
        (b"\xef\xbb\xbf  \n<?xml version='1.0'?><robot/>", True),
        (b"[robot]\nname = '<'", False),
        (b"", False),
    ):
        path.write_bytes(content)
        assert is_urdf(path) is is_one
    assert not is_urdf(tmp_path / "missing")
    assert not is_urdf(tmp_path)
    with pytest.raises(ConfigurationError, match="expected a URDF"):
        read_urdf_tree(tmp_path / "missing")
