"""`armload calibrate`: one arm from all its runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.options import RobotArgument
from armload_controller.cli.output.findings_output import ReportOption
from armload_controller.cli.output.output_files import require_drawable, require_folder
from armload_controller.cli.screen import PLAIN, Screen


def calibrate_arm_command(
    robot: RobotArgument,
    runs: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUNS...",
            help="A table of runs (CSV: recording, mounting, mass_kg, payload), or recordings that contain what the "
            "arm carried",
        ),
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="Calibration file (TOML) to write.")],
    report: ReportOption = None,
    screen: Screen = PLAIN,
) -> None:
    """Calibrate an arm from all its runs: gains, body and friction, with intervals.

    Runs of any motion and from any day, unloaded and loaded. A weighed payload (mass_kg in the table) sets the scale of
    the gains; leave the mass of the others empty. Runs with the same payload, mounted once, share a name in the column
    mounting. Runs that cannot be used or that contradict the others are left out and reported.
    """
    from armload_controller.analysis import robot_calibration
    from armload_controller.config.robot import load_robot

    arm = load_robot(robot)
    require_folder(output, "calibration")
    require_drawable(report)
    with screen.track("reading and calibrating", total=200) as done:
        result = robot_calibration.calibrate(arm, runs, progress=lambda count, _total: done(count))
    screen.result_table(result.table())
    screen.result_table(result.runs_table())
    screen.remarks("left out", (f"{name}: {reason}" for name, reason in result.calibration.left_out))
    screen.remarks("warning", result.calibration.warnings)
    screen.write(result.save, output)
    screen.write(result.report, report)
    screen.document(result.to_dict, {"calibration": output, "report": report})
