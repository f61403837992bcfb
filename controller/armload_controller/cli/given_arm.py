"""The arm given to a command: by name, file or URDF."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from armload_controller.cli.options import bus_address

if TYPE_CHECKING:
    from armload_controller.config.measured_arm import MeasuredArm
    from armload_controller.config.robot import Robot


def given_arm(robot: str, base: str | None, flange: str | None) -> MeasuredArm:
    """The arm of a ROBOT argument that may be a URDF.

    Args:
        robot: Name of a shipped robot, or path of a robot's file or of a URDF.
        base: First link of the arm in the URDF.
        flange: Its last link.

    Raises:
        BadParameter: links without a URDF.
        ConfigurationError: the file cannot be used.
    """
    from armload_controller.config.chain_from_urdf import read_urdf_arm
    from armload_controller.config.urdf_tree import is_urdf

    if is_urdf(Path(robot)):
        return read_urdf_arm(robot, base, flange)
    from armload_controller.config.robot import load_robot

    if base is not None or flange is not None:
        raise typer.BadParameter(f"select the arm in a URDF; ROBOT {robot!r} is none", param_hint="--base, --flange")
    return load_robot(robot)


def arm_on_bus(robot: str, bus: str | None, bitrate: int | None = None, cycle_hz: float | None = None) -> Robot:
    """The arm of a ROBOT argument, on the bus of the options.

    Args:
        robot: Name or path of a robot's file.
        bus: INTERFACE:CHANNEL, instead of the configured bus.
        bitrate: Bit rate in bit/s, instead of the configured one.
        cycle_hz: SYNC rate, instead of the configured one.

    Raises:
        BadParameter: the bus has another form.
        ConfigurationError: the file cannot be used, or has no bus.
    """
    from armload_controller.config.robot import load_robot

    interface, channel = (None, None) if bus is None else bus_address(bus, "--bus")
    return load_robot(robot).with_bus(interface, channel, bitrate, cycle_hz)
