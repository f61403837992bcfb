"""An arm's drift on the console, as files and as JSON."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from armload_controller.cli.screen import Screen
    from armload_identification.results.arm_history import ArmHistory


def show_drift(screen: Screen, history: ArmHistory, *, report: Path | None, picture: Path | None) -> None:
    """Show levels and changes, and write the requested files."""
    screen.result_table(history.table())
    screen.remarks("left out", (f"{name}: {reason}" for name, reason in history.left_out))
    if not history.drift.began:
        screen.step("note: not every recording has a start time, so they are used in the given order")
    screen.write(history.report, report)
    screen.write(history.picture, picture)
    screen.document(history.to_dict, {"report": report, "picture": picture})
