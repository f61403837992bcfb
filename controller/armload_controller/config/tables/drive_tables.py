"""`[bus]` and `[joints.drive]`, and the driver layer's settings made from them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
from msgspec import Meta, field

from armload_controller.config.tables.table_types import Positive
from armload_drivers.cia402.arm_settings import (
    ArmSettings,
    DriveSettings,
    EffortFeedback,
    Fieldbus,
    FixedPdo,
    Identity,
    OperationMode,
    VendorObject,
    VendorSetting,
)
from armload_drivers.cia402.drive_safety import SAFETY_KEYS, property_of
from armload_drivers.cia402.object_dictionary import DataType, Entry, PdoDirection
from armload_drivers.cia402.process_data.process_image import drive_image
from armload_identification.float_array import FloatArray
from armload_identification.storage.strict_toml import BadValue, Table

if TYPE_CHECKING:
    from armload_drivers.cia402.eds_parser import DeviceDescription

_OBJECT_INDEX = re.compile("[0-9A-Fa-f]{4}")
_NUMBER_TYPES = {
    "i8": DataType.I8, "u8": DataType.U8, "i16": DataType.I16, "u16": DataType.U16, "i32": DataType.I32,
    "u32": DataType.U32, "f32": DataType.F32,
}  # fmt: skip
_MODES = {"csp": OperationMode.CYCLIC_SYNCHRONOUS_POSITION, "ip": OperationMode.INTERPOLATED_POSITION}
_KEYS_OF = {
    Fieldbus.ETHERCAT: ("watchdog_s",),
    Fieldbus.CANOPEN: ("bitrate", "heartbeat_s", "sync_counter"),
}
"""Keys of `[bus]` that belong to one bus only."""
OF_THE_JOINT = (
    "joint", "position_min_rad", "position_max_rad", "velocity_max_rad_s", "acceleration_max_rad_s2", "gear_ratio",
)  # fmt: skip
"""Fields of `DriveSettings` that the joint's table states."""

_PdoName = Annotated[str, Meta(pattern="^[rt]pdo[1-4]$")]
_MappingWord = Annotated[int, Meta(ge=0, lt=1 << 32)]
_DIRECTION = {"r": PdoDirection.RECEIVE, "t": PdoDirection.TRANSMIT}

VIRTUAL = "virtual"
"""The interface inside one process, shared with its simulated drives."""


ETHERCAT = "ethercat"
"""The interface for EtherCAT; its channel is a network interface. All others are python-can's, for CANopen."""


class PartTable(Table):
    """One of two buses of an arm."""

    interface: str
    channel: str


