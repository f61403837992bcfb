"""The ROS 2 messages that armload exchanges, as DDS types; fields, order and names are those of the ROS packages.

References:
    ROS 2 design, "Topic and Service name mapping to DDS": a type `pkg/msg/Name` is `pkg::msg::dds_::Name_` in DDS.
"""

# no `from __future__ import annotations` here: cyclonedds reads the types of the fields
from dataclasses import dataclass
from typing import TYPE_CHECKING

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import byte, float64, int32, uint32

if TYPE_CHECKING:
    from collections.abc import Sequence as sequence  # noqa: N813
else:
    from cyclonedds.idl.types import sequence


@dataclass
class Stamp(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    """Time since 1970, or of a simulation."""

    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    """Time of the data, and their frame."""

    stamp: Stamp
    frame_id: str


@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    """Positions in rad, velocities in rad/s and efforts of the joints named; a quantity may be absent."""

    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    """Three coordinates."""

    x: float64
    y: float64
    z: float64


@dataclass
class Inertia(IdlStruct, typename="geometry_msgs::msg::dds_::Inertia_"):
    """Mass in kg, centre of mass in m, inertia about the centre of mass in kg m2."""

    m: float64
    com: Vector3
    ixx: float64
    ixy: float64
    ixz: float64
    iyy: float64
    iyz: float64
    izz: float64


@dataclass
class InertiaStamped(IdlStruct, typename="geometry_msgs::msg::dds_::InertiaStamped_"):
    """An inertia in a frame."""

    header: Header
    inertia: Inertia


@dataclass
class Text(IdlStruct, typename="std_msgs::msg::dds_::String_"):
    """A text."""

    data: str


@dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    """A value by its name."""

    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    """The state of one component: 0 in order, 1 warning, 2 error, 3 stale."""

    level: byte
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    """The states of several components."""

    header: Header
    status: sequence[DiagnosticStatus]
