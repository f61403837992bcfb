"""`armload watch`: the payload of an arm while it works."""

from __future__ import annotations

from enum import StrEnum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeVar

import typer

from armload_controller.cli.given_arm import arm_on_bus
from armload_controller.cli.options import (
    BitrateOption,
    BusOption,
    CalibrationOption,
    GainDriftOption,
    ReferenceMassOption,
    ReferenceOption,
    RobotArgument,
    seconds_of,
    share_of,
)
from armload_controller.cli.output.findings_output import ReportOption
from armload_controller.cli.output.json_output import JsonOption

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from contextlib import AbstractContextManager

    from armload_controller.analysis.payload_watch import PayloadWatch, WatchedMoment
    from armload_controller.analysis.watch_history import WatchDiary
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import Robot
    from armload_controller.session.joint_feeds import JointFeed
    from armload_controller.session.run_session import SessionLoad

_Stated = TypeVar("_Stated", bound=StrEnum)


def watch(
    robot: RobotArgument,
    recording: Annotated[
        Path | None,
        typer.Argument(metavar="[RECORDING]", help="Recording, finished or still growing; by default the arm's bus."),
    ] = None,
    calibration: CalibrationOption = None,
    bus: BusOption = None,
    bitrate: BitrateOption = None,
    ros2: Annotated[
        str | None,
        typer.Option("--ros2", metavar="TOPIC", help="Joint states of this ROS 2 topic, such as /joint_states."),
    ] = None,
    effort: Annotated[
        str | None,
        typer.Option(
            metavar="torque|current", help="With --ros2: what the topic's effort is; by default joint torque."
        ),
    ] = None,
    rtde: Annotated[
        str | None, typer.Option("--rtde", metavar="HOST", help="Controller of an arm of Universal Robots.")
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option("--record", help="Record the data received (.mcap); needs no calibration."),
    ] = None,
    load: Annotated[
        str | None,
        typer.Option(metavar="unloaded|loaded", help="With --record: what the arm carries, for `armload calibrate`."),
    ] = None,
    for_s: Annotated[
        str | None, typer.Option("--for", metavar="TIME", help="Without a RECORDING: end after this time, such as 60s.")
    ] = None,
    follow: Annotated[
        bool, typer.Option("--follow", help="Continue to read a growing recording, until it is finished or Ctrl-C.")
    ] = False,
    every_s: Annotated[float, typer.Option(min=0.1, help="Time between two lines in s.")] = 1.0,
    gain_drift: GainDriftOption = None,
    reference: ReferenceOption = None,
    reference_mass_kg: ReferenceMassOption = None,
    report: ReportOption = None,
    as_json: JsonOption = False,
) -> None:
    """Show what a calibrated arm carries while another program moves it: mass, interval, and events such as grasped.

    Joints come from the arm's CANopen bus, where armload only listens, from ROS 2 (--ros2), or from a UR controller
    (--rtde). --record saves the received data, --report draws them.
    """
    from time import sleep

    from armload_controller.analysis.payload_watch import PayloadWatch
    from armload_controller.analysis.payload_watch import follow as followed
    from armload_controller.analysis.stated_drift import StatedDrift
    from armload_controller.cli.output.output_files import require_drawable
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_controller.session.joint_feeds import bus_feed, ros2_feed, rtde_feed
    from armload_controller.session.run_session import SessionLoad
    from armload_identification.recording.reading_options import Effort

    sources = {"--bus": bus, "--ros2": ros2, "--rtde": rtde}
    _check_combination(recording, sources, {"--record": record, "--load": load, "--for": for_s}, effort, follow=follow)
    require_drawable(report)
    screen = Screen(as_json=as_json)
    arm = load_robot(robot)
    drift = StatedDrift(share_of(gain_drift), reference, reference_mass_kg)
    unused = (calibration, arm.calibration_file, gain_drift, reference, reference_mass_kg) == (None,) * 5
    payload = None if unused and record is not None else PayloadWatch(arm, calibration, every_s, drift)
    if recording is not None and payload is not None:
        watched = str(recording)
        moments = followed(payload, recording, sleep, every_s) if follow else payload.file(recording)
    else:
        duration_s = float("inf") if for_s is None else seconds_of(for_s, "--for")
        stated_load, stated_effort = (
            _stated(load, SessionLoad, "--load"),
            _stated(effort, Effort, "--effort") or Effort.TORQUE,
        )
        if ros2 is not None:
            watched, feed = ros2, ros2_feed(arm, ros2, stated_effort)
        elif rtde is not None:
            watched, feed = rtde, rtde_feed(arm, rtde)
        else:
            arm = arm_on_bus(robot, bus, bitrate)
            watched, feed = f"{arm.bus.address}", bus_feed(arm)
        moments = _live_moments(screen, arm, payload, feed, every_s, record, stated_load, duration_s)
    diary = None
    if report is not None:
        from armload_controller.analysis.watch_history import WatchDiary

        if payload is None:
            what = "requires a calibrated arm; without a calibration the arm is only recorded"
            raise typer.BadParameter(what, param_hint="--report")
        diary = WatchDiary(arm, payload, watched)
    _show(screen, arm, moments, diary, report)