class BusTable(Table):
    """The CANopen bus, or `a` and `b` if the arm has two; or EtherCAT with `interface = "ethercat"`."""

    interface: str | None = None
    channel: str | None = None
    a: PartTable | None = None
    b: PartTable | None = None
    bitrate: Annotated[int, Meta(ge=10_000, le=1_000_000)] | None = None
    cycle_hz: Annotated[float, Meta(gt=0, le=1000)]
    heartbeat_s: Positive | None = None
    watchdog_s: Annotated[float, Meta(gt=0, le=5)] | None = None
    max_missing_cycles: Annotated[int, Meta(ge=0)]
    sync_counter: Annotated[int, Meta(ge=0, le=240)] = 0
    other_nodes: list[Annotated[int, Meta(ge=1, le=127)]] = field(default_factory=list)

    @property
    def in_virtual_time(self) -> bool:
        """Whether time is virtual: master and drives wait for each other, and a cycle takes only its computing time."""
        return self.parts[0].interface == VIRTUAL

    @property
    def parts(self) -> tuple[PartTable, ...]:
        """The buses; a drive's `bus` is "a" or "b"."""
        if self.a is not None and self.b is not None:
            return self.a, self.b
        return (PartTable(interface=self.interface or "", channel=self.channel or ""),)

    @property
    def address(self) -> str:
        """The buses for messages, as socketcan:can0."""
        return " and ".join(f"{part.interface}:{part.channel}" for part in self.parts)

    def elsewhere(self, interface: str, channel: str) -> dict[str, object]:
        """The keys that place the arm on another bus; with two, CHANNEL,CHANNEL on that interface.

        Args:
            interface: python-can interface.
            channel: Its channel or channels.

        Raises:
            BadValue: another number of channels than buses.
        """
        if len(self.parts) == 1:
            return {"interface": interface, "channel": channel}
        channels = channel.split(",")
        if len(channels) != len(self.parts):
            raise BadValue("channel", channel, "the arm has two buses: expected two channels, such as can0,can1")
        return {name: {"interface": interface, "channel": each} for name, each in zip("ab", channels, strict=True)}

    def __post_init__(self) -> None:
        self._one_or_two()
        self._keys_of_its_kind()
        if self.sync_counter == 1:
            raise BadValue("sync_counter", 1, "expected 0 (SYNC without a counter) or 2 to 240 (1019)")

    def _one_or_two(self) -> None:
        single: dict[str, object] = {"interface": self.interface, "channel": self.channel}
        required, why = single, "required, or [bus.a] and [bus.b] for an arm on two buses"
        two = self.a is not None or self.b is not None
        if two:
            required, why = {"a": self.a, "b": self.b}, "required: an arm on two buses has [bus.a] and [bus.b]"
        for key, value in required.items():
            if value is None:
                raise BadValue(key, None, why)
        if two:
            for key, value in single.items():
                if value is not None:
                    raise BadValue(key, value, "an arm on two buses states it in [bus.a] and [bus.b]")
            first, second = self.parts
            if first.interface != second.interface or first.channel == second.channel:
                raise BadValue("b", self.address, "expected two channels of one interface")

    @property
    def on_ethercat(self) -> bool:
        """Whether the bus is EtherCAT."""
        return self.parts[0].interface == ETHERCAT

    def _keys_of_its_kind(self) -> None:
        if self.on_ethercat and self.a is not None:
            raise BadValue("a", self.address, "an arm on EtherCAT has one line: give interface and channel")
        own, other = _KEYS_OF if self.on_ethercat else reversed(_KEYS_OF)
        interface = f'interface = "{self.parts[0].interface}"'
        for key in _KEYS_OF[own]:
            if getattr(self, key) is None:
                raise BadValue(key, None, f"required on {own.value} ({interface})")
        for key in _KEYS_OF[other]:
            if getattr(self, key):
                raise BadValue(key, getattr(self, key), f"belongs to {other.value}: remove it, as {interface}")
        least_s = (self.max_missing_cycles + 2) / self.cycle_hz
        if self.watchdog_s is not None and self.watchdog_s < least_s:
            raise BadValue(
                "watchdog_s",
                self.watchdog_s,
                f"expected at least {least_s:g}: max_missing_cycles = {self.max_missing_cycles} frames may be lost at "
                f"{self.cycle_hz:g} Hz, and the drives would leave OP first",
            )

    def arm_settings(self, drives: Sequence[DriveSettings], coupling: FloatArray) -> ArmSettings:
        """Settings for the driver layer.

        Args:
            drives: The drives, from the base to the flange.
            coupling: (n, n) C with q_joint = C q_axis.
        """
        return ArmSettings(
            drives=tuple(drives),
            coupling=coupling,
            cycle_s=1 / self.cycle_hz,
            bitrate=self.bitrate or 0,
            heartbeat_s=self.heartbeat_s or 0.0,
            max_missing_cycles=self.max_missing_cycles,
            sync_counter=self.sync_counter,
            other_nodes=frozenset(self.other_nodes),
            fieldbus=Fieldbus.ETHERCAT if self.on_ethercat else Fieldbus.CANOPEN,
            watchdog_s=self.watchdog_s or 0.0,
        )


class IdentityTable(Table):
    """Expected content of object 1018."""

    vendor_id: int
    product_code: int | None = None
    revision: int | None = None
    serial: int | None = None


class VendorObjectTable(Table):
    """An object in a manufacturer's or a profile's own range."""

    index: Annotated[int, Meta(ge=0x2000, le=0x9FFF)]
    subindex: Annotated[int, Meta(ge=0, le=254)]


class EffortObjectTable(VendorObjectTable):
    """A vendor's object with the motor's current or torque, in place of 6078 or 6077."""

    type: Literal["i16", "i32"]
    a_per_unit: Positive | None = None
    nm_per_unit: Positive | None = None

    def __post_init__(self) -> None:
        if (self.a_per_unit is None) == (self.nm_per_unit is None):
            raise ValueError(
                "give one scale: a_per_unit (motor current) or nm_per_unit (torque at the axis, on the output side of "
                "the gear)"
            )

    def effort(self) -> VendorObject:
        """Object for the driver layer."""
        scale = float(self.a_per_unit or self.nm_per_unit or 0.0)
        return VendorObject(self.index, self.subindex, _NUMBER_TYPES[self.type], scale)


class TemperatureObjectTable(VendorObjectTable):
    """A vendor's object with a temperature of the drive or its motor, for `armload drives show`."""

    type: Literal["i8", "u8", "i16", "u16", "i32", "u32", "f32"]
    celsius_per_unit: Positive

    def temperature(self) -> VendorObject:
        """Object for the driver layer."""
        return VendorObject(self.index, self.subindex, _NUMBER_TYPES[self.type], self.celsius_per_unit)


