"""`armload validate`: does a payload file predict recordings it has not seen?"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.options import GainsOption, LoadedOption, RobotArgument, UnloadedOption, transmission_of

EXIT_FAILED = 3


def validate(
    robot: RobotArgument,
    payload: Annotated[Path, typer.Argument(metavar="PAYLOAD", help="Payload file to judge (TOML).")],
    loaded: LoadedOption,
    unloaded: UnloadedOption,
    gains: GainsOption = None,
) -> None:
    """Judge a payload file: residual beside the noise per joint. Exit status 3 where it fails."""
    from armload_controller.cli.result_tables import validation_table, verdict
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_controller.config.robot_recordings import read_of
    from armload_identification.files.payload_file import read_payload
    from armload_identification.identification_errors import PayloadFileError
    from armload_identification.pipeline.payload_identification import FLANGE
    from armload_identification.verdict.validation import validate as validate_payload

    arm = load_robot(robot)
    screen = Screen()
    judged = read_payload(payload)
    if judged.frame != FLANGE:
        raise PayloadFileError(
            str(payload),
            "payload.frame",
            judged.frame,
            f"expected {FLANGE!r}, the frame that the robot's kinematics end in",
        )
    result = validate_payload(
        read_of(arm, loaded), read_of(arm, unloaded), arm.chain, transmission_of(arm, gains), judged.model
    )
    screen.table(validation_table(result, arm.joint_names))
    screen.step(verdict(result, arm.joint_names))
    if not result.passed:
        raise typer.Exit(EXIT_FAILED)
