"""`armload export`: a payload file for other controllers, simulators and loops."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.options import CalibrationOption, RobotArgument
from armload_controller.cli.screen import PLAIN, Screen
from armload_controller.export.format_registry import ExportFormat, format_names
from armload_controller.export.licence import DEFAULT_LICENCE


def _known(name: str) -> str:
    """The name of a format, after checking that there is one."""
    if name in tuple(ExportFormat) or name in format_names():
        return name
    raise typer.BadParameter(f"{name!r}: expected one of {', '.join(map(repr, map(str, format_names())))}")


def export_payload(
    robot: RobotArgument,
    payload: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="Payload file (TOML) to export; or an arm's calibration, with --format urdf or mjcf."
        ),
    ],
    export_format: Annotated[
        str,
        typer.Option(
            "--format",
            metavar="FORMAT",
            help=f"What to write: {', '.join(ExportFormat)}; or a format of an installed package.",
            callback=_known,
            autocompletion=lambda: list(ExportFormat),
        ),
    ],
    output: Annotated[
        Path,
        typer.Option(
            "--output", "-o", help="Folder, or a file if the format has only one; an existing file is not overwritten."
        ),
    ] = Path(),
    single: Annotated[
        bool, typer.Option("--float", help="With --format c: single precision; the header states the error.")
    ] = False,
    calibration: CalibrationOption = None,
    flange_rpy_rad: Annotated[
        tuple[float, float, float] | None,
        typer.Option(
            metavar="ROLL PITCH YAW",
            help="With a robot controller's load data: the controller's flange in the flange frame of the robot file, "
            "as in a URDF, in rad. Required if that frame's z is not the last joint's axis.",
        ),
    ] = None,
    licence: Annotated[
        str, typer.Option(metavar="SPDX", help="Licence of generated source code, as an SPDX expression.")
    ] = DEFAULT_LICENCE,
    screen: Screen = PLAIN,
) -> None:
    """Export a payload as C source, an FMU, URDF, ROS 2 files or the load data of a robot controller.

    Given a calibration file instead of a payload, the arm itself is exported as URDF or MJCF: physically possible links
    that give the torque of the identified base parameters. With --calibration, the C source, the FMU and the LinuxCNC
    component include the payload's friction in the gears, and the C source also the recursive estimator.
    """
    from armload_controller.analysis import robot_export
    from armload_controller.cli.output.json_documents import export_document

    done = robot_export.export(
        robot,
        payload,
        export_format,
        output,
        calibration=calibration,
        options=robot_export.ExportOptions(single, flange_rpy_rad, licence),
    )
    for path, written in done.files.items():
        screen.result(f"{'written' if written else 'unchanged'}: {path}")
    screen.remarks("note", done.notes)
    screen.document(partial(export_document, done))
