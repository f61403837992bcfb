"""What `armload fleet` says: counts and rate of a run, and which arms are suspicious."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Any

from armload_controller.fleet.fleet_run import FleetTally
from armload_controller.fleet.recording_row import RowOutcome


def tally_text(tally: FleetTally) -> str:
    """A run in a line or two.

    Args:
        tally: What came of it.
    """
    if not tally.done:
        return f"nothing new: {tally.skipped} recordings done before"
    counts = ", ".join(f"{tally.outcomes[outcome.value]} {outcome.value}" for outcome in RowOutcome)
    return (
        f"{tally.done} recordings in {tally.wall_s:.1f} s, {tally.per_second:.2f}/s, {tally.cpu_s / tally.done:.2f} s "
        f"of CPU each: {counts}; {tally.skipped} done before"
    )


def fleet_document(tally: FleetTally, output: Path) -> dict[str, Any]:
    """The same for `--json`.

    Args:
        tally: What came of it.
        output: Folder of the rows.
    """
    return {
        "schema": "armload/fleet/1",
        "armload_version": version("armload"),
        **tally.to_dict(),
        "files": {"directory": str(output)},
    }
