"""`armload identify`: from recordings to a payload."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.options import LoadedOption, RobotArgument
from armload_controller.cli.output import require_folder
from armload_controller.cli.screen import Screen
from armload_controller.cli.tables import payload_table, possibility
from armload_controller.config import load_robot
from armload_controller.recordings import read_of
from armload_identification.identification import identify as identify_payload
from armload_identification.identification import payload_result
from armload_identification.payload_file import write_payload


def identify(
    robot: RobotArgument,
    loaded: LoadedOption,
    unloaded: Annotated[
        Path | None, typer.Option("--unloaded", help="Recording of the same motion without the payload.")
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Payload file (TOML) to write.")] = None,
) -> None:
    """Identify a payload from a recording with it and one without it."""
    arm = load_robot(robot)
    screen = Screen()
    if output is not None:
        require_folder(output)
    empty = None if unloaded is None else read_of(arm, unloaded)
    result = identify_payload(read_of(arm, loaded), empty, arm.chain(), arm.transmission())
    payload = payload_result(result, version("armload"), arm.sha256)
    screen.console.print(payload_table(payload, truth=None))
    screen.step(possibility(result))
    for note in result.notes:
        screen.step(f"note: {note}")
    if output is not None:
        write_payload(output, payload)
        screen.step(f"written: {output}")
