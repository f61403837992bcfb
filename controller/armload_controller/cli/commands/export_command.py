"""`armload export`: a payload file for other controllers, simulators and loops."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.output.json_output import JsonOption, print_document
from armload_controller.export.format_registry import ExportFormat, exporter


def export(
    payload: Annotated[Path, typer.Argument(metavar="PAYLOAD", help="Payload file (TOML) to export.")],
    robot: Annotated[
        str, typer.Option("--robot", metavar="ROBOT", help="The arm that carries it: a shipped robot, or a TOML file.")
    ],
    export_format: Annotated[ExportFormat, typer.Option("--format", help="What to write.")],
    output: Annotated[
        Path,
        typer.Option("--output", "-o", help="Folder, or a file where the format has one; an existing file is kept."),
    ] = Path(),
    as_json: JsonOption = False,
) -> None:
    """Write a payload as C source, URDF, ROS 2 files or the load data of a robot controller."""
    from armload_controller.cli.output.result_documents import export_document
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_controller.export.export_files import write_texts
    from armload_controller.export.subject import ExportSubject
    from armload_identification.files.payload_file import read_payload
    from armload_identification.model.payload import PARAMETER_NAMES

    arm, screen = load_robot(robot), Screen(as_json=as_json)
    result = read_payload(payload)
    subject = ExportSubject.of(arm, result, str(payload), hashlib.sha256(payload.read_bytes()).hexdigest())
    files = write_texts(exporter(export_format)(subject), output)
    for path, written in files.items():
        screen.result(f"{'written' if written else 'unchanged'}: {path}")
    notes = []
    unknown = [name for name, known in zip(PARAMETER_NAMES, result.determined, strict=True) if not known]
    if unknown:
        notes.append(f"not determined: {', '.join(unknown)}; the exported text says what is written for them")
    if result.provenance.configuration_sha256 != arm.sha256:
        notes.append(f"{payload} was identified with another configuration than {arm.name}'s")
    for note in notes:
        screen.step(f"note: {note}")
    if as_json:
        print_document(export_document(arm.name, export_format, files, notes))
