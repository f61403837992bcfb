"""What the driver layer needs to know about an arm, as plain data.

Axis and joint: an AXIS is one motor seen through its gear (motor angle / gear ratio). On most arms it is
the joint itself; where motors are coupled, q_joint = C q_axis and tau_joint = C^-T tau_axis. Drives know
axes only; `JointServos` speaks joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum

from armload_core.arrays import FloatArray
from armload_drivers.cia402.device_description import DeviceDescription
from armload_drivers.cia402.object_dictionary import DataType, Entry


class OperationMode(IntEnum):
    """Modes of operation (6060) that this driver streams in. CiA 402-2, 6.3."""

    INTERPOLATED_POSITION = 7
    CYCLIC_SYNCHRONOUS_POSITION = 8


class EffortFeedback(Enum):
    """How the drive reports the motor's effort, and the standard's object for it."""

    CURRENT = 0x6078
    """Current actual value, per mille of rated current (6075)."""
    TORQUE = 0x6077
    """Torque actual value, per mille of rated torque (6076)."""


@dataclass(frozen=True, slots=True)
class VendorEffort:
    """A vendor's object that reports the effort, for drives without 6078 or 6077.

    Attributes:
        index: Index of the object.
        subindex: Sub-index.
        type: Data type, 16 or 32 bits.
        per_unit: Motor current in A, or axis torque in N m, that one unit of the object means.
    """

    index: int
    subindex: int
    type: DataType
    per_unit: float


@dataclass(frozen=True, slots=True)
class TemperatureObject:
    """A vendor's object that reports a temperature of the drive or its motor; the standard has none.

    Attributes:
        index: Index of the object.
        subindex: Sub-index.
        type: Data type.
        celsius_per_unit: Degrees that one unit of the object means.
    """

    index: int
    subindex: int
    type: DataType
    celsius_per_unit: float


@dataclass(frozen=True, slots=True)
class VendorSetting:
    """A vendor's object that gives the drive a property that safety rests on; see `drive_safety`.

    Attributes:
        entry: The object.
        value: What it must hold.
        meets: Name of the property.
    """

    entry: Entry
    value: int
    meets: str


@dataclass(frozen=True, slots=True)
class Identity:
    """Identity object 1018; None matches anything."""

    vendor_id: int | None
    product_code: int | None
    revision: int | None = None


SIMULATION_IDENTITY = Identity(vendor_id=0x4152_4D4C, product_code=0x5349_4D01)
"""Identity of every simulated drive ("ARML", "SIM" 1). No vendor has it: whatever answers otherwise is real."""


@dataclass(frozen=True, slots=True)
class DriveSettings:
    """One drive and the scaling of its objects.

    Attributes:
        joint: Name of the joint.
        node_id: CANopen node id, 1 to 127.
        mode: Streaming mode.
        feedback: Object that reports the effort.
        counts_per_rad: Position units (607A, 6064) per radian of the AXIS; None takes what the drive reports.
        rated_current_a: Motor current that 1000 per mille of 6078 means; None with torque feedback, or takes what
            the drive reports.
        rated_torque_nm: AXIS torque that 1000 per mille of 6071, 6072, 6077, 60B2 means; None takes what the drive
            reports.
        max_torque_permille: 6072.
        following_error_rad: 6065, on the axis.
        position_min_rad: 607D:1, on the joint; the master widens it where motors are coupled.
        position_max_rad: 607D:2.
        has_brake: Torque may be removed without the axis falling.
        identity: The identity required of 1018.
        torque_offset: The drive takes a torque offset (60B2); two of eight products read do not.
        gear_ratio: Motor turns per axis turn, for drives that know nothing of their gear.
        vendor_effort: The vendor's object for the effort; the standard's where None.
        accept_missing: Properties that safety rests on and that this drive may lack all the same, by name.
        description: The vendor's device description, where there is one.
        temperature: The vendor's object for a temperature, where one is shown.
        torque_limit_in_drive: `max_torque_permille` is set in the drive by other means and cannot be read.
        vendor_settings: Vendor's objects that give properties that safety rests on.
        torque_offset_bits: Size of 60B2, 16 or 32.
        pdo_objects_max: So many objects fit one PDO, whatever their size.
        rated_torque_unit_nm: What one unit of 6076 means, in N m.
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
    has_brake: bool
    identity: Identity
    torque_offset: bool = True
    gear_ratio: float | None = None
    vendor_effort: VendorEffort | None = None
    accept_missing: frozenset[str] = frozenset()
    description: DeviceDescription | None = None
    temperature: TemperatureObject | None = None
    torque_limit_in_drive: bool = False
    vendor_settings: tuple[VendorSetting, ...] = ()
    torque_offset_bits: int = 16
    pdo_objects_max: int = 8
    rated_torque_unit_nm: float = 1e-3


@dataclass(frozen=True, slots=True)
class ArmSettings:
    """The whole arm on its bus.

    Attributes:
        drives: One entry per joint, in joint order.
        coupling: (n, n) C with q_joint = C q_axis.
        cycle_s: SYNC period.
        bitrate: Bits per second.
        heartbeat_s: Heartbeat period in both directions.
        max_missing_cycles: Feedback of a joint may be missing this many cycles in a row.
        max_bus_load: Worst-case share of the bus that a configuration may plan for.
        other_nodes: Node ids of CiA 402 drives on the bus that do not belong to the arm.
        sync_counter: Overflow value of the SYNC counter (1019), 2 to 240; 0 sends SYNC without one.
    """

    drives: tuple[DriveSettings, ...]
    coupling: FloatArray
    cycle_s: float
    bitrate: int
    heartbeat_s: float
    max_missing_cycles: int
    max_bus_load: float = 0.7
    sync_counter: int = 0
    other_nodes: frozenset[int] = frozenset()
