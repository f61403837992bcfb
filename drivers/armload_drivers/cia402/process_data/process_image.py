"""The cyclic frames of one arm, packed and unpacked, without a bus.

Every drive has one RPDO and one TPDO, both synchronous:

    RPDO1  6040 controlword (2), 607A target position or 60C1:1 set-point (4), 60B2 torque offset (2)
    TPDO1  6041 statusword (2), 6064 position actual (4), 6078 current or 6077 torque actual (2)

Drives without 60B2 get an RPDO of six bytes. If 60B2 or the object for the effort has 32 bits, it does not fit
into the frame with the other two and is sent separately, in RPDO2 or TPDO2; likewise if a PDO can hold only two
objects.

Of a drive with a fixed mapping (`DriveSettings.fixed_pdos`) those PDOs are used that carry these objects, in the
drive's order and with whatever else they carry: other feedback is ignored, and only such other setpoints are accepted
for which the value is known. 6060 gets the mode; the rest is 0, which drives disregard in the streaming modes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from msgspec import Struct

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import DriveSettings, EffortFeedback, FixedPdo, OperationMode
from armload_drivers.cia402.object_dictionary import Entry, Mappable, PdoDirection
from armload_drivers.cia402.process_data.frame_part import FramePart, frame_part

MAX_PDO_BITS = 64
_BYTE_BITS = 8
_LAST_DUMMY = 0x1F
_ZERO_IS_NOTHING = {0x6042, 0x6071, 0x60B1, 0x60B2, 0x60FF}
"""Setpoints of other modes, and offsets."""

_EFFORT = {
    EffortFeedback.CURRENT: (od.CURRENT_ACTUAL, od.CURRENT_ACTUAL_32),
    EffortFeedback.TORQUE: (od.TORQUE_ACTUAL, od.TORQUE_ACTUAL_32),
}
"""The standard's object for the effort, in 16 and in 32 bits."""


class PdoLayout(Struct, frozen=True):
    """One PDO with its mapping.

    Attributes:
        direction: As seen from the drive.
        number: Number of the PDO in that direction, from 0.
        cob_id: CAN identifier.
        entries: Objects that are exchanged, in the order of their values.
        fixed: Mapping parameters of a PDO that also carries other objects, or these in another order; empty otherwise.
        mode: Value of 6060, if the PDO carries it.
    """

    direction: PdoDirection
    number: int
    cob_id: int
    entries: tuple[Entry, ...]
    fixed: tuple[int, ...] = ()
    mode: int = 0

    @property
    def mapping(self) -> tuple[int, ...]:
        """Its mapping parameters."""
        return self.fixed or tuple(entry.mapping for entry in self.entries)

    @property
    def length(self) -> int:
        """Bytes of data."""
        return self._part.length

    @property
    def pack(self) -> Callable[..., bytes]:
        """All bytes, as a function of the values of `entries`; 6060 has the mode, and the rest is 0."""
        constants = bytearray(self.length)
        for entry, offset in self._part.others:
            if entry.mapping == od.MODE.mapping:
                constants[offset] = self.mode
        return self._part.packer(self.entries, bytes(constants))

    @property
    def unpack(self) -> Callable[[bytes | bytearray], tuple[Any, ...]]:
        """The values of `entries`, as a function of all bytes."""
        return self._part.unpacker(self.entries)

    @property
    def _part(self) -> FramePart:
        """Where the objects are."""
        return frame_part(self.mapping, self.entries)


class DriveImage(Struct, frozen=True):
    """The PDOs of one drive.

    Attributes:
        rpdo: Setpoints.
        tpdo: Feedback.
        effort: Feedback of the effort, if it does not fit into `tpdo`.
        offset: Torque offset, if it does not fit into `rpdo`.
    """

    rpdo: PdoLayout
    tpdo: PdoLayout
    effort: PdoLayout | None = None
    offset: PdoLayout | None = None

    @property
    def layouts(self) -> tuple[PdoLayout, ...]:
        """All PDOs."""
        each = (self.rpdo, self.offset, self.tpdo, self.effort)
        return tuple(layout for layout in each if layout is not None)


def target_entry(mode: OperationMode) -> Entry:
    """Object that carries the position setpoint in a mode."""
    if mode is OperationMode.INTERPOLATED_POSITION:
        return od.INTERPOLATION_SETPOINT
    return od.TARGET_POSITION


def offset_entry(drive: DriveSettings) -> Entry:
    """Object for the torque offset."""
    return od.TORQUE_OFFSET if drive.torque_offset_bits == od.TORQUE_OFFSET.type.bits else od.TORQUE_OFFSET_32


