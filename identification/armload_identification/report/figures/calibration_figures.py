"""The figures of a calibration's report: gains with intervals, and the friction of every run against its day."""

from __future__ import annotations

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.report.figures.control_chart_axes import draw_run_axis
from armload_identification.report.figures.figure_style import (
    BLUE,
    INK,
    LIGHT_GREY,
    NARROW_IN,
    VERMILION,
    WIDE_IN,
    styled_figure,
)
from armload_identification.report.figures.joint_figures import ticks
from armload_identification.report.figures.svg import inline_svg


def gains_figure(change: FloatArray, half_width_95: FloatArray, determined: list[bool], title: str) -> str:
    """Change of every joint's gain from nominal, with its interval.

    Args:
        change: (n,) ratio of calibrated to nominal gain, minus 1.
        half_width_95: (n,) half width of its 95 % interval.
        determined: Whether the runs determine each gain.
        title: Description of the figure.

    Returns:
        An `svg` element.
    """
    joints = np.arange(1, change.size + 1)
    with styled_figure(WIDE_IN, 2.1, "constrained") as figure:
        axes = figure.add_subplot()
        axes.axhline(0.0, color=INK, linewidth=0.7)
        for joint, middle, width, known in zip(joints, 100.0 * change, 100.0 * half_width_95, determined, strict=True):
            color = BLUE if known else VERMILION
            axes.errorbar(joint, middle, width, color=color, marker="o", markersize=4, capsize=4, linewidth=1.4)
        axes.set_xticks(joints, [f"joint {joint}" for joint in joints])
        axes.set_xlim(0.5, change.size + 0.5)
        axes.set_ylabel("gain against nominal, %")
        axes.yaxis.set_major_locator(ticks(5))
        axes.grid(axis="x", visible=False)
        return inline_svg(figure, "gains", title)


def drift_figure(place: FloatArray, change: FloatArray, usual: float, joint: int, title: str, *, dated: bool) -> str:
    """Change of a joint's friction over the runs.

    Args:
        place: (r,) position of every run on the axis, from `run_places`.
        change: (r,) change of the friction at half the greatest speed, N m.
        usual: Expected standard deviation, N m.
        joint: Joint, from 0.
        title: Description of the figure.
        dated: Whether the positions are dates.

    Returns:
        An `svg` element.
    """
    with styled_figure(NARROW_IN, 1.6, "constrained") as figure:
        axes = figure.add_subplot()
        axes.axhspan(-2.0 * usual, 2.0 * usual, color=LIGHT_GREY, linewidth=0)
        axes.axhline(0.0, color=INK, linewidth=0.7)
        axes.plot(place, change, "o", color=BLUE, markersize=3.5)
        draw_run_axis(axes, place, dated=dated)
        axes.set_ylabel("friction, N m")
        axes.yaxis.set_major_locator(ticks(4))
        return inline_svg(figure, f"drift-{joint + 1}", title)
