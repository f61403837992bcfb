"""Arguments and options that several commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

RobotArgument = Annotated[str, typer.Argument(metavar="ROBOT", help="A shipped robot, or the path of a robot's TOML.")]
MaybeRobotArgument = Annotated[
    str | None, typer.Argument(metavar="[ROBOT]", help="A shipped robot, or the path of a robot's TOML; or --urdf.")
]
UrdfOption = Annotated[
    Path | None, typer.Option("--urdf", help="URDF of the arm, in place of ROBOT; recorded effort is joint torque.")
]
BaseOption = Annotated[str | None, typer.Option("--base", help="Link that the arm begins at; the root if not given.")]
FlangeOption = Annotated[
    str | None, typer.Option("--flange", help="Link that it ends at; needed where the URDF leaves a choice.")
]
InterfaceOption = Annotated[
    str | None, typer.Option("--interface", help="python-can interface, instead of the configured one.")
]
ChannelOption = Annotated[str | None, typer.Option("--channel", help="Channel of the interface, such as can0.")]
BitrateOption = Annotated[int | None, typer.Option("--bitrate", help="Bit rate of the bus in bit/s.")]
CycleOption = Annotated[float | None, typer.Option("--cycle-hz", help="SYNC rate in Hz.")]
LoadedOption = Annotated[Path, typer.Option("--loaded", help="Recording with the payload: MCAP, ROS 2 bag, CSV, ...")]
UnloadedOption = Annotated[Path, typer.Option("--unloaded", help="Recording of the same motion without it.")]
SimulatedDrivesOption = Annotated[
    bool, typer.Option("--simulated-drives", help="Drive simulated drives only; each node is asked who it is.")
]
YesOption = Annotated[
    bool,
    typer.Option(
        "--yes", help="Skip prompts. Never the slow round, nor the first question with a payload on a real arm."
    ),
]
CalibrationOption = Annotated[
    Path | None,
    typer.Option(
        "--calibration", help="Calibration file of `armload calibrate`; else the one that the robot's file names."
    ),
]
LiveOption = Annotated[
    bool, typer.Option("--live", help="Show the arm while it moves, to Foxglove on this computer. Extra: live.")
]
LiveAddressOption = Annotated[
    str | None,
    typer.Option("--live-address", metavar="HOST:PORT", help="Show it there; 127.0.0.1:8765 if not given."),
]
