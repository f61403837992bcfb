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
_BETWEEN_ENDS = re.compile(r"(?<!\.)\.\.(?!\.)")
"""What stands between the ends of a range, as in 1..3; three dots could be a decimal point too."""
_SECONDS = {"": 1.0, "s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
_DURATION = re.compile(r"(\d+(?:\.\d*)?|\.\d+)\s*(ms|s|min|h|)")


def ends_of(text: str, unit: str = "") -> list[float]:
    """The numbers of a range, as in 1..3, or the only one; empty if one is no number, which may end with the unit."""
    try:
        return [float(part.strip().removesuffix(unit)) for part in _BETWEEN_ENDS.split(text)]
    except ValueError:
        return []


def time_s(text: str) -> float:
    """The time that an option states, in s.

    Args:
        text: Value of the option, such as 10s, 1.5min, 500ms, 2h, or 10 for 10 s.

    Raises:
        BadParameter: not a time.
    """
    match = _DURATION.fullmatch(text.strip())
    if match is None:
        raise typer.BadParameter(f"{text!r} is not a time; write 10s, 1.5min, 500ms or 2h")
    return float(match[1]) * _SECONDS[match[2]]


def duration_s(text: str) -> float:
    """The same, above zero.

    Raises:
        BadParameter: not a time, or not above zero.
    """
    seconds = time_s(text)
    if seconds == 0.0:
        raise typer.BadParameter(f"{text!r}: expected a time above zero, such as 10s")
    return seconds


def share(text: str) -> float:
    """The share that an option states: 0.03 from '3%' or '0.03'.

    Raises:
        BadParameter: not a share above zero.
    """
    number, percent, rest = text.partition("%")
    try:
        found = float(number) * (0.01 if percent else 1.0)
    except ValueError:
        found = float("nan")
    if rest.strip() or not found > 0.0:
        raise typer.BadParameter(f"{text!r}: expected a share such as 3% or 0.03")
    return found


def refuse_together(context: typer.Context, why: str, *names: str) -> None:
    """Refuse options that were given, and do not apply with what else was.

    Args:
        context: The command's, with what was given.
        why: Why they do not apply.
        names: Names of their parameters.

    Raises:
        BadParameter: naming those that were given.
    """
    options = [option for option in context.command.params if option.name in names]
    sources = [context.get_parameter_source(option.name or "") for option in options]
    given = [o.opts[0] for o, source in zip(options, sources, strict=True) if source and source.name == "COMMANDLINE"]
    if given:
        raise typer.BadParameter(why, param_hint=", ".join(given))


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
