"""The tables `[bus]` and `[joints.drive]` of a robot's file, and the driver layer's settings made from them."""

from __future__ import annotations

import math
import string
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, model_validator

from armload_controller.config.table_types import Positive, Table
from armload_controller.control_errors import ConfigurationError
from armload_drivers.cia402.arm_settings import (
    DriveSettings,
    EffortFeedback,
    Identity,
    OperationMode,
    TemperatureObject,
    VendorEffort,
)
from armload_drivers.cia402.device_description import DeviceDescription, read_description
from armload_drivers.cia402.object_dictionary import DataType
from armload_drivers.driver_errors import DescriptionError

_EFFORT_TYPES = {"i16": DataType.I16, "i32": DataType.I32}
_NUMBER_TYPES = {
    "i8": DataType.I8, "u8": DataType.U8, "i16": DataType.I16, "u16": DataType.U16, "i32": DataType.I32,
    "u32": DataType.U32, "f32": DataType.F32,
}  # fmt: skip


class BusTable(Table):
    """The CANopen bus."""

    interface: str
    channel: str
    bitrate: Annotated[int, Field(ge=10_000, le=1_000_000)]
    cycle_hz: Annotated[float, Field(gt=0, le=1000)]
    heartbeat_s: Positive
    max_missing_cycles: Annotated[int, Field(ge=0)]
    sync_counter: Annotated[int, Field(ge=0, le=240)] = 0
    other_nodes: list[Annotated[int, Field(ge=1, le=127)]] = Field(default=[])

    @model_validator(mode="after")
    def _countable(self) -> BusTable:
        if self.sync_counter == 1:
            raise ValueError("sync_counter is 0 (SYNC without a counter) or 2 to 240 (1019)")
        return self


class IdentityTable(Table):
    """What object 1018 has to say."""

    vendor_id: int
    product_code: int
    revision: int | None = None


class EffortObjectTable(Table):
    """A vendor's object that tells the motor's current or torque, in place of 6078 or 6077."""

    index: Annotated[int, Field(ge=0x2000, le=0x9FFF)]
    subindex: Annotated[int, Field(ge=0, le=254)]
    type: Literal["i16", "i32"]
    a_per_unit: Positive | None = None
    nm_per_unit: Positive | None = None

    @model_validator(mode="after")
    def _one_scale(self) -> EffortObjectTable:
        if (self.a_per_unit is None) == (self.nm_per_unit is None):
            raise ValueError(
                "give one scale: a_per_unit (motor current) or nm_per_unit (torque at the axis, behind the gear)"
            )
        return self


class TemperatureObjectTable(Table):
    """A vendor's object that tells a temperature of the drive or its motor, for `armload drives show`."""

    index: Annotated[int, Field(ge=0x2000, le=0x9FFF)]
    subindex: Annotated[int, Field(ge=0, le=254)]
    type: Literal["i8", "u8", "i16", "u16", "i32", "u32", "f32"]
    celsius_per_unit: Positive


class DriveTable(Table):
    """One joint's drive. A scale that is left out is read from the drive."""

    node_id: Annotated[int, Field(ge=1, le=127)]
    mode: Literal["csp", "ip"]
    feedback: Literal["current", "torque"]
    counts_per_axis_turn: Positive | None = None
    rated_current_a: Positive | None = None
    rated_torque_nm: Positive | None = None
    max_torque_permille: Annotated[int, Field(ge=1, le=65535)]
    following_error_rad: Positive
    following_lag_s: Positive | None = None
    has_brake: bool
    torque_offset: bool = True
    effort_object: EffortObjectTable | None = None
    temperature_object: TemperatureObjectTable | None = None
    accept_missing: list[str] = Field(default=[])
    description: str | None = None
    identity: IdentityTable | None = None

    @model_validator(mode="after")
    def _consistent(self) -> DriveTable:
        effort = self.effort_object
        if effort is not None:
            scale = effort.a_per_unit if self.feedback == "current" else effort.nm_per_unit
            if scale is None:
                key = "a_per_unit" if self.feedback == "current" else "nm_per_unit"
                raise ValueError(f'feedback = "{self.feedback}" needs effort_object.{key}')
        for name in self.accept_missing:
            if len(name) != 4 or not set(name) <= set(string.hexdigits):
                raise ValueError(f'accept_missing names objects by four hexadecimal digits, as "6007", not {name!r}')
        return self

    def identity_settings(self) -> Identity:
        """What 1018 has to say; anything where the file does not tell."""
        told = self.identity
        return Identity(None, None) if told is None else Identity(told.vendor_id, told.product_code, told.revision)

    def vendor_effort(self) -> VendorEffort | None:
        """The vendor's object for the effort."""
        told = self.effort_object
        if told is None:
            return None
        return VendorEffort(
            told.index, told.subindex, _EFFORT_TYPES[told.type], float(told.a_per_unit or told.nm_per_unit or 0.0)
        )

    def temperature(self) -> TemperatureObject | None:
        """The vendor's object for a temperature."""
        told = self.temperature_object
        if told is None:
            return None
        return TemperatureObject(told.index, told.subindex, _NUMBER_TYPES[told.type], told.celsius_per_unit)


