"""`armload simulate`: the drives of a simulated arm alone, for another process to command."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from armload_controller.cli.options import BitrateOption, ChannelOption, CycleOption, InterfaceOption, RobotArgument
from armload_controller.control_errors import ConfigurationError
from armload_controller.motion.motion_control import MotionControl

NO_PAYLOAD = "none"
POLL_S = 0.1


def simulate(
    robot: RobotArgument,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    cycle_hz: CycleOption = None,
    payload: Annotated[
        str | None,
        typer.Option(help="A payload named under simulation.payloads, or 'none'; the configured one if not given."),
    ] = None,
    description: Annotated[
        list[Path] | None,
        typer.Option(
            "--description",
            help="Serve exactly the objects of this EDS or DCF file: one for all joints, or one per joint in order.",
        ),
    ] = None,
    write_eds: Annotated[
        Path | None,
        typer.Option("--write-eds", help="Write an EDS file per joint into this folder, for other masters, and end."),
    ] = None,
) -> None:
    """Serve simulated CiA 402 drives with an arm behind them, until Ctrl-C."""
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_controller.session.arm_access import drives_alone
    from armload_controller.session.stop_signals import StopSignals
    from armload_drivers.bring_up.description_file import read_description
    from armload_drivers.simulation.drives.drive_eds import drive_eds
    from armload_identification.storage.strict_toml import write_text

    arm = load_robot(robot).with_bus(interface, channel, bitrate, cycle_hz)
    name = arm.simulation.payload_name if payload is None else payload
    mounted = None if name == NO_PAYLOAD else name
    screen = Screen()
    described = [read_description(path) for path in description or ()]
    for warning in [warning for found in described for warning in found.warnings]:
        screen.step(f"warning: {warning}")
    if len(described) not in {0, 1, arm.n}:
        raise ConfigurationError(
            "command line", "--description", len(described), f"expected one for all joints, or one per joint: {arm.n}"
        )
    if write_eds is not None:
        try:
            write_eds.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ConfigurationError(
                "command line", "--write-eds", str(write_eds), f"expected a folder: {error.strerror}"
            ) from error
        for drive in arm.drives.settings.drives:
            path = write_eds / f"{drive.joint}.eds"
            write_text(path, drive_eds(drive, arm.drives.settings.cycle_s), ConfigurationError)
            screen.step(f"written: {path}")
        return
    control = MotionControl()
    with (
        StopSignals(control),
        drives_alone(arm, mounted, run=int(mounted is not None), described=described) as drives,
    ):
        screen.step(
            f"{arm.n} simulated drives of {arm.name} on {arm.bus.interface}:{arm.bus.channel}, "
            f"payload {mounted or NO_PAYLOAD}. Ctrl-C ends them."
        )
        while drives.running and control.goal.stop is None:
            time.sleep(POLL_S)
    screen.step("drives stopped")
