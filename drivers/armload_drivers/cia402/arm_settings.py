"""Settings of an arm for the driver layer, as plain data.

Axis and joint: an AXIS is one motor seen through its gear (motor angle / gear ratio). On most arms it is the joint
itself; if motors are coupled, q_joint = C q_axis and tau_joint = C^-T tau_axis. Drives operate on axes; `JointServos`
operates on joints.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from enum import Enum, IntEnum
from typing import TYPE_CHECKING

from msgspec import Struct

from armload_drivers.cia402.object_dictionary import Access, DataType, Entry, Mappable, PdoDirection
from armload_drivers.servos import FloatArray

if TYPE_CHECKING:
    from armload_drivers.cia402.eds_parser import DeviceDescription

NODE_IDS = frozenset(range(1, 128))
"""Node ids of CANopen."""


class Fieldbus(Enum):
    """Buses that carry CiA 402."""

    CANOPEN = "CANopen"
    ETHERCAT = "EtherCAT"


class OperationMode(IntEnum):
    """Modes of operation (6060) that this driver streams in. CiA 402-2, 6.3."""

    INTERPOLATED_POSITION = 7
    CYCLIC_SYNCHRONOUS_POSITION = 8


class EffortFeedback(Enum):
    """Kind of effort that the drive reports, and the standard's object for it."""

    CURRENT = 0x6078
    """Current actual value, per mille of rated current (6075)."""
    TORQUE = 0x6077
    """Torque actual value, per mille of rated torque (6076)."""


class VendorObject(Struct, frozen=True):
    """A vendor's object with a measured value: the effort of drives without 6078 or 6077, or a temperature.

    Attributes:
        index: Index of the object.
        subindex: Sub-index.
        type: Data type; of an effort 16 or 32 bits.
        per_unit: Motor current in A, axis torque in N m, or degrees Celsius, per unit of the object.
    """

    index: int
    subindex: int
    type: DataType
    per_unit: float

    def entry(self, name: str, mappable: Mappable = Mappable.NO) -> Entry:
        """The object, with a name for messages."""
        return Entry(self.index, self.subindex, f"vendor's {name}", self.type, Access.RO, mappable)


class VendorSetting(Struct, frozen=True):
    """A vendor's object that provides a safety property of the drive; see `drive_safety`.

    Attributes:
        entry: The object.
        value: Its required value.
        meets: Name of the property.
    """

    entry: Entry
    value: int
    meets: str


class FixedPdo(Struct, frozen=True):
    """A PDO of a drive whose mapping cannot be changed.

    Attributes:
        direction: As seen from the drive.
        number: Number of the PDO in that direction, from 0.
        mapping: Its mapping parameters (1600, 1A00).
    """

    direction: PdoDirection
    number: int
    mapping: tuple[int, ...]

    @property
    def key(self) -> str:
        """Its key in the configuration."""
        return f"{'rpdo' if self.direction is PdoDirection.RECEIVE else 'tpdo'}{self.number + 1}"

    def carries(self, entries: Iterable[Entry]) -> bool:
        """Whether it contains all of the entries."""
        return {entry.mapping for entry in entries} <= set(self.mapping)


@dataclass(frozen=True, slots=True)
class Identity:
    """Identity object 1018; None matches anything."""

    vendor_id: int | None
    product_code: int | None
    revision: int | None = None
    serial: int | None = None


