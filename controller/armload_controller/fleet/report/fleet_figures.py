"""The figures of many arms: control charts of a suspicious one, and a small strip per quantity of every arm."""

from __future__ import annotations

from typing import Final

import numpy as np

from armload_controller.fleet.arm_runs import UNITS
from armload_controller.fleet.fleet_review import FigureReview
from armload_identification.float_array import FloatArray
from armload_identification.report.figures.control_chart_axes import days_of, draw_control_chart, draw_dates
from armload_identification.report.figures.figure_style import BLUE, INK, LIGHT_GREY, VERMILION, styled_figure
from armload_identification.report.figures.svg import inline_svg
from armload_identification.report.page import rendered

_WIDE_IN: Final = 2.6
_HIGH_IN: Final = 1.9


def chart_figure(figure: FigureReview, name: str, title: str) -> str:
    """The control chart of a quantity; the level of the twins is dashed.

    Args:
        figure: The quantity.
        name: Id, unique on the page.
        title: Description of the figure.

    Returns:
        An `svg` element.
    """
    with styled_figure(_WIDE_IN, _HIGH_IN) as drawing:
        # Fixed: a computed layout takes longer than the rest of the report.
        drawing.subplots_adjust(0.17, 0.24, 0.97, 0.86)
        axes = drawing.subplots()
        unit, scale = UNITS[figure.quantity.kind]
        place = days_of(figure.recorded)

        def drawn(values: FloatArray) -> FloatArray:
            return scale * (figure.center + values)

        draw_control_chart(axes, place, figure.chart, drawn)
        if figure.twins is not None:
            axes.axhline(scale * figure.twins, color=INK, linewidth=0.7, dashes=(4.0, 3.0))
        draw_dates(axes, place)
        axes.set_title(f"{figure.quantity}{', ' if unit else ''}{unit}", fontsize=7.5)
        return inline_svg(drawing, name, title)


def strip(figure: FigureReview) -> str:
    """The same chart in the size of a word: limits, runs, and outliers.

    Returns:
        An `svg` element.
    """
    chart, days = figure.chart, days_of(figure.recorded)
    low, high = float(np.min(-chart.limit)), float(np.max(chart.limit))
    bottom, top = min(low, float(chart.values.min())), max(high, float(chart.values.max()))
    along = (days - days[0]) / np.ptp(days) if np.ptp(days) > 0.0 else np.full(days.size, 0.5)
    up = (top - np.array([high, low, *chart.values])) / max(top - bottom, np.finfo(float).tiny)
    marks = zip(along.tolist(), up[2:].tolist(), (chart.outside | chart.alone).tolist(), strict=True)
    colors = {"limits": LIGHT_GREY, "usual": BLUE, "loud": VERMILION}
    return rendered("strip.svg.j2", __package__, figure=figure, limits=up[:2].tolist(), marks=marks, colors=colors)
