"""`armload drives`: who is on the bus, whether an arm's drives are as configured, how they fare, fault reset.

Nothing here energises a drive, so it is allowed on any bus. `scan` and `show` only read; what `check` and `reset` may
write to whom is decided in `armload_drivers.bring_up.drive_check`. On the virtual bus, where nobody else could be,
simulated drives answer.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Annotated

import can
import typer
from rich.markup import escape
from rich.table import Table

from armload_controller.cli.options import BitrateOption, ChannelOption, CycleOption, InterfaceOption, RobotArgument
from armload_controller.cli.screen import Screen, listening
from armload_controller.config.robot import Robot, load_robot
from armload_controller.control_errors import CommissioningError, ConfigurationError, UnsafeBus
from armload_controller.motion.motion_control import MotionControl
from armload_controller.session.arm_access import VIRTUAL, open_bus
from armload_drivers.bring_up.drive_check import Check, Verdict, check, reset
from armload_drivers.bring_up.inspection import ArmStatus, FoundNode, find_nodes, show
from armload_drivers.cia402.emergency import describe
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.plant_interface import IdealPlant

EXIT_WRONG = 1
MODE_NAMES = {1: "PP", 3: "PV", 4: "PT", 6: "HM", 7: "IP", 8: "CSP", 9: "CSV", 10: "CST"}
_COLOURS = {Verdict.OK: "green", Verdict.MISSING: "yellow", Verdict.WRONG: "red", Verdict.NOT_DONE: "dim"}

drives = typer.Typer(help="Look at the drives on a bus. Nothing is energised.", no_args_is_help=True)


@drives.command("scan")
def scan_command(
    interface: Annotated[str, typer.Option("--interface", help="python-can interface, such as socketcan.")],
    channel: Annotated[str, typer.Option("--channel", help="Channel of the interface, such as can0.")],
    bitrate: Annotated[int, typer.Option("--bitrate", help="Bit rate of the bus in bit/s.")] = 1_000_000,
) -> None:
    """Who is on the bus: identity, modes, and what safety would miss. Only reads."""
    if interface == VIRTUAL:
        raise UnsafeBus("nobody is on a virtual bus but this process: give the interface of a real one")
    screen = Screen()
    with open_bus(interface, channel, bitrate) as bus:
        found = find_nodes(bus)
    if not found:
        screen.step(f"nobody answers on {interface}:{channel} at {bitrate} bit/s")
        sys.exit(EXIT_WRONG)
    screen.table(_found_table(found))


@drives.command("check")
def check_command(
    robot: RobotArgument,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    cycle_hz: CycleOption = None,
) -> None:
    """Everything of bring-up short of enabling, as a table per joint. Resets and configures the nodes it knows."""
    arm = load_robot(robot).with_bus(interface, channel, bitrate, cycle_hz)
    screen = Screen()
    with _bus_of(arm) as bus:
        rows = check(arm.arm_settings(), bus)
    screen.table(_check_table(rows))
    wrong = sum(row.verdict in {Verdict.WRONG, Verdict.NOT_DONE} for row in rows)
    missing = sum(row.verdict is Verdict.MISSING for row in rows)
    screen.step(f"{len(rows) - wrong - missing} ok, {missing} missing, {wrong} wrong or not done")
    if wrong:
        sys.exit(EXIT_WRONG)


@drives.command("show")
def show_command(
    robot: RobotArgument,
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    once: Annotated[bool, typer.Option("--once", help="One table instead of a new one every second.")] = False,
) -> None:
    """State, position and effort of every drive, and the load of the bus, until Ctrl-C. Only reads."""
    arm = load_robot(robot).with_bus(interface, channel, bitrate)
    screen = Screen()
    control = MotionControl()
    with listening(control), _bus_of(arm) as bus:
        while control.goal.stop is None:
            status = show(arm.arm_settings(), bus)
            screen.table(_status_table(status))
            screen.step(_bus_line(status))
            if once:
                return


@drives.command("reset")
def reset_command(
    robot: RobotArgument,
    joint: Annotated[str, typer.Argument(metavar="JOINT", help="Name of the joint, as the configuration has it.")],
    interface: InterfaceOption = None,
    channel: ChannelOption = None,
    bitrate: BitrateOption = None,
    yes: Annotated[bool, typer.Option("--yes", help="The cause is gone: do not ask.")] = False,
) -> None:
    """Reset the fault of one drive, once its cause is gone. Asks on a real arm. Nothing is enabled."""
    arm = load_robot(robot).with_bus(interface, channel, bitrate)
    if joint not in arm.joint_names:
        raise ConfigurationError(arm.file, "JOINT", joint, f"one of: {', '.join(arm.joint_names)}")
    screen = Screen()
    with _bus_of(arm) as bus:
        state = reset(arm.arm_settings(), joint, bus, lambda question: yes or screen.confirm(question))
    if state is None:
        raise CommissioningError("not confirmed: nothing was reset")
    screen.step(f"{joint}: {state.title}")


@contextmanager
def _bus_of(robot: Robot) -> Iterator[can.BusABC]:
    """The robot's bus; a virtual one with simulated drives on it."""
    bus = robot.bus
    with open_bus(bus.interface, bus.channel, bus.bitrate) as opened:
        if bus.interface != VIRTUAL:
            yield opened
            return
        plant = IdealPlant(robot.simulated_start_rad)
        with (
            open_bus(bus.interface, bus.channel, bus.bitrate) as drives_bus,
            SimulatedDrives(robot.arm_settings(), plant, drives_bus, time.monotonic),
        ):
            yield opened


