"""Scan of the bus: all node ids are queried in parallel for their device type.

References:
    CiA 301, 7.2.4 (SDO), 7.5.2.1 (device type).
"""

from __future__ import annotations

import struct
from collections.abc import Iterable

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import NODE_IDS, ArmSettings
from armload_drivers.driver_errors import WrongDevice

_UPLOAD = struct.Struct("<BHB4x").pack(0x40, od.DEVICE_TYPE.index, 0)
_ANSWER = struct.Struct("<BHBI")


def scan(link: BusLink, node_ids: Iterable[int], wait_s: float) -> dict[int, list[int | None]]:
    """Query nodes for their device type.

    Args:
        link: The bus; no SDO transfer with these nodes may be in progress.
        node_ids: The nodes to query.
        wait_s: Total time to wait for answers.

    Returns:
        Device types (1000) by node id, None for an abort; more than one if several nodes have the same id. If requests
        of another client are heard, only the first answer counts.

    Raises:
        BusError: the bus failed.
    """
    found: dict[int, list[int | None]] = {}
    asked = tuple(node_ids)
    others: set[int] = set()

    def listen(node_id: int) -> None:
        def take(data: bytearray) -> None:
            if len(data) != 8:
                return
            command, index, _, value = _ANSWER.unpack(data)
            if index == od.DEVICE_TYPE.index and not (node_id in found and node_id in others):
                found.setdefault(node_id, []).append(None if command == 0x80 else value)

        link.subscribe(od.SDO_TX_BASE + node_id, take)
        link.subscribe(od.SDO_RX_BASE + node_id, lambda _: others.add(node_id))

    with link.subscribed_meanwhile(), link.everywhere():
        for node_id in asked:
            listen(node_id)
            link.send_frame(od.SDO_RX_BASE + node_id, _UPLOAD)
        link.pump_for(wait_s)
    return dict(sorted(found.items()))


def require_no_strangers(link: BusLink, arm: ArmSettings, wait_s: float) -> None:
    """Refuse a bus with a drive that the configuration does not name, or with two drives of one node id.

    Raises:
        WrongDevice: naming the node.
        BusError: the bus failed.
    """
    joints = {drive.node_id: drive.joint for drive in arm.drives}
    for node_id, device_types in scan(link, sorted(NODE_IDS - arm.other_nodes), wait_s).items():
        if node_id in joints:
            if len(device_types) > 1:
                raise WrongDevice(
                    node_id,
                    joints[node_id],
                    "looking for other drives",
                    f"two drives have node id {node_id}: one request was answered {len(device_types)} times",
                    "Both would obey this arm's setpoints. Give each drive a node id of its own, or unplug one",
                )
        elif any(device_type is not None and od.is_drive(device_type) for device_type in device_types):
            raise WrongDevice.unnamed(node_id, len(arm.drives), "on the bus")
