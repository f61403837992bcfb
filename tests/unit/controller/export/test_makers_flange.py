"""Load data in the maker's flange frame: wrong axes are refused, and turned ones are those of the right frame."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.chain_from_urdf import read_urdf_arm
from armload_controller.config.robot import shipped_robots
from armload_controller.control_errors import ExportError
from armload_controller.export.format_registry import LOAD_DATA, exporter
from armload_controller.export.load_data.makers_flange import has_makers_axes, in_makers_flange, outward_axis
from armload_controller.export.load_data.ur import export_ur
from armload_identification.model.chain import Chain, pose_from_xyz_rpy, rpy_rad
from armload_identification.model.payload import PARAMETER_NAMES

UR10E = Path(__file__).parents[4].parent / "shared" / "data" / "ur10e" / "ur10e.urdf"
EE_LINK_TO_TOOL0 = (-np.pi / 2, 0.0, -np.pi / 2)  # x of ee_link points out of the flange, z of tool0
LIFTED = pose_from_xyz_rpy((0.0, 0.0, 0.1), (0.0, 0.0, 0.0))


def reflanged(subject, flange, **changes):
    """The same body with another flange frame of the arm, `flange` in the present one."""
    chain = Chain(
        subject.chain.placement, subject.chain.axis, subject.chain.flange @ flange, subject.chain.gravity_m_s2
    )
    model = subject.payload.model.transformed(np.linalg.inv(flange))
    return replace(subject, chain=chain, payload=replace(subject.payload, model=model), **changes)


def numbers_of(text):
    """The numbers outside of comments."""
    lines = [line for line in text.splitlines() if not line.lstrip().startswith(("#", ";", "!", "//", "namespace"))]
    return [float(number) for number in re.findall(r"(?<![\w.])-?\d+(?:\.\d*)?(?:e-?\d+)?(?!\w)", "\n".join(lines))]


@pytest.fixture
def right(make_subject):
    """The er50 with its flange 0.1 m in front of the wrist."""
    return reflanged(make_subject("er50"), LIFTED)


@pytest.mark.parametrize("robot", shipped_robots())
def test_shipped_arms_have_the_makers_axes(make_subject, robot):
    assert has_makers_axes(make_subject(robot).chain)


@pytest.mark.parametrize("export_format", sorted(LOAD_DATA))
def test_wrong_axes_are_refused_and_turned_ones_written(right, export_format):
    export, frame = exporter(export_format), np.linalg.inv(pose_from_xyz_rpy((0, 0, 0), EE_LINK_TO_TOOL0))
    wrong = reflanged(right, frame)
    with pytest.raises(
        ExportError, match=r"out of the arm, is \(1, 0, 0\) in the flange frame .*`flange_rpy_rad=`"
    ) as no:
        export(wrong)
    turned = replace(wrong, flange_rpy_rad=EE_LINK_TO_TOOL0)
    for file, text in export(right).items():
        np.testing.assert_allclose(numbers_of(export(turned)[file]), numbers_of(text), rtol=0.0, atol=1e-12)
    assert "-1.5708 0 -1.5708 (x along -y)" in str(no.value)


def test_a_direction_that_the_kinematics_do_not_tell_is_said(make_subject):
    """A flange in the er50's wrist, which is 0.1 m behind its own."""
    frame = pose_from_xyz_rpy((0, 0, -0.1), (0, 0, 0)) @ np.linalg.inv(pose_from_xyz_rpy((0, 0, 0), EE_LINK_TO_TOOL0))
    with pytest.raises(ExportError, match=r"is \(1, 0, 0\) or \(-1, 0, 0\) in the flange frame .* do not tell which"):
        export_ur(reflanged(make_subject("er50"), frame))


def test_only_quarter_turns_about_z_are_offered(right):
    frame = pose_from_xyz_rpy((0, 0, 0), (0.0, np.pi / 2, 0.0))
    with pytest.raises(ExportError) as refusal:
        export_ur(reflanged(right, frame))
    assert str(refusal.value).count("(x along ") == 4


def test_z_into_the_arm_is_refused(right):
    with pytest.raises(ExportError, match=r"is \(0, 0, -1\) in the flange frame"):
        export_ur(reflanged(right, np.diag([1.0, -1.0, -1.0, 1.0])))


def test_a_rotation_to_wrong_axes_is_refused(right):
    with pytest.raises(ExportError, match=r"turned by `flange_rpy_rad=` 0 1\.5 0"):
        export_ur(replace(right, flange_rpy_rad=(0.0, 1.5, 0.0)))


def test_a_tools_frame_is_refused(right):
    with pytest.raises(ExportError, match=r"lies 30\.0 mm beside the last joint's axis, so it is a tool's frame"):
        export_ur(reflanged(right, pose_from_xyz_rpy((0.03, 0.0, 0.2), (0.0, 0.0, 0.0))))


def test_what_is_determined_turns_too(right):
    known = np.array([name not in {"ixx", "ixy"} for name in PARAMETER_NAMES])
    subject = replace(right, payload=replace(right.payload, determined=known), flange_rpy_rad=(0.0, 0.0, 1.5708))
    found = in_makers_flange(subject)
    assert [name for name, is_known in zip(PARAMETER_NAMES, found.determined, strict=True) if not is_known] == [
        "iyy",
        "ixy",
    ]
    skewed = in_makers_flange(replace(subject, flange_rpy_rad=(0.0, 0.0, 0.3)))
    assert [name for name, is_known in zip(PARAMETER_NAMES, skewed.determined, strict=True) if not is_known] == [
        "ixx",
        "iyy",
        "ixy",
    ]


