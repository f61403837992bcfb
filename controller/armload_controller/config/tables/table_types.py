"""Types shared by the tables of a robot's file: numbers with a range, vectors, poses."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from armload_identification.storage.strict_toml import Table

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(ge=0, lt=1)]
Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]


class PoseTable(Table):
    """Pose of a frame in another frame."""

    xyz_m: Vector3
    rpy_rad: Vector3
