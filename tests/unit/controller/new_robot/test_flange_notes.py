"""The note on a flange whose axes are not those of robot controllers."""

import numpy as np

from armload_controller.config.chain_from_urdf import read_urdf_arm
from armload_controller.new_robot.flange_notes import flange_notes

JOINTS = "".join(
    f'<joint name="joint_{i + 1}" type="revolute"><parent link="link_{i}"/><child link="link_{i + 1}"/>'
    f'<axis xyz="{axis}"/><origin xyz="0 0 0.2"/></joint><link name="link_{i + 1}"/>'
    for i, axis in enumerate(("0 0 1", "0 1 0", "0 1 0", "0 0 1"))
)
FIXED = (
    '<joint name="{0}_joint" type="fixed"><parent link="link_4"/><child link="{0}"/>'
    '<origin xyz="0 0 0.1" rpy="{1}"/></joint><link name="{0}"/>'
)


def arm(tmp_path, flange, *fixed):
    text = "".join(FIXED.format(name, rpy) for name, rpy in fixed)
    (tmp_path / "arm.urdf").write_text(f'<robot name="arm"><link name="link_0"/>{JOINTS}{text}</robot>')
    return read_urdf_arm(tmp_path / "arm.urdf", flange=flange)


def test_a_flange_with_z_out_needs_no_note(tmp_path):
    assert flange_notes(arm(tmp_path, "tool0", ("tool0", "0 0 1"))) == []


def test_another_is_named_with_the_rotation_to_tool0(tmp_path):
    ee_link = ("ee_link", f"0 {-np.pi / 2} 0")
    (note,) = flange_notes(arm(tmp_path, "ee_link", ee_link, ("tool0", "0 0 0")))
    assert "will require --flange-rpy-rad 0 1.5708 0, the axes of tool0; or choose --flange tool0" in note
    (alone,) = flange_notes(arm(tmp_path, "ee_link", ee_link))
    assert alone.endswith("will require --flange-rpy-rad")
