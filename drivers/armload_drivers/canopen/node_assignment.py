"""Giving a node its node id and bit rate, where that can disturb nobody."""

from __future__ import annotations

from collections.abc import Callable

import can

from armload_drivers.bring_up.sdo_requests import drive_state
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.bus_scan import scan
from armload_drivers.canopen.canopen_sdo import CanopenSdo
from armload_drivers.canopen.lss_master import LssAddress, LssMaster
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import NODE_IDS
from armload_drivers.cia402.state_machine import POWERED
from armload_drivers.cia402.timeouts import USUAL, Timeouts
from armload_drivers.driver_errors import LssRefused


def assign_node(
    bus: can.BusABC,
    node_id: int,
    bitrate: int | None,
    address: LssAddress | None,
    consent: Callable[[str], bool],
    timeouts: Timeouts = USUAL,
) -> LssAddress | None:
    """Give one node a node id, and a bit rate from its next power-on; the node stores both.

    Args:
        bus: An open bus.
        bitrate: The bit rate; None leaves it.
        address: Identity of the node; None for the one that has no node id.
        consent: Asked with a description of the action before anything is set.
        timeouts: Limits of all waits.

    Returns:
        Identity of the node; None if consent was refused.

    Raises:
        LssRefused: the node id is in use, a drive on the bus carries torque, no node was found, or the node refuses.
        ServoError: a drive does not report its state.
        BusError: the bus failed.
    """
    link = BusLink(bus)
    found = scan(link, sorted(NODE_IDS), timeouts.scan_s)
    if node_id in found:
        raise LssRefused(f"node id {node_id} is in use on this bus: choose another, or unplug that node")
    for other, device_types in found.items():
        if any(kind is not None and od.is_drive(kind) for kind in device_types):
            _require_no_torque(CanopenSdo(other, "unknown joint", link, timeouts.sdo_s), other)
    master = LssMaster(link)
    with master.services():
        if address is None:
            address = master.find()
            if address is None:
                raise LssRefused(
                    "no node without a node id answers. One that has an id is addressed by its identity "
                    "(VENDOR:PRODUCT:REVISION:SERIAL, 1018); one that does not support LSS has switches, or its "
                    "manufacturer's tool"
                )
        else:
            master.select(address)
        rate = "" if bitrate is None else f", and {bitrate} bit/s from its next power-on"
        if not consent(f"The node with identity {address} gets node id {node_id}{rate}, and stores this. Go on?"):
            return None
        master.assign(node_id, bitrate)
    return address


def _require_no_torque(sdo: CanopenSdo, node_id: int) -> None:
    """Refuse a bus on which a drive is at work."""
    sdo.step = "looking for torque"
    state = drive_state(sdo)
    if state in POWERED:
        raise LssRefused(f"node {node_id} carries torque, in {state.title}: settings are changed on a bus at rest only")
