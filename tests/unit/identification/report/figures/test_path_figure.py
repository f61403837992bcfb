"""The figure of an excitation: drawn only from its arguments."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.transforms import Bbox

from armload_controller.config.robot import Robot, load_robot
from armload_identification.excitation.fourier import Excitation
from armload_identification.excitation.geometry.workspace import Box, HalfSpace
from armload_identification.identification_errors import ExcitationError, ReportError
from armload_identification.model.chain import pose_from_xyz_rpy
from armload_identification.report.figures.figure_file import write_figure
from armload_identification.report.figures.path_figure import (
    _draw_history,
    _draw_limit_use,
    _draw_walls,
    _outline,
    path_figure,
)


@pytest.fixture(scope="module")
def arm() -> Robot:
    return load_robot("er50")


@pytest.fixture(scope="module")
def excitation(arm) -> Excitation:
    return arm.excitations["identification"]


@pytest.fixture(scope="module")
def figure(arm, excitation) -> Figure:
    return path_figure(excitation, arm.envelope(0.1, 0.7, 0.8), arm.joint_names)


def axes_titled(figure: Figure, words: str):
    found = [axes for axes in figure.get_axes() if words in axes.get_title(loc="left")]
    assert len(found) == 1
    return found[0]


def test_every_joint_is_drawn_over_a_period_between_its_limits(figure, arm, excitation):
    for i, name in enumerate(arm.joint_names):
        axes = axes_titled(figure, name)
        times_s, position = axes.lines[0].get_data()
        assert times_s[-1] == excitation.trajectory.period_s
        np.testing.assert_allclose(position, excitation.trajectory.evaluate(times_s).position_rad[:, i])
        low, high = axes.get_ylim()
        limits = arm.envelope(0.1, 0.7, 0.8).joints
        assert low < limits.position_min_rad[i] < position.min()
        assert position.max() < limits.position_max_rad[i] < high


def test_the_tools_path_and_what_is_in_the_way_are_seen_from_two_sides(figure, arm, excitation):
    chain = arm.chain
    times_s = np.linspace(0.0, excitation.trajectory.period_s, 600)
    flange = np.array([chain.forward(q)[-1, :3, 3] for q in excitation.trajectory.evaluate(times_s).position_rad])
    for words, plane in (("from the side", [0, 2]), ("from above", [0, 1])):
        axes = axes_titled(figure, words)
        longest = max((line for line in axes.lines), key=lambda line: len(line.get_xdata()))
        np.testing.assert_allclose(np.array(longest.get_data()).T, flange[:, plane], atol=1e-9)
        assert sum(len(found.get_paths()) for found in axes.collections if isinstance(found, PatchCollection)) > 50
        assert sum(isinstance(patch, Polygon) for patch in axes.patches) == 1
        named = {text.get_text() for text in axes.texts}
        assert named == ({"pedestal", "floor"} if words == "from the side" else {"pedestal"})


def test_the_share_of_every_limit_is_stated(figure, arm, excitation):
    axes = axes_titled(figure, "use of each limit")
    envelope = arm.envelope(0.1, 0.7, 0.8)
    room = envelope.margins(excitation.trajectory)
    reported = np.array([int(text.get_text()) for text in axes.texts]).reshape(6, 5)
    np.testing.assert_allclose(
        reported[:, 1], 100.0 * (1.0 - room.velocity_rad_s / envelope.joints.velocity_max_rad_s), atol=0.5
    )
    np.testing.assert_allclose(reported[:, 4], 100.0 * (1.0 - room.torque_nm / envelope.torque.available_nm), atol=0.5)
    name, distance_m = min(room.clearance_m.items(), key=lambda item: item[1])
    assert f"{name}: {distance_m:.3f}" in axes.get_xlabel()


def test_the_history_is_drawn_where_there_is_one(figure, arm, excitation):
    axes = axes_titled(figure, "a-optimal")
    assert len(axes.lines[0].get_xdata()) == len(excitation.history) > 100
    bare = path_figure(Excitation(excitation.trajectory, 1), arm.envelope(0.1, 0.7, 0.8), arm.joint_names)
    assert not axes_titled(bare, "criterion").lines


def test_another_arm_is_refused(arm, excitation):
    with pytest.raises(ExcitationError, match="a trajectory of 6 joints, limits of 6, 2 names"):
        path_figure(excitation, arm.envelope(0.1, 0.7, 0.8), arm.joint_names[:2])


@pytest.mark.parametrize("name", ["x.toml", "x"])
def test_a_picture_of_no_format_is_refused_with_the_formats_there_are(tmp_path, name):
    with pytest.raises(ReportError, match=rf"{name}: .* expected one of .*pdf, .*png, .*svg"):
        write_figure(tmp_path / name, Figure(), 20)
    assert list(tmp_path.iterdir()) == []


def test_joints_are_at_the_left_of_the_page_and_four_pictures_at_the_right_with_their_labels(figure, arm):
    np.testing.assert_allclose(figure.get_size_inches(), [11.7, 8.3])
    figure.draw_without_rendering()
    page = figure.bbox
    names = (*arm.joint_names, "from the side", "from above", "use of each limit", "a-optimal")
    boxes = [axes_titled(figure, name).get_tightbbox() for name in names]
    for box in boxes:
        assert page.x0 <= box.x0 < box.x1 <= page.x1
        assert page.y0 <= box.y0 < box.y1 <= page.y1
    for one, other in itertools.combinations(boxes, 2):
        shared = Bbox.intersection(one, other)
        assert shared is None or min(shared.width, shared.height) < 1.0, "no label is covered"
    rows, (side, above, use, history) = boxes[:-4], boxes[-4:]
    assert max(box.x1 for box in rows) <= 0.4 * page.width <= side.x0
    assert [box.y0 for box in rows] == sorted((box.y0 for box in rows), reverse=True)
    for beside, lower in (((side, above), (side, use)), ((use, history), (above, history))):
        assert beside[0].x1 <= beside[1].x0
        assert lower[1].y1 <= lower[0].y0


def test_the_room_beyond_a_joints_range_is_marked(figure, arm, excitation):
    limits = arm.envelope(0.1, 0.7, 0.8).joints
    for i, name in enumerate(arm.joint_names):
        axes = axes_titled(figure, name)
        low, high = limits.position_min_rad[i], limits.position_max_rad[i]
        room = 0.08 * (high - low)
        assert axes.get_ylim() == pytest.approx((low - room, high + room))
        assert axes.get_xlim() == (0.0, excitation.trajectory.period_s)
        bands = [patch.get_extents().transformed(axes.transData.inverted()).intervaly for patch in axes.patches]
        np.testing.assert_allclose(np.sort(np.sort(bands), axis=0), [[low - room, low], [high, high + room]], atol=1e-6)
        assert axes.get_title(loc="left") == f"{name}, rad"
        assert len(axes.lines[0].get_xdata()) == 600
    assert len({axes_titled(figure, name).lines[0].get_color() for name in arm.joint_names}) == 6
    assert axes_titled(figure, arm.joint_names[-1]).get_xlabel().startswith("time in the period of")


def test_eight_postures_are_drawn_with_their_spheres_from_base_to_flange(figure, arm, excitation):
    axes = axes_titled(figure, "from the side")
    postures = [line for line in axes.lines if line.get_alpha() == 0.7]
    assert len(postures) == 8
    assert {line.get_linewidth() for line in postures} == {0.8}
    times_s = np.linspace(0.0, excitation.trajectory.period_s, 600)[::75]
    positions = excitation.trajectory.evaluate(times_s).position_rad
    for line, q in zip(postures, positions, strict=True):
        frames = np.vstack([np.zeros((1, 3)), arm.chain.forward(q)[:, :3, 3]])
        np.testing.assert_allclose(line.get_xydata(), frames[:, [0, 2]], atol=1e-9)
    path, begin = (line for line in axes.lines if line.get_color() == "#0072b2")
    assert (path.get_linewidth(), begin.get_marker(), begin.get_markersize()) == (1.6, "o", 4)
    np.testing.assert_allclose(begin.get_xydata()[0], path.get_xydata()[0])
    spheres = [found for found in axes.collections if isinstance(found, PatchCollection)]
    carried = [sphere for sphere in arm.envelope(0.1, 0.7, 0.8).workspace.spheres if sphere.link > 0]
    assert [len(found.get_paths()) for found in spheres] == [len(carried)] * 8
    assert {found.get_alpha() for found in spheres} == {0.06}
    assert axes.get_aspect() == 1.0


def test_only_walls_seen_edge_on_are_drawn_with_their_names_behind_them():
    axes = Figure().subplots()
    wall = HalfSpace("wall", np.array([0.6, 0.0, 0.8]), 0.5, (1,))
    aslant = HalfSpace("aslant", np.array([0.6, 0.8, 0.0]), 0.5, (1,))
    _draw_walls(axes, SimpleNamespace(half_spaces=(wall, aslant)), (0, 2))
    (line,), (name,) = axes.lines, axes.texts
    assert line.get_xy1() == pytest.approx((0.3, 0.4))
    assert line.get_xy2() == pytest.approx((0.3 - 0.8, 0.4 + 0.6))
    assert line.get_linewidth() == 1.4
    assert (name.get_text(), name.get_position()) == ("wall", pytest.approx((0.3 - 0.024, 0.4 - 0.032)))
    assert name.get_clip_on()


def test_an_obstacle_has_the_outline_of_its_box():
    pose = pose_from_xyz_rpy([1.0, 2.0, 3.0], [0.0, 0.0, np.pi / 2.0])
    corners = _outline(Box("box", pose, np.array([0.4, 0.2, 0.6]), (1,)), (0, 1))
    assert sorted(np.round(corners, 9).tolist()) == [[0.9, 1.8], [0.9, 2.2], [1.1, 1.8], [1.1, 2.2]]


def test_the_use_of_limits_is_a_share_of_each_and_the_five_least_clearances_are_listed():
    """Half of a range of 2 rad is left of 1 rad; of speed a quarter of 4 rad/s, and so on."""
    axes, one = Figure().subplots(), np.ones(1)
    room = SimpleNamespace(
        position_rad=0.4 * one,
        velocity_rad_s=one,
        acceleration_rad_s2=-one,
        jerk_rad_s3=0.0 * one,
        torque_nm=9.0 * one,
        clearance_m={name: 0.1 * number for number, name in enumerate("gfedcba")},
    )
    limits = SimpleNamespace(
        position_min_rad=-one,
        position_max_rad=one,
        velocity_max_rad_s=4.0 * one,
        acceleration_max_rad_s2=10.0 * one,
        jerk_max_rad_s3=one,
    )
    envelope = SimpleNamespace(joints=limits, margins=lambda _: room, torque=SimpleNamespace(available_nm=10.0 * one))
    _draw_limit_use(axes, None, envelope, ("elbow",))
    assert [text.get_text() for text in axes.texts] == ["60", "75", "110", "100", "10"]
    assert [text.get_position() for text in axes.texts] == [(column, 0) for column in range(5)]
    assert axes.images[0].get_clim() == (0.0, 160.0)
    assert [label.get_text() for label in axes.get_xticklabels()] == ["range", "speed", "accel.", "jerk", "torque"]
    assert [label.get_text() for label in axes.get_yticklabels()] == ["elbow"]
    assert axes.get_xlabel().splitlines()[1:] == ["g: 0.000", "f: 0.100", "e: 0.200", "d: 0.300", "c: 0.400"]


def test_the_history_begins_with_its_first_iteration_and_the_title_ends_with_the_cost():
    axes = Figure().subplots()
    _draw_history(axes, SimpleNamespace(history=(9.0, 4.0), design={"criterion": "d-optimal", "cost": 3.14159}))
    assert axes.lines[0].get_xydata().tolist() == [[1.0, 9.0], [2.0, 4.0]]
    assert axes.get_title() == "d-optimal, finally 3.142"
    assert axes.get_yscale() == "log"
