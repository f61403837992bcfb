"""Figure of a payload's mass over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from armload_identification.report.figures.figure_style import BLUE

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def mass_figure(marks: Sequence[tuple[float, float, float]], gaps: Sequence[tuple[float, float]], title: str) -> Figure:
    """Mass with its 95 % interval over time.

    Args:
        marks: Time in s, mass in kg and half width of its interval in kg.
        gaps: Start and end in s of times without an estimate.
        title: Title of the figure.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 3.6), layout="constrained")
    axis = figure.subplots()
    if marks:
        time_s, mass_kg, half_kg = zip(*marks, strict=True)
        axis.errorbar(time_s, mass_kg, yerr=half_kg, fmt="o", color=BLUE, capsize=3, label="mass, 95 % interval")
    for number, (start_s, end_s) in enumerate(gaps):
        axis.axvspan(start_s, end_s, color="#dddddd", lw=0, label="no estimate" if number == 0 else None)
    axis.set_xlabel("time since the first movement, s")
    axis.set_ylabel("mass, kg")
    axis.set_title(title, fontsize=10)
    axis.grid(alpha=0.3)
    if marks or gaps:
        axis.legend(fontsize=8)
    return figure
