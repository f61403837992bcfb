"""The report of an arm's drift: what changed, the control charts, the warm-up curve and the runs, in one HTML file."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC
from pathlib import Path
from typing import Final

from markupsafe import Markup

from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.pipeline.arm_drift import ArmDrift
from armload_identification.report.figures.drift_figures import charts_drawing, warm_up_drawing
from armload_identification.report.figures.svg import inline_svg
from armload_identification.report.page import rendered, write_page

_TEMPLATE: Final = "drift.html.j2"


def write_drift_report(
    path: Path,
    drift: ArmDrift,
    calibration: ArmCalibration,
    *,
    calibration_name: str,
    robot: str,
    description: str,
    names: Sequence[str],
    advice: str,
    left_out: Sequence[tuple[str, str]],
    armload_version: str,
) -> None:
    """Write the report.

    Args:
        path: The file; an existing one is replaced.
        drift: The arm over its runs.
        calibration: The calibration with which the runs were compared.
        calibration_name: Its file.
        robot: Name of the arm.
        description: Description of the arm, in one line.
        names: Names of its joints.
        advice: Recommended action.
        left_out: Name and reason of runs that could not be used.
        armload_version: Version of the program.

    Raises:
        ReportError: the file cannot be written.
    """
    warming = drift.warming
    days = [f"{moment:%Y-%m-%d}" for moment in drift.began]
    span = "" if not days else f" of {days[0]}" if days[0] == days[-1] else f" from {days[0]} to {days[-1]}"
    write_page(
        path,
        rendered(
            _TEMPLATE,
            robot=robot,
            description=description,
            calibration=calibration_name,
            origin=calibration.origin,
            span=span,
            armload_version=armload_version,
            out_of_date=drift.out_of_date,
            findings=[found.text for found in drift.findings],
            advice=advice,
            left_out=left_out,
            runs=drift.runs,
            began=[f"{moment.astimezone(UTC):%Y-%m-%d %H:%M} UTC" for moment in drift.began]
            or [run.recorded or "\N{EN DASH}" for run in drift.runs],
            charts=Markup(
                inline_svg(
                    charts_drawing(drift, names),
                    "charts",
                    f"Friction, gain and residual of {len(names)} joints over {len(drift.runs)} runs.",
                )
            ),
            warming=None
            if warming is None
            else Markup(inline_svg(warm_up_drawing(warming, names), "warm-up", "Friction against time in operation.")),
        ),
    )
