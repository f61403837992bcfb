"""The report of a watch: payload of an arm over time, events, and its friction, in one HTML file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from armload_identification.float_array import FloatArray
from armload_identification.report.figures.figure_style import BLUE, INK, VERMILION, WIDE_IN, styled_figure
from armload_identification.report.figures.svg import inline_svg
from armload_identification.report.page import rendered, write_page

_HIGH_IN = 3.0
_MOST_MOMENTS: Final = 2000
"""Of a longer watch every k-th moment is drawn."""
_WIDEST: Final = 0.25
"""An interval wider than this share of the figure's range is not drawn ..."""
_NARROWEST: Final = 4.0
"""... unless it is narrower than this many times the narrowest interval: at the beginning they are very wide."""


@dataclass(frozen=True, eq=False)
class WatchHistory:
    """History of a watch.

    Attributes:
        robot: Name of the arm.
        description: Description of the arm, in one line.
        watched: The recording, or the bus.
        time_s: (N,) moments.
        mass_kg: (N,) estimates.
        half_width_95_kg: (N,) half widths of their intervals.
        known: (N,) True once the joints have moved enough for an estimate.
        events: Time in s, text, and whether it is drawn in the figure (grasped, dropped, changed), of each event.
        joints: Cells of each joint's row at the end: `name`; `moving_s`, time during which it moved fast enough for an
            estimate; `friction_nm`, its friction minus the calibration's, at half its greatest speed; `usual_nm`,
            standard deviation of that difference between runs; `missing`, number of cycles without its response, 0 for
            a recording.
        drift: What is assumed of the drift of the gains; empty if no mass was determined.
    """

    robot: str
    description: str
    watched: str
    time_s: FloatArray
    mass_kg: FloatArray
    half_width_95_kg: FloatArray
    known: NDArray[np.bool_]
    events: Sequence[tuple[float, str, bool]]
    joints: Sequence[Mapping[str, Any]]
    drift: str = ""


def write_watch_report(path: Path, history: WatchHistory) -> None:
    """Write the report; an existing file is replaced.

    Raises:
        ReportError: the file cannot be written.
    """
    title = "Mass that the arm carried over time, with its 95 % interval, and events."
    drawing = Markup(watch_svg(history, "mass", title) if _drawn(history).any() else "")
    far = [joint for joint in history.joints if abs(joint["friction_nm"]) > 3.0 * joint["usual_nm"]]
    write_page(path, rendered("watch.html.j2", history=history, drawing=drawing, far=far))


def watch_svg(history: WatchHistory, name: str, title: str) -> str:
    """Mass with its interval over time, and a line at each marked event.

    Args:
        name: Id, unique on the page.
        title: Description of the figure.

    Returns:
        An `svg` element.
    """
    step = max(1, len(history.time_s) // _MOST_MOMENTS)
    time_s, mass, width = (x[::step] for x in (history.time_s, history.mass_kg, history.half_width_95_kg))
    shown = np.where(_drawn(history)[::step], mass, np.nan)
    with styled_figure(WIDE_IN, _HIGH_IN, "constrained") as figure:
        axes = figure.add_subplot()
        axes.axhline(0.0, color=INK, linewidth=0.7)
        axes.fill_between(time_s, shown - width, shown + width, color=BLUE, alpha=0.25, linewidth=0)
        axes.plot(time_s, shown, color=BLUE, linewidth=1.4)
        for when_s, text, marked in history.events:
            if marked:
                axes.axvline(when_s, color=VERMILION, linewidth=0.9)
                axes.annotate(
                    text, (when_s, 1.0), (3.0, -2.0), xycoords=("data", "axes fraction"),
                    textcoords="offset points", rotation=90, va="top", fontsize=7, color=VERMILION,
                )  # fmt: skip
        axes.set_xlabel("time, s")
        axes.set_ylabel("mass, kg")
        if time_s.size:
            axes.set_xlim(float(time_s[0]), max(float(time_s[-1]), float(time_s[0]) + 1.0))
        return inline_svg(figure, name, title)


def _drawn(history: WatchHistory) -> NDArray[np.bool_]:
    """(N,) Moments with a known mass whose interval is narrow enough for the figure, which includes zero."""
    if not history.known.any():
        return history.known
    range_kg = float(np.ptp(np.append(history.mass_kg[history.known], 0.0)))
    widest_kg = max(_WIDEST * range_kg, _NARROWEST * float(history.half_width_95_kg[history.known].min()))
    return np.asarray(history.known & (history.half_width_95_kg < widest_kg))
