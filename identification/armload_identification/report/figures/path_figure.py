"""The picture of an excitation: the motion of joints and tool, and the use of every limit."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PatchCollection
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from armload_identification.excitation.design_envelope import Envelope
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.excitation.geometry.workspace import Box, Workspace
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ExcitationError
from armload_identification.report.figures.figure_style import (
    BLUE,
    FIGURE_STYLE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PURPLE,
    SKY_BLUE,
    VERMILION,
)

COLORS: Final = (BLUE, VERMILION, GREEN, PURPLE, ORANGE, SKY_BLUE, INK)
_FORBIDDEN: Final = "#e8d5d0"
_WALL: Final = "#a0522d"
_STYLE_OF_FIGURE: Final = {
    "font.size": 8.0,
    "axes.titlesize": 8.5,
    "axes.titlelocation": "left",
    "lines.linewidth": 1.1,
}
_SAMPLES: Final = 600
_POSTURES: Final = 8
_NEAREST: Final = 5
_SIZE_IN: Final = (11.7, 8.3)


def path_figure(excitation: Excitation, envelope: Envelope, joint_names: tuple[str, ...]) -> Figure:
    """One page about an excitation.

    Left: every joint's position over a period, with its limits. Right: the flange's path and some postures from the
    side and from above, with the obstacles. Below: use of each limit, and the criterion over the iterations of the
    design.

    Args:
        excitation: The motion; its history is drawn if the file has it.
        envelope: The limits of the design.
        joint_names: Names of the joints, from the base to the flange.

    Raises:
        ExcitationError: numbers of joints that differ.
    """
    if not excitation.trajectory.n == envelope.n == len(joint_names):
        raise ExcitationError(
            f"a trajectory of {excitation.trajectory.n} joints, limits of {envelope.n}, {len(joint_names)} names"
        )
    with matplotlib.style.context(["default", FIGURE_STYLE, _STYLE_OF_FIGURE]):
        figure = Figure(figsize=_SIZE_IN, layout="constrained")
        page = figure.add_gridspec(1, 2, width_ratios=(0.4, 0.6))
        left, right = figure.add_subfigure(page[0]), figure.add_subfigure(page[1])
        rows = left.subplots(excitation.trajectory.n, sharex=True, squeeze=False)[:, 0]
        _draw_joints(rows, excitation.trajectory, envelope, joint_names)
        side, above, use, history = right.subplots(2, 2, height_ratios=(0.6, 0.4)).flat
        _draw_tool({side: (0, 2), above: (0, 1)}, excitation.trajectory, envelope.workspace)
        side.set_title("from the side: x to the right, z up, m")
        above.set_title("from above: x to the right, y up, m")
        _draw_limit_use(use, excitation.trajectory, envelope, joint_names)
        _draw_history(history, excitation)
    return figure


def _draw_joints(
    rows: NDArray[np.object_], trajectory: FourierTrajectory, envelope: Envelope, names: tuple[str, ...]
) -> None:
    """Position over a period, a row per joint."""
    times_s = np.linspace(0.0, trajectory.period_s, _SAMPLES)
    position = trajectory.evaluate(times_s).position_rad
    limits = envelope.joints
    for i, axes in enumerate(rows):
        low, high = limits.position_min_rad[i], limits.position_max_rad[i]
        room = 0.08 * (high - low)
        for edge, outside in ((low, low - room), (high, high + room)):
            axes.axhspan(edge, outside, color=_FORBIDDEN, linewidth=0.0)
        axes.plot(times_s, position[:, i], color=COLORS[i % len(COLORS)])
        axes.set_ylim(low - room, high + room)
        axes.set_xlim(0.0, trajectory.period_s)
        axes.set_title(f"{names[i]}, rad", pad=2.0)
    rows[-1].set_xlabel(f"time in the period of {trajectory.period_s:g} s, s")


def _draw_tool(planes: Mapping[Axes, tuple[int, int]], trajectory: FourierTrajectory, workspace: Workspace) -> None:
    """Path of the flange, postures with their spheres, and obstacles, projected onto planes.

    A plane is given by the base's axes that point to the right and up.
    """
    every = _SAMPLES // _POSTURES
    positions = trajectory.evaluate(np.linspace(0.0, trajectory.period_s, _SAMPLES)).position_rad
    joints_m = workspace.chain.forward(positions)[:, :, :3, 3]
    centres_m = [workspace.centres(q) for q in positions[::every]]
    for axes, plane in planes.items():
        points = joints_m[:, :, plane]
        for box in workspace.boxes:
            axes.add_patch(Polygon(_outline(box, plane), closed=True, facecolor=_FORBIDDEN, edgecolor=GREY))
            x, y = box.pose[list(plane), 3]
            axes.text(x, y, box.name, ha="center", va="center", color=GREY)
        for centres, joints in zip(centres_m, points[::every], strict=True):
            axes.plot(*np.vstack([np.zeros(2), joints]).T, color=GREY, linewidth=0.8, alpha=0.7)
            spheres = zip(centres[:, plane], workspace.spheres, strict=True)
            circles = [Circle(center, sphere.radius_m) for center, sphere in spheres if sphere.link > 0]
            axes.add_collection(PatchCollection(circles, color=GREY, alpha=0.06, linewidths=0.0))
        axes.plot(*points[:, -1].T, color=COLORS[0], linewidth=1.6)
        axes.plot(*points[0, -1], marker="o", color=COLORS[0], markersize=4)
        axes.autoscale_view()
        axes.set_aspect("equal", adjustable="datalim")
        _draw_walls(axes, workspace, plane)


def _draw_walls(axes: Axes, workspace: Workspace, plane: tuple[int, int]) -> None:
    """Half-spaces seen edge-on, as lines with their names."""
    for wall in workspace.half_spaces:
        normal = wall.normal[list(plane)]
        if abs(np.linalg.norm(normal) - 1.0) > 1e-6:
            continue
        foot = wall.offset_m * normal
        axes.axline((foot[0], foot[1]), (foot[0] - normal[1], foot[1] + normal[0]), color=_WALL, linewidth=1.4)
        x, y = foot - 0.04 * normal
        axes.text(x, y, wall.name, ha="center", va="top", color=_WALL, clip_on=True)


def _outline(box: Box, plane: tuple[int, int]) -> FloatArray:
    """(M, 2) corners of a box's projection, in order."""
    signs = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3)).reshape(3, -1).T
    shadow = ((signs * box.size_m) @ box.pose[:3, :3].T + box.pose[:3, 3])[:, plane]
    return np.asarray(shadow[ConvexHull(shadow).vertices])


