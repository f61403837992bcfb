"""Arguments and options that several commands share."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

RobotArgument = Annotated[str, typer.Argument(metavar="ROBOT", help="A shipped robot, or the path of a robot's TOML.")]
ArmArgument = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT", help="A shipped robot, or the path of a robot's TOML or URDF (effort is then joint torque)."
    ),
]
BaseOption = Annotated[str | None, typer.Option("--base", help="First link of the arm; by default the root.")]
FlangeOption = Annotated[
    str | None, typer.Option("--flange", help="Last link of the arm; required if the URDF is ambiguous.")
]
BUS_FORM = "INTERFACE:CHANNEL"
BusOption = Annotated[
    str | None,
    typer.Option(
        "--bus",
        metavar=BUS_FORM,
        help="The bus, such as socketcan:can0, or socketcan:can0,can1 for an arm on two, instead of that in its file.",
    ),
]
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
GainDriftOption = Annotated[
    str | None,
    typer.Option(
        "--gain-drift",
        metavar="SHARE",
        help="With a calibrated arm: standard deviation of the drift of all gains together since the calibration, "
        "such as 3%; if not given, that between the calibration's sessions, else 1%.",
    ),
]
ReferenceOption = Annotated[
    Path | None,
    typer.Option(
        "--reference",
        help="With a calibrated arm: a run of the same day and of any motion, empty or with a weighed tool, which "
        "measures that drift.",
    ),
]
ReferenceMassOption = Annotated[
    float | None, typer.Option("--reference-mass", metavar="KG", help="Mass of the tool on the reference.")
]
MountedOption = Annotated[
    str | None,
    typer.Option(
        "--mounted",
        help="Payload on the flange of the simulated arm in this process, as named under simulation.payloads.",
    ),
]
LiveOption = Annotated[
    bool, typer.Option("--live", help="Show the moving arm in Foxglove on this computer. Requires the extra live.")
]
LiveAddressOption = Annotated[
    str | None,
    typer.Option("--live-address", metavar="HOST:PORT", help="Address for --live; by default 127.0.0.1:8765."),
]

_SECONDS = {"": 1.0, "s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
_DURATION = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*(ms|s|min|h|)")


def seconds_of(text: str, option: str, *, above_zero: bool = True) -> float:
    """The time that an option states, in s.

    Args:
        text: Value of the option, such as 10s, 1.5min, 500ms, 2h, or 10 for 10 s.
        option: Name of the option.
        above_zero: Whether a time of zero is refused.

    Raises:
        BadParameter: not a time, or not above zero.
    """
    match = _DURATION.fullmatch(text.strip())
    if match is None:
        raise typer.BadParameter(f"{text!r} is not a time; write 10s, 1.5min, 500ms or 2h", param_hint=option)
    seconds = float(match[1]) * _SECONDS[match[2]]
    if above_zero and seconds == 0.0:
        raise typer.BadParameter(f"{text!r}: expected a time above zero, such as 10s", param_hint=option)
    return seconds


def share_of(text: str | None, option: str = "--gain-drift") -> float | None:
    """The share that an option states: 0.03 from '3%' or '0.03'; None if it is not given.

    Raises:
        BadParameter: not a share above zero.
    """
    if text is None:
        return None
    number, percent, rest = text.partition("%")
    try:
        share = float(number) * (0.01 if percent else 1.0)
    except ValueError:
        share = float("nan")
    if rest.strip() or not share > 0.0:
        raise typer.BadParameter(f"{text!r}: expected a share such as 3% or 0.03", param_hint=option)
    return share


def bus_address(text: str, option: str) -> tuple[str, str]:
    """The python-can interface and its channel that an option states.

    Args:
        text: Value of the option, such as socketcan:can0.
        option: Name of the option.

    Raises:
        BadParameter: the text does not have this form.
    """
    interface, _, channel = text.partition(":")
    if not interface or not channel:
        raise typer.BadParameter(f"{text!r}: expected {BUS_FORM}, such as socketcan:can0", param_hint=option)
    return interface, channel
