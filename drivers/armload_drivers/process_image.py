"""The cyclic frames of one arm, packed and unpacked, without a bus.

Every drive has one RPDO and one TPDO, both synchronous:

    RPDO1  6040 controlword (2), 607A target position or 60C1:1 set-point (4), 60B2 torque offset (2)
    TPDO1  6041 statusword (2), 6064 position actual (4), 6078 current or 6077 torque actual (2)

Drives without 60B2 get an RPDO of six bytes.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

from armload_drivers import objects as od
from armload_drivers.arm import DriveSettings, EffortFeedback, OperationMode
from armload_drivers.objects import Entry, PdoDirection


@dataclass(frozen=True, slots=True)
class PdoLayout:
    """One PDO as it is mapped.

    Attributes:
        direction: As seen from the drive.
        cob_id: CAN identifier.
        entries: Mapped objects in order.
    """

    direction: PdoDirection
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
    """The two PDOs of one drive."""

    rpdo: PdoLayout
    tpdo: PdoLayout


def target_entry(mode: OperationMode) -> Entry:
    """Object that carries the position setpoint in a mode."""
    if mode is OperationMode.INTERPOLATED_POSITION:
        return od.INTERPOLATION_SETPOINT
    return od.TARGET_POSITION


def effort_entry(feedback: EffortFeedback) -> Entry:
    """Object that tells the motor's effort."""
    return od.CURRENT_ACTUAL if feedback is EffortFeedback.CURRENT else od.TORQUE_ACTUAL


def drive_image(drive: DriveSettings) -> DriveImage:
    """PDOs of a configured drive, on the COB-IDs of the pre-defined connection set."""
    setpoints = [od.CONTROLWORD, target_entry(drive.mode)]
    if drive.torque_offset:
        setpoints.append(od.TORQUE_OFFSET)
    feedback = (od.STATUSWORD, od.POSITION_ACTUAL, effort_entry(drive.feedback))
    receive, transmit = PdoDirection.RECEIVE, PdoDirection.TRANSMIT
    return DriveImage(
        PdoLayout(receive, receive.default_cob_id(0, drive.node_id), tuple(setpoints)),
        PdoLayout(transmit, transmit.default_cob_id(0, drive.node_id), feedback),
    )
