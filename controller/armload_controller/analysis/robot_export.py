"""Export a payload, or a calibrated arm, for other programs."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from os import PathLike
from pathlib import Path
from typing import Final

from armload_controller.analysis.arm_in_use import Calibration, arm_in_use, calibration_of
from armload_controller.config.objects_or_paths import FilePath, PayloadSource, payload_from, robot_of
from armload_controller.config.robot import Robot
from armload_controller.control_errors import ExportError
from armload_controller.export.export_files import write_files
from armload_controller.export.exported_payload import ExportSubject
from armload_controller.export.format_registry import LOAD_DATA, OF_AN_ARM, ExportFormat, exporter
from armload_controller.export.licence import DEFAULT_LICENCE
from armload_identification.argument_types import path_of, require_type
from armload_identification.files.calibration_file import is_calibration
from armload_identification.files.payload_file import format_payload
from armload_identification.model.payload import PARAMETER_NAMES
from armload_identification.result_table import PrintedResult, ResultTable


@dataclass(frozen=True, repr=False)
class Exported(PrintedResult):
    """The files of an export; prints as a table.

    Attributes:
        robot: Name of the arm.
        files: Path of each file, and whether it was written; False if it already had this content.
        notes: What the files cannot express, or state as unknown.
    """

    robot: str
    export_format: str
    files: Mapping[Path, bool]
    notes: tuple[str, ...]

    def table(self) -> ResultTable:
        """The files, and the notes below."""
        rows = [(str(path), "written" if new else "unchanged") for path, new in self.files.items()]
        return ResultTable(f"{self.robot} as {self.export_format}", ("file", ""), rows, (0, 1), self.notes)


@dataclass(frozen=True)
class ExportOptions:
    """Options of an export that only some formats need.

    Attributes:
        single: Single precision; only for "c".
        flange_rpy_rad: With a robot controller's load data: the controller's flange in the flange frame of the robot
            file, as in a URDF. Required if that frame's z is not the last joint's axis.
        licence: Licence of generated source code, as an SPDX expression.

    Examples:
        >>> import armload
        >>> options = armload.ExportOptions(licence="BSD-3-Clause")
        >>> exported = armload.export("er50", "runs/today/payload.toml", "c", "export_c", options=options)
        >>> len(exported.files) > 0
        True
    """

    single: bool = False
    flange_rpy_rad: tuple[float, float, float] | None = None
    licence: str = DEFAULT_LICENCE


_DEFAULT: Final = ExportOptions()


def export(
    robot: Robot | FilePath,
    payload: PayloadSource,
    export_format: ExportFormat | str,
    output: FilePath = ".",
    *,
    calibration: Calibration | None = None,
    options: ExportOptions = _DEFAULT,
) -> Exported:
    """Write a payload as C source, an FMU, URDF, MJCF, ROS 2 files or the load data of a robot controller.

    Args:
        robot: The arm that carries it: a robot, the name of a shipped robot, or the path of its TOML.
        payload: The payload, or its file; or an arm's calibration file, with the format "urdf" or "mjcf".
        export_format: Name of the format, such as "c", "fmu", "urdf" or "kuka", or of one from an installed package; a
            wrong one is answered with all.
        output: Folder, or a file if the format has only one; an existing file is not overwritten.
        calibration: Calibration of the arm, or its file: the payload's friction in the gears, and the recursive
            estimator, become part of the C source.
        options: What only some formats need.

    Raises:
        ExportError: the payload may not be exported, or a file cannot be written.

    Examples:
        >>> import armload
        >>> exported = armload.export("er50", "runs/today/payload.toml", "urdf", "export")
        >>> [path.name for path in exported.files]
        ['er50_payload_inertial.xml']
    """
    require_type("options", options, ExportOptions)
    arm, folder = robot_of(robot), path_of("output", output)
    target, write = str(export_format), exporter(export_format)
    if options.single and target != ExportFormat.C:
        raise ExportError("`single=`", f"can only be used with the format c, not with {target}")
    if options.flange_rpy_rad is not None and target not in LOAD_DATA:
        raise ExportError(
            "`flange_rpy_rad=`",
            f"can only be used with {', '.join(sorted(LOAD_DATA))}, not with {target}, which keeps the robot file's "
            "flange frame",
        )
    if isinstance(payload, str | PathLike) and is_calibration(payload):
        if target not in OF_AN_ARM:
            raise ExportError(str(payload), f"is an arm's calibration: expected {' or '.join(sorted(OF_AN_ARM))}")
        return _exported_arm(arm, target, Path(payload), folder)
    result = payload_from(payload, "payload")
    source, content = "payload", format_payload(result).encode()
    if isinstance(payload, str | PathLike):
        source, content = str(payload), Path(payload).read_bytes()
    sha256 = hashlib.sha256(content).hexdigest()
    used = arm_in_use(arm, calibration)
    known = used.calibration, used.calibration_sha256
    subject = ExportSubject.of(arm, result, source, sha256, *known)
    subject = replace(subject, flange_rpy_rad=options.flange_rpy_rad, licence=options.licence)
    notes = []
    if options.single:
        from armload_controller.export.c99 import export_c
        from armload_controller.export.c_code.rounding import single_precision_error
        from armload_controller.export.straight_line.precision import Precision

        write = partial(export_c, precision=Precision.SINGLE)
        notes.append(single_precision_error(subject).statement)
    files = write_files(write(subject), folder)
    unknown = [name for name, known in zip(PARAMETER_NAMES, result.determined, strict=True) if not known]
    if unknown:
        notes.append(f"not determined: {', '.join(unknown)}; the exported file states what is written for them")
    made = result.provenance
    if made.recordings_sha256 and made.configuration_sha256 != arm.sha256:
        notes.append(
            f"{source} was identified with another robot file than the present one of {arm.name}: if kinematics, gear "
            "ratios or torque constants have changed, identify it again"
        )
    return Exported(arm.name, target, files, tuple(notes))


def _exported_arm(arm: Robot, target: str, file: Path, output: Path) -> Exported:
    """A calibrated arm as URDF or MJCF."""
    from armload_controller.export.calibrated_mjcf import arm_mjcf
    from armload_controller.export.calibrated_urdf import arm_urdf
    from armload_identification.calibration.possible_links import possible_links

    calibration = calibration_of(arm, file)
    possible = possible_links(calibration.level(arm.chain), calibration)
    sha256 = hashlib.sha256(file.read_bytes()).hexdigest()
    made_from = f"armload {version('armload')} from {file.name}, sha256 {sha256}"
    as_urdf = target == ExportFormat.URDF
    files = write_files((arm_urdf if as_urdf else arm_mjcf)(arm, calibration, possible, made_from), output)
    absent = "rotors and load-dependent friction" if as_urdf else "load-dependent friction"
    notes = [f"{target.upper()} cannot describe {absent}; the comment in the file contains them"]
    if not possible.exact:
        residual = ", ".join(f"{value:.2g}" for value in possible.left_nm)
        notes.append(
            "no physically possible links have the identified parameters; those written differ by "
            f"{possible.off:.2f} standard deviations, {residual} N m RMS"
        )
    return Exported(arm.name, target, files, tuple(notes))
