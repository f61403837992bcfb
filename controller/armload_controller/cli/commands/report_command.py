"""`armload report`: a report from existing files."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.exit_status import require_not_wrong
from armload_controller.cli.options import CalibrationOption, RobotArgument
from armload_controller.cli.output.findings_output import ValidationOption, finish
from armload_controller.cli.output.output_files import require_drawable
from armload_controller.cli.screen import PLAIN, Screen
from armload_controller.cli.tolerance_option import TOLERANCE, ToleranceOption
from armload_identification.verdict.tolerance import Tolerance


def report(
    robot: RobotArgument,
    payload: Annotated[Path, typer.Argument(metavar="PAYLOAD", help="Payload file (TOML).")],
    output: Annotated[Path, typer.Option("--output", "-o", help="Report (HTML) to write.")],
    identified: Annotated[
        tuple[Path, Path] | None,
        typer.Option(metavar="LOADED UNLOADED", help="Recordings that the payload was identified from."),
    ] = None,
    validation: ValidationOption = None,
    calibration: CalibrationOption = None,
    tolerance: ToleranceOption = TOLERANCE,
    screen: Screen = PLAIN,
) -> None:
    """Write the report of a payload file and its recordings. Exit status 3: the payload is wrong."""
    from armload_controller.analysis.robot_identification import findings_from_files

    require_drawable(output, option="--output")
    findings = findings_from_files(
        robot,
        payload,
        fitted=identified,
        validation=validation,
        calibration=calibration,
        tolerance=Tolerance(*tolerance),
    )
    finish(screen, findings, payload=None, report=output)
    require_not_wrong(findings.outcome)
