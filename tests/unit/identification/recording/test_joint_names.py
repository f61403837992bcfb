"""Joints found in the names that other programs give them."""

import pytest

from armload_identification.recording.joint_names import JointNames, words_of

pytestmark = pytest.mark.pure

UR = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("wrist_1_joint", ["wrist", "1", "joint"]),
        ("J2 Position", ["j", "2", "position"]),
        ("elbowTorque", ["elbow", "torque"]),
        ("UR10/elbowX.pos", ["ur", "10", "elbow", "x", "pos"]),
        ("", []),
    ],
)
def test_words_end_at_signs_numbers_and_capitals(name, words):
    assert words_of(name) == words


@pytest.mark.parametrize(
    ("name", "joint", "part", "whole"),
    [
        ("shoulder_pan_joint", 0, (0, 3), True),
        ("ur10/wrist_1.pos", 3, (2, 4), False),
        ("actual elbow", 2, (1, 2), False),
        ("lift", 1, (0, 1), False),
        ("Wrist2JointVelocity", 4, (0, 3), True),
        ("arm elbow_joint elbow", 2, (1, 3), True),
        ("elbow elbow", 2, (1, 2), False),
    ],
)
def test_the_shortest_end_that_no_other_joint_has_is_enough(name, joint, part, whole):
    found = JointNames(UR).find(words_of(name))
    assert found == (joint, *part, whole)


@pytest.mark.parametrize("name", ["wrist", "joint", "1", "3_joint", "shoulder", "gripper", "", "elbow_lift"])
def test_what_several_joints_share_and_a_bare_number_name_none(name):
    assert JointNames(UR).find(words_of(name)) is None


def test_a_longer_name_wins_over_a_part_of_another():
    names = JointNames(["arm_yaw", "yaw_arm_tilt"])
    assert names.find(["arm", "tilt"])[0] == 1
    assert names.find(["arm", "yaw"])[0] == 0


@pytest.mark.parametrize(
    ("names", "numbered"),
    [(["joint_1", "joint_2"], True), (["A1", "A2", "E1"], False), (UR, False), (["joint_1"], True)],
)
def test_names_that_differ_by_numbers_only(names, numbered):
    assert JointNames(names).numbered is numbered


def test_numbered_joints_are_found_by_name_and_number_together():
    names = JointNames([f"prbt_joint_{k}" for k in range(1, 7)])
    assert names.find(words_of("joint_3 [rad]"))[0] == 2
    assert names.find(words_of("prbt_joint_6"))[3]
    assert names.find(["3"]) is None
    assert names.find(["joint"]) is None


def test_a_single_joint_keeps_all_of_its_ends():
    names = JointNames(["left_elbow_joint"])
    assert names.find(["joint"])[0] == 0
    assert names.find(["elbow", "joint"])[0] == 0


def test_letters_alone_are_no_end():
    names = JointNames(["axis_a", "axis_b"])
    assert names.find(["a"]) is None
    assert names.find(["axis", "a"])[0] == 0


def test_places_are_those_of_joints_that_are_named_once_or_exactly():
    names = JointNames(UR)
    assert names.places(["elbow", "wrist_1", "time"]) == {2: 0, 3: 1}
    assert names.places(["target elbow", "actual elbow"]) == {}, "which of them?"
    assert names.places(["target elbow", "elbow_joint"]) == {2: 1}, "the exact name decides"
    assert names.places([]) == {}


@pytest.mark.parametrize(
    ("names", "text", "joint"),
    [
        (["a_x", "b_x"], "b", None),
        (["arm_x", "leg_x"], "leg", 1),
        (["arm_x", "leg_x"], "x", None),
        (["one_arm_x", "two_arm_x"], "two", 1),
        (["one_arm_x", "two_arm_x"], "two_arm", 1),
        (["one_arm_x", "two_arm_x"], "arm_x", None),
        (["x", "x_y"], "x", 0),
        (["left_x_1", "right_x_1"], "right_x", 1),
        (["7_elbow", "8_elbow"], "8_elbow", 1),
        (["7_elbow", "8_elbow"], "8", None),
    ],
)
def test_words_that_all_joints_end_with_may_be_missing(names, text, joint):
    found = JointNames(names).find(words_of(text))
    assert (None if found is None else found[0]) == joint


def test_a_name_of_many_words_costs_as_much_as_it_has_words():
    class Words(list):
        looked_up = 0

        def __getitem__(self, key):
            self.looked_up += 1
            return super().__getitem__(key)

    words = Words(["word"] * 500)
    assert JointNames(UR).find(words) is None
    assert words.looked_up <= 3 * len(words)
