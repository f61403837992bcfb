"""`armload calibrate`: one arm from all its runs."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.options import RobotArgument
from armload_controller.cli.output.findings_output import ReportOption
from armload_controller.cli.output.json_output import JsonOption
from armload_controller.cli.output.output_files import require_drawable, require_folder


def calibrate(
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
    as_json: JsonOption = False,
) -> None:
    """Calibrate an arm from all its runs: gains, body and friction, with intervals.

    Runs of any motion and from any day, unloaded and loaded. A weighed payload (mass_kg in the table) sets the scale of
    the gains; leave the mass of the others empty. Runs with the same payload, mounted once, share a name in the column
    mounting. Runs that cannot be used or that contradict the others are left out and reported.
    """
    from armload_controller.analysis.robot_calibration import calibrate_from_files
    from armload_controller.cli.output.calibration_tables import gains_table, runs_table
    from armload_controller.cli.output.result_documents import calibration_document
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_identification.files.calibration_file import write_calibration

    arm = load_robot(robot)
    screen = Screen(as_json=as_json)
    require_folder(output)
    if report is not None:
        require_drawable(report)
    with screen.track("reading and calibrating", total=200) as done:
        result = calibrate_from_files(arm, runs, lambda count, _total: done(count))
    screen.table(gains_table(result, arm.joint_names))
    screen.table(runs_table(result))
    screen.remarks("left out", (f"{name}: {reason}" for name, reason in result.left_out))
    screen.remarks("warning", result.warnings)
    write_calibration(output, result)
    screen.step(f"written: {output}")
    if report is not None:
        from armload_identification.report.calibration_report import write_calibration_report

        write_calibration_report(report, result, arm.description, arm.joint_names)
        screen.step(f"written: {report}")
    document = partial(calibration_document, arm.name, arm.joint_names, result)
    screen.document(document, {"calibration": output, "report": report})
