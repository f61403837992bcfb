"""`[kinematics]` and `[transmission]`: placement of the joints, and coupling of the motors to them."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from msgspec import Meta

from armload_controller.config.tables.table_types import Angle, PoseTable, Vector3
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain, pose_from_xyz_rpy
from armload_identification.storage.strict_toml import BadValue, Table


class DhRowTable(Table):
    """One Denavit-Hartenberg row."""

    alpha_rad: Angle
    a_m: float
    d_m: float
    theta_rad: Angle


class OriginTable(PoseTable):
    """One joint's frame in the previous one, and its axis."""

    axis: Vector3


class KinematicsTable(Table):
    """Rows or origins, and the flange in the last frame."""

    convention: Literal["modified-dh", "standard-dh", "joint-origins"]
    rows: list[DhRowTable] | None = None
    origins: list[OriginTable] | None = None
    flange: PoseTable

    def __post_init__(self) -> None:
        wanted, other = ("origins", "rows") if self.convention == "joint-origins" else ("rows", "origins")
        if getattr(self, wanted) is None or getattr(self, other) is not None:
            raise ValueError(f'with convention = "{self.convention}" give {wanted} and not {other}')

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.rows or self.origins or ())

    def chain(self, gravity_m_s2: FloatArray) -> Chain:
        """Kinematics up to the flange.

        Args:
            gravity_m_s2: (3,) gravitational acceleration in the base frame.
        """
        flange = pose_from_xyz_rpy(self.flange.xyz_m, self.flange.rpy_rad)
        if self.origins is not None:
            return Chain.from_origins(
                np.array([o.xyz_m for o in self.origins]),
                np.array([o.rpy_rad for o in self.origins]),
                np.array([o.axis for o in self.origins]),
                flange,
                gravity_m_s2,
            )
        rows = np.array([[r.alpha_rad, r.a_m, r.d_m, r.theta_rad] for r in self.rows or ()])
        build = Chain.from_modified_dh if self.convention == "modified-dh" else Chain.from_standard_dh
        return build(rows, flange, gravity_m_s2)


class TransmissionTable(Table):
    """Coupled motors, q_joint = C q_axis, and how far the torque that drives report can be trusted."""

    coupling: list[list[float]] | None = None
    gain_deviation: Annotated[float, Meta(ge=0.0, le=0.5)] | None = None
    scale_deviation: Annotated[float, Meta(ge=0.0, le=0.5)] | None = None

    def check(self, n: int) -> None:
        """Refuse a matrix that is not an invertible coupling of n joints.

        Raises:
            BadValue: naming the key.
        """
        if self.coupling is None:
            return
        if len(self.coupling) != n or any(len(row) != n for row in self.coupling):
            raise BadValue("transmission.coupling", self.coupling, f"expected {n} rows of {n} numbers")
        if abs(np.linalg.det(np.array(self.coupling))) < 1e-6:
            raise BadValue("transmission.coupling", self.coupling, "expected an invertible matrix")
