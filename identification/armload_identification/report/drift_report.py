"""The report of an arm's drift: what changed, the control charts, the warm-up curve and the runs, in one HTML file."""

from __future__ import annotations

from datetime import UTC
from pathlib import Path

from markupsafe import Markup

from armload_identification.report.compared_runs import ComparedRuns
from armload_identification.report.figures.drift_figures import charts_drawing, warm_up_drawing
from armload_identification.report.figures.svg import inline_svg
from armload_identification.report.page import rendered, write_page


def write_drift_report(path: Path, content: ComparedRuns) -> None:
    """Write the report.

    Args:
        path: The file; an existing one is replaced.
        content: The arm over its runs.

    Raises:
        ReportError: the file cannot be written.
    """
    drift, names = content.drift, content.joint_names
    days = [f"{moment:%Y-%m-%d}" for moment in drift.began]
    span = "" if not days else f" of {days[0]}" if days[0] == days[-1] else f" from {days[0]} to {days[-1]}"
    began = [f"{moment.astimezone(UTC):%Y-%m-%d %H:%M} UTC" for moment in drift.began]
    title = f"Friction, gain and residual of {len(names)} joints over {len(drift.runs)} runs."
    warming = None
    if drift.warming is not None:
        curve = warm_up_drawing(drift.warming, names)
        warming = Markup(inline_svg(curve, "warm-up", "Friction against time in operation."))
    page = rendered(
        "drift.html.j2",
        content=content,
        drift=drift,
        span=span,
        began=began or [run.recorded or "\N{EN DASH}" for run in drift.runs],
        charts=Markup(inline_svg(charts_drawing(drift, names), "charts", title)),
        warming=warming,
    )
    write_page(path, page)
