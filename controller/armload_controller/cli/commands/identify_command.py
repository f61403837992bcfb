"""`armload identify`: from recordings to a payload."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from armload_controller.cli.drift_options import DriftOptions
from armload_controller.cli.exit_status import require_not_wrong
from armload_controller.cli.given_arm import given_arm
from armload_controller.cli.options import (
    ArmArgument,
    BaseOption,
    CalibrationOption,
    FlangeOption,
    LoadedOption,
    duration_s,
    ends_of,
    refuse_together,
)
from armload_controller.cli.output.findings_output import (
    ReportOption,
    ValidationOption,
    finish,
    finish_without_payload,
)
from armload_controller.cli.output.output_files import require_drawable, require_folder, require_replaceable
from armload_controller.cli.recording_options import RecordingOptions
from armload_controller.cli.screen import PLAIN, Screen
from armload_controller.cli.tolerance_option import TOLERANCE, ToleranceOption
from armload_identification.verdict.tolerance import Tolerance

if TYPE_CHECKING:
    from armload_identification.estimation.prior_knowledge import KnownPayload


_OF_THE_WHOLE: Final = ("validation", "report", "mass_kg", "cad")
"""Parameters that are about the whole load."""
_OF_ONE_RESULT: Final = (
    *("unloaded", "output", "minus", "center_of_mass_m", "symmetric"),
    *_OF_THE_WHOLE,
)
"""Parameters that are about one payload, not about windows."""


def _number_or_range(text: str) -> float | tuple[float, float]:
    """2.1 from '2.1', or (1.0, 3.0) from '1..3'."""
    ends = ends_of(text)
    if len(ends) not in {1, 2}:
        raise typer.BadParameter(f"{text!r}: expected a number such as 2.1, or a range such as 1..3")
    return ends[0] if len(ends) == 1 else (ends[0], ends[1])


@dataclass(frozen=True)
class PriorKnowledge:
    """Options about what is known of the payload."""

    mass_kg: Annotated[
        Any,
        typer.Option(metavar="KG", parser=_number_or_range, help="Known mass, such as 2.1, or a range, such as 1..3."),
    ] = None
    center_of_mass_m: Annotated[
        tuple[Any, Any, Any] | None,
        typer.Option(
            metavar="X Y Z",
            parser=_number_or_range,
            help="Known centre of mass in the flange frame; each a number or a range, such as 0 0 0.05..0.1.",
        ),
    ] = None
    symmetric: Annotated[
        bool, typer.Option("--symmetric", help="The payload is symmetric about the flange axis, z.")
    ] = False
    cad: Annotated[
        Path | None, typer.Option(help="Payload file with CAD values, used with the uncertainty --cad-share.")
    ] = None
    cad_share: Annotated[
        float,
        typer.Option(help="Standard deviation of the CAD values, as a fraction of the mass, of 0.1 m, of m (0.1 m)^2."),
    ] = 0.05

    def known(self) -> KnownPayload | None:
        """The knowledge; None without any."""
        from armload_identification.estimation.prior_knowledge import KnownPayload
        from armload_identification.files.payload_file import read_payload

        if self == PriorKnowledge(cad_share=self.cad_share):
            return None
        model = None if self.cad is None else read_payload(self.cad).model
        return KnownPayload(self.mass_kg, self.center_of_mass_m, model, self.cad_share, self.symmetric)


def identify_payload(
    context: typer.Context,
    robot: ArmArgument,
    loaded: LoadedOption,
    *,
    unloaded: Annotated[
        Path | None, typer.Option("--unloaded", help="Recording of the same motion without the payload.")
    ] = None,
    base: BaseOption = None,
    flange: FlangeOption = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Payload file (TOML) to write.")] = None,
    report: ReportOption = None,
    validation: ValidationOption = None,
    calibration: CalibrationOption = None,
    prior: PriorKnowledge,
    chosen: RecordingOptions,
    minus: Annotated[
        str | None,
        typer.Option(
            metavar="TOOL",
            help="Tool whose payload is subtracted: a name from `armload tools add`, or a payload file. The result is "
            "what the tool carries, with the uncertainty of both.",
        ),
    ] = None,
    drift: DriftOptions,
    tolerance: ToleranceOption = TOLERANCE,
    every_s: Annotated[
        float | None,
        typer.Option(
            "--every",
            metavar="TIME",
            parser=duration_s,
            help="Identify the payload in windows of this length, such as 10s; requires a calibrated arm.",
        ),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(help="With --every: picture (.png, .svg) of the mass over time to write.")
    ] = None,
    force: Annotated[
        bool,
        typer.Option("--force", help="Overwrite an existing file of another payload, or any other file, at --output."),
    ] = False,
    screen: Screen = PLAIN,
) -> None:
    """Identify a payload from a recording with it and one without it, or from any motion of a calibrated arm."""
    from armload_controller.analysis import robot_identification
    from armload_controller.analysis.tools import tool_payload
    from armload_controller.config.robot_recordings import read_of
    from armload_identification.extras import Extra, require_extra
    from armload_identification.identification_errors import NothingMounted
    from armload_identification.results.arm_without_payload import ArmWithoutPayload

    require_extra(Extra.IDENTIFY, "armload identify")
    require_folder(output)
    require_drawable(report)
    require_drawable(picture, "picture", "--picture")
    known = prior.known()
    if every_s is None:
        refuse_together(context, "needs --every", "picture")
    else:
        refuse_together(context, "cannot be combined with --every, which gives a mass for each window", *_OF_ONE_RESULT)
    if minus is not None:
        why = "cannot be combined with --minus: it is about the whole load, and the result is what the tool carries"
        refuse_together(context, why, *_OF_THE_WHOLE)
    arm = given_arm(robot, base, flange)
    files = [loaded, *([] if unloaded is None else [unloaded]), *(validation or ())]
    choices = chosen.choices(len(files))
    if validation is not None:
        choices[-2:] = [replace(choice, between_s=None) for choice in choices[-2:]]
    runs = [read_of(arm, file, choice) for file, choice in zip(files, choices, strict=True)]
    stated = drift.stated(drift.reference and read_of(arm, drift.reference, replace(choices[0], between_s=None)))
    if every_s is not None:
        history = robot_identification.identify_over_time(arm, runs[0], every_s, calibration=calibration, drift=stated)
        screen.result_table(history.table())
        screen.write(history.picture, picture)
        screen.document(history.to_dict, {"picture": picture})
        return
    fitted = runs[: 1 if unloaded is None else 2]
    if output is not None and not force:
        require_replaceable(output, [run.source.sha256 for run in fitted])
    try:
        findings = robot_identification.identify(
            arm,
            runs[0],
            None if unloaded is None else runs[1],
            validation=None if validation is None else (runs[-2], runs[-1]),
            tolerance=Tolerance(*tolerance),
            calibration=calibration,
            known=known,
            minus=None if minus is None else tool_payload(minus),
            drift=stated,
        )
    except NothingMounted as empty:
        found = ArmWithoutPayload(arm, empty, [run.source for run in fitted])
        finish_without_payload(screen, found, payload=output, report=report)
        return
    finish(screen, findings, payload=output, report=report)
    require_not_wrong(findings.outcome)
