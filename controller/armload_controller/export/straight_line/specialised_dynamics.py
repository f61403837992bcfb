"""The payload's torque of one chain as expressions: outward and inward recursion over groups of parallel joints.

    tau = J(q)^T w(q, dq, ddq, theta)                                           Chen 2016, eq. (2)

The recursion is that of Newton and Euler for a massless arm: only the payload's wrench is propagated inwards. It is
short because of `planar_groups` (frames, sums of angles) and `expressions` (zeros, ones, common terms).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from armload_controller.export.straight_line.expressions import Expression, Graph, Vector
from armload_controller.export.straight_line.planar_groups import PlanarGroup, PlanarGroups

_ROUNDING = 4e-15
"""Rounding error of angles in units of right angles."""


@dataclass(frozen=True)
class _Motion:
    """Angular velocity, angular and linear acceleration of a frame, (3,) each."""

    w: Vector
    e: Vector
    a: Vector

    def seen_from(self, rotation: Vector) -> _Motion:
        """R^T of each; `rotation` is (3, 3)."""
        return _Motion(rotation.T @ self.w, rotation.T @ self.e, rotation.T @ self.a)

    def acceleration_at(self, p: Vector) -> Vector:
        """Linear acceleration of a point p that is fixed in the frame."""
        return np.asarray(self.a + spin_matrix(self.w, self.e) @ p)


Wrench = tuple[Vector, Vector]
"""Force and moment."""


class SpecialisedArm:
    """The chain's motion, and the inward recursion of wrenches.

    Args:
        graph: Graph for the expressions.
        groups: The chain.
        q: (n) joint positions.
        dq: (n) velocities; None for zero.
        ddq: (n) accelerations; None for zero.

    Attributes:
        graph: The graph.
        groups: The chain, from the base outwards.
        flange: (4, 4) pose of the flange in the frame after the last group, which payload parameters refer to.
        motion: Motion of that frame.
        turned: Motion at every joint's axis, at the foot of the previous normal, in its group's frame rotated by it.
    """

    def __init__(
        self,
        graph: Graph,
        groups: PlanarGroups,
        q: Sequence[Expression],
        dq: Sequence[Expression] | None,
        ddq: Sequence[Expression] | None,
    ) -> None:
        self.graph = graph
        self.groups = groups.groups
        self.flange = groups.flange
        zero = graph.constant(0.0)
        self._dq = [zero] * len(q) if dq is None else list(dq)
        self._ddq = [zero] * len(q) if ddq is None else list(ddq)
        gravity = graph.constants(-groups.gravity_m_s2)
        # vertical first axis: nothing depends on the first joint's position, so its angle is omitted
        upright = gravity[0].is_zero and gravity[1].is_zero
        self._turns = [self._angles(group, q, skip_first=upright and i == 0) for i, group in enumerate(self.groups)]
        self._alpha = [_about_x(graph, *_cosine_sine(graph, zero, group.alpha_rad)) for group in self.groups]
        self.turned: dict[int, _Motion] = {}
        nothing = graph.constants(np.zeros(3))
        self.motion = _Motion(nothing, nothing, gravity)
        for group, turns, alpha in zip(self.groups, self._turns, self._alpha, strict=True):
            self.motion = self._outwards(self.motion, group, turns, alpha)

    def inwards(self, wrenches: Mapping[int, Wrench]) -> list[Expression]:
        """Joint torques of wrenches by joint, each about the point and in the axes of `turned`."""
        nothing = self.graph.constants(np.zeros(3))
        torque: dict[int, Expression] = {}
        force = moment = nothing
        for group, turns, alpha in reversed(list(zip(self.groups, self._turns, self._alpha, strict=True))):
            outermost = len(group.joints) - 1
            for k in reversed(range(outermost + 1)):
                joint, turn = group.joints[k], turns[k]
                own_force, own_moment = wrenches.get(joint.index, (nothing, nothing))
                if k == outermost:
                    force, moment = turn @ (force + own_force), turn @ (moment + own_moment)
                else:
                    moment = moment + np.cross(turn @ self._shift(joint.shift_m), force)
                    force, moment = force + turn @ own_force, moment + turn @ own_moment
                torque[joint.index] = moment[2] if joint.sign > 0 else -moment[2]
            force, moment = alpha @ force, alpha @ moment
            moment = moment + np.cross(self._shift(group.shift_m), force)
        return [torque[i] for i in range(len(torque))]

    def screws(self) -> list[tuple[Vector, Vector]]:
        """Axis of each joint, and the flange's velocity per rad/s of the joint, in flange coordinates."""
        # rotation to flange coordinates, and the vector from a frame's origin to the flange's
        rotation = self.graph.constants(self.flange[:3, :3].T)
        way = rotation @ self.graph.constants(self.flange[:3, 3])
        found: dict[int, tuple[Vector, Vector]] = {}
        for group, turns, alpha in reversed(list(zip(self.groups, self._turns, self._alpha, strict=True))):
            rotation = rotation @ turns[-1].T
            for k in reversed(range(len(group.joints))):
                joint = group.joints[k]
                way = way + rotation @ (turns[k] @ self._shift(joint.shift_m))
                axis = rotation[:, 2] if joint.sign > 0 else -rotation[:, 2]
                found[joint.index] = (axis, np.cross(axis, way))
            rotation = rotation @ alpha.T
            way = way + rotation @ self._shift(group.shift_m)
        return [found[i] for i in range(len(found))]

    def at_flange(self) -> _Motion:
        """Motion of the flange, in its coordinates."""
        moved = self.motion.acceleration_at(self.graph.constants(self.flange[:3, 3]))
        return _Motion(self.motion.w, self.motion.e, moved).seen_from(self.graph.constants(self.flange[:3, :3]))

    def _outwards(self, motion: _Motion, group: PlanarGroup, turns: list[Vector], alpha: Vector) -> _Motion:
        """Motion after a group; `turns` and `alpha` are its (3, 3) rotations."""
        moved = motion.acceleration_at(self._shift(group.shift_m))
        motion = _Motion(motion.w, motion.e, moved).seen_from(alpha)
        zero = self.graph.constant(0.0)
        for joint, turn in zip(group.joints, turns, strict=True):
            rate, rise = self._dq[joint.index], self._ddq[joint.index]
            if joint.sign < 0:
                rate, rise = -rate, -rise
            spin = np.array([zero, zero, rate])
            e = motion.e + np.cross(motion.w, spin) + np.array([zero, zero, rise])
            motion = _Motion(motion.w + spin, e, motion.a)
            self.turned[joint.index] = motion.seen_from(turn)
            motion = _Motion(motion.w, e, motion.acceleration_at(turn @ self._shift(joint.shift_m)))
        return motion.seen_from(turns[-1])

    def _angles(self, group: PlanarGroup, q: Sequence[Expression], *, skip_first: bool) -> list[Vector]:
        """(3, 3) rotation by every joint's angle, measured from the group's frame."""
        graph = self.graph
        angle, zero, turns = graph.constant(0.0), 0.0, []
        for k, joint in enumerate(group.joints):
            if not (skip_first and k == 0):
                angle = angle + (q[joint.index] if joint.sign > 0 else -q[joint.index])
                zero += joint.sign * joint.zero_rad
            turns.append(_about_z(graph, *_cosine_sine(graph, angle, zero)))
        return turns

    def _shift(self, shift_m: tuple[float, float]) -> Vector:
        """(3,) a shift along x and z."""
        return self.graph.constants(np.array([shift_m[0], 0.0, shift_m[1]]))


