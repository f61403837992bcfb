"""Collision geometry of a URDF: distances of an arm's links from each other and from their surroundings.

Boxes, cylinders, spheres and meshes, as in the file; a mesh is replaced by its convex hull. Joints of the file that are
not part of the arm stay at zero.

Between samples: the distance of two rigid bodies changes at most as fast as the points of one move in the frame of the
other. For links a < b only the joints between them matter; the speed of a point of b at a distance r from its joint is
at most

    V = sum_{j=a+1..b} |dq_j| (|p_{j+1}| + ... + |p_b| + r)

with p_k the offset of joint k in the frame of joint k - 1. After a sample with distance d the next one is taken a time
(d - keep + SURPLUS) / V later, so that with no sample below keep the distance never falls below keep - SURPLUS / 2.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from armload_controller.motion.urdf_geometry import load_urdf_geometry
from armload_identification.excitation.derivative_bounds import rate_bounds
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain

SURPLUS_M = 0.003
"""Least distance to keep; half of it is reserved for the bound between samples."""
_SAME_LINE_M = 1e-3
_SAME_DIRECTION = 1e-3
_POSES = 8
_SEED = 1
_SLOW_M_S = 1e-9


class Meshes:
    """Collision geometry of one arm.

    Args:
        file: The URDF; its meshes are searched for relative to it.
        chain: The arm as configured.
        joint_names: Its joints; the URDF must have joints of the same names.
        keep_m: Distance to keep between all pairs; at least `SURPLUS_M` is used.
        touching: Pairs of links that may touch each other, in addition to those that a joint connects.

    Attributes:
        keep_m: Distance that is kept at every sample.
        least_m: Distance that is kept at all times.
        pairs: (K,) the two links of each distance.
        names: (K,) the same for messages.
        joints_between: (K,) number of joints between the two links of each distance.

    Raises:
        ModelError: Pinocchio is missing, or the file cannot be used or describes another arm.
    """

    def __init__(
        self,
        file: Path,
        chain: Chain,
        joint_names: tuple[str, ...],
        keep_m: float,
        touching: tuple[tuple[str, str], ...] = (),
    ) -> None:
        loaded = load_urdf_geometry(file, joint_names)
        self._pin, self._coal, self._model, self._geometry = loaded.pin, loaded.coal, loaded.model, loaded.geometry
        self.keep_m = max(keep_m, SURPLUS_M)
        self.least_m = self.keep_m - 0.5 * SURPLUS_M
        self._require_same_arm(file, chain, joint_names)
        self._data = self._model.createData()
        for body in self._geometry.geometryObjects:
            self._make_solid(file, body)
        links = [self._model.frames[body.parentFrame].name for body in self._geometry.geometryObjects]
        self._pair_bodies(loaded.connected | _touching_pairs(file, touching, links), links)
        self._placements = self._geometry.createData()

    def distances(self, q: FloatArray) -> FloatArray:
        """Distance of every pair.

        Args:
            q: (n,) configuration in rad.

        Returns:
            (K,) in m, negative if they overlap.
        """
        self._pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._placements, q)
        self._pin.computeDistances(self._geometry, self._placements)
        return np.array([result.min_distance for result in self._placements.distanceResults])

    def nearest(self, trajectory: FourierTrajectory) -> tuple[float, str]:
        """Lower bound of all distances along a motion, or up to the first place where it is less than `least_m`.

        Args:
            trajectory: One period.

        Returns:
            The distance in m, and the links; inf if there are no pairs.
        """
        rates = rate_bounds(trajectory)[0]
        return self._nearest(rates, trajectory.period_s, lambda t: trajectory.evaluate(t).position_rad)

    def nearest_on_line(self, start_rad: FloatArray, goal_rad: FloatArray) -> tuple[float, str]:
        """As `nearest`, on the straight line between two configurations (n,)."""
        way = goal_rad - start_rad
        return self._nearest(np.abs(way), 1.0, lambda share: start_rad + share * way)

    def _nearest(
        self, rates: FloatArray, duration_s: float, position: Callable[[float], FloatArray]
    ) -> tuple[float, str]:
        """`nearest` by samples as far apart as the distances allow; rates (n,) bound the joints' speeds."""
        if not self.names:
            return np.inf, "nothing"
        speed = np.maximum(np.array([reach @ rates for reach in self._reach]), _SLOW_M_S)
        smallest, between, time_s = np.inf, "", 0.0
        while True:
            distances = self.distances(position(time_s))
            worst = int(distances.argmin())
            if distances[worst] < smallest:
                smallest, between = float(distances[worst]), self.names[worst]
            if smallest < self.keep_m or time_s >= duration_s:
                return smallest - 0.5 * SURPLUS_M, between
            time_s = min(time_s + float(((distances - self.keep_m + SURPLUS_M) / speed).min()), duration_s)

    def _require_same_arm(self, file: Path, chain: Chain, joint_names: tuple[str, ...]) -> None:
        """Raise unless the URDF's joints are those configured, with the same axes."""
        pin, model = self._pin, self._model
        found = tuple(model.names)[1:]
        if found != joint_names or model.nq != chain.n:
            raise ModelError(
                f"{file}: moving joints {', '.join(found) or 'none'}; expected {', '.join(joint_names)} in this order, "
                "each of type revolute or continuous"
            )
        data = model.createData()
        for q in np.random.default_rng(_SEED).uniform(-np.pi, np.pi, (_POSES, chain.n)):
            poses = chain.forward(q)
            columns = pin.computeJointJacobians(model, data, q)
            for i, name in enumerate(joint_names):
                axis, direction = poses[i, :3, :3] @ chain.axis[i], columns[3:, i]
                apart = np.linalg.norm(np.cross(data.oMi[i + 1].translation - poses[i, :3, 3], axis))
                if np.abs(direction - axis).max() > _SAME_DIRECTION or apart > _SAME_LINE_M:
                    raise ModelError(
                        f"{file}: {name} turns about an axis that differs from the one in [kinematics], {apart:.3f} m "
                        "away; both must have the same base frame, zeros and directions"
                    )

    def _make_solid(self, file: Path, body: Any) -> None:
        """Replace a mesh by its convex hull; a disc's rim is shifted slightly if its corner has too many neighbours."""
        shape = body.geometry
        if isinstance(shape, self._coal.BVHModelBase):
            for option in ("Qt", "QJ"):
                with suppress(RuntimeError):
                    shape.buildConvexHull(True, option)
                if shape.convex is not None:
                    break
            else:
                expected = "expected a body with a volume, and fewer than 256 edges at a corner"
                raise ModelError(f"{file}: no convex hull of the mesh {body.meshPath}: {expected}")
            body.geometry = shape.convex
        body.geometry.computeLocalAABB()

    def _pair_bodies(self, apart: frozenset[frozenset[str]], links: list[str]) -> None:
        """Find all pairs of bodies on different, unconnected links, and the levers of their relative motion."""
        bodies = list(self._geometry.geometryObjects)
        offsets = [float(np.linalg.norm(placement.translation)) for placement in self._model.jointPlacements]
        reaches, pairs = [], []
        for i, first in enumerate(bodies):
            for k in range(i):
                low, high = sorted((bodies[k], first), key=lambda body: body.parentJoint)
                pair = frozenset((links[i], links[k]))
                if low.parentJoint == high.parentJoint or pair in apart:
                    continue
                self._geometry.addCollisionPair(self._pin.CollisionPair(k, i))
                pairs.append((links[k], links[i]))
                centre = high.placement.act(np.array(high.geometry.aabb_center))
                lever = float(np.linalg.norm(centre)) + float(high.geometry.aabb_radius)
                reach = np.zeros(self._model.nq)
                for joint in range(low.parentJoint + 1, high.parentJoint + 1):
                    reach[joint - 1] = sum(offsets[joint + 1 : high.parentJoint + 1]) + lever
                reaches.append(reach)
        self.pairs, self._reach = tuple(pairs), reaches
        self.names = tuple(f"{one} to {other}" for one, other in pairs)
        self.joints_between = tuple(int(np.count_nonzero(reach)) for reach in reaches)


def _touching_pairs(file: Path, touching: tuple[tuple[str, str], ...], links: list[str]) -> set[frozenset[str]]:
    """Pairs that may touch, checked for unknown links."""
    for name in {name for pair in touching for name in pair}:
        if name not in links:
            known = ", ".join(sorted(set(links)))
            raise ModelError(f"{file}: no link {name!r} with a collision geometry; those that have one: {known}")
    return {frozenset(pair) for pair in touching}
