"""`armload commission`: the complete procedure, from switched-off drives to a payload file and a report."""

from __future__ import annotations

import time
from collections.abc import Sequence
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.attendance import operator_at
from armload_controller.cli.drift_options import DriftOptions
from armload_controller.cli.exit_status import require_not_wrong
from armload_controller.cli.given_arm import DrivenArm
from armload_controller.cli.options import (
    CalibrationOption,
    LiveAddressOption,
    LiveOption,
    MountedOption,
    YesOption,
    refuse_together,
    share,
)
from armload_controller.cli.output.output_files import make_folder, require_writable
from armload_controller.cli.screen import PLAIN, Screen
from armload_controller.cli.tolerance_option import TOLERANCE, ToleranceOption
from armload_controller.control_errors import CommissioningError
from armload_identification.verdict.tolerance import Tolerance

if TYPE_CHECKING:
    from armload_controller.config.robot import Robot
    from armload_controller.cycle.following_monitor import CycleSummary
    from armload_controller.session.commissioning import CommissioningPlan
    from armload_controller.session.run_session import Consent, Operator, ServosFactory
    from armload_controller.session.session_load import SessionLoad


class Runs(StrEnum):
    """Which halves of a commissioning to make."""

    BOTH = "both"
    UNLOADED = "unloaded"
    LOADED = "loaded"


def commission_arm(
    context: typer.Context,
    driven: DrivenArm,
    *,
    runs: Annotated[
        Runs, typer.Option(help="Run one half at a time; 'loaded' continues with the recordings of 'unloaded'.")
    ] = Runs.BOTH,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", help="Folder for the results; by default runs/ROBOT-TIME."),
    ] = None,
    mass_kg: Annotated[
        float | None, typer.Option(help="Mass of the payload, if it was weighed; it sets the scale of the gains.")
    ] = None,
    until: Annotated[
        float | None,
        typer.Option(
            metavar="SHARE",
            parser=share,
            help="Repeat the loaded periods, at most five times, until the mass repeats within this share, such as 1%. "
            "That is the part of its interval that more periods reduce; with nominal gains their scale is not.",
        ),
    ] = None,
    slow_only: Annotated[
        bool,
        typer.Option("--slow-only", help="Run the slow rounds alone: mass and centre of mass, in wider intervals."),
    ] = False,
    calibration: CalibrationOption = None,
    drift: DriftOptions,
    mounted: MountedOption = None,
    yes: YesOption = False,
    live: LiveOption = False,
    live_address: LiveAddressOption = None,
    tolerance: ToleranceOption = TOLERANCE,
    screen: Screen = PLAIN,
) -> None:
    """Run the arm empty and loaded, identify and validate the payload, write a report. Exit status 3: payload wrong.

    Ctrl-C, SIGTERM and a lost terminal bring the arm to rest and remove its torque; a second signal stops it at once.
    Signals that the shell has set to be ignored (SIGINT in a script's background job, SIGHUP under nohup) stay ignored,
    except SIGTERM.
    """
    from armload_controller.analysis.arm_in_use import arm_in_use
    from armload_controller.cli.output.findings_output import show_findings
    from armload_controller.session.commissioning import CommissioningPlan, missing_roles, require_recordings
    from armload_controller.session.commissioning_results import PAYLOAD_NAME, REPORT_NAME, evaluate
    from armload_controller.session.folder_claim import claimed_folder
    from armload_controller.session.live.live_view import live_at
    from armload_controller.session.session_load import SessionLoad
    from armload_identification.extras import Extra, require_extra
    from armload_identification.results.json_document import json_document

    for extra in (Extra.IDENTIFY, Extra.REPORT):
        require_extra(extra, "commissioning")
    if slow_only:
        refuse_together(context, "no periods are run with --slow-only", "until")
    shown = live_at(live, live_address)
    arm = driven.arm(driven.cycle_hz)
    if mounted is not None:
        arm = arm.with_simulated_payload(mounted)
    stated = drift.stated()
    stated.session(arm, arm_in_use(arm, calibration))
    now = datetime.now(UTC)
    directory = output or Path("runs") / f"{arm.name}-{now:%Y%m%d-%H%M%S}"
    plan = CommissioningPlan(directory, mass_kg, calibration, stated, until, slow_only)
    halves = [load for load in SessionLoad if runs in {Runs.BOTH, load}]
    if any(missing_roles(directory, load) for load in halves):
        driven.require_rules(arm)
    if runs is Runs.LOADED:
        if output is None:
            raise CommissioningError("--runs loaded requires --output: the folder used by --runs unloaded")
        require_recordings(directory, SessionLoad.UNLOADED)
    make_folder(directory)
    require_writable(directory)
    with claimed_folder(directory):
        done = not any(missing_roles(directory, load) for load in halves)
        if done and (runs is Runs.UNLOADED or all((directory / n).exists() for n in (PAYLOAD_NAME, REPORT_NAME))):
            raise CommissioningError(
                f"{directory} already contains these recordings, which are never overwritten: choose another --output"
            )
        with operator_at(arm, screen, agreed=yes, live=shown) as operator:
            _record(arm, plan, screen, operator, halves, driven.opened(arm, screen))
        if runs is Runs.UNLOADED:
            screen.step(f"recorded: {directory}. Mount the payload, then: --runs loaded --output {directory}")
            screen.document(lambda: json_document("commission-half", {}), {"directory": directory})
            return
        findings, calibrated = evaluate(arm, plan, Tolerance(*tolerance), now)
        show_findings(screen, findings)
        for text in (f"payload: {directory / PAYLOAD_NAME}", f"report:  {directory / REPORT_NAME}", *calibrated):
            screen.step(text)
    screen.document(findings.to_dict, _files(directory))
    require_not_wrong(findings.outcome)


