"""`armload compare`: a payload's errors against CAD, as the paper counts them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def compare(
    payload: Annotated[Path, typer.Argument(metavar="PAYLOAD", help="Payload file that was identified (TOML).")],
    cad: Annotated[Path, typer.Argument(metavar="CAD", help="Payload file with the true values (TOML).")],
) -> None:
    """Print the relative errors of a payload against CAD in the paper's convention."""
    from armload_controller.cli.cad_table import comparison_table
    from armload_controller.cli.screen import Screen
    from armload_identification.files.payload_file import read_payload
    from armload_identification.verdict.cad_comparison import compare as compare_payloads

    result = compare_payloads(read_payload(payload), read_payload(cad))
    screen = Screen()
    screen.table(comparison_table(result))
    screen.step("inertia about the frame's origin, products as the paper has them: ixy = +int xy dm")
