"""The figure of an excitation: drawn only from its arguments."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from armload_controller.config.robot import Robot, load_robot
from armload_identification.excitation.fourier import Excitation
from armload_identification.identification_errors import ExcitationError, ReportError
from armload_identification.report.figures.figure_file import write_figure
from armload_identification.report.figures.path_figure import path_figure


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
