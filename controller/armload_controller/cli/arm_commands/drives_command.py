"""`armload drives`: nodes on the bus, an arm's drives against its configuration, their state, fault reset.

Nothing here energises a drive but `check --brakes`, under the rules for moving an arm. `scan` and `show` only read;
`armload_drivers.bring_up.drive_check` decides what `check` and `reset` may write to which drive. On the virtual bus,
which has no other node, simulated drives answer. `store` and `assign` write what a drive keeps, and ask first.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import asdict
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer

from armload_controller.cli.command_group import Commands
from armload_controller.cli.exit_status import ExitStatus
from armload_controller.cli.given_arm import ArmOnBus, DrivenArm
from armload_controller.cli.options import BUS_FORM, bus_address
from armload_controller.cli.screen import PLAIN, Screen
from armload_controller.control_errors import CommissioningError, ConfigurationError, UnsafeBus
from armload_controller.motion.motion_control import MotionControl
from armload_identification.results.json_document import json_document

if TYPE_CHECKING:
    import can

    from armload_controller.config.robot import Robot
    from armload_controller.session.brake_test import BrakeFinding
    from armload_drivers.bring_up.arm_bring_up import ArmBringUp
    from armload_drivers.canopen.lss_master import LssAddress

drives = Commands("Inspect the drives on a bus. Only check --brakes energises.")

_MOST_COLUMNS = 100
"""Width of a check also in a file, where other output is not wrapped."""


@drives.command("scan")
def scan_command(
    bus: Annotated[str, typer.Argument(metavar=BUS_FORM, help="The bus, such as socketcan:can0.")],
    bitrate: Annotated[int, typer.Option("--bitrate", help="Bit rate of the bus in bit/s.")] = 1_000_000,
    screen: Screen = PLAIN,
) -> None:
    """List the drives on the bus: identity, modes, and missing safety properties. Only reads.

    ethercat:eth1 lists the drives of an EtherCAT line, which are put in PREOP; refused if another master is heard.
    """
    from armload_controller.cli.output.drive_result_tables import found_table
    from armload_controller.cli.output.json_documents import nodes_document
    from armload_controller.config.tables.drive_tables import VIRTUAL
    from armload_controller.session.arm_access import nodes_on

    interface, channel = bus_address(bus, BUS_FORM)
    if interface == VIRTUAL:
        raise UnsafeBus("a virtual bus has no nodes outside this process: give the interface of a real bus")
    found = nodes_on(interface, channel, bitrate)
    screen.document(partial(nodes_document, interface, channel, found))
    if not found:
        screen.step(f"no node answers on {interface}:{channel} at {bitrate} bit/s")
        raise typer.Exit(ExitStatus.REFUSED)
    screen.table(found_table(found))
    _hint_at_profiles(screen, (node.identity.vendor_id for node in found))


def _hint_at_profiles(screen: Screen, vendor_ids: Iterable[int | None]) -> None:
    """Name the shipped profiles of vendors, each once."""
    from armload_controller.config.drive_profiles import profile_hint

    for hint in dict.fromkeys(filter(None, map(profile_hint, vendor_ids))):
        screen.console.print(hint)


@drives.command("check")
def check_command(
    driven: DrivenArm,
    brakes: Annotated[
        bool,
        typer.Option("--brakes", help="Then enable the drives with their brakes closed, and push against each. Asks."),
    ] = False,
    screen: Screen = PLAIN,
) -> None:
    """Perform bring-up short of enabling, and check the safety properties. Resets and configures the arm's nodes."""
    from armload_controller.cli.output.drive_result_tables import check_table, safety_table
    from armload_controller.cli.output.json_documents import checks_document
    from armload_drivers.bring_up.drive_check import Verdict, check

    arm = driven.arm(driven.cycle_hz)
    screen.console.width = min(screen.console.width, _MOST_COLUMNS)
    for text in arm.drives.peculiarities:
        screen.console.print(text)
    with _bring_up(arm) as bring_up:
        found = check(bring_up)
    rows = found.steps
    screen.table(check_table(rows))
    if found.secured:
        screen.table(safety_table(found.secured))
    wrong = sum(row.verdict in {Verdict.WRONG, Verdict.NOT_DONE} for row in rows)
    missing = sum(row.verdict is Verdict.MISSING for row in rows)
    left = [f"{count} {what}" for count, what in ((wrong, "wrong or not done"), (missing, "missing")) if count]
    if left:
        drives = arm.drives.settings.drives
        named = arm.drives.profiles
        _hint_at_profiles(screen, (drive.wanted_identity.vendor_id for drive in drives if drive.joint not in named))
    screen.result(f"of {len(rows)} steps {', '.join(left)}" if left else f"all {len(rows)} steps are ok")
    tried = _brakes_tried(arm, screen, driven) if brakes and not wrong else ()
    screen.document(partial(checks_document, arm.name, found, tried))
    if wrong or any(finding.tried_nm and not finding.holds for finding in tried):
        raise typer.Exit(ExitStatus.REFUSED)


