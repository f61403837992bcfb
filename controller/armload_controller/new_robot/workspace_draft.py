"""A first `[workspace]` from a URDF's collision geometry: spheres, floor, pairs kept apart, meshes that may touch.

Random poses show whether two links can be kept apart: parts that overlap in nearly all of them are neighbours whose
coarse shapes touch.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Final

import numpy as np

from armload_controller.config.chain_from_urdf import UrdfArm
from armload_controller.motion.collision_meshes import Meshes
from armload_controller.motion.urdf_geometry import load_urdf_geometry
from armload_controller.new_robot.arm_draft import ArmDraft
from armload_controller.new_robot.enclosing_spheres import enclosing_spheres
from armload_identification.excitation.geometry.workspace import HalfSpace, Sphere, Workspace
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError

KEEP_M: Final = 0.02
"""Clearance to all obstacles."""
BARE_RADIUS_M: Final = 0.05
"""Radius of the sphere around the origin of a link without geometry."""
_POSES: Final = 200
_MESH_POSES: Final = 40
_SEED: Final = 1
_CLEAR_SHARE: Final = 0.5
"""Share of poses in which a pair's spheres must be clear; keeping other pairs apart would forbid most of the range."""
_NEIGHBOUR_SHARE: Final = 0.9
"""Share of poses above which two touching meshes count as neighbours."""
_NEAR_NEIGHBOUR_SHARE: Final = 0.7
"""The same for links at most `_NEAR_JOINTS` joints apart: the convex hulls that represent the meshes fill the space
between them (Baxter: torso and elbow, in 81 % of the poses)."""
_NEAR_JOINTS: Final = 3


@dataclass(frozen=True, eq=False)
class WorkspaceDraft:
    """Data for a `[workspace]`.

    Attributes:
        spheres: Spheres around every link and the tool.
        bare: Links without geometry, which get a default sphere.
        floor_m: Height of the floor over the base frame: that of the URDF's root.
        above_floor: Links that are kept above it, the tool being n + 1; the others reach it in nearly every pose, for
            example those next to the base.
        apart: Pairs of links that are kept apart.
        overlapping: Pairs that are not, because their spheres overlap in most poses.
        meshes: Whether the URDF's meshes are checked as well.
        touching: Pairs of the URDF's links that may touch.
        why_no_meshes: Why the meshes are not checked; empty if they are.
        urdf: Path of the URDF as the robot's file names it; None without one.
    """

    spheres: tuple[Sphere, ...]
    bare: tuple[int, ...]
    floor_m: float
    above_floor: tuple[int, ...]
    apart: tuple[tuple[int, int], ...]
    overlapping: tuple[tuple[int, int], ...]
    meshes: bool
    touching: tuple[tuple[str, str], ...]
    why_no_meshes: str
    urdf: str | None = None


def workspace_of_urdf(arm: UrdfArm, draft: ArmDraft, tool: Sphere) -> WorkspaceDraft:
    """The workspace of a URDF's arm.

    Args:
        draft: The same arm, with the ranges to use.
        tool: Sphere around tool and payload.

    Raises:
        ModelError: the geometry cannot be loaded.
    """
    loaded = load_urdf_geometry(Path(arm.file), arm.joint_names)
    model = loaded.model
    base = model.frames[model.getFrameId(arm.base, loaded.pin.FrameType.BODY)].placement
    found = [
        Sphere(s.link, base.rotation.T @ (s.center_m - base.translation), s.radius_m) if s.link == 0 else s
        for s in enclosing_spheres(loaded)
    ]
    workspace = workspace_of_spheres(draft, found, tool, floor_m=-float(base.translation[2]))
    if not np.allclose(base.homogeneous, np.eye(4), atol=1e-9):
        return replace(workspace, why_no_meshes=f"the arm begins at {arm.base}, which is not the root of the URDF")
    try:
        meshes = Meshes(Path(arm.file), arm.chain, arm.joint_names, KEEP_M)
    except ModelError as error:
        return replace(workspace, why_no_meshes=str(error).removeprefix(f"{arm.file}: "))
    near = np.mean([meshes.distances(q) < meshes.keep_m for q in _poses(draft, _MESH_POSES)], axis=0)
    touching = tuple(
        pair
        for pair, share, joints in zip(meshes.pairs, near, meshes.joints_between, strict=True)
        if share >= (_NEAR_NEIGHBOUR_SHARE if joints <= _NEAR_JOINTS else _NEIGHBOUR_SHARE)
    )
    ordered = tuple(sorted({(a, b) if a < b else (b, a) for a, b in touching}))
    return replace(workspace, meshes=True, touching=ordered, why_no_meshes="")


