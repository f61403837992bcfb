"""`armload watch`: what a calibrated arm carries while it works."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.options import CalibrationOption, RobotArgument
from armload_controller.cli.output.json_output import JsonOption


def watch(
    robot: RobotArgument,
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording, finished or still growing.")],
    calibration: CalibrationOption = None,
    follow: Annotated[
        bool, typer.Option("--follow", help="Wait for more, until the recording is finished or Ctrl-C.")
    ] = False,
    every_s: Annotated[float, typer.Option(min=0.1, help="Time between two lines in s.")] = 1.0,
    as_json: JsonOption = False,
) -> None:
    """Show what a calibrated arm carries, second by second: mass, interval, grasped, dropped, contact at rest."""
    from importlib.metadata import version
    from time import sleep

    from armload_controller.analysis import payload_watch
    from armload_controller.cli.output.json_output import print_document
    from armload_controller.cli.output.watch_output import moment_text
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot

    screen = Screen(as_json=as_json)
    arm = load_robot(robot)
    watching = payload_watch.PayloadWatch(arm, calibration, every_s)
    moments = payload_watch.follow(watching, recording, sleep, every_s) if follow else watching.file(recording)
    try:
        for moment in moments:
            for event in moment.events:
                screen.step(f"{event.time_s:10.1f} s  {event}")
            screen.result(moment_text(moment))
            if as_json:
                print_document(moment.to_dict(arm.name, version("armload")))
    except KeyboardInterrupt:
        screen.step("no longer watched")