def _brakes_tried(arm: Robot, screen: Screen, driven: DrivenArm) -> tuple[BrakeFinding, ...]:
    """Try the brakes, and show the result."""
    from armload_controller.cli.attendance import operator_at
    from armload_controller.cli.output.drive_result_tables import brake_table
    from armload_controller.session.brake_test import brakes_tried
    from armload_controller.session.run_session import run_session
    from armload_controller.session.session_load import SessionLoad

    driven.require_rules(arm)
    open_servos = driven.opened(arm, screen, brakes_closed=True)
    with (
        operator_at(arm, screen, agreed=False, live=None) as operator,
        run_session(arm, SessionLoad.LOADED, open_servos, operator) as session,
    ):
        found = brakes_tried(session)
    screen.table(brake_table(found))
    return found


@drives.command("show")
def show_drives(
    on_bus: ArmOnBus,
    once: Annotated[bool, typer.Option("--once", help="Print one table instead of a new one every second.")] = False,
    screen: Screen = PLAIN,
) -> None:
    """Show state, position and effort of every drive, and the bus load, until Ctrl-C. Only reads."""
    from armload_controller.cli.output.drive_result_tables import bus_line, status_table
    from armload_controller.cli.output.json_documents import status_document
    from armload_controller.session.stop_signals import StopSignals
    from armload_drivers.bring_up import arm_bring_up

    arm = on_bus.arm()
    control = MotionControl()
    with StopSignals(control), _bring_up(arm) as bring_up:
        while control.goal.stop is None:
            status = bring_up.status(arm_bring_up.LISTEN_S)
            screen.table(status_table(status))
            screen.result(bus_line(status))
            screen.document(partial(status_document, arm.name, status))
            if once:
                return


@drives.command("reset")
def reset_command(
    on_bus: ArmOnBus,
    joint: Annotated[str, typer.Argument(metavar="JOINT", help="Name of the joint, as in the configuration.")],
    yes: Annotated[bool, typer.Option("--yes", help="The cause has been removed: do not ask.")] = False,
    screen: Screen = PLAIN,
) -> None:
    """Reset the fault of one drive, once its cause is removed. On a real arm, asks first. Nothing is enabled."""
    from armload_drivers.bring_up.drive_check import reset

    arm = on_bus.arm()
    if joint not in arm.joint_names:
        raise ConfigurationError(arm.file, "JOINT", joint, f"one of: {', '.join(arm.joint_names)}")
    node_id = arm.drives.settings.drives[arm.joint_names.index(joint)].node_id
    with _bring_up(arm) as bring_up:
        state = reset(bring_up, joint, lambda question: yes or screen.confirm(question))
    if state is None:
        raise CommissioningError("not confirmed: nothing was reset")
    fields = {"robot": arm.name, "joint": joint, "node_id": node_id, "state": state.title}
    screen.document(lambda: json_document("reset", fields))
    screen.result(f"{joint}: {state.title}")


@drives.command("store")
def store_command(
    on_bus: ArmOnBus,
    yes: Annotated[bool, typer.Option("--yes", help="Store the settings: do not ask.")] = False,
    screen: Screen = PLAIN,
) -> None:
    """Store the present settings of the arm's drives in their memory (1010). On a real arm, asks first."""
    from armload_drivers.bring_up.drive_store import store

    arm = on_bus.arm()
    with _bring_up(arm) as bring_up:
        if not store(bring_up, lambda question: yes or screen.confirm(question)):
            raise CommissioningError("not confirmed: nothing was stored")
    screen.document(lambda: json_document("stored", {"robot": arm.name, "joints": list(arm.joint_names)}))
    screen.result(f"stored: {', '.join(arm.joint_names)}")