def workspace_of_spheres(
    draft: ArmDraft, spheres: list[Sphere], tool: Sphere, why: str = "", floor_m: float = 0.0
) -> WorkspaceDraft:
    """A workspace with spheres only.

    Args:
        spheres: The known spheres.
        tool: Sphere around tool and payload.
        why: Why meshes are not checked.
        floor_m: Height of the floor over the base frame.
    """
    n = draft.n
    bare = tuple(sorted(set(range(1, n + 1)) - {s.link for s in spheres}))
    spheres = [*spheres, *(Sphere(link, np.zeros(3), BARE_RADIUS_M) for link in bare), tool]
    links = sorted({s.link for s in spheres})
    poses = _poses(draft, _POSES)
    share: dict[tuple[int, int], float] = {}
    candidates = [(a, b) for a, b in combinations(links, 2) if b - a >= 2 and (a, b) != (n - 1, n + 1)]
    if candidates:
        model = Workspace(draft.chain, tuple(spheres), apart=tuple(candidates))
        first = np.sort(np.unique(model.names, return_index=True)[1])  # of each pair's spheres, in the order of pairs
        clear = np.minimum.reduceat(model.clearances(poses), first, axis=1) >= KEEP_M
        share = dict(zip(candidates, clear.mean(axis=0), strict=True))
    return WorkspaceDraft(
        spheres=tuple(spheres),
        bare=bare,
        floor_m=floor_m,
        above_floor=_above_floor(draft, spheres, floor_m, poses),
        apart=tuple(pair for pair in candidates if share[pair] >= _CLEAR_SHARE),
        overlapping=tuple(pair for pair in candidates if share[pair] < _CLEAR_SHARE),
        meshes=False,
        touching=(),
        why_no_meshes=why,
    )


def _poses(draft: ArmDraft, count: int) -> FloatArray:
    """(count, n) random configurations within the joints' ranges, or within a turn."""
    least = np.nan_to_num(draft.position_min_rad, nan=-np.pi).clip(min=-np.pi)
    greatest = np.nan_to_num(draft.position_max_rad, nan=np.pi).clip(max=np.pi)
    return np.random.default_rng(_SEED).uniform(least, greatest, (count, draft.n))


def up_of(draft: ArmDraft) -> FloatArray:
    """(3,) unit vector opposite to gravity, in the base frame."""
    return np.asarray(-draft.chain.gravity_m_s2 / np.linalg.norm(draft.chain.gravity_m_s2))


def _above_floor(draft: ArmDraft, spheres: list[Sphere], floor_m: float, poses: FloatArray) -> tuple[int, ...]:
    """Links that can be kept above the floor."""
    floor = HalfSpace("floor", up_of(draft), floor_m, tuple(range(1, draft.n + 2)))
    moving = tuple(s for s in spheres if s.link)
    low = Workspace(draft.chain, moving, (floor,)).clearances(poses) < KEEP_M
    always = {sphere.link for sphere, share in zip(moving, low.mean(axis=0), strict=True) if share > _NEIGHBOUR_SHARE}
    return tuple(link for link in floor.links if link not in always)
