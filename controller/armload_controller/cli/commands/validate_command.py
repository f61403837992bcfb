"""`armload validate`: does a payload file predict recordings that it was not identified from?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.exit_status import exit_status
from armload_controller.cli.given_arm import given_arm
from armload_controller.cli.options import (
    ArmArgument,
    BaseOption,
    CalibrationOption,
    FlangeOption,
    LoadedOption,
    UnloadedOption,
)
from armload_controller.cli.output.findings_output import ReportOption, finish
from armload_controller.cli.output.output_files import require_drawable
from armload_controller.cli.recording_options import RecordingOptions
from armload_controller.cli.screen import PLAIN, Screen
from armload_controller.cli.tolerance_option import TOLERANCE, ToleranceOption
from armload_identification.verdict.tolerance import Tolerance


def validate_payload(
    robot: ArmArgument,
    payload: Annotated[Path, typer.Argument(metavar="PAYLOAD", help="Payload file (TOML).")],
    loaded: LoadedOption,
    unloaded: UnloadedOption,
    *,
    base: BaseOption = None,
    flange: FlangeOption = None,
    report: ReportOption = None,
    calibration: CalibrationOption = None,
    chosen: RecordingOptions,
    tolerance: ToleranceOption = TOLERANCE,
    screen: Screen = PLAIN,
) -> None:
    """Validate a payload file by identifying the payload again. Exit status 3: wrong; 4: cannot tell."""
    from armload_controller.analysis import robot_identification
    from armload_controller.config.robot_recordings import read_of
    from armload_identification.extras import Extra, require_extra

    require_extra(Extra.IDENTIFY, "armload validate")
    arm = given_arm(robot, base, flange)
    require_drawable(report)
    allowed = Tolerance(*tolerance)
    judged = robot_identification.payload_of(payload, arm)
    choices = chosen.choices(2)
    runs = [read_of(arm, file, choice) for file, choice in zip((loaded, unloaded), choices, strict=True)]
    findings = robot_identification.validate(arm, judged, *runs, calibration=calibration, tolerance=allowed)
    finish(screen, findings, payload=None, report=report)
    if findings.outcome is not None:
        raise typer.Exit(exit_status(findings.outcome))
