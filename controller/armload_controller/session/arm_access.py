"""Opening an arm: the simulated one in this process, or drives on a bus.

On any bus except `virtual` a real arm is assumed. The rules, in the order in which they are checked:

1. The configuration states every drive's identity (1018), the workspace, and the joints' torque; an operator is at the
   terminal. Otherwise the bus is not opened.
2. The drivers compare every node's identity with the configuration's before they write anything to it, and refuse
   drives without the required safety properties: see `armload_drivers.bring_up.drive_bring_up`.
3. Drives without the simulation's identity are moved only with consent, and slowly first: see `commissioning`.

With `--simulated-drives` the required identity is the simulation's, so that no real drive can pass.
"""

from __future__ import annotations

import errno
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager
from dataclasses import replace

import can

from armload_controller.config.robot import Robot
from armload_controller.config.robot_simulation import NO_PAYLOAD
from armload_controller.config.tables.drive_tables import ETHERCAT
from armload_controller.control_errors import UnsafeBus
from armload_controller.cycle.realtime import tuned_for_cycles
from armload_controller.session.session_load import SessionLoad
from armload_drivers.bring_up.inspection import FoundNode
from armload_drivers.bus.joined_bus import BusRole, JoinedBus
from armload_drivers.bus.kernel_sync import BcmSync, BroadcastManager
from armload_drivers.bus.sync_sources import TimerSync
from armload_drivers.canopen.canopen_bring_up import find_nodes
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY
from armload_drivers.cia402.eds_parser import DeviceDescription
from armload_drivers.deadline_clock import DeadlineClock
from armload_drivers.driver_errors import BusError
from armload_drivers.ethercat.ethercat_bring_up import find_drives
from armload_drivers.ethercat.ethercat_line import open_line
from armload_drivers.ethercat.ethercat_servos import EthercatServos
from armload_drivers.servos import JointServos
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.lockstep_bus import lockstep_bus, lockstep_wires
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_drivers.simulation.plant_spec import ScheduledPayload
from armload_drivers.simulation.virtual_clock import VirtualClock

SOCKETCAN = "socketcan"
_CANOPEN_ONLY = "this command works on CANopen only, and this is an EtherCAT bus: give it a CANopen bus"


def require_rules(robot: Robot, *, simulated_drives: bool, attended: bool) -> None:
    """Refuse to open a bus on which a real arm could be, unless everything that a real arm requires is present.

    `arm_on_bus` begins with this; commands call it before they ask anything or create a folder.

    Args:
        simulated_drives: Whether only drives with the simulation's identity will be driven.
        attended: Whether an operator is at the terminal.

    Raises:
        ConfigurationError: the file does not state the drives' identities, or the constraints on motions.
        UnsafeBus: there is no operator to ask.
    """
    if robot.bus.in_virtual_time or simulated_drives:
        return
    robot.require_complete_for_real_arm()
    if not attended:
        raise UnsafeBus(
            f"bus {robot.bus.address}: a real arm is moved only with an operator at a terminal, "
            "even with --yes. Run the command from a terminal, within reach of the emergency stop"
        )


def open_arm(
    robot: Robot,
    load: SessionLoad,
    report: Callable[[str], None],
    *,
    simulated_drives: bool,
    attended: bool,
    brakes_closed: bool = False,
) -> AbstractContextManager[JointServos]:
    """Open the arm that the configuration names: in this process or on a bus.

    Args:
        load: Load on the flange, for a simulation in this process.
        report: Called with remarks for the operator.
        simulated_drives: On a bus, require the simulation's identity of every drive.
        attended: Whether an operator is at the terminal.
        brakes_closed: Whether brakes stay closed while drives are enabled, to test them.
    """
    if robot.bus.in_virtual_time:
        return simulated_arm(robot, load, brakes_closed=brakes_closed)
    return arm_on_bus(robot, report, simulated_drives=simulated_drives, attended=attended, brakes_closed=brakes_closed)


@contextmanager
def simulated_arm(
    robot: Robot, load: SessionLoad, described: Sequence[DeviceDescription] = (), *, brakes_closed: bool = False
) -> Iterator[JointServos]:
    """Master and simulated drives in this process, in lockstep.

    Args:
        robot: The arm; the loaded half runs with its configured payload.
        load: Load on the flange.
        described: Device descriptions that the drives implement: none, one for all joints, or one per joint.
        brakes_closed: As in `open_arm`.
    """
    arm = replace(robot.drives.settings, brakes_closed=brakes_closed)
    payload = robot.simulation.payload_name if load is SessionLoad.LOADED else None
    plant = ArmPlant(robot.simulation.plant_spec(payload, run=int(load is SessionLoad.LOADED)))
    clock = VirtualClock()
    wires = lockstep_wires(arm)
    with (
        lockstep_bus(arm, wires, BusRole.DRIVES) as drives_bus,
        lockstep_bus(arm, wires, BusRole.MASTER) as bus,
        SimulatedDrives(arm, plant, drives_bus, clock, _traits(robot, described)),
        closing(CanopenServos(arm, bus, LockstepSync(clock))) as servos,
    ):
        yield servos


