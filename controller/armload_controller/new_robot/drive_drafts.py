"""First `[joints.drive]` tables: from the drives that answer on a bus, from a device description, or as a template."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from armload_controller.control_errors import ConfigurationError
from armload_drivers.bring_up.inspection import FoundNode
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import Identity, OperationMode
from armload_drivers.cia402.drive_safety import Safety, has_a_way
from armload_drivers.cia402.eds_parser import DeviceDescription

_WIDE_BITS = 32


@dataclass(frozen=True)
class DriveDraft:
    """Known data of one joint's drive.

    Attributes:
        identity: Object 1018; None if unknown.
        mode: "csp" or "ip"; None if it supports neither, or this is unknown.
        feedback: "torque" or "current"; None if unknown.
        torque_offset: Whether it has 60B2; None if unknown.
        wide: Keys of objects that have 32 bits instead of 16.
        max_torque_permille: Value of 6072 after a reset; None if unknown.
        missing: Names of the safety properties for which it has no object.
    """

    node_id: int
    identity: Identity | None
    mode: str | None
    feedback: str | None
    torque_offset: bool | None
    max_torque_permille: int | None
    missing: tuple[str, ...]
    wide: tuple[str, ...] = ()


@dataclass(frozen=True)
class BusDraft:
    """The drives of an arm, and the bus that they are on.

    Attributes:
        drives: One per joint, from the base to the flange.
        interface: python-can interface.
        bitrate: Bit rate, bit/s.
        description: Path of the device description to write into the robot's file; None without one.
        source: Origin of the data, for the operator.
    """

    drives: tuple[DriveDraft, ...]
    interface: str
    channel: str
    bitrate: int
    description: str | None
    source: str


def drives_found(nodes: Sequence[FoundNode], n: int, described: DeviceDescription | None) -> tuple[DriveDraft, ...]:
    """The drives found on a bus, lowest node id at the base.

    Args:
        nodes: All nodes that answered.
        described: Their device description; None without one.

    Raises:
        ConfigurationError: the number of CiA 402 drives differs from that of the joints.
    """
    drives = sorted((node for node in nodes if node.is_drive), key=lambda node: node.node_id)
    for node in drives:
        if node.twins:
            found = f"{node.twins + 1} drives with node id {node.node_id}"
            raise ConfigurationError("command line", "--scan", found, "one drive per node id")
    if len(drives) != n:
        listed = ", ".join(str(node.node_id) for node in drives) or "none"
        found = f"{len(drives)} CiA 402 drives (nodes {listed})"
        raise ConfigurationError("command line", "--scan", found, f"one per joint, {n} in this arm")
    unknown = DriveDraft(0, None, None, None, None, None, ())
    return tuple(
        replace(
            unknown if described is None else drive_described(described, node.node_id),
            node_id=node.node_id,
            identity=node.identity if node.identity.vendor_id is not None else None,
            mode=_mode(node.modes),
            missing=node.missing,
        )
        for node in drives
    )


def drive_described(description: DeviceDescription, node_id: int) -> DriveDraft:
    """One drive's data from a device description."""
    vendor, product = description.vendor_id, description.product_code
    modes = description.modes
    effort = description.find(od.TORQUE_ACTUAL) or description.find(od.CURRENT_ACTUAL)
    torque, current = (description.find(entry) is not None for entry in (od.TORQUE_ACTUAL, od.CURRENT_ACTUAL))
    sizes = {"torque_offset_bits": description.find(od.TORQUE_OFFSET), "effort_bits": effort}
    return DriveDraft(
        node_id=node_id,
        identity=None if vendor is None else Identity(vendor, product),
        mode=_mode(tuple(number + 1 for number in range(32) if modes >> number & 1)),
        feedback="torque" if torque else "current" if current else None,
        torque_offset=description.find(od.TORQUE_OFFSET) is not None,
        max_torque_permille=description.value(od.MAX_TORQUE, node_id) or None,
        missing=tuple(
            of.key for of in Safety if not has_a_way(of, None, lambda entry: description.find(entry) is not None)
        ),
        wide=tuple(key for key, found in sizes.items() if found is not None and found.bits == _WIDE_BITS),
    )


def nodes_described(description: DeviceDescription, n: int) -> tuple[DriveDraft, ...]:
    """The same drive at every joint, with nodes numbered from the base, starting at 1 or at the node of a DCF."""
    first = description.node_id or 1
    return tuple(drive_described(description, first + joint) for joint in range(n))


def path_beside(file: Path, output: Path) -> str:
    """A file's path relative to the folder of a robot's file."""
    return Path(os.path.relpath(file.resolve(), output.resolve().parent)).as_posix()


def _mode(modes: tuple[int, ...]) -> str | None:
    """The mode that armload would use; None if neither is supported."""
    if OperationMode.CYCLIC_SYNCHRONOUS_POSITION in modes:
        return "csp"
    return "ip" if OperationMode.INTERPOLATED_POSITION in modes else None
