"""`armload validate`: do recordings that it has not seen agree with a payload file?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.options import (
    CalibrationOption,
    GainsOption,
    LoadedOption,
    RobotArgument,
    UnloadedOption,
    arm_in_use,
)
from armload_controller.cli.verdict_output import TOLERANCE, ToleranceOption, exit_status, show_verdict, tolerance_of


def validate(
    robot: RobotArgument,
    payload: Annotated[Path, typer.Argument(metavar="PAYLOAD", help="Payload file to judge (TOML).")],
    loaded: LoadedOption,
    unloaded: UnloadedOption,
    gains: GainsOption = None,
    calibration: CalibrationOption = None,
    tolerance: ToleranceOption = TOLERANCE,
) -> None:
    """Judge a payload file by identifying it again. Exit status 3: wrong; 4: these runs cannot tell."""
    from armload_controller.cli.result_tables import validation_table
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_controller.config.robot_recordings import read_of
    from armload_identification.files.payload_file import read_payload
    from armload_identification.identification_errors import PayloadFileError
    from armload_identification.pipeline.payload_identification import FLANGE
    from armload_identification.pipeline.payload_validation import validate as validate_payload
    from armload_identification.verdict.verdict_text import sentences

    arm = load_robot(robot)
    screen = Screen()
    allowed = tolerance_of(tolerance)
    judged = read_payload(payload)
    if judged.frame != FLANGE:
        raise PayloadFileError(
            str(payload),
            "payload.frame",
            judged.frame,
            f"expected {FLANGE!r}, the frame that the robot's kinematics end in",
        )
    used = arm_in_use(arm, gains, calibration)
    result = validate_payload(
        read_of(arm, loaded),
        read_of(arm, unloaded),
        used.chain,
        used.transmission,
        judged,
        allowed,
        arm=used.known,
    )
    screen.table(validation_table(result, arm.joint_names))
    show_verdict(screen, result.outcome, sentences(result.verdict, arm.joint_names))
    raise typer.Exit(exit_status(result.outcome))
