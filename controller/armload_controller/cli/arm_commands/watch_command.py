"""`armload watch`: the payload of an arm while it works."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.drift_options import DriftOptions
from armload_controller.cli.given_arm import ArmOnBus
from armload_controller.cli.options import CalibrationOption, duration_s, refuse_together
from armload_controller.cli.output.findings_output import ReportOption
from armload_controller.cli.screen import PLAIN, Screen
from armload_controller.session.session_load import SessionLoad
from armload_identification.recording.reading_options import Effort

if TYPE_CHECKING:
    from collections.abc import Iterator
    from contextlib import AbstractContextManager

    from armload_controller.analysis.payload_watch import PayloadWatch, WatchedMoment
    from armload_controller.analysis.watch_history import WatchDiary
    from armload_controller.config.robot import Robot
    from armload_controller.session.joint_feeds import JointFeed


def watch_payload(
    context: typer.Context,
    on_bus: ArmOnBus,
    *,
    recording: Annotated[
        Path | None,
        typer.Argument(metavar="[RECORDING]", help="Recording, finished or still growing; by default the arm's bus."),
    ] = None,
    calibration: CalibrationOption = None,
    ros2: Annotated[
        str | None,
        typer.Option("--ros2", metavar="TOPIC", help="Joint states of this ROS 2 topic, such as /joint_states."),
    ] = None,
    effort: Annotated[
        Effort | None, typer.Option(help="With --ros2: what the topic's effort is; by default joint torque.")
    ] = None,
    rtde: Annotated[
        str | None, typer.Option("--rtde", metavar="HOST", help="Controller of an arm of Universal Robots.")
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(help="Record the data received (.mcap); needs no calibration."),
    ] = None,
    load: Annotated[
        SessionLoad | None, typer.Option(help="With --record: what the arm carries, for `armload calibrate`.")
    ] = None,
    for_s: Annotated[
        float | None,
        typer.Option(
            "--for",
            metavar="TIME",
            parser=duration_s,
            help="Without a RECORDING: end after this time, such as 60s.",
        ),
    ] = None,
    follow: Annotated[
        bool, typer.Option("--follow", help="Continue to read a growing recording, until it is finished or Ctrl-C.")
    ] = False,
    every_s: Annotated[float, typer.Option(min=0.1, help="Time between two lines in s.")] = 1.0,
    drift: DriftOptions,
    report: ReportOption = None,
    screen: Screen = PLAIN,
) -> None:
    """Show what a calibrated arm carries while another program moves it: mass, interval, and events such as grasped.

    Joints come from the arm's CANopen bus, where armload only listens, from ROS 2 (--ros2), or from a UR controller
    (--rtde). --record saves the received data, --report draws them.
    """
    from time import sleep

    from armload_controller.analysis.payload_watch import PayloadWatch
    from armload_controller.analysis.payload_watch import follow as followed
    from armload_controller.cli.output.output_files import require_drawable
    from armload_controller.config.robot import load_robot
    from armload_controller.session.joint_feeds import bus_feed, ros2_feed, rtde_feed

    _refuse_other_sources(context, recording, on_bus, ros2, rtde)
    if record is None:
        refuse_together(context, "requires --record", "load")
    require_drawable(report)
    arm = load_robot(on_bus.robot)
    unused = calibration is None and arm.calibration_file is None and drift == DriftOptions()
    payload = None if unused and record is not None else PayloadWatch(arm, calibration, every_s, drift.stated())
    if recording is not None and payload is not None:
        watched = str(recording)
        moments = followed(payload, recording, sleep, every_s) if follow else payload.file(recording)
    else:
        if ros2 is not None:
            watched, feed = ros2, ros2_feed(arm, ros2, effort or Effort.TORQUE)
        elif rtde is not None:
            watched, feed = rtde, rtde_feed(arm, rtde)
        else:
            arm = on_bus.arm()
            watched, feed = f"{arm.bus.address}", bus_feed(arm)
        moments = _live_moments(screen, arm, payload, feed, every_s, record, load, for_s or float("inf"))
    diary = None
    if payload is None:
        refuse_together(context, "requires a calibrated arm; without a calibration the arm is only recorded", "report")
    elif report is not None:
        from armload_controller.analysis.watch_history import WatchDiary

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
    if diary is not None:
        screen.write(diary.write, report)


def _refuse_other_sources(
    context: typer.Context, recording: Path | None, on_bus: ArmOnBus, ros2: str | None, rtde: str | None
) -> None:
    """Refuse options of other sources of the arm's joints than the one that is given."""
    sources = ("bus", "ros2", "rtde")
    if recording is None:
        refuse_together(context, "requires a RECORDING; a moving arm is always followed", "follow")
    else:
        what = "applies to an arm that moves now and cannot be combined with a RECORDING"
        refuse_together(context, what, *sources, "record", "load", "for_s")
    if [on_bus.bus, ros2, rtde].count(None) < len(sources) - 1:
        refuse_together(context, "the joints come from one place; give one of them", *sources)
    if ros2 is None:
        refuse_together(context, "requires --ros2", "effort")


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
