"""Options that state the drift of a calibrated arm's gains."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.options import share

if TYPE_CHECKING:
    from armload_controller.analysis.stated_drift import StatedDrift
    from armload_controller.config.objects_or_paths import RunSource


@dataclass(frozen=True)
class DriftOptions:
    """What is stated of the drift."""

    gain_drift: Annotated[
        float | None,
        typer.Option(
            metavar="SHARE",
            parser=share,
            help="With a calibrated arm: standard deviation of the drift of all gains together since the calibration, "
            "such as 3%; if not given, that between the calibration's sessions, else 1%.",
        ),
    ] = None
    reference: Annotated[
        Path | None,
        typer.Option(
            help="With a calibrated arm: a run of the same day and of any motion, empty or with a weighed tool, which "
            "measures that drift.",
        ),
    ] = None
    reference_mass_kg: Annotated[
        float | None, typer.Option("--reference-mass", metavar="KG", help="Mass of the tool on the reference.")
    ] = None

    def stated(self, reference: RunSource | None = None) -> StatedDrift:
        """The statement; `reference` is the run at that path, if it was read before."""
        from armload_controller.analysis.stated_drift import StatedDrift

        return StatedDrift(self.gain_drift, reference or self.reference, self.reference_mass_kg)
