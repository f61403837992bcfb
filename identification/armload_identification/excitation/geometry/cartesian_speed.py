"""Speed of points of an arm: its elbow, wrist, flange and tool centre point, and of what it carries.

A point p moved by the first m joints, with axes z_j through o_j in the base frame, has the velocity

    v = sum_{j <= m} z_j x (p - o_j) dq_j

and for k <= m this velocity depends on a joint's position by

    dv/dq_k = z_k x sum_{k <= j <= m} z_j x (p - o_j) dq_j  +  w_{k-1} x (z_k x (p - o_k))

with w_k = sum_{j <= k} z_j dq_j, the angular velocity of link k.

What the arm carries is bounded by spheres that are fixed to the flange. No point within a distance r of a centre c is
faster than

    |v_c| + r |w_n|        d|w_n|/dq_k = (z_k x (w_n - w_k)) . w_n / |w_n|        d|w_n|/d(dq_k) = z_k . w_n / |w_n|

Between samples: a vector whose second derivative is at most B is nowhere further than B h^2 / 8 from the straight line
between two samples a time h apart, and on that line nowhere longer than at its longer end. Hence

    |v(t)| <= max(|v(t_j)|, |v(t_j+1)|) + B h^2 / 8.

The same holds for |v_c| + r |w_n|, a norm of both vectors, with B that of a point at the far side of the sphere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from armload_core.arrays import FloatArray
from armload_identification.excitation.derivative_bounds import point_rates, rate_bounds
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.model.chain import Chain

_SAMPLES = 4096
"""Number of intervals of a period for the bound of the greatest speed."""
_APART_M = 1e-6
"""Points of one link that are closer than this count as one."""


@dataclass(frozen=True, eq=False, slots=True)
class CarriedSphere:
    """A sphere around something that is fixed to the flange.

    Attributes:
        name: What it is, for messages.
        center_m: (3,) centre in the flange frame.
        radius_m: Radius.
    """

    name: str
    center_m: FloatArray
    radius_m: float


@dataclass(frozen=True, eq=False)
class ArmPoints:
    """The points of an arm whose speed is computed: the origin of every moving joint frame, flange and tool.

    The speed of a sphere that the arm carries is that of its fastest point, from above.

    Attributes:
        chain: The arm.
        tool_m: (3,) tool centre point in the flange frame.
        carried: Spheres that count as points, too.
        names: (P,) names of the points in messages.
    """

    chain: Chain
    tool_m: FloatArray
    carried: tuple[CarriedSphere, ...] = ()
    names: tuple[str, ...] = field(init=False)
    _link: tuple[int, ...] = field(init=False, repr=False)
    _in_link: FloatArray = field(init=False, repr=False)
    _radius_m: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        chain = self.chain
        last = chain.n
        flange = chain.flange
        tool, *centres = (
            flange[:3, :3] @ at + flange[:3, 3] for at in (self.tool_m, *(sphere.center_m for sphere in self.carried))
        )
        # The origin of joint k + 1 is fixed in link k.
        points = [(f"joint {k + 1}", k, chain.placement[k, :3, 3]) for k in range(1, last)]
        points += [("flange", last, flange[:3, 3]), ("tool centre point", last, tool)]
        kept = [
            (name, link, at)
            for number, (name, link, at) in enumerate(points)
            if not any(
                link == other and np.abs(at - there).max() < _APART_M for _, other, there in points[number + 1 :]
            )
        ]
        radii = [0.0] * len(kept) + [sphere.radius_m for sphere in self.carried]
        kept += [(sphere.name, last, centre) for sphere, centre in zip(self.carried, centres, strict=True)]
        object.__setattr__(self, "names", tuple(name for name, _, _ in kept))
        object.__setattr__(self, "_link", tuple(link for _, link, _ in kept))
        object.__setattr__(self, "_in_link", np.array([at for _, _, at in kept]))
        object.__setattr__(self, "_radius_m", np.array(radii))

    def speeds(self, q: FloatArray, dq: FloatArray) -> FloatArray:
        """Speed of every point.

        Args:
            q: (N, n) joint positions in rad.
            dq: (N, n) joint velocities in rad/s.

        Returns:
            (N, P) in m/s.
        """
        axes, levers = self._axes_and_levers(q)
        centres = np.stack([_length(_velocity(axes, lever, dq)[:, 0]) for lever in levers], axis=1)
        spin = _length(np.einsum("ijk,ij->ik", axes, dq))
        return np.asarray(centres + spin[:, None] * self._radius_m)

    def slope(self, weight: FloatArray, q: FloatArray, dq: FloatArray) -> FloatArray:
        """Derivative of the weighted sum of all speeds by positions and velocities.

        Args:
            weight: (N, P) weight of each speed.
            q: (N, n) joint positions in rad.
            dq: (N, n) joint velocities in rad/s.

        Returns:
            (2, N, n) by position and by velocity.
        """
        axes, levers = self._axes_and_levers(q)
        turning = np.cumsum(axes * dq[:, :, None], axis=1)
        before = turning - axes * dq[:, :, None]
        slope = np.zeros((2, *q.shape))
        for point, lever in enumerate(levers):
            m = lever.shape[1]
            column = np.cross(axes[:, :m], lever)
            outward = _velocity(axes, lever, dq)
            velocity = outward[:, 0]
            direction = velocity / np.maximum(_length(velocity), np.finfo(float).tiny)[:, None]
            direction = direction * weight[:, point, None]
            turned = np.cross(axes[:, :m], outward) + np.cross(before[:, :m], column)
            slope[0, :, :m] += np.einsum("ijk,ik->ij", turned, direction)
            slope[1, :, :m] += np.einsum("ijk,ik->ij", column, direction)
        spin = turning[:, -1]
        direction = spin / np.maximum(_length(spin), np.finfo(float).tiny)[:, None]
        direction = direction * (weight @ self._radius_m)[:, None]
        slope[0] += np.einsum("ijk,ik->ij", np.cross(axes, spin[:, None] - turning), direction)
        slope[1] += np.einsum("ijk,ik->ij", axes, direction)
        return slope

    def greatest_on(self, trajectory: FourierTrajectory) -> FloatArray:
        """(P,) upper bound of the speed of every point along a trajectory, also between samples, in m/s."""
        return np.asarray(self.greatest_in_period(trajectory, _SAMPLES).max(axis=0))

    def greatest_in_period(self, trajectory: FourierTrajectory, samples: int) -> FloatArray:
        """(samples, P) as `greatest_between`, along one period."""

        def motion(times_s: FloatArray) -> tuple[FloatArray, FloatArray]:
            state = trajectory.evaluate(times_s)
            return state.position_rad, state.velocity_rad_s

        return self.greatest_between(motion, rate_bounds(trajectory), trajectory.period_s, samples)

    def greatest_between(
        self,
        motion: Callable[[FloatArray], tuple[FloatArray, FloatArray]],
        rates: FloatArray,
        duration_s: float,
        samples: int,
    ) -> FloatArray:
        """Upper bound of the speed of every point from each sample of a motion to the next.

        Args:
            motion: Returns positions and velocities (N, n) at times (N,).
            rates: (4, n) bounds of the joints' derivatives, as `derivative_bounds.rate_bounds`.
            duration_s: End of the motion, which begins at 0.
            samples: Number of intervals of equal length.

        Returns:
            (samples, P) in m/s.
        """
        speed = self.speeds(*motion(np.linspace(0.0, duration_s, samples + 1)))
        between = np.maximum(speed[:-1], speed[1:])
        bend = np.array(
            [
                point_rates(self.chain, rates, link, float(np.linalg.norm(at)) + radius_m)[2]
                for link, at, radius_m in zip(self._link, self._in_link, self._radius_m, strict=True)
            ]
        )
        return np.asarray(between + bend * (duration_s / samples) ** 2 / 8.0)

    def _axes_and_levers(self, q: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
        """Axes (N, n, 3), and per point the vectors (N, m, 3) to it from the origins of the m joints that move it."""
        origins, axes, rotations = _frames(self.chain, q)
        levers = []
        for link, at in zip(self._link, self._in_link, strict=True):
            point = origins[:, link - 1] + rotations[:, link - 1] @ at
            levers.append(point[:, None] - origins[:, :link])
        return axes, levers


@dataclass(frozen=True, eq=False)
class SpeedLimit:
    """Speed limit of an arm's points.

    Attributes:
        points: The points.
        speed_m_s: The limit.
    """

    points: ArmPoints
    speed_m_s: float


def _frames(chain: Chain, q: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Origins (N, n, 3), axes (N, n, 3) and orientations (N, n, 3, 3) of the joint frames."""
    count, n = q.shape
    origins, axes, rotations = np.empty((count, n, 3)), np.empty((count, n, 3)), np.empty((count, n, 3, 3))
    origin, rotation = np.zeros((count, 3)), np.broadcast_to(np.eye(3), (count, 3, 3))
    for i in range(n):
        placement, (x, y, z) = chain.placement[i], chain.axis[i]
        across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        turn = placement[:3, :3] @ np.hstack([np.eye(3), across, across @ across])
        sine, cosine = np.sin(q[:, i])[:, None, None], np.cos(q[:, i])[:, None, None]
        origin = origin + rotation @ placement[:3, 3]
        fixed, first, second = np.split((rotation.reshape(-1, 3) @ turn).reshape(count, 3, 9), 3, axis=2)
        rotation = fixed + sine * first + (1.0 - cosine) * second
        origins[:, i], rotations[:, i] = origin, rotation
        axes[:, i] = rotation @ chain.axis[i]
    return origins, axes, rotations


def _velocity(axes: FloatArray, lever: FloatArray, dq: FloatArray) -> FloatArray:
    """(N, m, 3) velocity of a point due to joint j and those beyond it; for the first joint the total velocity."""
    m = lever.shape[1]
    each = np.cross(axes[:, :m], lever) * dq[:, :m, None]
    return np.asarray(np.cumsum(each[:, ::-1], axis=1)[:, ::-1])


def _length(vectors: FloatArray) -> FloatArray:
    """(N,) lengths of (N, 3)."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vectors, vectors)))