def _show(
    screen: Screen, arm: Robot, moments: Iterator[WatchedMoment], diary: WatchDiary | None, report: Path | None
) -> None:
    """Show the moments as they come, and write the report at the end."""
    from armload_controller.cli.output.watch_output import shown_moments
    from armload_drivers.driver_errors import DriverError

    try:
        with shown_moments(screen, arm.name, arm.joint_names) as show:
            for moment in moments:
                show(moment)
                if diary is not None:
                    diary.add(moment)
                screen.document(partial(moment.to_dict, arm.name))
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


def _check_combination(
    recording: Path | None,
    sources: Mapping[str, str | None],
    of_live: Mapping[str, object],
    effort: str | None,
    *,
    follow: bool,
) -> None:
    """Refuse options that cannot be combined."""
    given = [name for name, value in {**sources, **of_live}.items() if value is not None]
    if recording is not None and given:
        what = "applies to an arm that moves now and cannot be combined with a RECORDING"
        raise typer.BadParameter(what, param_hint=", ".join(given))
    if sum(name in sources for name in given) > 1:
        raise typer.BadParameter("the joints come from one place; give one of them", param_hint=", ".join(given))
    if effort is not None and sources["--ros2"] is None:
        raise typer.BadParameter("requires --ros2", param_hint="--effort")
    if of_live["--load"] is not None and of_live["--record"] is None:
        raise typer.BadParameter("requires --record", param_hint="--load")
    if follow and recording is None:
        raise typer.BadParameter("requires a RECORDING; a moving arm is always followed", param_hint="--follow")


def _live_moments(
    screen: Screen,
    arm: Robot,
    payload: PayloadWatch | None,
    opened: AbstractContextManager[JointFeed],
    every_s: float,
    record: Path | None,
    load: SessionLoad | None,
    for_s: float,
) -> Iterator[WatchedMoment]:
    """Moments of the moving arm, until stopped or the time is over."""
    import time
    from contextlib import ExitStack

    from armload_controller.motion.motion_control import MotionControl
    from armload_controller.session.bus_watch import BusWatch, recorder_of
    from armload_controller.session.stop_signals import StopSignals
    from armload_drivers.driver_errors import DriverError

    control = MotionControl()
    end_s = time.monotonic() + for_s
    recorder = None
    try:
        with ExitStack() as stack:
            stack.enter_context(StopSignals(control))
            feed = stack.enter_context(opened)
            recorder = None if record is None else stack.enter_context(recorder_of(arm, record, load))
            screen.step(f"listening to {arm.name} on {feed.name}; {feed.what_is_sent}. Ctrl-C ends it")
            watching = BusWatch(arm, payload, recorder, every_s, effort=feed.effort)
            for moment in watching.moments(feed.cycles, lambda: control.goal.stop is None and time.monotonic() < end_s):
                feed.publish(moment)
                yield moment
    except DriverError:
        if recorder is not None and recorder.rows:
            screen.step(f"recorded up to the error: {recorder.partial}, {recorder.rows} cycles, usable as it is")
        raise
    if recorder is not None:
        screen.step(f"written: {record}, {recorder.rows} cycles" if recorder.rows else "nothing was recorded")


def _stated(text: str | None, kind: type[_Stated], option: str) -> _Stated | None:
    """The value given by an option."""
    try:
        return None if text is None else kind(text)
    except ValueError:
        raise typer.BadParameter(f"{text!r}: expected {' or '.join(kind)}", param_hint=option) from None