@pytest.mark.skipif(not UR10E.exists(), reason="no ../shared/data/ur10e")
def test_the_ur10es_tool0_is_right_and_its_ee_link_is_not(make_subject):
    arms = {flange: read_urdf_arm(UR10E, flange=flange) for flange in ("tool0", "ee_link")}
    assert {flange: has_makers_axes(arm.chain) for flange, arm in arms.items()} == {"tool0": True, "ee_link": False}
    right = replace(make_subject("ur10e"), chain=arms["tool0"].chain)
    frame = np.linalg.inv(arms["tool0"].chain.flange) @ arms["ee_link"].chain.flange
    wrong = reflanged(right, frame)
    with pytest.raises(ExportError, match=r"is \(1, 0, 0\)"):
        export_ur(wrong)
    rpy = tuple(rpy_rad(frame[:3, :3].T))
    last = [
        export_ur(subject)["ur10e_payload.script"].splitlines()[-1]
        for subject in (right, replace(wrong, flange_rpy_rad=rpy))
    ]
    assert last[0] == last[1]


def test_the_text_says_what_was_checked(make_subject, right):
    """With the flange at the wrist the kinematics do not tell where out is."""
    subject = make_subject("er50")
    placement = subject.chain.placement.copy()
    placement[-1, :3, 3] = 0.0
    at_wrist = Chain(placement, subject.chain.axis, np.eye(4), subject.chain.gravity_m_s2)
    for shown, checked in ((right, True), (replace(subject, chain=at_wrist), False)):
        text = " ".join(export_ur(shown)["er50_payload.script"].replace("#", "").split())
        assert ("the last joint's axis, out of the flange, as in" in text) is checked
        assert ("no kinematics state it: that z points out of the flange, that x and y" in text) is not checked


@pytest.mark.parametrize(("tilt_rad", "right_axes"), [(0.9e-3, True), (1.1e-3, False), (-1.1e-3, False)])
def test_z_may_be_a_milliradian_off_the_axis(right, tilt_rad, right_axes):
    assert has_makers_axes(reflanged(right, pose_from_xyz_rpy((0, 0, 0), (tilt_rad, 0, 0))).chain) is right_axes


@pytest.mark.parametrize(("beside_m", "refused"), [(0.9e-3, False), (1.1e-3, True)])
def test_a_flange_may_be_a_millimetre_beside_the_axis(right, beside_m, refused):
    subject = reflanged(right, pose_from_xyz_rpy((0.0, beside_m, 0.0), (0, 0, 0)))
    if refused:
        with pytest.raises(ExportError, match=r"lies 1\.1 mm beside"):
            in_makers_flange(subject)
    else:
        in_makers_flange(subject)


@pytest.mark.parametrize(("off_rad", "exact"), [(0.9e-4, True), (1.1e-4, False)])
def test_angles_of_four_digits_are_quarter_turns(right, off_rad, exact):
    before, after = (
        in_makers_flange(replace(right, flange_rpy_rad=rpy)).model.center_of_mass_m
        for rpy in (None, (0.0, 0.0, np.pi / 2 + off_rad))
    )
    x, y, z = before
    assert (after.tolist() == [y, -x, z]) is exact
    np.testing.assert_allclose(after, [y, -x, z], atol=1e-4)


def crossing(angle_rad, flange_m):
    """Two axes that cross in the origin at an angle, and a flange along the last one, z."""
    first = (np.sin(angle_rad), 0.0, np.cos(angle_rad))
    pose = pose_from_xyz_rpy((0.0, 0.0, flange_m - 0.5), (0, 0, 0))
    return Chain.from_origins([(0, 0, 0), (0, 0, 0.5)], np.zeros((2, 3)), [first, (0, 0, 1)], pose, (0, 0, -9.81))


@pytest.mark.parametrize(
    ("angle_rad", "flange_m", "axis", "known"),
    [
        (1.1e-3, 0.1, (0, 0, 1), True), (0.9e-3, 0.1, (0, 0, 1), False), (1.0, -0.1, (0, 0, -1), True),
        (1.0, 1.1e-3, (0, 0, 1), True), (1.0, 0.9e-3, (0, 0, 1), False), (1.0, -0.9e-3, (0, 0, 1), False),
    ],
)  # fmt: skip
def test_out_is_from_the_wrist_to_the_flange_if_both_are_known(angle_rad, flange_m, axis, known):
    found, is_known = outward_axis(crossing(angle_rad, flange_m))
    np.testing.assert_allclose(found, axis, atol=1e-12)
    assert is_known is known


def test_one_axis_alone_has_no_wrist():
    chain = Chain.from_origins([(0, 0, 0.3)], [(0, 0, 0)], [(0, 0, 1)], LIFTED, (0, 0, -9.81))
    assert outward_axis(chain)[1] is False
    assert has_makers_axes(chain)


def test_a_rotated_element_is_determined_if_all_that_enters_it_is(right):
    def lacking(name, rpy):
        known = np.array([each != name for each in PARAMETER_NAMES])
        found = in_makers_flange(replace(right, payload=replace(right.payload, determined=known), flange_rpy_rad=rpy))
        return [each for each, is_known in zip(PARAMETER_NAMES, found.determined, strict=True) if not is_known]

    assert lacking("izz", (0.0, 0.0, 0.3)) == ["izz"]
    assert lacking("ixz", (0.0, 0.0, 0.3)) == ["ixz", "iyz"]
    assert lacking("ixz", (0.0, 0.0, np.pi / 2)) == ["iyz"]
