"""Inspection of drives on CANopen without a cycle. Only reads, also on a bus in use."""

from __future__ import annotations

import time

import can

from armload_drivers.bring_up.inspection import ArmStatus, FoundNode, describe, drive_status
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.bus_scan import scan
from armload_drivers.canopen.canopen_sdo import CanopenSdo
from armload_drivers.canopen.canopen_setup import canopen_setups
from armload_drivers.cia402.arm_settings import NODE_IDS, ArmSettings
from armload_drivers.cia402.timeouts import Timeouts

LISTEN_S = 1.0
"""How long a status listens to the bus, for a load that means something."""


def find_nodes(bus: can.BusABC, timeouts: Timeouts | None = None) -> list[FoundNode]:
    """All nodes that answer on a bus. Only reads.

    Raises:
        ServoError: a node stops answering.
        BusError: the bus failed.
    """
    limits = timeouts or Timeouts()
    link = BusLink(bus)
    return [
        describe(CanopenSdo(node_id, "unknown joint", link, limits.sdo_s), node_id, device_types)
        for node_id, device_types in scan(link, sorted(NODE_IDS), limits.scan_s).items()
    ]


def show(arm: ArmSettings, bus: can.BusABC, listen_s: float, timeouts: Timeouts | None = None) -> ArmStatus:
    """Status of the drives of an arm. Only reads, so it can be used while another program moves the arm.

    Args:
        bus: Where its drives are.
        listen_s: Time over which the bus load is measured.
        timeouts: Limits of all waits.

    Raises:
        BusError: the bus failed.
    """
    link, limits = BusLink(bus), timeouts or Timeouts()
    begun_s = time.monotonic()
    while (left_s := begun_s + listen_s - time.monotonic()) > 0.0:
        link.pump(left_s)
    bits, listened_s = link.busiest_bits, time.monotonic() - begun_s
    drives = tuple(drive_status(setup, limits) for setup in canopen_setups(arm, link, limits))
    return ArmStatus(drives, bits / (arm.bitrate * listened_s), link.error_frames, link.error_passive)
