"""Scan of the bus: all node ids are queried in parallel for their device type.

References:
    CiA 301, 7.2.4 (SDO), 7.5.2.1 (device type).
"""

from __future__ import annotations

import struct
from collections.abc import Iterable

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.driver_errors import WrongDevice

NODE_IDS = range(1, 128)
_UPLOAD = struct.Struct("<BHB4x").pack(0x40, od.DEVICE_TYPE.index, 0)
_ANSWER = struct.Struct("<BHBI")


def scan(link: BusLink, node_ids: Iterable[int], wait_s: float) -> dict[int, int | None]:
    """Query nodes for their device type.

    Args:
        link: The bus; no SDO transfer with these nodes may be in progress.
        node_ids: The nodes to query.
        wait_s: Total time to wait for answers.

    Returns:
        Device type (1000) of each node that answers; None for an abort.

    Raises:
        BusError: the bus failed.
    """
    found: dict[int, int | None] = {}
    asked = tuple(node_ids)

    def listen(node_id: int) -> None:
        def take(data: bytearray) -> None:
            if len(data) == 8:
                command, _, _, value = _ANSWER.unpack(data)
                found[node_id] = None if command == 0x80 else value

        link.subscribe(od.SDO_TX_BASE + node_id, take)

    with link.subscribed_meanwhile():
        for node_id in asked:
            listen(node_id)
            link.send_frame(od.SDO_RX_BASE + node_id, _UPLOAD)
        link.pump_for(wait_s)
    return dict(sorted(found.items()))


def require_no_strangers(link: BusLink, arm: ArmSettings, wait_s: float) -> None:
    """Refuse a bus with a drive that the configuration does not name.

    Raises:
        WrongDevice: naming the node.
        BusError: the bus failed.
    """
    known = {drive.node_id for drive in arm.drives} | arm.other_nodes
    others = scan(link, (node_id for node_id in NODE_IDS if node_id not in known), wait_s)
    for node_id, device_type in others.items():
        if device_type is not None and od.is_drive(device_type):
            raise WrongDevice(
                node_id,
                "no configured joint",
                "looking for other drives",
                f"a CiA 402 drive that the configuration does not name; it names {len(arm.drives)}",
                "Is this the right arm, with all its joints configured? List drives on the bus that do not belong to "
                "it in other_nodes",
            )