SIMULATION_IDENTITY = Identity(vendor_id=0x4152_4D4C, product_code=0x5349_4D01)
"""Identity of every simulated drive ("ARML", "SIM" 1). No vendor uses it: a device with another identity is real."""


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """One drive and the scaling of its objects.

    Attributes:
        joint: Name of the joint.
        node_id: CANopen node id, 1 to 127; on EtherCAT the drive's place in the line, from 1.
        mode: Streaming mode.
        feedback: Object that reports the effort.
        counts_per_rad: Position units (607A, 6064) per radian of the AXIS; None to read it from the drive.
        rated_current_a: Motor current of 1000 per mille in 6078; None with torque feedback, or to read it from the
            drive.
        rated_torque_nm: AXIS torque of 1000 per mille in 6071, 6072, 6077, 60B2; None to read it from the drive.
        max_torque_permille: 6072.
        following_error_rad: 6065, on the axis.
        position_min_rad: 607D:1, on the joint; the master widens it if motors are coupled.
        position_max_rad: 607D:2, likewise.
        velocity_max_rad_s: Greatest speed of the joint.
        acceleration_max_rad_s2: Greatest acceleration of the joint on paths.
        has_brake: Whether a brake holds the axis when torque is removed.
        identity: Required content of 1018.
        torque_offset: Whether the drive has a torque offset (60B2); two of eight products examined do not.
        gear_ratio: Motor turns per axis turn, for drives that do not store it.
        vendor_effort: The vendor's object for the effort; None for the standard's.
        accept_missing: Names of the safety properties that this drive is permitted to lack.
        description: The vendor's device description, if any.
        temperature: The vendor's object for a temperature, if any.
        torque_limit_in_drive: Whether `max_torque_permille` is set in the drive by other means and cannot be read.
        vendor_settings: Vendor's objects that provide safety properties.
        torque_offset_bits: Size of 60B2, 16 or 32.
        effort_bits: Size of 6078 or 6077, 16 or 32.
        pdo_objects_max: Greatest number of objects in one PDO, whatever their size.
        fixed_pdos: The PDOs of a drive whose mapping cannot be changed; empty if all can be mapped.
        rated_torque_unit_nm: Value of one unit of 6076, in N m.
        homed_bit: Bit of the statusword that is 1 while the position has its reference; None if the drive reports none.
        bus: Number of the bus that the drive is on, from 0.
        second_axis_unused: Whether nothing is connected to the further axes of a drive that serves several.
        alias: EtherCAT station alias that the drive must have; None if it is not checked.
        sync0: Whether the drive follows its distributed clock (SYNC0) instead of the frame's arrival.
    """

    joint: str
    node_id: int
    mode: OperationMode
    feedback: EffortFeedback
    counts_per_rad: float | None
    rated_current_a: float | None
    rated_torque_nm: float | None
    max_torque_permille: int
    following_error_rad: float
    position_min_rad: float
    position_max_rad: float
    velocity_max_rad_s: float
    acceleration_max_rad_s2: float
    has_brake: bool
    identity: Identity
    torque_offset: bool = True
    gear_ratio: float | None = None
    vendor_effort: VendorObject | None = None
    accept_missing: frozenset[str] = frozenset()
    description: DeviceDescription | None = None
    temperature: VendorObject | None = None
    torque_limit_in_drive: bool = False
    vendor_settings: tuple[VendorSetting, ...] = ()
    torque_offset_bits: int = 16
    effort_bits: int = 16
    pdo_objects_max: int = 8
    fixed_pdos: tuple[FixedPdo, ...] = ()
    rated_torque_unit_nm: float = 1e-3
    second_axis_unused: bool = False
    alias: int | None = None
    sync0: bool = False
    homed_bit: int | None = None
    bus: int = 0

    @property
    def wanted_identity(self) -> Identity:
        """The identity required of 1018: the configured one, else the description's; never its exact revision."""
        if self.description is None or self.identity.vendor_id is not None:
            return self.identity
        return Identity(self.description.vendor_id, self.description.product_code)

    @property
    def is_named(self) -> bool:
        """Whether a vendor is stated, otherwise nothing is written to a real drive; some report no product code."""
        return self.wanted_identity.vendor_id is not None


@dataclass(frozen=True, slots=True)
class ArmSettings:
    """The whole arm on its bus.

    Attributes:
        drives: One entry per joint, in joint order.
        coupling: (n, n) C with q_joint = C q_axis.
        cycle_s: Period of SYNC, or of EtherCAT's frames.
        bitrate: Bits per second; of CANopen.
        heartbeat_s: Heartbeat period in both directions; of CANopen.
        max_missing_cycles: Greatest number of consecutive cycles in which a joint's feedback may be missing.
        brakes_closed: Whether brakes stay closed while drives are enabled, to test them.
        other_nodes: Node ids of CiA 402 drives on the bus that do not belong to the arm.
        sync_counter: Overflow value of the SYNC counter (1019), 2 to 240; 0 sends SYNC without one.
        fieldbus: The bus.
        watchdog_s: Time without process data after which an EtherCAT drive leaves OP.
    """

    drives: tuple[DriveSettings, ...]
    coupling: FloatArray
    cycle_s: float
    bitrate: int
    heartbeat_s: float
    max_missing_cycles: int
    sync_counter: int = 0
    other_nodes: frozenset[int] = frozenset()
    brakes_closed: bool = False
    fieldbus: Fieldbus = Fieldbus.CANOPEN
    watchdog_s: float = 0.1

    @property
    def master_node_id(self) -> int:
        """Node id of the master's heartbeat: the highest that no other node has."""
        return max(NODE_IDS - {drive.node_id for drive in self.drives} - self.other_nodes)

    def by_bus(self) -> tuple[ArmSettings, ...]:
        """The arm's settings with the drives of each bus."""
        buses = range(max((drive.bus for drive in self.drives), default=0) + 1)
        return tuple(replace(self, drives=tuple(drive for drive in self.drives if drive.bus == bus)) for bus in buses)
