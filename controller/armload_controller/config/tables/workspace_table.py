"""`[workspace]`: what an arm must not touch."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from msgspec import Meta, field

from armload_controller.config.tables.table_types import NonNegative, PoseTable, Positive, Vector3
from armload_identification.excitation.geometry.workspace import Box, HalfSpace, Sphere, Workspace
from armload_identification.model.chain import Chain, pose_from_xyz_rpy
from armload_identification.storage.strict_toml import BadValue, Table

if TYPE_CHECKING:
    from armload_controller.motion.collision_meshes import Meshes

_ANY_LINK = '0 for the base, the number of a joint for the link that it moves, or "tool"'
Link = Annotated[int, Meta(ge=0, description=_ANY_LINK)] | Literal["tool"]
"""0 for the base, i for the link that joint i moves, "tool" for everything on the flange including the payload."""


class SphereTable(Table):
    """A sphere around a part of the arm, in the base frame, a link's joint frame, or for the tool the flange frame."""

    link: Link
    center_m: Vector3
    radius_m: Positive


class HalfSpaceTable(Table):
    """A half-space that the arm must not enter; the normal points to the side where the arm may be."""

    name: str
    normal: Vector3
    offset_m: float
    links: list[Link] | None = None

    def __post_init__(self) -> None:
        if not float(np.linalg.norm(self.normal)) > 0.0:
            raise BadValue("normal", self.normal, "a plane needs a direction, such as [0.0, 0.0, 1.0]")


class BoxTable(PoseTable):
    """A box as an obstacle: pose of its centre in the base frame, and the lengths of its edges."""

    name: str
    size_m: Annotated[list[Positive], Meta(min_length=3, max_length=3)]
    links: list[Link] | None = None


class InsideTable(Table):
    """A box aligned with the base frame's axes that the arm must not leave."""

    min_m: Vector3
    max_m: Vector3

    def __post_init__(self) -> None:
        if any(low >= high for low, high in zip(self.min_m, self.max_m, strict=True)):
            raise ValueError(f"min_m = {self.min_m} is not below max_m = {self.max_m}: exchange them")


class WorkspaceTable(Table):
    """Obstacles and spheres that limit where the arm may be."""

    keep_m: NonNegative
    floor_height_m: float | None = None
    inside: InsideTable | None = None
    spheres: list[SphereTable]
    half_spaces: list[HalfSpaceTable] = field(default_factory=list)
    boxes: list[BoxTable] = field(default_factory=list)
    urdf: str | None = None
    urdf_touching: list[Annotated[list[str], Meta(min_length=2, max_length=2)]] = field(default_factory=list)
    apart: list[Annotated[list[Link], Meta(min_length=2, max_length=2)]] = field(default_factory=list)

    def check(self, n: int) -> None:
        """Refuse links that an arm of n joints does not have, and a link without a sphere.

        Raises:
            BadValue: naming the key.
        """
        named: list[tuple[str, Link]] = [(f"spheres[{i + 1}].link", s.link) for i, s in enumerate(self.spheres)]
        named += [(f"half_spaces[{i + 1}].links", a) for i, p in enumerate(self.half_spaces) for a in p.links or ()]
        named += [(f"boxes[{i + 1}].links", a) for i, b in enumerate(self.boxes) for a in b.links or ()]
        named += [(f"apart[{i + 1}]", a) for i, pair in enumerate(self.apart) for a in pair]
        for key, link in named:
            if link != "tool" and link > n:
                raise BadValue(f"workspace.{key}", link, f'expected 0 (the base) to {n}, or "tool"')
        bare = sorted(set(range(1, n + 2)) - {_link_number(s.link, n) for s in self.spheres})
        if bare:
            name = "tool" if bare[0] == n + 1 else str(bare[0])
            expected = "expected at least one around every link and around the tool"
            raise BadValue("workspace.spheres", f"none with link = {name}", expected)

    def workspace(self, chain: Chain) -> Workspace:
        """Spheres around the arm, and the obstacles.

        Args:
            chain: The arm; with a floor its gravity must not be zero.

        Raises:
            ModelError: an obstacle is invalid, for example one that no part of the arm can touch.
        """
        n = chain.n
        moving = tuple(range(1, n + 2))

        def links(names: Sequence[Link] | None) -> tuple[int, ...]:
            return moving if names is None else tuple(_link_number(name, n) for name in names)

        half_spaces = []
        if self.floor_height_m is not None:
            up = -chain.gravity_m_s2 / float(np.linalg.norm(chain.gravity_m_s2))
            half_spaces.append(HalfSpace("floor", up, self.floor_height_m, moving))
        if self.inside is not None:
            for axis, letter in enumerate("xyz"):
                direction = np.eye(3)[axis]
                half_spaces.append(HalfSpace(f"inside, -{letter}", direction, self.inside.min_m[axis], moving))
                half_spaces.append(HalfSpace(f"inside, +{letter}", -direction, -self.inside.max_m[axis], moving))
        for plane in self.half_spaces:
            normal = np.array(plane.normal)
            half_spaces.append(
                HalfSpace(plane.name, normal / np.linalg.norm(normal), plane.offset_m, links(plane.links))
            )
        return Workspace(
            chain,
            tuple(Sphere(_link_number(s.link, n), np.array(s.center_m), s.radius_m) for s in self.spheres),
            tuple(half_spaces),
            tuple(
                Box(b.name, pose_from_xyz_rpy(b.xyz_m, b.rpy_rad), np.array(b.size_m), links(b.links))
                for b in self.boxes
            ),
            tuple((_link_number(a, n), _link_number(b, n)) for a, b in self.apart),
            self.keep_m,
        )

    def meshes(self, folder: Path, chain: Chain, joint_names: tuple[str, ...]) -> Meshes | None:
        """The collision geometry of `urdf`; None if the file names none.

        Args:
            folder: Folder of the URDF.
            joint_names: Names of its joints, which the URDF must also contain.

        Raises:
            ModelError: the URDF cannot be used, or the library that reads it is not installed.
        """
        if self.urdf is None:
            return None
        from armload_controller.motion.collision_meshes import Meshes

        touching = tuple((a, b) for a, b in self.urdf_touching)
        return Meshes(folder / self.urdf, chain, joint_names, self.keep_m, touching)


def _link_number(name: Link, n: int) -> int:
    """Number of a link in the workspace: the tool of an arm of n joints is n + 1."""
    return n + 1 if name == "tool" else int(name)
