"""Bring-up of the drives of one arm over CANopen, and inspection of a bus without a cycle."""

from __future__ import annotations

import time
from collections.abc import Sequence

import can

from armload_drivers.bring_up.arm_bring_up import ArmBringUp
from armload_drivers.bring_up.drive_bring_up import DriveSetup
from armload_drivers.bring_up.inspection import ArmStatus, FoundNode, drive_status, inspect_node
from armload_drivers.bring_up.powered_drive import PoweredDrive
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.bus_scan import require_no_strangers, scan
from armload_drivers.canopen.canopen_sdo import CanopenSdo
from armload_drivers.canopen.canopen_setup import canopen_setups
from armload_drivers.canopen.safe_reset import powered_on_bus, reset_drives
from armload_drivers.cia402.arm_settings import NODE_IDS, ArmSettings
from armload_drivers.cia402.timeouts import USUAL, Timeouts


class CanopenBringUp(ArmBringUp):
    """The drives of one arm on an open bus.

    Args:
        bus: An open bus; nothing else may read from it.
        timeouts: Limits of all waits.
    """

    def __init__(self, arm: ArmSettings, bus: can.BusABC, timeouts: Timeouts = USUAL) -> None:
        self._bus, self._link, self._timeouts = bus, BusLink(bus), timeouts
        super().__init__(arm, canopen_setups(arm, self._link, self._timeouts))

    def require_no_strangers(self) -> None:
        """Query all node ids at once."""
        require_no_strangers(self._link, self.arm, self._timeouts.scan_s)

    def powered_drives(self, setups: Sequence[DriveSetup]) -> list[PoweredDrive]:
        """As `safe_reset.powered_drives`."""
        return powered_on_bus(setups, self.arm, self._link)

    def restart(self, setups: Sequence[DriveSetup]) -> list[DriveSetup]:
        """NMT reset; drives that sent no boot-up message are returned."""
        return reset_drives(setups, (), self._link, self._timeouts.boot_s)

    def status(self, listen_s: float) -> ArmStatus:
        """Measure the bus load meanwhile, on a link of its own, whose counters begin at zero."""
        link = BusLink(self._bus)
        begun_s = time.monotonic()
        while (left_s := begun_s + listen_s - time.monotonic()) > 0.0:
            link.pump(left_s)
        bits, listened_s = link.busiest_bits, time.monotonic() - begun_s
        drives = tuple(drive_status(setup, self._timeouts) for setup in canopen_setups(self.arm, link, self._timeouts))
        return ArmStatus(drives, bits / (self.arm.bitrate * listened_s), link.error_frames, link.error_passive)


def find_nodes(bus: can.BusABC, timeouts: Timeouts = USUAL) -> list[FoundNode]:
    """All nodes that answer on a bus. Only reads.

    Raises:
        ServoError: a node stops answering.
        BusError: the bus failed.
    """
    link = BusLink(bus)
    return [
        inspect_node(CanopenSdo(node_id, "unknown joint", link, timeouts.sdo_s), node_id, device_types)
        for node_id, device_types in scan(link, sorted(NODE_IDS), timeouts.scan_s).items()
    ]
