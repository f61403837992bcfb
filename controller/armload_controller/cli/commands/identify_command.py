"""`armload identify`: from recordings to a payload."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.given_arm import given_arm
from armload_controller.cli.options import (
    ArmArgument,
    BaseOption,
    CalibrationOption,
    FlangeOption,
    GainDriftOption,
    LoadedOption,
    ReferenceMassOption,
    ReferenceOption,
    seconds_of,
    share_of,
)
from armload_controller.cli.output.findings_output import (
    ReportOption,
    ValidationOption,
    finish,
    finish_without_payload,
    require_not_wrong,
)
from armload_controller.cli.output.json_output import JsonOption
from armload_controller.cli.output.output_files import require_drawable, require_folder, require_replaceable
from armload_controller.cli.output.verdict_output import TOLERANCE, ToleranceOption
from armload_controller.cli.output.windows_output import show_windows
from armload_controller.cli.recording_options import (
    BetweenOption,
    ColumnsOption,
    EffortOption,
    EpisodeOption,
    JointsOption,
    recording_choices,
)
from armload_identification.recording.reading_options import Effort
from armload_identification.verdict.tolerance import Tolerance

if TYPE_CHECKING:
    from armload_identification.estimation.prior_knowledge import KnownPayload


def identify_payload(
    robot: ArmArgument,
    loaded: LoadedOption,
    unloaded: Annotated[
        Path | None, typer.Option("--unloaded", help="Recording of the same motion without the payload.")
    ] = None,
    base: BaseOption = None,
    flange: FlangeOption = None,
    output: Annotated[Path | None, typer.Option("--output", "-o", help="Payload file (TOML) to write.")] = None,
    report: ReportOption = None,
    validation: ValidationOption = None,
    calibration: CalibrationOption = None,
    mass_kg: Annotated[
        str | None, typer.Option(metavar="KG", help="Known mass, such as 2.1, or a range, such as 1..3.")
    ] = None,
    center_of_mass_m: Annotated[
        tuple[str, str, str] | None,
        typer.Option(
            metavar="X Y Z",
            help="Known centre of mass in the flange frame; each a number or a range, such as 0 0 0.05..0.1.",
        ),
    ] = None,
    symmetric: Annotated[
        bool, typer.Option("--symmetric", help="The payload is symmetric about the flange axis, z.")
    ] = False,
    cad: Annotated[
        Path | None, typer.Option(help="Payload file with CAD values, used with the uncertainty --cad-share.")
    ] = None,
    cad_share: Annotated[
        float,
        typer.Option(help="Standard deviation of the CAD values, as a fraction of the mass, of 0.1 m, of m (0.1 m)^2."),
    ] = 0.05,
    columns: ColumnsOption = None,
    effort: EffortOption = Effort.TORQUE,
    between: BetweenOption = None,
    joints: JointsOption = None,
    episode: EpisodeOption = None,
    minus: Annotated[
        str | None,
        typer.Option(
            metavar="TOOL",
            help="Tool whose payload is subtracted: a name from `armload tools add`, or a payload file. The result is "
            "what the tool carries, with the uncertainty of both.",
        ),
    ] = None,
    gain_drift: GainDriftOption = None,
    reference: ReferenceOption = None,
    reference_mass_kg: ReferenceMassOption = None,
    tolerance: ToleranceOption = TOLERANCE,
    every: Annotated[
        str | None,
        typer.Option(
            metavar="TIME",
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
    as_json: JsonOption = False,
) -> None:
    """Identify a payload from a recording with it and one without it, or from any motion of a calibrated arm."""
    from armload_controller.analysis import robot_identification
    from armload_controller.analysis.stated_drift import StatedDrift
    from armload_controller.analysis.tools import tool_payload
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot_recordings import read_of
    from armload_identification.extras import Extra, require_extra
    from armload_identification.identification_errors import NothingMounted
    from armload_identification.results.arm_without_payload import ArmWithoutPayload

    require_extra(Extra.IDENTIFY, "armload identify")
    require_folder(output)
    require_drawable(report)
    require_drawable(picture)
    known = _known(mass_kg, center_of_mass_m, cad, cad_share, symmetric=symmetric)
    of_one_result = {
        "--unloaded": unloaded,
        "--output": output,
        "--report": report,
        "--validation": validation,
        "--mass-kg": mass_kg,
        "--center-of-mass-m": center_of_mass_m,
        "--symmetric": symmetric or None,
        "--cad": cad,
        "--minus": minus,
        "--gain-drift": gain_drift,
        "--reference": reference,
    }
    refused = ", ".join(name for name, value in of_one_result.items() if value is not None)
    if every is not None and refused:
        raise typer.BadParameter(
            "cannot be combined with --every, which gives a mass for each window instead of one payload",
            param_hint=refused,
        )
    of_the_whole = {"--validation": validation, "--report": report, "--mass-kg": mass_kg, "--cad": cad}
    refused = ", ".join(name for name, value in of_the_whole.items() if value is not None)
    if minus is not None and refused:
        raise typer.BadParameter(
            "cannot be combined with --minus: it is about the whole load, and the result is what the tool carries",
            param_hint=refused,
        )
    every_s = None if every is None else seconds_of(every, "--every")
    if picture is not None and every is None:
        raise typer.BadParameter("needs --every", param_hint="--picture")
    arm = given_arm(robot, base, flange)
    files = [loaded, *([] if unloaded is None else [unloaded]), *(validation or ())]
    choices = recording_choices(columns, effort, between, joints, episode, count=len(files))
    if validation is not None:
        choices[-2:] = [replace(choice, between_s=None) for choice in choices[-2:]]
    runs = [read_of(arm, file, choice) for file, choice in zip(files, choices, strict=True)]
    if every_s is not None:
        history = robot_identification.identify_over_time(arm, runs[0], every_s, calibration=calibration)
        show_windows(Screen(as_json=as_json), history, picture=picture)
        return
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
            drift=StatedDrift(
                share_of(gain_drift),
                None if reference is None else read_of(arm, reference, replace(choices[0], between_s=None)),
                reference_mass_kg,
            ),
        )
    except NothingMounted as empty:
        sources = [run.source for run in runs[: 1 if unloaded is None else 2]]
        finish_without_payload(
            Screen(as_json=as_json), ArmWithoutPayload(arm, empty, sources), payload=output, report=report
        )
        return
    if output is not None and not force:
        require_replaceable(output, findings.payload)
    finish(Screen(as_json=as_json), findings, payload=output, report=report)
    require_not_wrong(findings)


def _number_or_range(text: str, option: str) -> float | tuple[float, float]:
    """2.1 from '2.1', or (1.0, 3.0) from '1..3'."""
    try:
        ends = [float(part) for part in text.split("..")]
    except ValueError:
        ends = []
    if len(ends) not in {1, 2}:
        raise typer.BadParameter(f"{text!r}: expected a number such as 2.1, or a range such as 1..3", param_hint=option)
    return ends[0] if len(ends) == 1 else (ends[0], ends[1])


def _known(
    mass_kg: str | None,
    center_of_mass_m: tuple[str, str, str] | None,
    cad: Path | None,
    cad_share: float,
    *,
    symmetric: bool,
) -> KnownPayload | None:
    """The operator's prior knowledge of the payload; None without any."""
    from armload_identification.estimation.prior_knowledge import KnownPayload
    from armload_identification.files.payload_file import read_payload

    if mass_kg is None and center_of_mass_m is None and cad is None and not symmetric:
        return None
    model = None if cad is None else read_payload(cad).model
    mass = None if mass_kg is None else _number_or_range(mass_kg, "--mass-kg")
    center = center_of_mass_m and [_number_or_range(text, "--center-of-mass-m") for text in center_of_mass_m]
    return KnownPayload(mass, center, model, cad_share, symmetric)
