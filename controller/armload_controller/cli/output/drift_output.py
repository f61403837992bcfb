"""An arm's drift on the console, as files and as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from armload_controller.cli.output.windows_output import write_picture

if TYPE_CHECKING:
    from armload_controller.cli.screen import Screen
    from armload_identification.results.arm_history import ArmHistory


def show_drift(screen: Screen, history: ArmHistory, *, report: Path | None, picture: Path | None) -> None:
    """Show levels and changes, and write the requested files."""
    from rich.table import Table

    from armload_controller.cli.console_text import right
    from armload_identification.report.numerals import counted
    from armload_identification.results.arm_history import HEADINGS

    runs = counted(len(history.drift.runs), "run")
    title = f"{history.robot}: {runs} against {history.calibration_name}, present levels"
    table = Table(HEADINGS[0], *right(*HEADINGS[1:]), title=title, title_justify="left")
    for row in history.rows():
        table.add_row(*row)
    screen.table(table)
    for found in history.drift.findings:
        screen.result(found.text)
    screen.result(history.advice)
    screen.remarks("left out", (f"{name}: {reason}" for name, reason in history.left_out))
    if not history.drift.began:
        screen.step("note: not every recording has a start time, so they are used in the given order")
    if report is not None:
        history.report(report)
        screen.step(f"written: {report}")
    if picture is not None:
        write_picture(screen, history.picture, picture)
    screen.document(history.to_dict, {"report": report, "picture": picture})
