"""Frames that only the master of an arm may send, sent by another node.

A second master is a fault that no drive detects: it obeys both. A node that sends NMT commands, setpoints or SYNC, uses
the master's node id, or writes an object of a drive, stops this master; a node that reads objects is named in the next
error.
"""

from __future__ import annotations

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.object_dictionary import NmtCommand
from armload_drivers.cia402.process_data.process_image import drive_image

_NAMES = {command.value: command.name.replace("_", " ").lower() for command in NmtCommand}
_INITIATE_DOWNLOAD = 1
_REMEDY = "Two masters cannot share an arm: stop the other program, or disconnect its device"


class ForeignTraffic:
    """Watches one bus.

    Args:
        sync_is_ours: Whether this master's own SYNCs are received back; then the SYNC source detects others.

    Attributes:
        commands: Command of another node, as text; empty if there was none.
        requests: SDO request of another client to a drive, as text; empty if there was none.
    """

    def __init__(self, arm: ArmSettings, link: BusLink, *, sync_is_ours: bool) -> None:
        self.commands = ""
        self.requests = ""
        self._joints = {drive.node_id: drive.joint for drive in arm.drives}
        link.subscribe(od.NMT_COB_ID, self._take_nmt)
        own = arm.master_node_id
        self._accuse(link, od.HEARTBEAT_BASE + own, f"uses this master's node id {own}")
        if not sync_is_ours:
            self._accuse(link, od.SYNC_DEFAULT_COB_ID, "also produces SYNC")
        for drive in arm.drives:
            image = drive_image(drive)
            self._accuse(link, image.rpdo.cob_id, f"sends setpoints to {drive.joint}")
            if image.offset is not None:
                self._accuse(link, image.offset.cob_id, f"sends torque offsets to {drive.joint}")
            self._note_requests(link, drive.node_id)

    def forget(self) -> None:
        """Discard everything received before the cycle started."""
        self.commands = self.requests = ""

    def _accuse(self, link: BusLink, cob_id: int, what: str) -> None:
        """Treat frames of a COB-ID as sent by a second master."""

        def take(_: bytearray) -> None:
            self.commands = f"another node {what} (COB-ID 0x{cob_id:03X}). {_REMEDY}"

        link.subscribe(cob_id, take)

    def _note_requests(self, link: BusLink, node_id: int) -> None:
        """Treat SDO requests as sent by another client: downloads as a second master's."""
        joint = self._joints[node_id]

        def take(data: bytearray) -> None:
            if len(data) != 8:
                return
            drive, what = f"{joint} (node {node_id})", f"object {data[2]:02X}{data[1]:02X}:{data[3]}"
            if data[0] >> 5 == _INITIATE_DOWNLOAD:
                self.commands = f"another node writes to {drive}, {what}. {_REMEDY}"
            else:
                self.requests = f"Another SDO client talks to {drive}, {what}"

        link.subscribe(od.SDO_RX_BASE + node_id, take)

    def _take_nmt(self, data: bytearray) -> None:
        """Process an NMT command of another node."""
        if len(data) == 2 and (data[1] == 0 or data[1] in self._joints):
            to = "all nodes" if data[1] == 0 else f"{self._joints[data[1]]} (node {data[1]})"
            name = _NAMES.get(data[0], f"command {data[0]}")
            self.commands = f"another node sends NMT commands: {name} to {to}. {_REMEDY}"