def _draw_limit_use(axes: Axes, trajectory: FourierTrajectory, envelope: Envelope, names: tuple[str, ...]) -> None:
    """Use of every limit in per cent, and the clearances."""
    joints, room = envelope.joints, envelope.margins(trajectory)
    limits = {
        "range": (room.position_rad, 0.5 * (joints.position_max_rad - joints.position_min_rad)),
        "speed": (room.velocity_rad_s, joints.velocity_max_rad_s),
        "accel.": (room.acceleration_rad_s2, joints.acceleration_max_rad_s2),
        "jerk": (room.jerk_rad_s3, joints.jerk_max_rad_s3),
        "torque": (room.torque_nm, envelope.torque.available_nm),
    }
    share = np.array([100.0 * (1.0 - left / limit) for left, limit in limits.values()]).T
    axes.imshow(share, cmap="Blues", vmin=0.0, vmax=160.0, aspect="auto")
    for (row, column), value in np.ndenumerate(share):
        axes.text(column, row, f"{value:.0f}", ha="center", va="center", color=INK)
    axes.set_xticks(range(len(limits)), list(limits))
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(length=0.0)
    axes.grid(visible=False)
    axes.set_title("maximum use of each limit, %")
    if room.clearance_m:
        nearest = sorted(room.clearance_m.items(), key=lambda item: item[1])[:_NEAREST]
        text = "minimum clearance, m\n" + "\n".join(f"{name}: {value:.3f}" for name, value in nearest)
        axes.set_xlabel(text, loc="left", linespacing=1.4)


def _draw_history(axes: Axes, excitation: Excitation) -> None:
    """The criterion over the iterations."""
    if excitation.history:
        axes.semilogy(np.arange(1, len(excitation.history) + 1), excitation.history, color=COLORS[0])
        axes.set_xlabel("iteration of the best start")
    cost = excitation.design.get("cost")
    final = f", finally {cost:.4g}" if isinstance(cost, float) else ""
    axes.set_title(f"{excitation.design.get('criterion', 'criterion')}{final}")
