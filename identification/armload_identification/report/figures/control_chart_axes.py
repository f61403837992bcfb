"""A control chart in the axes of a figure: limits, runs, levels and changes over the days."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import Final

import numpy as np
from matplotlib.axes import Axes

from armload_identification.float_array import FloatArray
from armload_identification.report.figures.figure_style import BLUE, INK, LIGHT_GREY, VERMILION
from armload_identification.report.figures.joint_figures import ticks
from armload_identification.verdict.control_limits import ControlChart

DATES: Final = 4
"""Most tick labels below a chart."""
_DAY_S: Final = 86_400.0
_FEW_DAYS: Final = 3.0
_FEW_MINUTES: Final = 5.0 / 1440.0


def days_of(moments: Sequence[datetime]) -> FloatArray:
    """(r,) positions of moments on an axis, in days.

    Args:
        moments: With time zone.
    """
    return np.array([moment.timestamp() / _DAY_S for moment in moments])


def draw_control_chart(
    axes: Axes, place: FloatArray, chart: ControlChart, drawn: Callable[[FloatArray], FloatArray]
) -> None:
    """Draw limits in grey, runs, levels in black, and outliers and changes in orange.

    Args:
        place: (r,) positions of the runs along the axis.
        drawn: Converts the chart's values to those of the axis.
    """
    known = np.isfinite(chart.values)
    low, high = drawn(-chart.limit[known]), drawn(chart.limit[known])
    axes.fill_between(place[known], low, high, color=LIGHT_GREY, linewidth=0)
    axes.plot(place[known], drawn(chart.level[known]), color=INK, linewidth=0.7, drawstyle="steps-post")
    loud = chart.outside | chart.alone
    for rows, color, marker in ((known & ~loud, BLUE, "o"), (known & loud, VERMILION, "D")):
        axes.plot(place[rows], drawn(chart.values[rows]), marker, color=color, markersize=2.8)
    for change in chart.changes:
        axes.axvline(place[change.index], color=VERMILION, linewidth=0.8, dashes=(3.0, 2.0))
    axes.yaxis.set_major_locator(ticks(4))


def draw_dates(axes: Axes, place: FloatArray) -> None:
    """Label an axis of days with dates, with times if there are few days; a single moment is the middle of a day.

    Args:
        place: (r,) days, from `days_of`.
    """
    if np.ptp(place) == 0.0:
        axes.set_xlim(place[0] - 0.5, place[0] + 0.5)
    axes.xaxis.set_major_locator(ticks(DATES))
    span = np.ptp(place)
    text = "{:%d %b\n%Y}" if span >= _FEW_DAYS else "{:%d %b\n%H:%M}" if span >= _FEW_MINUTES else "{:%d %b\n%H:%M:%S}"
    axes.xaxis.set_major_formatter(lambda day, _position: text.format(datetime.fromtimestamp(day * _DAY_S, UTC)))


def run_places(began: Sequence[datetime], runs: int) -> tuple[FloatArray, bool]:
    """Positions of runs on an axis, and whether these are dates; runs of one commissioning state the same moment.

    Args:
        began: Start of each run; empty if unknown.
        runs: Number of runs.
    """
    return (days_of(began), True) if len(set(began)) > 1 else (np.arange(1.0, runs + 1.0), False)


def draw_run_axis(axes: Axes, place: FloatArray, *, dated: bool) -> None:
    """Label an axis of `run_places` with dates, or with the numbers of the runs."""
    if dated:
        draw_dates(axes, place)
    else:
        axes.set_xlabel("run")
        axes.xaxis.set_major_locator(ticks(DATES))
