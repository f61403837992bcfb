"""Workspace of an arm: spheres around its links and its tool, and obstacles that these must not touch.

Obstacles are half-spaces (a floor, a wall) and boxes; links may also be kept apart from each other, sphere by
sphere. A CLEARANCE is the distance of a sphere's surface from an obstacle, negative inside.

Between samples: the distances from a half-space, from a box and from another sphere's centre change at most as fast as
the centres move: they are distances from convex sets, or norms, and so 1-Lipschitz. Every time t is within half a step
h of a sample t_j, hence

    clearance(t) >= clearance(t_j) - V h / 2,

with V the greatest speed of the centre (the sum of both for two spheres) from `derivative_bounds`. `least`
returns the smallest sample minus V h / 2: a lower bound for all times, at most SURPLUS_M too small per sphere.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import product
from math import ceil

import numpy as np
from numpy.typing import NDArray

from armload_core import kernels
from armload_identification.excitation.derivative_bounds import point_rates, rate_bounds
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain
from armload_identification.model.finite_array import set_fields

IntArray = NDArray[np.int64]

SURPLUS_M = 0.003
"""Allowed error per sphere of the bound between samples; it determines the number of samples."""
MOST_SAMPLES = 65536
"""Upper limit: a motion far beyond the limits, which is useless anyway, is bounded more coarsely."""
_FEWEST_SAMPLES = 64
_AT_ONCE = 8192
_UNIT_TOLERANCE = 1e-9


@dataclass(frozen=True, eq=False, slots=True)
class Sphere:
    """A sphere around a part of the arm.

    Attributes:
        link: What it is attached to: 0 the base, i the link moved by joint i, n + 1 the flange, for the tool.
        center_m: (3,) centre in the base frame, in joint frame i, or in the flange frame.
    """

    link: int
    center_m: FloatArray
    radius_m: float


@dataclass(frozen=True, eq=False, slots=True)
class HalfSpace:
    """Everything behind a plane, such as a floor.

    Attributes:
        name: For messages.
        normal: (3,) unit vector in the base frame, pointing to the side of the arm.
        offset_m: Distance of the plane from the base frame's origin, along the normal.
        links: Links that must not touch it, as `Sphere.link`.
    """

    name: str
    normal: FloatArray
    offset_m: float
    links: tuple[int, ...]


@dataclass(frozen=True, eq=False, slots=True)
class Box:
    """A box-shaped obstacle.

    Attributes:
        name: For messages.
        pose: (4, 4) of its centre in the base frame; its edges are parallel to the axes of this pose.
        size_m: (3,) lengths of its edges.
        links: Links that must not touch it, as `Sphere.link`.
    """

    name: str
    pose: FloatArray
    size_m: FloatArray
    links: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Workspace:
    """Workspace of an arm.

    Attributes:
        chain: The arm.
        spheres: Around its links and its tool.
        half_spaces: Obstacles.
        boxes: Obstacles.
        apart: Pairs of links, as `Sphere.link`, whose spheres must not touch each other.
        keep_m: Required distance from all obstacles and between these pairs.
        names: (K,) name of the obstacle, or pair of links, of each clearance.
        between: (K,) the part of the arm and the obstacle of each clearance, in words.

    Raises:
        ModelError: a link that the arm does not have, a size not above 0, a normal that is not a unit vector, or an
            obstacle or pair to which no sphere applies.
    """

    chain: Chain
    spheres: tuple[Sphere, ...] = ()
    half_spaces: tuple[HalfSpace, ...] = ()
    boxes: tuple[Box, ...] = ()
    apart: tuple[tuple[int, int], ...] = ()
    keep_m: float = 0.0
    names: tuple[str, ...] = field(init=False)
    between: tuple[tuple[str, str], ...] = field(init=False)
    _packed: tuple[IntArray, FloatArray, FloatArray, IntArray, FloatArray, IntArray, IntArray] = field(
        init=False, repr=False
    )

    def __post_init__(self) -> None:
        self._require_sense()
        on_plane, on_box = self._pairs_to_check(self.half_spaces), self._pairs_to_check(self.boxes)
        of_link = [[s for s, ball in enumerate(self.spheres) if ball.link == k] for k in range(self.chain.n + 2)]
        pairs = [pair for first, second in self.apart for pair in product(of_link[first], of_link[second])]
        obstacles = [(s, self.half_spaces[k].name) for s, k in on_plane] + [(s, self.boxes[k].name) for s, k in on_box]
        names = [name for _, name in obstacles]
        names += [self._pair_name(self.spheres[a].link, self.spheres[b].link) for a, b in pairs]
        between = [(self._link_of_sphere(s), repr(name)) for s, name in obstacles]
        between += [(self._link_of_sphere(a), self._link_of_sphere(b)) for a, b in pairs]
        for name in {obstacle.name for obstacle in self._obstacles} | {self._pair_name(*pair) for pair in self.apart}:
            if name not in names:
                raise ModelError(
                    f"workspace: {name!r} has no effect, because the links named there have no spheres; add spheres"
                )
        planes = np.array([[*h.normal, h.offset_m] for h in self.half_spaces]).reshape(-1, 4)
        boxes = np.array([[*b.pose[:3, :3].ravel(), *b.pose[:3, 3], *(0.5 * b.size_m)] for b in self.boxes])
        packed = (
            np.array([min(s.link, self.chain.n) for s in self.spheres], dtype=np.int64),
            np.array([self._packed_sphere(s) for s in self.spheres]).reshape(-1, 4),
            np.ascontiguousarray(planes),
            np.array(on_plane, dtype=np.int64).reshape(-1, 2),
            np.ascontiguousarray(boxes.reshape(-1, kernels.BOX_NUMBERS)),
            np.array(on_box, dtype=np.int64).reshape(-1, 2),
            np.array(pairs, dtype=np.int64).reshape(-1, 2),
        )
        set_fields(self, {"names": tuple(names), "between": tuple(between), "_packed": packed})

    def centres(self, q: FloatArray) -> FloatArray:
        """Positions of the spheres.

        Args:
            q: (n,) configuration in rad.

        Returns:
            (S, 3) centres in the base frame.
        """
        poses = np.concatenate([np.eye(4)[None], self.chain.forward(q)])  # base, links, flange
        return np.array([poses[s.link, :3, :3] @ s.center_m + poses[s.link, :3, 3] for s in self.spheres])

    def clearances(self, q: FloatArray) -> FloatArray:
        """All clearances.

        Args:
            q: (N, n) configurations in rad.

        Returns:
            (N, K) in m, negative inside; K may be zero.
        """
        q = np.ascontiguousarray(q)
        out = np.empty((len(q), len(self.names)))
        if self.names:
            kernels.clearances_into(self.chain.packed, *self._packed, q, out)
        return out

    def slope(self, weight: FloatArray, q: FloatArray) -> FloatArray:
        """Derivative of the weighted sum of all clearances by the configurations.

        Args:
            weight: (N, K) weight of each clearance.
            q: (N, n) configurations in rad.

        Returns:
            (N, n) in m/rad.
        """
        q, weight = np.ascontiguousarray(q), np.ascontiguousarray(weight)
        slope = np.zeros_like(q)
        if self.names:
            kernels.clearance_slope_into(self.chain.packed, *self._packed, q, slope, weight)
        return slope

    def least(self, trajectory: FourierTrajectory) -> FloatArray:
        """Lower bound of each clearance along a trajectory, also between samples.

        Args:
            trajectory: One period of the motion.

        Returns:
            (K,) in m, negative if the bound does not exclude contact.
        """
        rates, period_s = rate_bounds(trajectory), trajectory.period_s
        return self._least(rates, period_s, 0.0, lambda t: trajectory.evaluate(t).position_rad)

    def least_on_line(self, start_rad: FloatArray, goal_rad: FloatArray) -> FloatArray:
        """Lower bound of each clearance on the straight line between two configurations.

        Args:
            start_rad: (n,) first configuration.
            goal_rad: (n,) last configuration.

        Returns:
            (K,) in m, negative if the bound does not exclude contact.
        """
        way = goal_rad - start_rad
        rates = np.zeros((4, len(way)))
        rates[0] = np.abs(way)
        return self._least(rates, 1.0, 0.5, lambda share: start_rad + way * share[:, None])

    def _least(
        self, rates: FloatArray, duration_s: float, first: float, position: Callable[[FloatArray], FloatArray]
    ) -> FloatArray:
        """(K,) the smallest clearance of a motion, from samples and the joints' greatest rates (4, n).

        `first` is the position of the first sample in steps: 0 for a periodic motion, else 0.5.
        """
        if not self.names:
            return np.zeros(0)
        speed = np.array([self._speed(s, rates) for s in self.spheres])
        wanted = ceil(duration_s * float(speed.max()) / (2.0 * SURPLUS_M))
        samples = min(max(_FEWEST_SAMPLES, wanted), MOST_SAMPLES)
        step_s = duration_s / samples
        smallest = np.full(len(self.names), np.inf)
        for begin in range(0, samples, _AT_ONCE):
            times_s = np.arange(begin + first, min(begin + _AT_ONCE, samples), 1.0, dtype=np.float64) * step_s
            smallest = np.minimum(smallest, self.clearances(position(times_s)).min(axis=0))
        on_plane, on_box, pairs = self._packed[3], self._packed[5], self._packed[6]
        fastest = np.concatenate([speed[on_plane[:, 0]], speed[on_box[:, 0]], speed[pairs].sum(axis=1)])
        return np.asarray(smallest - 0.5 * step_s * fastest)

    @property
    def _obstacles(self) -> tuple[HalfSpace | Box, ...]:
        return (*self.half_spaces, *self.boxes)

    def _speed(self, sphere: Sphere, rates: FloatArray) -> float:
        """Greatest speed of a sphere's centre in m/s."""
        lever_m = float(np.linalg.norm(self._in_link(sphere)))
        return float(point_rates(self.chain, rates, min(sphere.link, self.chain.n), lever_m)[0])

    def _in_link(self, sphere: Sphere) -> FloatArray:
        """(3,) centre in the link's joint frame; for the tool in the last joint's."""
        if sphere.link <= self.chain.n:
            return sphere.center_m
        flange = self.chain.flange
        return np.asarray(flange[:3, :3] @ sphere.center_m + flange[:3, 3])

    def _packed_sphere(self, sphere: Sphere) -> list[float]:
        """Centre in the kernels' frame of the link, and radius."""
        center = self._in_link(sphere)
        if sphere.link > 0:
            center = self.chain.turned_back(min(sphere.link, self.chain.n) - 1) @ center
        return [*center.tolist(), sphere.radius_m]

    def _pairs_to_check(self, obstacles: Sequence[HalfSpace | Box]) -> list[tuple[int, int]]:
        """Indices of sphere and obstacle for all pairs to check."""
        return [(s, k) for k, o in enumerate(obstacles) for s, ball in enumerate(self.spheres) if ball.link in o.links]

    def _link_name(self, link: int) -> str:
        """Name of a link in a message."""
        return "base" if link == 0 else "tool" if link == self.chain.n + 1 else f"link {link}"

    def _pair_name(self, link: int, other: int) -> str:
        """Name of two links in a message."""
        return f"{self._link_name(link)} to {self._link_name(other)}"

    def _link_of_sphere(self, sphere: int) -> str:
        """Name, with its article, of the link that a sphere is attached to."""
        link = self.spheres[sphere].link
        return self._link_name(link) if 0 < link <= self.chain.n else f"the {self._link_name(link)}"

    def _require_sense(self) -> None:
        """Raise for unknown links and invalid sizes, distances and normals."""
        known = range(self.chain.n + 2)
        used = [s.link for s in self.spheres] + [link for pair in self.apart for link in pair]
        used += [link for o in self._obstacles for link in o.links]
        for link in used:
            if link not in known:
                raise ModelError(f"workspace: link {link} of an arm of {self.chain.n}; expected 0 to {known[-1]}")
        for sphere in self.spheres:
            if not sphere.radius_m > 0.0:
                raise ModelError(f"workspace: a radius of {sphere.radius_m} m; expected a number above 0")
        if not 0.0 <= self.keep_m < np.inf:
            raise ModelError(f"workspace: a distance of {self.keep_m} m to keep; expected 0 or above")
        for box in self.boxes:
            if not np.all(box.size_m > 0.0):
                raise ModelError(f"workspace: {box.name!r} has the size {box.size_m.tolist()} m; expected above 0")
        for half_space in self.half_spaces:
            if abs(np.linalg.norm(half_space.normal) - 1.0) > _UNIT_TOLERANCE:
                raise ModelError(f"workspace: normal of {half_space.name!r} is not a unit vector")