@drives.command("assign")
def assign_command(
    bus: Annotated[str, typer.Argument(metavar=BUS_FORM, help="The bus, such as socketcan:can0.")],
    node_id: Annotated[int, typer.Option("--node-id", min=1, max=127, help="Node id of the node from now on.")],
    new_bitrate: Annotated[
        int | None, typer.Option(help="Bit rate of the node from its next power-on, in bit/s.")
    ] = None,
    identity: Annotated[
        str | None,
        typer.Option(
            metavar="VENDOR:PRODUCT:REVISION:SERIAL",
            help="Identity (1018) of the node; by default the one that has no node id.",
        ),
    ] = None,
    bitrate: Annotated[int, typer.Option("--bitrate", help="Bit rate of the bus in bit/s.")] = 1_000_000,
    yes: Annotated[bool, typer.Option("--yes", help="Set it: do not ask.")] = False,
    screen: Screen = PLAIN,
) -> None:
    """Give a node its node id, and a bit rate, by layer setting services (LSS). Asks first."""
    from armload_controller.session.arm_access import open_bus
    from armload_drivers.canopen.lss_master import BIT_TIMINGS
    from armload_drivers.canopen.node_assignment import assign_node

    if new_bitrate is not None and new_bitrate not in BIT_TIMINGS:
        raise typer.BadParameter(f"{new_bitrate}: expected one of {', '.join(map(str, BIT_TIMINGS))}")
    address = None if identity is None else _address(identity)
    with open_bus(*bus_address(bus, BUS_FORM), bitrate) as opened:
        found = assign_node(opened, node_id, new_bitrate, address, lambda question: yes or screen.confirm(question))
    if found is None:
        raise CommissioningError("not confirmed: nothing was set")
    fields = asdict(found) | {"node_id": node_id, "bitrate": new_bitrate}
    screen.document(lambda: json_document("assigned", fields))
    screen.result(f"{found}: node id {node_id}")


def _address(text: str) -> LssAddress:
    """The identity in an option.

    Raises:
        BadParameter: not four numbers of 32 bits.
    """
    from armload_drivers.canopen.lss_master import LssAddress

    try:
        numbers = [int(part, 0) for part in text.split(":")]
    except ValueError:
        numbers = []
    if len(numbers) != 4 or not all(0 <= number < 1 << 32 for number in numbers):
        raise typer.BadParameter(f"{text!r}: expected four numbers of 32 bits, such as 0x2DC:0x1:0x10000:0x7")
    return LssAddress(*numbers)


@contextmanager
def _bring_up(robot: Robot) -> Iterator[ArmBringUp]:
    """The robot's drives on its bus, before cycles run."""
    from armload_drivers.canopen.canopen_bring_up import CanopenBringUp
    from armload_drivers.ethercat.ethercat_bring_up import open_bring_up

    if robot.bus.on_ethercat:
        with open_bring_up(robot.drives.settings, robot.bus.parts[0].channel) as bring_up:
            yield bring_up
        return
    with _bus_of(robot) as opened:
        yield CanopenBringUp(robot.drives.settings, opened)


@contextmanager
def _bus_of(robot: Robot) -> Iterator[can.BusABC]:
    """The robot's bus; a virtual one with simulated drives on it."""
    from armload_controller.session.arm_access import bus_of
    from armload_drivers.bus.joined_bus import BusRole
    from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
    from armload_drivers.simulation.plant_interface import StandingPlant

    with ExitStack() as stack:
        opened = stack.enter_context(bus_of(robot))
        if robot.bus.in_virtual_time:
            drives_bus = stack.enter_context(bus_of(robot, BusRole.DRIVES))
            plant = StandingPlant(robot.simulation.start_rad)
            stack.enter_context(SimulatedDrives(robot.drives.settings, plant, drives_bus, time.monotonic))
        yield opened
