"""`JointServos` over CANopen: the drives of an arm on any bus that python-can opens.

Rules of this file, besides those of `cyclic.cyclic_servos`:
- Only the calling thread sends and receives: no other thread, no callback from elsewhere.
- The heartbeat is sent by the cycle. If the caller stops calling, it ends, and the drives stop the arm (1016, 6007, and
  the time-out of the RPDO).

The bus belongs to the caller: open it before, and close it after `close`.
"""

from __future__ import annotations

import math

import can

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.bus_scan import require_no_strangers
from armload_drivers.bus.sync_sources import SyncSource
from armload_drivers.canopen.bus_remarks import BusRemarks
from armload_drivers.canopen.canopen_cycle import CanopenCycle
from armload_drivers.canopen.canopen_setup import canopen_setups
from armload_drivers.canopen.drive_node import DriveNode
from armload_drivers.canopen.safe_reset import answering_drives, powered_on_bus, reset_drives
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.bus_budget import require_room
from armload_drivers.cia402.drive_safety import Safety
from armload_drivers.cia402.timeouts import USUAL, Timeouts
from armload_drivers.cyclic.cyclic_servos import CyclicServos, Phase
from armload_drivers.cyclic.rhythm import Rhythm


class CanopenServos(CyclicServos):
    """All drives of one arm over CANopen.

    Args:
        bus: An open bus; nothing else may read from it.
        timeouts: Limits of all waits.
    """

    def __init__(self, arm: ArmSettings, bus: can.BusABC, sync: SyncSource, timeouts: Timeouts = USUAL) -> None:
        self._link, self._sync = BusLink(bus), sync
        self._can_setups = canopen_setups(arm, self._link, timeouts)
        self._can_nodes = [DriveNode(drive, self._link, sync, arm) for drive in arm.drives]
        super().__init__(arm, self._can_setups, self._can_nodes, timeouts)
        self._rhythms = Rhythm("SYNC", arm.cycle_s), Rhythm("feedback", arm.cycle_s)
        self._bus_remarks = BusRemarks(self._link, self._can_nodes, self._rhythms)
        self._taken_over = ""

    def connect(self) -> None:
        """Boot, identify, configure and verify every drive; nothing is energised.

        Raises:
            StateError: already connected, or closed.
            BusOverload: the cycle exceeds the bus's capacity.
            WrongDevice: a node is not the configured drive.
            ServoTimeout: only simulated drives are allowed, and a node does not answer; then no node has been reset.
            ServoError: a drive carries torque that must not be removed, and nothing was reset; or a node failed at the
                step that the error names.
            BusError: the bus failed.
        """
        self._require(Phase.NEW)
        require_room(self._arm)
        self._link.drain()  # answers to another master's requests
        answering = answering_drives(self._can_setups, self._arm, self._link)
        require_no_strangers(self._link, self._arm, self._timeouts.scan_s)
        powered = powered_on_bus(answering, self._arm, self._link)
        for setup in reset_drives(self.setups, powered, self._link, self._timeouts.boot_s):
            setup.require_alive()
        for node in self._can_nodes:
            node.booted = False
        self._taken_over = ", ".join(drive.setup.settings.joint for drive in powered)
        units = self._configure()
        for node, setup in zip(self._can_nodes, self.setups, strict=True):
            if any(finding.of is Safety.DRIVE_LOST and finding.way is None for finding in setup.safety):
                node.heartbeat_limit_s = math.inf
        self._running = CanopenCycle(self._arm, self._can_nodes, self._link, self._sync, units, self._rhythms)
        self._phase = Phase.CONNECTED

    def _drain(self) -> None:
        """Drop what other programs caused to be received."""
        self._link.drain()

    def _require_started(self) -> None:
        """Everything was checked before."""

    def _leave(self) -> None:
        """End SYNC."""
        self._sync.end(self._link)

    def take_remarks(self) -> tuple[str, ...]:
        """What the operator should know since the last call: torque that `connect` removed, problems on the bus."""
        joints, self._taken_over = self._taken_over, ""
        trouble = self._bus_remarks.take()
        if not joints:
            return trouble
        return (f"{joints}: held with torque after the last master ended; the reset removed the torque", *trouble)
