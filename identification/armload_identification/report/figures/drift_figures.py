"""The figures of an arm's drift: a control chart per joint and quantity, and friction over time in operation."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Final

import numpy as np
from matplotlib.figure import Figure

from armload_identification.float_array import FloatArray
from armload_identification.pipeline.arm_drift import ArmDrift, Monitored
from armload_identification.pipeline.warm_up import WARM_S, WarmUp
from armload_identification.report.figures.control_chart_axes import draw_control_chart, draw_run_axis, run_places
from armload_identification.report.figures.figure_style import BLUE, VERMILION, WIDE_IN, styled_figure
from armload_identification.report.figures.joint_figures import ticks

_ROW_IN: Final = 1.25
_ENDS_IN: Final = 0.6
_COLUMNS: Final = 3
_HEADINGS: Final = {
    Monitored.FRICTION: "change of friction, N m",
    Monitored.GAIN: "change of gain, %",
    Monitored.RESIDUAL: "relative residual",
}


def charts_drawing(drift: ArmDrift, names: Sequence[str]) -> Figure:
    """The control charts of all joints, one row per joint."""
    place, dated = run_places(drift.began, len(drift.runs))
    height_in = _ROW_IN * len(names) + _ENDS_IN
    with styled_figure(WIDE_IN, height_in) as drawing:
        # Fixed: a computed layout takes longer than the rest of the report.
        drawing.subplots_adjust(0.1, 0.4 / height_in, 0.97, 1.0 - 0.2 / height_in, 0.3, 0.3)
        grid = drawing.subplots(len(names), len(Monitored), sharex=True, squeeze=False)
        for joint, name in enumerate(names):
            for column, quantity in enumerate(Monitored):
                axes = grid[joint][column]
                draw_control_chart(axes, place, drift.charts[quantity][joint], partial(_drawn, quantity=quantity))
                if joint == 0:
                    axes.set_title(_HEADINGS[quantity], fontsize=7.5)
                if column == 0:
                    axes.set_ylabel(f"{joint + 1} {name}")
                if joint == len(names) - 1:
                    draw_run_axis(axes, place, dated=dated)
        return drawing


def _drawn(values: FloatArray, quantity: Monitored) -> FloatArray:
    """A chart's values in the units of the drawing."""
    if quantity is Monitored.RESIDUAL:
        return np.asarray(np.exp(values))
    return 100.0 * values if quantity is Monitored.GAIN else values


def warm_up_drawing(warming: WarmUp, names: Sequence[str]) -> Figure:
    """Friction over time in operation, one panel per joint."""
    rows = -(-len(names) // _COLUMNS)
    elapsed_s = np.linspace(0.0, max(float(warming.at_work_s.max()), WARM_S), 100)
    with styled_figure(WIDE_IN, 1.6 * rows, "constrained") as drawing:
        grid = drawing.subplots(rows, _COLUMNS, squeeze=False)
        for joint, axes in enumerate(grid.ravel()):
            if joint >= len(names):
                axes.set_axis_off()
                continue
            axes.plot(warming.at_work_s / 60.0, warming.friction_nm[:, joint], "o", color=BLUE, markersize=2.0)
            if warming.slope_nm[joint] != 0.0:
                axes.plot(elapsed_s / 60.0, warming.curve_nm(elapsed_s)[:, joint], color=VERMILION)
            axes.set_title(f"{joint + 1} {names[joint]}", fontsize=7.5)
            axes.set_ylabel("friction, N m")
            axes.yaxis.set_major_locator(ticks(4))
            axes.set_xlabel("minutes in operation")
        return drawing
