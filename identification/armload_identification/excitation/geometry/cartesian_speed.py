"""Speed of points of an arm: its elbow, wrist, flange and tool centre point, and of what it carries.

A point p moved by the first m joints, with axes z_j through o_j in the base frame, has the velocity

    v = v_{o_m} + w_m x (p - o_m)      w_k = sum_{j <= k} z_j dq_j      v_{o_{k+1}} = v_{o_k} + w_k x (o_{k+1} - o_k)

and with its direction e = v / |v| its speed depends on joint k <= m by

    d|v|/dq_k = z_k . (e x v_{o_k}) + (w_{k-1} x z_k) . ((p - o_k) x e)        d|v|/d(dq_k) = z_k . ((p - o_k) x e)

For a weighted sum of speeds, e and p x e are summed over the points that a joint moves.

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
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from armload_identification.excitation.derivative_bounds import point_rates, rate_bounds
from armload_identification.excitation.fourier import FourierState, FourierTrajectory
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain, cross
from armload_identification.model.finite_array import set_fields

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
    """

    name: str
    center_m: FloatArray
    radius_m: float


class _Point(NamedTuple):
    """A point, or sphere, that is fixed in a link, by its place in the frame of the joint that moves the link."""

    name: str
    link: int
    at: FloatArray
    radius_m: float = 0.0


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
    _points: tuple[_Point, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        chain, last = self.chain, self.chain.n
        turn, shift = chain.flange[:3, :3], chain.flange[:3, 3]
        # The origin of joint k + 1 is fixed in link k.
        points = [_Point(f"joint {k + 1}", k, chain.placement[k, :3, 3]) for k in range(1, last)]
        points += [_Point("flange", last, shift), _Point("tool centre point", last, turn @ self.tool_m + shift)]
        kept = [
            one
            for number, one in enumerate(points, 1)
            if all(one.link != other.link or np.abs(one.at - other.at).max() >= _APART_M for other in points[number:])
        ]
        kept += [_Point(ball.name, last, turn @ ball.center_m + shift, ball.radius_m) for ball in self.carried]
        set_fields(self, {"names": tuple(one.name for one in kept), "_points": tuple(kept)})

    def speeds(self, q: FloatArray, dq: FloatArray) -> FloatArray:
        """Speed of every point.

        Args:
            q: (N, n) joint positions in rad.
            dq: (N, n) joint velocities in rad/s.

        Returns:
            (N, P) in m/s.
        """
        return self.moving(q, dq).speeds

    def moving(self, q: FloatArray, dq: FloatArray) -> MovingPoints:
        """The points in N states, of positions (N, n) in rad and velocities (N, n) in rad/s."""
        poses = self.chain.forward(q)
        origins, axes = poses[:, :-1, :3, 3], self.chain.axes(poses)
        link = np.array([one.link for one in self._points]) - 1
        turning = np.cumsum(axes * dq[:, :, None], axis=1)
        drift = np.zeros_like(origins)
        drift[:, 1:] = np.cumsum(cross(turning[:, :-1], np.diff(origins, axis=1)), axis=1)
        lever = (poses[:, link, :3, :3] @ np.array([one.at for one in self._points])[:, :, None])[..., 0]
        velocity = drift[:, link] + cross(turning[:, link], lever)
        moves = np.arange(self.chain.n)[:, None] <= link
        before = turning - axes * dq[:, :, None]
        radius_m = np.array([one.radius_m for one in self._points])
        return MovingPoints(origins, axes, before, turning, drift, origins[:, link] + lever, velocity, radius_m, moves)

    def greatest_on(self, trajectory: FourierTrajectory) -> FloatArray:
        """(P,) upper bound of the speed of every point along a trajectory, also between samples, in m/s."""
        return np.asarray(self.greatest_in_period(trajectory, _SAMPLES).max(axis=0))

    def greatest_in_period(self, trajectory: FourierTrajectory, samples: int) -> FloatArray:
        """(samples, P) as `greatest_between`, along one period."""
        return self.greatest_between(trajectory.evaluate, rate_bounds(trajectory), trajectory.period_s, samples)

    def greatest_between(
        self, motion: Callable[[FloatArray], FourierState], rates: FloatArray, duration_s: float, samples: int
    ) -> FloatArray:
        """Upper bound of the speed of every point from each sample of a motion to the next.

        Args:
            motion: Returns the state at times (N,).
            rates: (4, n) bounds of the joints' derivatives, as `derivative_bounds.rate_bounds`.
            duration_s: End of the motion, which begins at 0.
            samples: Number of intervals of equal length.

        Returns:
            (samples, P) in m/s.
        """
        speed = self.speeds(*motion(np.linspace(0.0, duration_s, samples + 1))[:2])
        between = np.maximum(speed[:-1], speed[1:])
        levers_m = [(link, float(np.linalg.norm(at)) + radius_m) for _, link, at, radius_m in self._points]
        bend = np.array([point_rates(self.chain, rates, link, lever_m)[2] for link, lever_m in levers_m])
        return np.asarray(between + bend * (duration_s / samples) ** 2 / 8.0)


@dataclass(frozen=True, eq=False)
class MovingPoints:
    """The P points of an arm of n joints in N states; vectors in the base frame.

    Attributes:
        origins: (N, n, 3) a point on each joint's axis.
        axes: (N, n, 3) the axes.
        before: (N, n, 3) angular velocity of the link before each joint.
        turning: (N, n, 3) of the one after it.
        drift: (N, n, 3) velocity of the origins.
        at: (N, P, 3) the points.
        velocity: (N, P, 3) of the points, or of the centres of spheres.
        radius_m: (P,) of the spheres; 0 for a point.
        moves: (n, P) whether a joint moves a point.
    """

    origins: FloatArray
    axes: FloatArray
    before: FloatArray
    turning: FloatArray
    drift: FloatArray
    at: FloatArray
    velocity: FloatArray
    radius_m: FloatArray
    moves: NDArray[np.bool_]

    @property
    def speeds(self) -> FloatArray:
        """(N, P) speed of every point in m/s."""
        return np.asarray(_length(self.velocity) + _length(self.turning[:, -1])[:, None] * self.radius_m)

    def slope(self, weight: FloatArray) -> FloatArray:
        """Derivative of the weighted sum of all speeds by positions and velocities.

        Args:
            weight: (N, P) weight of each speed.

        Returns:
            (2, N, n) by position and by velocity.
        """
        pull, twist = _unit(self.velocity) * weight[:, :, None], _unit(self.turning[:, -1])
        spun = (twist * (weight @ self.radius_m)[:, None])[:, None]
        moves = self.moves.astype(np.float64)
        force = moves @ pull
        moment = moves @ cross(self.at, pull) - cross(self.origins, force)
        along = cross(force, self.drift) + cross(spun, self.turning)
        by_position = np.sum(self.axes * along + cross(self.before, self.axes) * moment, axis=2)
        return np.stack([by_position, np.sum(self.axes * (moment + spun), axis=2)])


@dataclass(frozen=True, eq=False)
class SpeedLimit:
    """Speed limit of an arm's points.

    Attributes:
        speed_m_s: The limit.
    """

    points: ArmPoints
    speed_m_s: float


def _length(vectors: FloatArray) -> FloatArray:
    """(...) lengths of (..., 3)."""
    return np.asarray(np.sqrt(np.sum(vectors * vectors, axis=-1)))


def _unit(vectors: FloatArray) -> FloatArray:
    """(..., 3) directions; 0 for no length."""
    return np.asarray(vectors / np.maximum(_length(vectors), np.finfo(float).tiny)[..., None])
