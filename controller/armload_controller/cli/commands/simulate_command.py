"""`armload simulate`: the drives of a simulated arm alone, for another process to command."""

from __future__ import annotations

import time
from typing import Annotated

import typer

from armload_controller.cli.options import BitrateOption, ChannelOption, CycleOption, InterfaceOption, RobotArgument
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
) -> None:
    """Serve simulated CiA 402 drives with an arm behind them, until Ctrl-C."""
    from armload_controller.cli.screen import Screen
    from armload_controller.config.robot import load_robot
    from armload_controller.session.arm_access import drives_alone
    from armload_controller.session.stop_signals import StopSignals

    arm = load_robot(robot).with_bus(interface, channel, bitrate, cycle_hz)
    name = arm.simulation.payload_name if payload is None else payload
    mounted = None if name == NO_PAYLOAD else name
    screen = Screen()
    control = MotionControl()
    with (
        StopSignals(control),
        drives_alone(arm, mounted, run=int(mounted is not None)) as drives,
    ):
        screen.step(
            f"{arm.n} simulated drives of {arm.name} on {arm.bus.interface}:{arm.bus.channel}, "
            f"payload {mounted or NO_PAYLOAD}. Ctrl-C ends them."
        )
        while drives.running and control.goal.stop is None:
            time.sleep(POLL_S)
    screen.step("drives stopped")