def drive_settings(
    drive: DriveTable,
    joint: str,
    position_rad: tuple[float, float],
    gear_ratio: float | None,
    description: DeviceDescription | None,
) -> DriveSettings:
    """What the driver layer has to know of one drive.

    Args:
        drive: Its table.
        joint: Name of its joint.
        position_rad: Least and greatest position of the joint.
        gear_ratio: Motor turns per axis turn, where the file tells.
        description: The vendor's device description.
    """
    csp = drive.mode == "csp"
    turn = drive.counts_per_axis_turn
    return DriveSettings(
        joint=joint,
        node_id=drive.node_id,
        mode=OperationMode.CYCLIC_SYNCHRONOUS_POSITION if csp else OperationMode.INTERPOLATED_POSITION,
        feedback=EffortFeedback.CURRENT if drive.feedback == "current" else EffortFeedback.TORQUE,
        counts_per_rad=None if turn is None else turn / (2 * math.pi),
        rated_current_a=drive.rated_current_a,
        rated_torque_nm=drive.rated_torque_nm,
        max_torque_permille=drive.max_torque_permille,
        following_error_rad=drive.following_error_rad,
        position_min_rad=position_rad[0],
        position_max_rad=position_rad[1],
        has_brake=drive.has_brake,
        identity=drive.identity_settings(),
        torque_offset=drive.torque_offset,
        gear_ratio=gear_ratio,
        vendor_effort=drive.vendor_effort(),
        accept_missing=frozenset(name.upper() for name in drive.accept_missing),
        description=description,
        temperature=drive.temperature(),
    )


def read_descriptions(file: str, folder: Path, drives: Mapping[str, DriveTable | None]) -> dict[str, DeviceDescription]:
    """Device descriptions of the joints whose drives name one.

    Args:
        file: Name of the robot's file, for messages.
        folder: Folder of that file; descriptions are named relative to it.
        drives: Table by joint.

    Raises:
        ConfigurationError: a description cannot be used.
    """
    found = {}
    for number, (joint, drive) in enumerate(drives.items(), start=1):
        if drive is not None and drive.description is not None:
            try:
                found[joint] = read_description(folder / drive.description)
            except DescriptionError as error:
                raise ConfigurationError(
                    file, f"joints[{number}].drive.description", drive.description, f"a usable EDS or DCF file; {error}"
                ) from error
    return found


def require_scales(file: str, drives: Mapping[str, DriveTable | None]) -> None:
    """Refuse drives that are to be simulated and whose scale only a real drive could tell.

    Raises:
        ConfigurationError: naming the key.
    """
    for number, drive in enumerate(drives.values(), start=1):
        if drive is None:
            continue
        needed = ["counts_per_axis_turn", "rated_torque_nm"] + ["rated_current_a"] * (drive.feedback == "current")
        missing = [name for name in needed if getattr(drive, name) is None]
        if missing:
            key = f"joints[{number}].drive.{missing[0]}"
            raise ConfigurationError(file, key, None, "a simulated drive needs its scale here")
