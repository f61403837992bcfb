"""Limits of one joint, and the torque that may be added to it."""

import math

import msgspec
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.config.tables.joint_table import JointTable

JOINT = load_robot("prbt").tables.joints[1]


def joint(**changes):
    values = {name: getattr(JOINT, name) for name in JointTable.__struct_fields__}
    return JointTable(**values | changes)


@pytest.mark.parametrize(("least", "greatest", "refused"), [(1.0, 1.1, False), (1.0, 1.0, True), (1.1, 1.0, True)])
def test_positions_lie_between_two_different_limits(least, greatest, refused):
    if not refused:
        assert joint(position_min_rad=least, position_max_rad=greatest).position_max_rad == greatest
        return
    with pytest.raises(ValueError, match=rf"position_min_rad = {least} is not below .* = {greatest}: exchange them"):
        joint(position_min_rad=least, position_max_rad=greatest)


@pytest.mark.parametrize(
    ("rated_nm", "permille", "axis_nm", "added_nm"),
    [(100.0, 1500, 150.0, 120.0), (100.0, 1100, 110.0, 110.0), (None, 1500, math.inf, 120.0)],
)
def test_no_more_torque_is_added_than_joint_and_drive_allow(rated_nm, permille, axis_nm, added_nm):
    drive = msgspec.structs.replace(JOINT.drive, rated_torque_nm=rated_nm, max_torque_permille=permille)
    found = joint(torque_max_nm=120.0, drive=drive)
    assert (found.axis_torque_max_nm, found.added_torque_max_nm) == (axis_nm, added_nm)
    assert joint(drive=None).axis_torque_max_nm == math.inf
