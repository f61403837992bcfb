"""`armload watch`: the payload of an arm while it works."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.given_arm import arm_on_bus
from armload_controller.cli.options import (
    BitrateOption,
    BusOption,
    CalibrationOption,
    RobotArgument,
    seconds_of,
)
from armload_controller.cli.output.findings_output import ReportOption
from armload_controller.cli.output.json_output import JsonOption

if TYPE_CHECKING:
    from collections.abc import Iterator

    from armload_controller.analysis.payload_watch import PayloadWatch, WatchedMoment
    from armload_controller.analysis.watch_history import WatchDiary
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import Robot
    from armload_controller.session.run_session import Load


def watch(
    robot: RobotArgument,
    recording: Annotated[
        Path | None,
        typer.Argument(metavar="[RECORDING]", help="Recording, finished or still growing; by default the arm's bus."),
    ] = None,
    calibration: CalibrationOption = None,
    bus: BusOption = None,
    bitrate: BitrateOption = None,
    record: Annotated[
        Path | None,
        typer.Option("--record", help="Record the data received on the bus (.mcap); needs no calibration."),
    ] = None,
    load: Annotated[
        str | None,
        typer.Option(metavar="unloaded|loaded", help="With --record: what the arm carries, for `armload calibrate`."),
    ] = None,
    for_s: Annotated[
        str | None, typer.Option("--for", metavar="TIME", help="On a bus: end after this time, such as 60s.")
    ] = None,
    follow: Annotated[
        bool, typer.Option("--follow", help="Continue to read a growing recording, until it is finished or Ctrl-C.")
    ] = False,
    every_s: Annotated[float, typer.Option(min=0.1, help="Time between two lines in s.")] = 1.0,
    report: ReportOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what a calibrated arm carries while another program moves it: mass, interval, and events such as grasped.

    On the arm's bus armload only listens and never sends. --record saves the received data, --report draws them.
    """
    from importlib.metadata import version

    from armload_controller.analysis.payload_watch import PayloadWatch
    from armload_controller.cli.output.output_files import require_drawable
    from armload_controller.cli.output.watch_output import shown_moments
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_drivers.driver_errors import DriverError

    of_bus = {"--bus": bus, "--record": record, "--load": load, "--for": for_s}
    if recording is not None and any(value is not None for value in of_bus.values()):
        given = ", ".join(name for name, value in of_bus.items() if value is not None)
        raise typer.BadParameter("applies to a bus and cannot be combined with a RECORDING", param_hint=given)
    if load is not None and record is None:
        raise typer.BadParameter("requires --record", param_hint="--load")
    if follow and recording is None:
        raise typer.BadParameter("requires a RECORDING; a bus is always followed", param_hint="--follow")
    if report is not None:
        require_drawable(report)
    screen = Screen(as_json=as_json)
    arm = load_robot(robot)
    calibrated = calibration is not None or arm.calibration_file is not None
    payload = PayloadWatch(arm, calibration, every_s) if calibrated or record is None else None
    if recording is not None and payload is not None:
        watched, moments = str(recording), _recording_moments(payload, recording, every_s, follow=follow)
    else:
        arm = arm_on_bus(robot, bus, bitrate)
        watched = f"{arm.bus.interface}:{arm.bus.channel}"
        duration_s = float("inf") if for_s is None else seconds_of(for_s, "--for")
        moments = _bus_moments(screen, arm, payload, every_s, record, _stated_load(load), duration_s)
    diary = None if report is None else _diary(arm, payload, watched)
    try:
        with shown_moments(screen, arm.name, arm.joint_names) as show:
            for moment in moments:
                show(moment)
                if diary is not None:
                    diary.add(moment)
                screen.document(partial(moment.to_dict, arm.name, version("armload")))
    except KeyboardInterrupt:
        screen.step("stopped watching")
    except DriverError:
        if report is not None and diary is not None and not diary.empty:
            diary.write(report)
            screen.step(f"written: {report}, up to the error")
        raise
    if report is not None and diary is not None:
        diary.write(report)
        screen.step(f"written: {report}")


def _diary(arm: Robot, payload: PayloadWatch | None, watched: str) -> WatchDiary:
    """Collects the moments for a report."""
    from importlib.metadata import version

    from armload_controller.analysis.watch_history import WatchDiary

    if payload is None:
        raise typer.BadParameter(
            "requires a calibrated arm; without a calibration the arm is only recorded", param_hint="--report"
        )
    return WatchDiary(arm, payload, watched, version("armload"))


def _recording_moments(
    watching: PayloadWatch, recording: Path, every_s: float, *, follow: bool
) -> Iterator[WatchedMoment]:
    """Moments of a recording, from its beginning."""
    from time import sleep

    from armload_controller.analysis.payload_watch import follow as followed

    return followed(watching, recording, sleep, every_s) if follow else watching.file(recording)


def _bus_moments(
    screen: Screen,
    arm: Robot,
    payload: PayloadWatch | None,
    every_s: float,
    record: Path | None,
    load: Load | None,
    for_s: float,
) -> Iterator[WatchedMoment]:
    """Moments of the arm's bus, until stopped or the time is over."""
    import time
    from contextlib import ExitStack

    from armload_controller.motion.motion_control import MotionControl
    from armload_controller.session.bus_watch import BusWatch, heard_cycles, recorder_of
    from armload_controller.session.stop_signals import StopSignals
    from armload_drivers.driver_errors import DriverError

    control = MotionControl()
    end_s = time.monotonic() + for_s
    recorder = None
    try:
        with ExitStack() as stack:
            stack.enter_context(StopSignals(control))
            cycles = stack.enter_context(heard_cycles(arm))
            recorder = None if record is None else stack.enter_context(recorder_of(arm, record, load))
            screen.step(
                f"listening to {arm.name} on {arm.bus.interface}:{arm.bus.channel}; nothing is sent. Ctrl-C ends it"
            )
            watching = BusWatch(arm, payload, recorder, every_s)
            yield from watching.moments(cycles, lambda: control.goal.stop is None and time.monotonic() < end_s)
    except DriverError:
        if recorder is not None and recorder.rows:
            screen.step(f"recorded up to the error: {recorder.partial}, {recorder.rows} cycles, usable as it is")
        raise
    if recorder is not None:
        screen.step(f"written: {record}, {recorder.rows} cycles" if recorder.rows else "nothing was recorded")


def _stated_load(text: str | None) -> Load | None:
    """The load given by the option."""
    from armload_controller.session.run_session import Load

    try:
        return None if text is None else Load(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r}: expected unloaded or loaded", param_hint="--load") from None
