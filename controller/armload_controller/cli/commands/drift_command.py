"""`armload drift`: an arm's friction, gains and residual over its runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.options import CalibrationOption, RobotArgument
from armload_controller.cli.output.findings_output import ReportOption
from armload_controller.cli.output.output_files import require_drawable
from armload_controller.cli.screen import PLAIN, Screen

_PARTS = 100
"""Steps of the progress."""


def watch_drift(
    robot: RobotArgument,
    runs: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUNS...",
            help="Recordings of any motion, or a table of them (CSV: recording, mounting, mass_kg, recorded)",
        ),
    ],
    calibration: CalibrationOption = None,
    report: ReportOption = None,
    picture: Annotated[
        Path | None, typer.Option(help="The control charts as a picture (.png, .svg, .pdf) to write.")
    ] = None,
    screen: Screen = PLAIN,
) -> None:
    """Monitor a calibrated arm's friction, gains and residual over days: what changed, and since when.

    Runs of any motion, empty or with any payload; an unknown payload is fitted. Recordings without a start time are
    used in the given order, or give a table with the column recorded.
    """
    from armload_controller.analysis.robot_drift import drift
    from armload_controller.config.robot import load_robot

    arm = load_robot(robot)
    require_drawable(report)
    require_drawable(picture, "picture", "--picture")
    with screen.track("reading", total=_PARTS) as done:
        history = drift(arm, runs, calibration=calibration, progress=lambda count, total: done(_PARTS * count // total))
    screen.result_table(history.table())
    screen.remarks("left out", (f"{name}: {reason}" for name, reason in history.left_out))
    if not history.drift.began:
        screen.step("note: not every recording has a start time, so they are used in the given order")
    screen.write(history.report, report)
    screen.write(history.picture, picture)
    screen.document(history.to_dict, {"report": report, "picture": picture})
