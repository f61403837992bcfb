"""Figure of a payload's mass over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from armload_identification.report.figures.figure_style import BLUE, LIGHT_GREY, styled_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def mass_figure(marks: Sequence[tuple[float, float, float]], gaps: Sequence[tuple[float, float]], title: str) -> Figure:
    """Mass with its 95 % interval over time.

    Args:
        marks: Time in s, mass in kg and half width of its interval in kg.
        gaps: Start and end in s of times without an estimate.
        title: Title of the figure.
    """
    with styled_figure(9.0, 3.6, "constrained") as figure:
        axes = figure.add_subplot()
        if marks:
            time_s, mass_kg, half_kg = zip(*marks, strict=True)
            axes.errorbar(time_s, mass_kg, yerr=half_kg, fmt="o", color=BLUE, capsize=3, label="mass, 95 % interval")
        for number, (start_s, end_s) in enumerate(gaps):
            axes.axvspan(start_s, end_s, color=LIGHT_GREY, lw=0, label="no estimate" if number == 0 else None)
        axes.set_xlabel("time since the first movement, s")
        axes.set_ylabel("mass, kg")
        axes.set_title(title, fontsize=10)
        if marks or gaps:
            axes.legend(fontsize=8)
        return figure
