"""Opening an arm: the simulated one in this process, or drives on a bus.

Until driver and motion layer are complete, a bus other than `virtual` is only driven when the caller asks for
simulated drives and every node shows the simulation's identity; the drivers compare identities before they
write anything to a node, so that anything else is refused unconfigured and unmoved.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace

import can

from armload_controller.commissioning import Load
from armload_controller.config import Robot
from armload_controller.errors import UnsafeBus
from armload_controller.realtime import tuned_for_cycles
from armload_drivers.arm import SIMULATION_IDENTITY
from armload_drivers.bcm_sync import BcmSync, BroadcastManager
from armload_drivers.canopen_servos import CanopenServos
from armload_drivers.clock import VirtualClock
from armload_drivers.errors import BusError
from armload_drivers.plant import ArmPlant
from armload_drivers.servos import JointServos
from armload_drivers.simulated_drives import SimulatedDrives
from armload_drivers.sync import LockstepSync, SyncSource, TimerSync

VIRTUAL = "virtual"
"""The interface that lives in one process, and with it its simulated drives."""

SOCKETCAN = "socketcan"


def require_safe_bus(robot: Robot, simulated_drives: bool) -> None:
    """Refuse buses on which a real arm could be.

    Raises:
        UnsafeBus: the bus is not virtual and the caller did not ask for simulated drives.
    """
    if robot.bus.interface != VIRTUAL and not simulated_drives:
        raise UnsafeBus(
            f"bus {robot.bus.interface}:{robot.bus.channel} is refused: this version drives simulated arms only. "
            "Where `armload simulate` answers on that bus, say so with --simulated-drives"
        )


@contextmanager
def simulated_arm(robot: Robot, load: Load) -> Iterator[JointServos]:
    """Master and simulated drives in this process, in lockstep on the virtual bus.

    Args:
        robot: The arm; its configured payload hangs on the flange in the loaded half.
        load: What hangs on the flange.
    """
    arm = robot.arm_settings()
    payload = robot.simulated_payload_name if load is Load.LOADED else None
    plant = ArmPlant(robot.plant_spec(payload, run=int(load is Load.LOADED)))
    clock = VirtualClock()
    with _bus(robot) as drives_bus, _bus(robot) as bus, SimulatedDrives(arm, plant, drives_bus, clock):
        servos = CanopenServos(arm, bus, LockstepSync(clock))
        try:
            yield servos
        finally:
            servos.close()


@contextmanager
def arm_on_bus(robot: Robot, tell: Callable[[str], None]) -> Iterator[JointServos]:
    """Simulated drives that another process serves; this process is tuned for the cycle meanwhile.

    Args:
        robot: The arm.
        tell: Is told what of the tuning was not permitted.

    Raises:
        BusError: the interface cannot be opened.
    """
    arm = robot.arm_settings()
    simulated = tuple(replace(drive, identity=SIMULATION_IDENTITY) for drive in arm.drives)
    with _bus(robot) as bus, tuned_for_cycles(tell):
        servos = CanopenServos(replace(arm, drives=simulated), bus, sync_for(robot))
        try:
            yield servos
        finally:
            servos.close()


def sync_for(robot: Robot) -> SyncSource:
    """SYNC from the kernel where the bus is SocketCAN, else from this process."""
    if robot.bus.interface == SOCKETCAN:
        return BcmSync(BroadcastManager(robot.bus.channel))
    return TimerSync()


@contextmanager
def drives_alone(robot: Robot, payload: str | None, run: int) -> Iterator[SimulatedDrives]:
    """Simulated drives on a bus, on the wall clock, for another process to command.

    Raises:
        UnsafeBus: on the virtual bus nobody else could reach them.
        BusError: the interface cannot be opened.
    """
    if robot.bus.interface == VIRTUAL:
        raise UnsafeBus(
            "drives alone on the virtual bus cannot be reached from another process: "
            "give --interface and --channel, such as --interface socketcan --channel vcan0"
        )
    plant = ArmPlant(robot.plant_spec(payload, run))
    with _bus(robot) as bus, SimulatedDrives(robot.arm_settings(), plant, bus, time.monotonic) as drives:
        yield drives


def _bus(robot: Robot) -> AbstractContextManager[can.BusABC]:
    """The robot's bus."""
    return open_bus(robot.bus.interface, robot.bus.channel, robot.bus.bitrate)


@contextmanager
def open_bus(interface: str, channel: str, bitrate: int) -> Iterator[can.BusABC]:
    """A bus, closed again.

    Raises:
        BusError: it cannot be opened.
    """
    try:
        opened = can.Bus(interface=interface, channel=channel, bitrate=bitrate)
    except (can.CanError, OSError, ValueError) as error:
        raise BusError(
            f"bus {interface}:{channel} cannot be opened: {error}. Check the interface's name and that it is up"
        ) from error
    try:
        yield opened
    finally:
        opened.shutdown()