def effort_entry(drive: DriveSettings) -> Entry:
    """Object that reports the motor's effort."""
    if drive.vendor_effort is not None:
        return drive.vendor_effort.entry("effort", Mappable.TPDO)
    of_16, of_32 = _EFFORT[drive.feedback]
    return of_16 if drive.effort_bits == of_16.type.bits else of_32


def _layout(direction: PdoDirection, number: int, node_id: int, entries: list[Entry]) -> PdoLayout:
    """A PDO on the COB-ID of the pre-defined connection set."""
    return PdoLayout(direction, number, direction.default_cob_id(number, node_id), tuple(entries))


def setpoint_entries(drive: DriveSettings) -> list[Entry]:
    """Objects that the master sends in every cycle; the torque offset is the last."""
    entries = [od.CONTROLWORD, target_entry(drive.mode)]
    return [*entries, offset_entry(drive)] if drive.torque_offset else entries


def feedback_entries(drive: DriveSettings) -> list[Entry]:
    """Objects that the drive sends in every cycle; the effort is the last."""
    return [od.STATUSWORD, od.POSITION_ACTUAL, effort_entry(drive)]


def drive_image(drive: DriveSettings) -> DriveImage:
    """PDOs of a configured drive.

    Raises:
        ValueError: its fixed PDOs cannot be used.
    """
    receive, rpdo2 = _pdos(PdoDirection.RECEIVE, drive, setpoint_entries(drive))
    transmit, tpdo2 = _pdos(PdoDirection.TRANSMIT, drive, feedback_entries(drive))
    return DriveImage(receive, transmit, effort=tpdo2, offset=rpdo2)


def _pdos(direction: PdoDirection, drive: DriveSettings, entries: list[Entry]) -> tuple[PdoLayout, PdoLayout | None]:
    """One PDO, and another for the third entry if it does not fit."""
    fixed = [pdo for pdo in drive.fixed_pdos if pdo.direction is direction]
    if fixed:
        return _fixed(fixed, drive, entries)
    node_id = drive.node_id
    fits = len(entries) <= drive.pdo_objects_max and sum(entry.type.bits for entry in entries) <= MAX_PDO_BITS
    if fits:
        return _layout(direction, 0, node_id, entries), None
    return _layout(direction, 0, node_id, entries[:2]), _layout(direction, 1, node_id, entries[2:])


def _fixed(pdos: Sequence[FixedPdo], drive: DriveSettings, entries: list[Entry]) -> tuple[PdoLayout, PdoLayout | None]:
    """Those of a drive's own PDOs that carry the entries: the first two in one, the third there or in another."""
    first = _carrying(pdos, entries[:2])
    second = first if first.carries(entries[2:]) else _carrying(pdos, entries[2:])
    if second is first:
        return _fixed_layout(first, drive, entries), None
    return _fixed_layout(first, drive, entries[:2]), _fixed_layout(second, drive, entries[2:])


def _carrying(pdos: Sequence[FixedPdo], entries: list[Entry]) -> FixedPdo:
    """The first PDO that carries all of the entries."""
    for pdo in pdos:
        if pdo.carries(entries):
            return pdo
    names = " and ".join(f"{entry.index:04X}:{entry.subindex}" for entry in entries)
    raise ValueError(f"none of {', '.join(pdo.key for pdo in pdos)} carries {names}")


def _fixed_layout(pdo: FixedPdo, drive: DriveSettings, entries: list[Entry]) -> PdoLayout:
    """The layout of a PDO with a fixed mapping."""
    used = {entry.mapping for entry in entries} | {od.MODE.mapping}
    bits = sum(word & 0xFF for word in pdo.mapping)
    if bits > MAX_PDO_BITS or any(word & 0xFF & _BYTE_BITS - 1 for word in pdo.mapping):
        raise ValueError(f"{pdo.key} has {bits} bits: expected whole bytes, and at most {MAX_PDO_BITS} bits")
    for word in pdo.mapping:
        index = word >> 16
        unknown = word not in used and index > _LAST_DUMMY and index not in _ZERO_IS_NOTHING
        if unknown and pdo.direction is PdoDirection.RECEIVE:
            raise ValueError(f"{pdo.key} carries {index:04X}:{word >> 8 & 0xFF}, whose value is not known")
    cob_id = pdo.direction.default_cob_id(pdo.number, drive.node_id)
    return PdoLayout(pdo.direction, pdo.number, cob_id, tuple(entries), pdo.mapping, int(drive.mode))