def _found_table(found: list[FoundNode]) -> Table:
    """One row per node."""
    table = Table(title="nodes on the bus")
    for heading in ("node", "device", "vendor", "product", "revision", "modes", "lacks for safety"):
        table.add_column(heading)
    for node in found:
        kind = escape(node.name) or ("CiA 402 drive" if node.is_drive else "no CiA 402 drive")
        identity = node.identity
        numbers = (identity.vendor_id, identity.product_code, identity.revision)
        modes = " ".join(MODE_NAMES.get(mode, str(mode)) for mode in node.modes)
        lacks = " ".join(node.missing) if node.is_drive else "-"
        table.add_row(str(node.node_id), kind, *(_hexadecimal(number) for number in numbers), modes, lacks or "nothing")
    return table


def _hexadecimal(number: int | None) -> str:
    """A number of 1018."""
    return "-" if number is None else f"0x{number:08X}"


def _check_table(rows: list[Check]) -> Table:
    """One row per step and joint."""
    table = Table(title="bring-up, short of enabling")
    for heading in ("joint", "node", "step", "", "what"):
        table.add_column(heading, overflow="fold")
    for row in rows:
        verdict = f"[{_COLOURS[row.verdict]}]{row.verdict.value}[/]"
        table.add_row(row.joint, str(row.node_id), row.step, verdict, escape(row.detail))
    return table


def _status_table(status: ArmStatus) -> Table:
    """One row per joint."""
    table = Table()
    warm = any(drive.temperature_celsius is not None for drive in status.drives)
    for heading in ("joint", "node", "state", "axis position rad", "effort", *["°C"] * warm, "error"):
        table.add_column(heading, no_wrap=heading == "joint")
    for drive in status.drives:
        if drive.state is None:
            table.add_row(drive.joint, str(drive.node_id), "?", "", "", *[""] * warm, escape(drive.trouble))
            continue
        position = "-" if drive.position_rad is None else f"{drive.position_rad:+.5f}"
        effort = "-" if drive.effort is None else f"{drive.effort:+.3f} {drive.effort_unit}"
        error = "-" if drive.error_code is None else describe(drive.error_code)
        celsius = "-" if drive.temperature_celsius is None else f"{drive.temperature_celsius:.0f}"
        table.add_row(drive.joint, str(drive.node_id), drive.state.title, position, effort, *[celsius] * warm, error)
    return table


def _bus_line(status: ArmStatus) -> str:
    """The bus in one line."""
    passive = ", error passive" if status.error_passive else ""
    return f"bus load {status.bus_load:.1%}, {status.error_frames} error frames{passive}"
