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
from armload_controller.export.format_registry import DEFAULT_LICENCE, LOAD_DATA, OF_AN_ARM, ExportFormat, exporter

if TYPE_CHECKING:
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import Robot


def export(
    robot: RobotArgument,
    payload: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="Payload file (TOML) to export; or an arm's calibration, with --format urdf or mjcf."
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
    as_json: JsonOption = False,
) -> None:
    """Export a payload as C source, an FMU, URDF, ROS 2 files or the load data of a robot controller.

    Given a calibration file instead of a payload, the arm itself is exported as URDF or MJCF: physically possible links
    that give the torque of the identified base parameters. With --calibration, the C source, the FMU and the LinuxCNC
    component include the payload's friction in the gears, and the C source also the recursive estimator.
    """
    if single and export_format is not ExportFormat.C:
        raise typer.BadParameter(f"can only be used with --format c, not with {export_format}", param_hint="--float")
    if flange_rpy_rad is not None and export_format not in LOAD_DATA:
        raise typer.BadParameter(
            f"can only be used with {', '.join(sorted(LOAD_DATA))}, not with {export_format}, which keeps the robot "
            "file's flange frame",
            param_hint="--flange-rpy-rad",
        )
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
        if export_format not in OF_AN_ARM:
            expected = " or ".join(sorted(OF_AN_ARM))
            raise typer.BadParameter(f"{payload} is an arm's calibration: expected {expected}", param_hint="--format")
        _export_arm(screen, arm, export_format, payload, output)
        return
    result = read_payload(payload)
    used = arm_in_use(arm, calibration)
    sha256 = hashlib.sha256(payload.read_bytes()).hexdigest()
    subject = ExportSubject.of(
        arm,
        result,
        str(payload),
        sha256,
        used.calibration,
        used.calibration_sha256,
        flange_rpy_rad=flange_rpy_rad,
        licence=licence,
    )
    contents = export_c(subject, Precision.SINGLE) if single else exporter(export_format)(subject)
    files = write_files(contents, output)
    notes = [single_precision_error(subject).statement] if single else []
    unknown = [name for name, known in zip(PARAMETER_NAMES, result.determined, strict=True) if not known]
    if unknown:
        notes.append(f"not determined: {', '.join(unknown)}; the exported file states what is written for them")
    if result.provenance.configuration_sha256 != arm.sha256:
        notes.append(f"{payload} was identified with a configuration other than that of {arm.name}")
    _show(screen, arm, export_format, files, notes)


def _export_arm(screen: Screen, arm: Robot, export_format: ExportFormat, file: Path, output: Path) -> None:
    """Write a calibrated arm as URDF or MJCF."""
    from armload_controller.analysis.arm_in_use import calibration_of
    from armload_controller.export.calibrated_mjcf import arm_mjcf
    from armload_controller.export.calibrated_urdf import arm_urdf
    from armload_controller.export.export_files import write_files
    from armload_identification.calibration.possible_links import possible_links

    calibration = calibration_of(arm, file)
    possible = possible_links(calibration.level(arm.chain), calibration)
    sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
    made_from = f"armload {version('armload')} from {file.name}, sha256 {sha256}"
    as_urdf = export_format is ExportFormat.URDF
    files = write_files((arm_urdf if as_urdf else arm_mjcf)(arm, calibration, possible, made_from), output)
    absent = "rotors and load-dependent friction" if as_urdf else "load-dependent friction"
    notes = [f"{export_format.upper()} cannot describe {absent}; the comment in the file contains them"]
    if not possible.exact:
        residual = ", ".join(f"{value:.2g}" for value in possible.left_nm)
        notes.append(
            "no physically possible links have the identified parameters; those written differ by "
            f"{possible.off:.2f} standard deviations, {residual} N m RMS"
        )
    _show(screen, arm, export_format, files, notes)


def _show(screen: Screen, arm: Robot, export_format: ExportFormat, files: dict[Path, bool], notes: list[str]) -> None:
    """Show the files, whether each was written, and notes."""
    from armload_controller.cli.output.result_documents import export_document

    for path, written in files.items():
        screen.result(f"{'written' if written else 'unchanged'}: {path}")
    screen.remarks("note", notes)
    screen.document(partial(export_document, arm.name, export_format, files, notes))