class VendorSettingTable(VendorObjectTable):
    """A vendor's object that provides a safety property of the drive; it is written and read back."""

    type: Literal["i8", "u8", "i16", "u16", "i32", "u32"]
    value: int
    meets: str

    def __post_init__(self) -> None:
        least, greatest = _NUMBER_TYPES[self.type].bounds
        if not least <= self.value <= greatest:
            raise BadValue("value", self.value, f"expected {least} to {greatest}, the range of {self.type}")
        if self.meets not in SAFETY_KEYS:
            raise BadValue("meets", self.meets, f"expected one of {', '.join(SAFETY_KEYS)}")

    def setting(self) -> VendorSetting:
        """Setting for the driver layer."""
        entry = Entry(self.index, self.subindex, "vendor's setting", _NUMBER_TYPES[self.type])
        return VendorSetting(entry, self.value, self.meets)


class ProductKeys(Table):
    """Keys of `[joints.drive]` that belong to the product, and so may stand in its profile."""

    counts_per_axis_turn: Positive | None = None
    torque_offset: bool = True
    torque_offset_bits: Literal[16, 32] = 16
    effort_bits: Literal[16, 32] = 16
    homed_bit: Literal[8, 14, 15] | None = None
    pdo_objects_max: Annotated[int, Meta(ge=2, le=8)] = 8
    fixed_pdos: dict[_PdoName, list[_MappingWord]] = field(default_factory=dict)
    rated_torque_unit_nm: Positive = 1e-3
    effort_object: EffortObjectTable | None = None
    temperature_object: TemperatureObjectTable | None = None
    vendor_settings: list[VendorSettingTable] = field(default_factory=list)


class DriveTable(ProductKeys):
    """One joint's drive. A scale that is not given is read from the drive."""

    profile: str | None = None
    bus: Literal["a", "b"] = "a"
    node_id: Annotated[int, Meta(ge=1, le=127)]
    mode: Literal["csp", "ip"]
    feedback: Literal["current", "torque"]
    rated_current_a: Positive | None = None
    rated_torque_nm: Positive | None = None
    max_torque_permille: Annotated[int, Meta(ge=1, le=65535)]
    following_error_rad: Positive
    following_lag_s: Positive | None = None
    has_brake: bool
    torque_limit_in_drive: bool = False
    second_axis_unused: bool = False
    alias: Annotated[int, Meta(ge=1, le=65535)] | None = None
    sync0: bool = False
    accept_missing: list[str] = field(default_factory=list)
    description: str | None = None
    identity: IdentityTable | None = None

    def __post_init__(self) -> None:
        effort = self.effort_object
        if effort is not None:
            key = "a_per_unit" if self.feedback == "current" else "nm_per_unit"
            if getattr(effort, key) is None:
                raise ValueError(f'feedback = "{self.feedback}" needs effort_object.{key}')
        for name in self.accept_missing:
            if name not in SAFETY_KEYS:
                of = property_of(int(name, 16)) if _OBJECT_INDEX.fullmatch(name) else None
                meant = "" if of is None else f'; {name.upper()} belongs to "{of.key}"'
                raise BadValue("accept_missing", name, f"expected names of {', '.join(SAFETY_KEYS)}{meant}")
        try:
            drive_image(self.settings(dict.fromkeys(OF_THE_JOINT), None))
        except ValueError as error:
            raise BadValue("fixed_pdos", "", str(error)) from error

    def missing_scale(self) -> str | None:
        """Key of a scale that must be read from the drive, which only a real one can provide; None if all are given."""
        needed = ["counts_per_axis_turn", "rated_torque_nm"] + ["rated_current_a"] * (self.feedback == "current")
        return next((name for name in needed if getattr(self, name) is None), None)

    def settings(self, of_the_joint: Mapping[str, Any], description: DeviceDescription | None) -> DriveSettings:
        """Settings for the driver layer. Keys that both tables have pass as they are.

        Args:
            of_the_joint: Those of `OF_THE_JOINT`.
            description: The vendor's device description.
        """
        turn, named, effort, heat = (
            self.counts_per_axis_turn,
            self.identity,
            self.effort_object,
            self.temperature_object,
        )
        unchanged = {key.name: getattr(self, key.name) for key in fields(DriveSettings) if hasattr(self, key.name)}
        converted = {
            "mode": _MODES[self.mode],
            "feedback": EffortFeedback[self.feedback.upper()],
            "identity": Identity(None, None) if named is None else Identity(**msgspec.structs.asdict(named)),
            "accept_missing": frozenset(self.accept_missing),
            "description": description,
            "bus": "ab".index(self.bus),
            "vendor_settings": tuple(table.setting() for table in self.vendor_settings),
            "fixed_pdos": tuple(
                FixedPdo(_DIRECTION[name[0]], int(name[-1]) - 1, tuple(words))
                for name, words in self.fixed_pdos.items()
            ),
        }
        return DriveSettings(
            counts_per_rad=None if turn is None else turn / (2 * math.pi),
            vendor_effort=None if effort is None else effort.effort(),
            temperature=None if heat is None else heat.temperature(),
            **(unchanged | converted | dict(of_the_joint)),
        )