def spin_matrix(w: Vector, e: Vector) -> Vector:
    """[e]x + [w]x [w]x, the matrix that maps a fixed point to its acceleration relative to the origin."""
    xx, yy, zz = w * w
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    return np.array(
        [
            [-(yy + zz), xy - e[2], xz + e[1]],
            [xy + e[2], -(xx + zz), yz - e[0]],
            [xz - e[1], yz + e[0], -(xx + yy)],
        ]
    )


def specialised_torque(arm: SpecialisedArm, theta: Sequence[Expression]) -> list[Expression]:
    """Joint torques of a body at the end of the arm; `theta` (10) in the frame after the last group."""
    return arm.inwards({len(arm.turned) - 1: _body_wrench(arm.motion, theta)})


def link_torque(arm: SpecialisedArm, links: Sequence[Sequence[Expression]]) -> list[Expression]:
    """Joint torques of the arm's own links, (n, 10) about the points and in the axes of `arm.turned`."""
    return arm.inwards({i: _body_wrench(arm.turned[i], theta) for i, theta in enumerate(links)})


def _body_wrench(motion: _Motion, theta: Sequence[Expression]) -> Wrench:
    """Force and moment, about a moving frame's origin, that accelerate a body of ten parameters with the frame."""
    m, sx, sy, sz, ixx, iyy, izz, ixy, ixz, iyz = theta
    w, e, a = motion.w, motion.e, motion.a
    first = np.array([sx, sy, sz])
    force = a * m + spin_matrix(w, e) @ first
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    xx, yy, zz = w * w
    inertia = np.array(
        [
            ixx * e[0] + (izz - iyy) * yz + ixy * (e[1] - xz) + ixz * (e[2] + xy) + iyz * (yy - zz),
            iyy * e[1] + (ixx - izz) * xz + iyz * (e[2] - xy) + ixy * (e[0] + yz) + ixz * (zz - xx),
            izz * e[2] + (iyy - ixx) * xy + ixz * (e[0] - yz) + iyz * (e[1] + xz) + ixy * (xx - yy),
        ]
    )
    return force, inertia + np.cross(first, a)


