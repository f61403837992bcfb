"""NMT reset of an arm's drives, and what is verified before it, because a reset removes torque at once.

Rules of this file:
- No NMT reset is sent before the power states of the drives were read. Elsewhere it is sent only to a drive that keeps
  its torque against every other request (`cyclic.torque_removal`).
- OPERATION ENABLED: never reset. Something commands the drive, even if nothing is received on the bus: another make of
  master may move it by SDO, its manufacturer's tool over a separate cable, or a program in the drive itself.
- QUICK STOP ACTIVE (and FAULT REACTION ACTIVE): drives remain in this state after their master has ended (6007, and
  605A = 6), and are briefly in it while their master still runs. They may be reset if no master is heard, the axis
  stands still, and a brake holds it. So a program that was killed can be started again.
- A master is detected by frames that only a master sends: `rival_master`. While no drive carries torque this check is
  omitted, and SYNC from another node does not prevent the reset: a drive may produce it, which bring-up ends (1005),
  and a second producer is detected as soon as cycles run.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

from armload_drivers.bring_up.drive_bring_up import DriveSetup
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.rival_master import ForeignTraffic
from armload_drivers.canopen.canopen_setup import CanopenSetup
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.drive_safety import HEARTBEAT_TOLERANCE
from armload_drivers.cia402.object_dictionary import NmtCommand, NmtState
from armload_drivers.cia402.state_machine import State

if TYPE_CHECKING:
    from armload_drivers.bring_up.powered_drive import PoweredDrive

_TOGGLE = 0x80
"""Bit of a heartbeat's byte that alternates in answers to node guarding."""


def answering_drives(setups: Sequence[CanopenSetup], arm: ArmSettings, link: BusLink) -> list[CanopenSetup]:
    """Identified drives. A silent node is set to PRE-OPERATIONAL and asked again, the only command before the reset.

    A node that NMT has stopped answers no SDO, and may hold its axis with torque. A drive in OPERATIONAL that is only
    slow would stop its axis at this command (6007): nothing is sent to one that is heard in OPERATIONAL, while a master
    is heard, or while another drive of the arm is in OPERATION ENABLED.

    Args:
        setups: Drives of the arm.

    Returns:
        Those that answer.

    Raises:
        ServoTimeout: only simulated drives are allowed, and a node does not answer.
        WrongDevice: a node is not the configured drive.
        ServoError: a silent node is in OPERATIONAL, or a master is heard; or an SDO failed.
        BusError: the bus failed.
    """
    from armload_drivers.bring_up.powered_drive import PoweredDrive, judged

    answering = [setup for setup in setups if setup.identify_before_reset()]
    silent = [setup for setup in setups if setup not in answering]
    if not silent:
        return answering
    with link.subscribed_meanwhile():
        foreign = ForeignTraffic(arm, link, sync_is_ours=False)
        operational = _heard(silent, link, NmtState.OPERATIONAL.value, NmtState.OPERATIONAL.value | _TOGGLE)
        link.pump_for(HEARTBEAT_TOLERANCE * arm.heartbeat_s)
    answering += [setup for setup in silent if setup.identify_before_reset()]
    for setup in setups:
        if setup in answering:
            if setup.read_powered_state() is State.OPERATION_ENABLED:
                raise judged(setup, State.OPERATION_ENABLED, foreign.commands, 0.0).refusal()
        elif foreign.commands or setup in operational:
            what = f"it does not answer, and {foreign.commands or 'its heartbeat shows that it is in OPERATIONAL'}"
            raise PoweredDrive(setup, what, "End its master, then repeat this command").refusal()
    silent = [setup for setup in setups if setup not in answering]
    for setup in silent:
        link.command(NmtCommand.PRE_OPERATIONAL, setup.settings.node_id)
    return [setup for setup in setups if setup in answering or setup.identify_before_reset()]


def powered_on_bus(setups: Sequence[DriveSetup], arm: ArmSettings, link: BusLink) -> list[PoweredDrive]:
    """Drives that carry torque. Only reads; if there are any, listens for as long as a drive waits for its master.

    Args:
        setups: Drives of the arm that answer.

    Raises:
        ServoError: a drive does not report its state, position or scale.
        BusError: the bus failed.
    """
    from armload_drivers.bring_up import powered_drive

    with link.subscribed_meanwhile():
        foreign = ForeignTraffic(arm, link, sync_is_ours=False)
        # A drive whose master's heartbeat (1016) is missing for this long regards it as ended.
        listened_s = HEARTBEAT_TOLERANCE * arm.heartbeat_s
        return powered_drive.powered_drives(setups, listened_s, link.pump_for, lambda: foreign.commands)


def reset_drives(
    setups: Sequence[DriveSetup], powered: Sequence[PoweredDrive], link: BusLink, boot_s: float
) -> list[DriveSetup]:
    """NMT reset of drives; waits until each has sent its boot-up message, or the time is over.

    Args:
        setups: The drives.
        powered: Drives of the arm that carry torque, from `powered_drives`.
        boot_s: Longest wait.

    Returns:
        Drives that sent no boot-up message.

    Raises:
        ServoError: a drive of the arm carries torque that must not be removed; nothing was sent.
        BusError: the bus failed.
    """
    for drive in powered:
        if not drive.abandoned:
            raise drive.refusal()
    with link.subscribed_meanwhile():
        booted = _heard(setups, link, NmtState.BOOT_UP.value)
        for setup in setups:
            link.command(NmtCommand.RESET_NODE, setup.settings.node_id)
        link.pump_until(lambda: len(booted) == len(setups), boot_s)
    return [setup for setup in setups if setup not in booted]


def _heard(setups: Sequence[DriveSetup], link: BusLink, *wanted: int) -> set[DriveSetup]:
    """Drives whose heartbeat is one of these bytes from now on: filled while the bus is pumped."""
    heard: set[DriveSetup] = set()

    def take(setup: DriveSetup, data: bytearray) -> None:
        if data and data[0] in wanted:
            heard.add(setup)

    for setup in setups:
        link.subscribe(od.HEARTBEAT_BASE + setup.settings.node_id, partial(take, setup))
    return heard
