"""Joints in messages."""

import numpy as np
import pytest

from armload_identification.verdict.joint_words import named_joints, numbered_joints


@pytest.mark.parametrize(
    ("joints", "text"),
    [
        ((1,), "joint 2"),
        ((0, 4), "joints 1 and 5"),
        ((3, 4, 5), "joints 4 to 6"),
        ((0, 3, 5), "joints 1, 4 and 6"),
        ((3, 4), "joints 4 and 5"),
    ],
)
def test_one_joint_or_several(joints, text):
    assert numbered_joints(np.isin(np.arange(6), joints)) == text


def test_a_remark_stays_with_its_joint():
    assert named_joints(["1 (12 %)", "3 (up to 9 %)"]) == "joints 1 (12 %) and 3 (up to 9 %)"
