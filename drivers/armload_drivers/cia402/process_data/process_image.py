"""The cyclic frames of one arm, packed and unpacked, without a bus.

Every drive has one RPDO and one TPDO, both synchronous:

    RPDO1  6040 controlword (2), 607A target position or 60C1:1 set-point (4), 60B2 torque offset (2)
    TPDO1  6041 statusword (2), 6064 position actual (4), 6078 current or 6077 torque actual (2)

Drives without 60B2 get an RPDO of six bytes. If 60B2 or the object for the effort has 32 bits, it does not fit
into the frame with the other two and is sent separately, in RPDO2 or TPDO2; likewise if a PDO can hold only two
objects.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import DriveSettings, EffortFeedback, OperationMode
from armload_drivers.cia402.object_dictionary import Access, Entry, Mappable, PdoDirection

MAX_PDO_BITS = 64

_EFFORT = {
    EffortFeedback.CURRENT: (od.CURRENT_ACTUAL, od.CURRENT_ACTUAL_32),
    EffortFeedback.TORQUE: (od.TORQUE_ACTUAL, od.TORQUE_ACTUAL_32),
}
"""The standard's object for the effort, in 16 and in 32 bits."""


@dataclass(frozen=True, slots=True)
class PdoLayout:
    """One PDO with its mapping.

    Attributes:
        direction: As seen from the drive.
        number: Number of the PDO in that direction, from 0.
        cob_id: CAN identifier.
        entries: Mapped objects in order.
    """

    direction: PdoDirection
    number: int
    cob_id: int
    entries: tuple[Entry, ...]

    @property
    def format(self) -> struct.Struct:
        """Little-endian layout of the frame's data."""
        return struct.Struct("<" + "".join(entry.type.code for entry in self.entries))

    @property
    def length(self) -> int:
        """Bytes of data."""
        return self.format.size


@dataclass(frozen=True, slots=True)
class DriveImage:
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
    vendor = drive.vendor_effort
    if vendor is not None:
        return Entry(vendor.index, vendor.subindex, "vendor's effort", vendor.type, Access.RO, Mappable.TPDO)
    of_16, of_32 = _EFFORT[drive.feedback]
    return of_16 if drive.effort_bits == of_16.type.bits else of_32


def temperature_entry(drive: DriveSettings) -> Entry | None:
    """Configured object for a temperature, if any; it is not mapped to a PDO."""
    configured = drive.temperature
    if configured is None:
        return None
    return Entry(configured.index, configured.subindex, "vendor's temperature", configured.type, Access.RO)


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
    """PDOs of a configured drive."""
    receive, rpdo2 = _split(PdoDirection.RECEIVE, drive, setpoint_entries(drive))
    transmit, tpdo2 = _split(PdoDirection.TRANSMIT, drive, feedback_entries(drive))
    return DriveImage(receive, transmit, effort=tpdo2, offset=rpdo2)


def _split(direction: PdoDirection, drive: DriveSettings, entries: list[Entry]) -> tuple[PdoLayout, PdoLayout | None]:
    """One PDO, and another for the third entry if it does not fit."""
    node_id = drive.node_id
    fits = len(entries) <= drive.pdo_objects_max and sum(entry.type.bits for entry in entries) <= MAX_PDO_BITS
    if fits:
        return _layout(direction, 0, node_id, entries), None
    return _layout(direction, 0, node_id, entries[:2]), _layout(direction, 1, node_id, entries[2:])
