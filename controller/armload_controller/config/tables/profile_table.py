"""A profile of a drive: the properties of a product family, independent of the arm."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from armload_controller.config.tables.drive_tables import EffortObjectTable, TemperatureObjectTable, VendorSettingTable
from armload_controller.config.tables.table_types import Positive
from armload_identification.storage.strict_toml import Table, Text


class ProductTable(Table):
    """The product family, with remarks for the integrator."""

    name: Text
    source: Text
    peculiarities: list[Text] = Field(default=[])


class DriveProfileTable(Table):
    """Keys of `[joints.drive]` that belong to the product; consents, node ids and limits belong to the arm."""

    mode: Literal["csp", "ip"] | None = None
    feedback: Literal["current", "torque"] | None = None
    counts_per_axis_turn: Positive | None = None
    torque_offset: bool | None = None
    torque_offset_bits: Literal[16, 32] | None = None
    pdo_objects_max: Annotated[int, Field(ge=2, le=8)] | None = None
    rated_torque_unit_nm: Positive | None = None
    effort_object: EffortObjectTable | None = None
    temperature_object: TemperatureObjectTable | None = None
    vendor_settings: list[VendorSettingTable] | None = None

    def given(self) -> dict[str, Any]:
        """The keys that the profile gives, as in TOML."""
        return self.model_dump(exclude_none=True)


class ProfileFile(Table):
    """The whole file."""

    content = "a drive's profile"

    product: ProductTable
    drive: DriveProfileTable
