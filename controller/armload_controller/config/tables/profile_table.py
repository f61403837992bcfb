"""A profile of a drive: the properties of a product family, independent of the arm."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec
from msgspec import Meta, field

from armload_controller.config.tables.drive_tables import ProductKeys
from armload_identification.storage.strict_toml import Table, Text


class ProductTable(Table):
    """The product family, with remarks for the integrator."""

    name: Text
    source: Text
    vendor_id: Annotated[int, Meta(gt=0, lt=1 << 32)] | None = None
    peculiarities: list[Text] = field(default_factory=list)


class DriveProfileTable(ProductKeys):
    """`[drive]`: the product's keys; consents, node ids and limits belong to the arm."""

    mode: Literal["csp", "ip"] | None = None
    feedback: Literal["current", "torque"] | None = None

    def given(self) -> dict[str, Any]:
        """The keys in which the profile differs from the defaults, as in TOML."""
        return dict(msgspec.to_builtins(self))


class ProfileFile(Table):
    """The whole file."""

    content = "a drive's profile"

    product: ProductTable
    drive: DriveProfileTable
