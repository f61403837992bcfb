"""A payload's findings on the console: values, verdict, notes, and the written files."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from armload_controller.cli.screen import Screen
    from armload_identification.results.arm_without_payload import ArmWithoutPayload
    from armload_identification.results.findings import Findings

ReportOption = Annotated[Path | None, typer.Option("--report", help="Report (HTML) to write.")]
ValidationOption = Annotated[
    tuple[Path, Path] | None,
    typer.Option(metavar="LOADED UNLOADED", help="Recordings of another motion, to validate the payload."),
]


def show_findings(screen: Screen, findings: Findings) -> None:
    """Show values, validation and notes."""
    from armload_controller.cli.output.result_tables import payload_table, validation_table
    from armload_identification.verdict.agreement import Outcome
    from armload_identification.verdict.verdict_text import sentences, title

    validation = findings.validation
    screen.result_table(payload_table(findings.payload, findings.truth))
    if validation is not None:
        screen.result_table(validation_table(validation, findings.arm.joint_names))
        name = title(validation.verdict)
        screen.result(f"verdict: {name if findings.outcome is Outcome.RIGHT else name.upper()}")
        for sentence in sentences(validation.verdict, findings.arm.joint_names):
            screen.result(f"  {sentence}")
    screen.remarks("note", findings.notes)


def finish(screen: Screen, findings: Findings, *, payload: Path | None, report: Path | None) -> None:
    """Write the requested files and show the findings."""
    show_findings(screen, findings)
    screen.write(findings.save, payload)
    screen.write(findings.report, report)
    screen.document(findings.to_dict, {"payload": payload, "report": report})


def finish_without_payload(
    screen: Screen, found: ArmWithoutPayload, *, payload: Path | None, report: Path | None
) -> None:
    """Show that an arm carries nothing, and write the report; there is no payload to be written."""
    screen.result(f"{found.arm.name}: {found.found.statement}")
    if payload is not None:
        screen.step(f"not written: {payload}: there is no payload")
    screen.write(found.report, report)
    screen.document(found.to_dict, {"report": report})
