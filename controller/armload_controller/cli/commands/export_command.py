"""`armload export`: a payload file for other controllers, simulators and loops."""

from __future__ import annotations

import hashlib
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.options import CalibrationOption, RobotArgument
from armload_controller.cli.output.json_output import JsonOption
from armload_controller.export.format_registry import ExportFormat, exporter

if TYPE_CHECKING:
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import Robot


def export(
    robot: RobotArgument,
    payload: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="Payload file (TOML) to export; or an arm's calibration, with --format urdf."
        ),
    ],
    export_format: Annotated[
        ExportFormat,
        typer.Option("--format", metavar="FORMAT", help=f"What to write: {', '.join(ExportFormat)}."),
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
    as_json: JsonOption = False,
) -> None:
    """Export a payload as C source, an FMU, URDF, ROS 2 files or the load data of a robot controller.

    Given a calibration file instead of a payload, the arm itself is exported as URDF: physically possible links that
    give the torque of the identified base parameters. With --calibration, the C source, the FMU and the LinuxCNC
    component include the payload's friction in the gears, and the C source also the recursive estimator.
    """
    if single and export_format is not ExportFormat.C:
        raise typer.BadParameter(f"can only be used with --format c, not with {export_format}", param_hint="--float")
    from armload_controller.analysis.arm_in_use import arm_in_use
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_controller.export.c99 import export_c
    from armload_controller.export.c_code.rounding import single_precision_error
    from armload_controller.export.export_files import write_files
    from armload_controller.export.exported_payload import ExportSubject
    from armload_controller.export.straight_line.precision import Precision
    from armload_identification.files.calibration_file import is_calibration
    from armload_identification.files.payload_file import read_payload
    from armload_identification.model.payload import PARAMETER_NAMES

    arm, screen = load_robot(robot), Screen(as_json=as_json)
    if is_calibration(payload):
        if export_format is not ExportFormat.URDF:
            raise typer.BadParameter(f"{payload} is an arm's calibration: expected urdf", param_hint="--format")
        _export_arm(screen, arm, payload, output)
        return
    result = read_payload(payload)
    used = arm_in_use(arm, calibration)
    sha256 = hashlib.sha256(payload.read_bytes()).hexdigest()
    subject = ExportSubject.of(arm, result, str(payload), sha256, used.calibration, used.calibration_sha256)
    contents = export_c(subject, Precision.SINGLE) if single else exporter(export_format)(subject)
    files = write_files(contents, output)
    notes = [single_precision_error(subject).statement] if single else []
    unknown = [name for name, known in zip(PARAMETER_NAMES, result.determined, strict=True) if not known]
    if unknown:
        notes.append(f"not determined: {', '.join(unknown)}; the exported file states what is written for them")
    if result.provenance.configuration_sha256 != arm.sha256:
        notes.append(f"{payload} was identified with a configuration other than that of {arm.name}")
    _show(screen, arm, export_format, files, notes)


def _export_arm(screen: Screen, arm: Robot, file: Path, output: Path) -> None:
    """Write a calibrated arm as URDF."""
    from armload_controller.analysis.arm_in_use import calibration_of
    from armload_controller.export.calibrated_urdf import arm_urdf
    from armload_controller.export.export_files import write_files
    from armload_identification.calibration.possible_links import possible_links

    calibration = calibration_of(arm, file)
    possible = possible_links(calibration.level(arm.chain), calibration)
    sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
    made_from = f"armload {version('armload')} from {file.name}, sha256 {sha256}"
    files = write_files(arm_urdf(arm, calibration, possible, made_from), output)
    notes = ["URDF cannot describe rotors and load-dependent friction; the comment in the file contains them"]
    if not possible.exact:
        residual = ", ".join(f"{value:.2g}" for value in possible.left_nm)
        notes.append(
            "no physically possible links have the identified parameters; those written differ by "
            f"{possible.off:.2f} standard deviations, {residual} N m RMS"
        )
    _show(screen, arm, ExportFormat.URDF, files, notes)


def _show(screen: Screen, arm: Robot, export_format: ExportFormat, files: dict[Path, bool], notes: list[str]) -> None:
    """Show the files, whether each was written, and notes."""
    from armload_controller.cli.output.result_documents import export_document

    for path, written in files.items():
        screen.result(f"{'written' if written else 'unchanged'}: {path}")
    screen.remarks("note", notes)
    screen.document(partial(export_document, arm.name, export_format, files, notes))