@contextmanager
def arm_on_bus(
    robot: Robot,
    report: Callable[[str], None],
    *,
    simulated_drives: bool,
    attended: bool,
    brakes_closed: bool = False,
) -> Iterator[JointServos]:
    """Drives on a bus; within the block this process is tuned for the cycle.

    Args:
        report: Called with the tuning that was not permitted.
        simulated_drives: Require the simulation's identity of every drive, instead of the configured one.
        attended: Whether an operator is at the terminal.
        brakes_closed: As in `open_arm`.

    Raises:
        ConfigurationError: the file does not state the drives' identities, or the constraints on motions.
        UnsafeBus: there is no operator to ask.
        BusError: the interface cannot be opened.
    """
    require_rules(robot, simulated_drives=simulated_drives, attended=attended)
    arm = replace(robot.drives.settings, brakes_closed=brakes_closed)
    if simulated_drives:
        drives = tuple(replace(drive, identity=SIMULATION_IDENTITY) for drive in arm.drives)
        arm = replace(arm, drives=drives)
    first = robot.bus.parts[0]
    if robot.bus.on_ethercat:
        with (
            open_line(first.channel) as line,
            tuned_for_cycles(report),
            closing(EthercatServos(arm, line, DeadlineClock())) as servos,
        ):
            yield servos
        return
    # SYNC from the kernel if the bus is SocketCAN, otherwise from this process
    kernel_sync = first.interface == SOCKETCAN
    role = BusRole.PACED_BY_KERNEL if kernel_sync else BusRole.MASTER
    with bus_of(robot, role) as bus, tuned_for_cycles(report):
        sync = BcmSync(BroadcastManager(first.channel)) if kernel_sync else TimerSync()
        with closing(CanopenServos(arm, bus, sync)) as servos:
            yield servos


@contextmanager
def drives_alone(
    robot: Robot, payload: str, changes: Sequence[ScheduledPayload] = (), described: Sequence[DeviceDescription] = ()
) -> Iterator[SimulatedDrives]:
    """Simulated drives on a bus, in real time, commanded by another process.

    Args:
        payload: Name of the payload on the flange, see `RobotSimulation.mounted`.
        changes: Payloads mounted and removed later.
        described: Device descriptions that the drives implement: none, one for all joints, or one per joint.

    Raises:
        UnsafeBus: the bus is virtual, where no other process can reach them.
        BusError: the interface cannot be opened.
    """
    if robot.bus.in_virtual_time:
        raise UnsafeBus(
            "drives alone on the virtual bus cannot be reached from another process: "
            "give another bus, such as --bus socketcan:vcan0"
        )
    plant = ArmPlant(robot.simulation.plant_spec(payload, int(payload != NO_PAYLOAD), changes))
    traits = _traits(robot, described)
    arm = robot.drives.settings
    with bus_of(robot, BusRole.DRIVES) as bus, SimulatedDrives(arm, plant, bus, clock_from_now(), traits) as drives:
        yield drives


def _traits(robot: Robot, described: Sequence[DeviceDescription]) -> dict[int, DriveTraits]:
    """Traits of simulated drives by node id; empty without a description."""
    each = [described[0]] * robot.n if len(described) == 1 else described
    drives = robot.drives.settings.drives
    return {drive.node_id: DriveTraits(description=found) for drive, found in zip(drives, each, strict=False)}


def clock_from_now() -> Callable[[], float]:
    """A monotonic clock that starts at zero, because a plant is simulated from time zero of its clock."""
    begun_s = time.monotonic()
    return lambda: time.monotonic() - begun_s


@contextmanager
def bus_of(robot: Robot, role: BusRole = BusRole.MASTER) -> Iterator[can.BusABC]:
    """The robot's bus, or its buses as one, shut down after the block; see `open_bus`.

    Args:
        role: Who uses the bus.

    Raises:
        UnsafeBus: the arm is on EtherCAT.
    """
    bus, bitrate = robot.bus, robot.bus.bitrate
    if bitrate is None:
        raise UnsafeBus(_CANOPEN_ONLY)
    with ExitStack() as stack:
        opened = [stack.enter_context(open_bus(part.interface, part.channel, bitrate)) for part in bus.parts]
        if len(opened) == 1:
            yield opened[0]
            return
        parts = robot.drives.settings.by_bus()
        members = [frozenset(drive.node_id for drive in part.drives) for part in parts]
        yield stack.enter_context(JoinedBus(opened, members, role, 1 / bus.cycle_hz))


def nodes_on(interface: str, channel: str, bitrate: int) -> list[FoundNode]:
    """All drives that answer on a bus.

    Raises:
        BusError: the bus cannot be opened, or failed.
        ForeignMaster: another EtherCAT master is heard.
        ServoError: a node stops answering.
    """
    if interface == ETHERCAT:
        with open_line(channel) as line:
            return find_drives(line)
    with open_bus(interface, channel, bitrate) as bus:
        return find_nodes(bus)


@contextmanager
def open_bus(interface: str, channel: str, bitrate: int) -> Iterator[can.BusABC]:
    """A CAN bus, shut down after the block.

    Raises:
        UnsafeBus: it is an EtherCAT line.
        BusError: the bus cannot be opened.
    """
    if interface == ETHERCAT:
        raise UnsafeBus(_CANOPEN_ONLY)
    try:
        opened = can.Bus(interface=interface, channel=channel, bitrate=bitrate)
    except (can.CanError, OSError, ValueError) as error:
        if isinstance(error, OSError) and error.errno == errno.EAFNOSUPPORT:
            remedy = "This kernel has no CAN support loaded: try `modprobe can`; a container uses its host's kernel"
        else:
            remedy = "Check the interface's name and that it is up"
        raise BusError(f"bus {interface}:{channel} cannot be opened: {error}. {remedy}") from error
    try:
        yield opened
    except BaseException as error:
        try:
            opened.shutdown()
        except (can.CanError, OSError) as again:  # it must not replace what is known about the drives
            error.add_note(f"The bus could not be closed: {again}")
        raise
    opened.shutdown()
