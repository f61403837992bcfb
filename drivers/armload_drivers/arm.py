"""What the driver layer has to know of an arm, as plain data.

Axis and joint: an AXIS is one motor seen through its gear (motor angle / gear ratio). On most arms it is
the joint itself; where motors are coupled, q_joint = C q_axis and tau_joint = C^-T tau_axis. Drives know
axes only; `JointServos` speaks joints.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, IntEnum

from armload_drivers.servos import FloatArray


class OperationMode(IntEnum):
    """Modes of operation (6060) that this driver streams in. CiA 402-2, 6.3."""

    INTERPOLATED_POSITION = 7
    CYCLIC_SYNCHRONOUS_POSITION = 8


class EffortFeedback(Enum):
    """Which object tells the motor's effort."""

    CURRENT = 0x6078
    """Current actual value, per mille of rated current (6075)."""
    TORQUE = 0x6077
    """Torque actual value, per mille of rated torque (6076)."""


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
        feedback: Object that tells the effort.
        counts_per_rad: Position units (607A, 6064) per radian of the AXIS.
        rated_current_a: Motor current that 1000 per mille of 6078 means; None with torque feedback.
        rated_torque_nm: AXIS torque that 1000 per mille of 6071, 6072, 6077, 60B2 means.
        max_torque_permille: 6072.
        following_error_rad: 6065, on the axis.
        position_min_rad: 607D:1, on the joint; the master widens it where motors are coupled.
        position_max_rad: 607D:2.
        has_brake: Torque may be removed without the axis falling.
        identity: What 1018 has to say.
        torque_offset: The drive takes a torque offset (60B2); two of eight products read do not.
    """

    joint: str
    node_id: int
    mode: OperationMode
    feedback: EffortFeedback
    counts_per_rad: float
    rated_current_a: float | None
    rated_torque_nm: float
    max_torque_permille: int
    following_error_rad: float
    position_min_rad: float
    position_max_rad: float
    has_brake: bool
    identity: Identity
    torque_offset: bool = True


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
    """

    drives: tuple[DriveSettings, ...]
    coupling: FloatArray
    cycle_s: float
    bitrate: int
    heartbeat_s: float
    max_missing_cycles: int
    max_bus_load: float = 0.7
