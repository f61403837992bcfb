"""A profile of a drive: the properties of a product family, independent of the arm."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from armload_controller.config.tables.drive_tables import ProductKeys
from armload_identification.storage.strict_toml import Table, Text


class ProductTable(Table):
    """The product family, with remarks for the integrator."""

    name: Text
    source: Text
    vendor_id: Annotated[int, Field(gt=0, lt=1 << 32)] | None = None
    peculiarities: list[Text] = Field(default=[])


class DriveProfileTable(ProductKeys):
    """`[drive]`: the product's keys; consents, node ids and limits belong to the arm."""

    mode: Literal["csp", "ip"] | None = None
    feedback: Literal["current", "torque"] | None = None

    def given(self) -> dict[str, Any]:
        """The keys that the profile gives, as in TOML."""
        return self.model_dump(exclude_unset=True)


class ProfileFile(Table):
    """The whole file."""

    content = "a drive's profile"

    product: ProductTable
    drive: DriveProfileTable
