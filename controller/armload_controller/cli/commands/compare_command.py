"""`armload compare`: a payload against CAD: the verdict, and the errors in the paper's convention."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.exit_status import exit_status
from armload_controller.cli.screen import PLAIN, Screen
from armload_controller.cli.tolerance_option import TOLERANCE, ToleranceOption
from armload_identification.verdict.tolerance import Tolerance


def compare_payload(
    payload: Annotated[Path, typer.Argument(metavar="PAYLOAD", help="Payload file that was identified (TOML).")],
    cad: Annotated[Path, typer.Argument(metavar="CAD", help="Payload file with the true values (TOML).")],
    calibration: Annotated[
        Path | None,
        typer.Option("--calibration", help="Calibration file of the arm; its gains are applied to the payload."),
    ] = None,
    tolerance: ToleranceOption = TOLERANCE,
    screen: Screen = PLAIN,
) -> None:
    """Compare a payload with CAD: the verdict, and relative errors. Exit status 3: wrong; 4: cannot tell.

    The verdict covers mass and centre of mass; with a calibration, as they are with its gains. The errors follow the
    paper's convention.
    """
    from armload_controller.analysis.robot_comparison import compare

    result = compare(payload, cad, calibration=calibration, tolerance=Tolerance(*tolerance))
    screen.result_table(result.table())
    screen.document(result.to_dict)
    raise typer.Exit(exit_status(result.outcome))