def specialised_regressor(arm: SpecialisedArm) -> list[list[Expression]]:
    """Ten columns per joint of the regressor of a body in the flange frame.

    Returns:
        n lists of ten, tau_i = sum_k row_i[k] theta[k].
    """
    motion = arm.at_flange()
    w, e, a = motion.w, motion.e, motion.a
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    xx, yy, zz = w * w
    inertia = np.array(
        [
            [e[0], -yz, yz, e[1] - xz, e[2] + xy, yy - zz],
            [xz, e[1], -xz, e[0] + yz, zz - xx, e[2] - xy],
            [-xy, xy, e[2], xx - yy, e[0] - yz, e[1] + xz],
        ]
    )
    s = spin_matrix(w, e)
    # axis . (e_k x a) = (a x axis)_k
    return [[velocity @ a, *(velocity @ s + np.cross(a, axis)), *(axis @ inertia)] for axis, velocity in arm.screws()]


def _cosine_sine(graph: Graph, angle: Expression, zero_rad: float) -> tuple[Expression, Expression]:
    """Cosine and sine of angle + zero; multiples of a right angle cost nothing."""
    quarter = zero_rad / (math.pi / 2.0)
    whole = round(quarter)
    if abs(quarter - whole) < _ROUNDING * max(1.0, abs(quarter)):
        if angle.is_zero:
            c, s = graph.constant(1.0), graph.constant(0.0)
        else:
            c, s = graph.cosine(angle), graph.sine(angle)
        return [(c, s), (-s, c), (-c, -s), (s, -c)][whole % 4]
    if angle.is_zero:
        return graph.constant(math.cos(zero_rad)), graph.constant(math.sin(zero_rad))
    moved = angle + graph.constant(zero_rad)
    return graph.cosine(moved), graph.sine(moved)


def _about_x(graph: Graph, c: Expression, s: Expression) -> Vector:
    """(3, 3) rotation about x by its cosine and sine."""
    one, zero = graph.constant(1.0), graph.constant(0.0)
    return np.array([[one, zero, zero], [zero, c, -s], [zero, s, c]])


def _about_z(graph: Graph, c: Expression, s: Expression) -> Vector:
    """(3, 3) rotation about z by its cosine and sine."""
    one, zero = graph.constant(1.0), graph.constant(0.0)
    return np.array([[c, -s, zero], [s, c, zero], [zero, zero, one]])
