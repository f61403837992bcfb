"""The verdict on the command line: its option, its text, and its exit status."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final

import typer

from armload_controller.cli.exit_status import ExitStatus
from armload_identification.verdict.tolerance import Tolerance

if TYPE_CHECKING:
    from armload_identification.verdict.agreement import Outcome

TOLERANCE: Final = (Tolerance().mass_share, Tolerance().center_m)
ToleranceOption = Annotated[
    tuple[float, float],
    typer.Option(
        "--tolerance",
        metavar="SHARE M",
        help="Permitted error of the payload: fraction of its mass, and distance of its centre of mass in m.",
    ),
]


def exit_status(outcome: Outcome) -> int:
    """0 if the payload is right, 3 if it is wrong, 4 if the runs cannot tell."""
    from armload_identification.verdict.agreement import Outcome

    return {
        Outcome.RIGHT: ExitStatus.DONE,
        Outcome.WRONG: ExitStatus.WRONG_PAYLOAD,
        Outcome.CANNOT_TELL: ExitStatus.CANNOT_TELL,
    }[outcome]
