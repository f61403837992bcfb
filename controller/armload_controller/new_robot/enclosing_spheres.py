"""Spheres around the links of a URDF's arm, from its collision geometry: an initial workspace.

The surface of a link is cut across its longest direction into slices about as long as they are wide. Each slice gets a
sphere that contains it, centred in the slice's bounding box.
"""

from __future__ import annotations

from itertools import pairwise
from math import ceil
from typing import Any

import numpy as np

from armload_controller.motion.urdf_geometry import UrdfGeometry
from armload_identification.excitation.geometry.workspace import Sphere
from armload_identification.float_array import FloatArray

MOST_SLICES = 3
SURFACE_M = 0.02
"""Approximate spacing of the surface's points; the surface bulges between them by far less than `MARGIN_M`."""
MARGIN_M = 0.005
_THIN_M = 0.03
_CORNERS = 24
"""Corners of the polygon that represents a circle."""
_TIE_BREAK = 1e-9 * np.diag([2.0, 1.0, 0.0])
"""Share of the spread that chooses among equally long directions, as of a disc or a ball; rounding would otherwise."""


def enclosing_spheres(loaded: UrdfGeometry) -> tuple[Sphere, ...]:
    """Spheres around every link that has a collision geometry.

    Returns:
        Spheres in the base frame and the joint frames; links without a geometry have none.
    """
    surfaces: dict[tuple[int, int], list[FloatArray]] = {}
    for body in loaded.geometry.geometryObjects:
        points = _surface(loaded.coal, body.geometry) * np.array(body.meshScale)
        placed = points @ body.placement.rotation.T + body.placement.translation
        link = int(body.parentJoint)
        # fixed parts can be a torso with a head and another arm: spheres around all of them would leave no room
        surfaces.setdefault((link, int(body.parentFrame) if link == 0 else 0), []).append(placed)
    return tuple(
        Sphere(link, centre, radius)
        for link, part in sorted(surfaces)
        for centre, radius in _slices(np.concatenate(surfaces[link, part]))
    )


def _slices(points: FloatArray) -> list[tuple[FloatArray, float]]:
    """Centre (m) and radius (m) of the spheres around (N, 3) points of a surface."""
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    spread = np.cov((points - middle).T) if len(points) > 1 else np.zeros((3, 3))
    turn = np.linalg.svd(spread + np.trace(spread) * _TIE_BREAK)[0]
    along = (points - middle) @ turn
    width = max(float(np.linalg.norm(along[:, 1:], axis=1).max()), _THIN_M)
    count = min(max(ceil(float(np.ptp(along[:, 0])) / (1.5 * width)), 1), MOST_SLICES)
    edges = np.linspace(along[:, 0].min(), along[:, 0].max(), count + 1)
    found = []
    for low, high in pairwise(edges):
        part = along[(along[:, 0] >= low - SURFACE_M) & (along[:, 0] <= high + SURFACE_M)]
        if not part.size:
            continue  # between two bodies that are far apart
        centre = 0.5 * (part.min(axis=0) + part.max(axis=0))
        radius = float(np.linalg.norm(part - centre, axis=1).max()) + MARGIN_M
        found.append((middle + turn @ centre, radius))
    return found


def _surface(coal: Any, shape: Any) -> FloatArray:
    """(N, 3) points of a surface, or of an enclosing one, in its own frame."""
    if isinstance(shape, coal.BVHModelBase):
        triangles = [[shape.tri_indices(i)[k] for k in range(3)] for i in range(shape.num_tris)]
        return _with_points_between(np.array(shape.vertices()), np.array(triangles))
    if isinstance(shape, coal.Box):
        half = np.array(shape.halfSide)
    elif isinstance(shape, coal.Sphere):
        half = np.full(3, shape.radius)
    elif isinstance(shape, coal.Cylinder | coal.Capsule):
        ends = shape.halfLength + (shape.radius if isinstance(shape, coal.Capsule) else 0.0)
        turn = np.linspace(0.0, 2.0 * np.pi, _CORNERS, endpoint=False)
        wide = shape.radius / np.cos(np.pi / _CORNERS)
        rows = np.linspace(-ends, ends, max(ceil(2.0 * ends / SURFACE_M), 1) + 1)
        return np.array([[wide * np.cos(a), wide * np.sin(a), z] for z in rows for a in turn])
    else:
        shape.computeLocalAABB()
        half = np.full(3, shape.aabb_radius)
    grids = [np.linspace(-size, size, max(ceil(2.0 * size / SURFACE_M), 1) + 1) for size in half]
    whole = np.stack(np.meshgrid(*grids, indexing="ij"), axis=-1).reshape(-1, 3)
    return np.asarray(whole[(np.abs(np.abs(whole) - half) < 1e-9 + 1e-9 * half).any(axis=1)])


def _with_points_between(vertices: FloatArray, triangles: FloatArray) -> FloatArray:
    """Vertices, and further points of triangles with long edges."""
    corners = vertices[triangles]
    longest = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)
    parts = [vertices]
    for steps in (2, 4, 8, 16):
        last = steps == 16
        chosen = (longest > SURFACE_M * steps / 2) & (last | (longest <= SURFACE_M * steps))
        shares = [(i / steps, k / steps) for i in range(steps + 1) for k in range(steps + 1 - i)]
        for one, other in shares if chosen.any() else ():
            weights = np.array([one, other, 1.0 - one - other])
            parts.append(np.einsum("k,tkx->tx", weights, corners[chosen]))
    return np.concatenate(parts)