def _files(directory: Path) -> dict[str, Path]:
    """The folder and the files written to it; a calibration only if the runs sufficed for one."""
    from armload_controller.session.commissioning_results import CALIBRATION_NAME, PAYLOAD_NAME, REPORT_NAME

    names = {"payload": PAYLOAD_NAME, "report": REPORT_NAME, "calibration": CALIBRATION_NAME}
    there = {key: directory / name for key, name in names.items() if (directory / name).exists()}
    return {"directory": directory} | there


def _record(
    arm: Robot,
    plan: CommissioningPlan,
    screen: Screen,
    operator: Operator,
    halves: Sequence[SessionLoad],
    open_servos: ServosFactory,
) -> None:
    """Record the halves that do not exist yet."""
    from armload_controller.session.commissioning import missing_roles, record_half
    from armload_controller.session.session_load import SessionLoad

    for load in halves:
        if not missing_roles(plan.directory, load):
            screen.step(f"{load}: already recorded in {plan.directory}, not repeated")
            continue
        if load is SessionLoad.LOADED and len(halves) > 1:
            _have_payload_mounted(arm, screen, operator.consent)
        begun_s = time.monotonic()
        summaries = record_half(arm, load, open_servos, operator, plan)
        screen.step(_counts_line(load, summaries, time.monotonic() - begun_s))


def _have_payload_mounted(arm: Robot, screen: Screen, consent: Consent) -> None:
    """Have the payload mounted while the drives are off."""
    if arm.bus.in_virtual_time:
        screen.step(f"payload {arm.simulation.payload_name!r} mounted on the simulated flange")
        return
    if not consent.given and not consent.ask(mounting_question(arm)):
        raise CommissioningError("not confirmed: nothing was moved with the payload. Continue later with --runs loaded")


def mounting_question(arm: Robot) -> str:
    """The question before the loaded runs; it mentions brakes only if every axis has one."""
    braked = all(drive.has_brake for drive in arm.drives.settings.drives)
    state = "The drives are off, the brakes are on." if braked else "The drives are off."
    return f"{state} Is the payload mounted and the workspace clear?"


def _counts_line(load: SessionLoad, summaries: list[CycleSummary], wall_s: float) -> str:
    """Counts of one half's runs, in one line."""
    motion_s = sum(summary.duration_s for summary in summaries)
    missing = sum(int(summary.missing.sum()) for summary in summaries)
    skipped = sum(summary.skipped for summary in summaries)
    return (
        f"{load}: {motion_s:.0f} s of motion in {wall_s:.0f} s ({motion_s / wall_s:.1f} times real time), "
        f"{missing} feedback frames missing, {skipped} cycles skipped"
    )
