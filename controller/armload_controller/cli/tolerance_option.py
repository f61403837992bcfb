"""The option of a verdict's tolerance."""

from __future__ import annotations

from typing import Annotated, Final

import typer

from armload_identification.verdict.tolerance import Tolerance

TOLERANCE: Final = (Tolerance().mass_share, Tolerance().center_m)
ToleranceOption = Annotated[
    tuple[float, float],
    typer.Option(
        "--tolerance",
        metavar="SHARE M",
        help="Permitted error of the payload: fraction of its mass, and distance of its centre of mass in m.",
    ),
]
