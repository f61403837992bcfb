"""The tables of a robot's file that an excitation's limits come from: the arm's own body, and its workspace."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, PlainValidator, field_validator, model_validator

from armload_controller.config.table_types import BodyTable, NonNegative, PoseTable, Positive, Table, Vector3


def _link(value: object) -> object:
    """One message for all that is no link."""
    if value == "tool" or (isinstance(value, int) and not isinstance(value, bool) and value >= 0):
        return value
    raise ValueError('0 for the base, the number of a joint for the link that turns with it, or "tool"')


Link = Annotated[int | Literal["tool"], PlainValidator(_link)]
"""0 the base, i the link that turns with joint i, "tool" what is on the flange, payload included."""


class ArmLinkTable(BodyTable):
    """One link in its joint frame, with its drive's rotor and friction."""

    reflected_rotor_inertia_kg_m2: NonNegative
    coulomb_nm: NonNegative
    viscous_nm_s_rad: NonNegative


class ArmBodyTable(Table):
    """What the arm itself is made of, as its maker or a CAD model tells."""

    links: list[ArmLinkTable]


class SphereTable(Table):
    """A sphere around a part of the arm, in the base frame, the link's joint frame, or for a tool the flange frame."""

    link: Link
    center_m: Vector3
    radius_m: Positive


class HalfSpaceTable(Table):
    """Everything on the far side of a plane; the normal points to where the arm may be."""

    name: str
    normal: Vector3
    offset_m: float
    links: list[Link] | None = None

    @field_validator("normal")
    @classmethod
    def _direction(cls, normal: list[float]) -> list[float]:
        if not float(np.linalg.norm(normal)) > 0.0:
            raise ValueError("a plane needs a direction, such as [0.0, 0.0, 1.0]")
        return normal


class BoxTable(PoseTable):
    """A box in the way: pose of its centre in the base frame, and the lengths of its edges."""

    name: str
    size_m: Annotated[list[Positive], Field(min_length=3, max_length=3)]
    links: list[Link] | None = None


class InsideTable(Table):
    """A box along the base frame's axes that the arm never leaves."""

    min_m: Vector3
    max_m: Vector3

    @model_validator(mode="after")
    def _ordered(self) -> InsideTable:
        if any(low >= high for low, high in zip(self.min_m, self.max_m, strict=True)):
            raise ValueError(f"min_m = {self.min_m} is not below max_m = {self.max_m}: exchange them")
        return self


class WorkspaceTable(Table):
    """Where the arm may be."""

    keep_m: NonNegative
    floor_height_m: float | None = None
    inside: InsideTable | None = None
    spheres: list[SphereTable]
    half_spaces: list[HalfSpaceTable] = Field(default=[])
    boxes: list[BoxTable] = Field(default=[])
    urdf: str | None = None
    urdf_touching: list[Annotated[list[str], Field(min_length=2, max_length=2)]] = Field(default=[])
    apart: list[Annotated[list[Link], Field(min_length=2, max_length=2)]] = Field(default=[])
