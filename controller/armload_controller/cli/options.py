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
    Path | None, typer.Option("--urdf", help="URDF of the arm, instead of ROBOT; recorded effort is joint torque.")
]
BaseOption = Annotated[str | None, typer.Option("--base", help="First link of the arm; by default the root.")]
FlangeOption = Annotated[
    str | None, typer.Option("--flange", help="Last link of the arm; required if the URDF is ambiguous.")
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
    bool, typer.Option("--simulated-drives", help="Use simulated drives only; the identity of each node is checked.")
]
YesOption = Annotated[
    bool,
    typer.Option(
        "--yes", help="Skip prompts, but not the slow round, nor on a real arm the first question with a payload."
    ),
]
CalibrationOption = Annotated[
    Path | None,
    typer.Option(
        "--calibration", help="Calibration file from `armload calibrate`; by default the one named in the robot's file."
    ),
]
LiveOption = Annotated[
    bool, typer.Option("--live", help="Show the moving arm in Foxglove on this computer. Requires the extra live.")
]
LiveAddressOption = Annotated[
    str | None,
    typer.Option("--live-address", metavar="HOST:PORT", help="Address for --live; by default 127.0.0.1:8765."),
]
