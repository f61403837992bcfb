"""The payload's torque of one chain as expressions: outward and inward recursion over groups of parallel joints.

    tau = J(q)^T w(q, dq, ddq, theta)                                           Chen 2016, eq. (2)

The recursion is that of Newton and Euler for a massless arm: only the payload's wrench is propagated inwards. It is
short because of `planar_groups` (frames, sums of angles) and `expressions` (zeros, ones, common terms).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from armload_controller.export.straight_line.expressions import Expression, Graph, Vector, cross, plus
from armload_controller.export.straight_line.planar_groups import Group, PlanarGroups
from armload_core.arrays import FloatArray

_ROUNDING = 4e-15
"""Rounding error of angles in units of right angles."""


@dataclass(frozen=True)
class _Motion:
    """Angular velocity, angular and linear acceleration of a frame."""

    w: Vector
    e: Vector
    a: Vector


@dataclass(frozen=True)
class _Turn:
    """Cosine and sine of a rotation about z."""

    c: Expression
    s: Expression

    def into(self, v: Vector) -> Vector:
        """R^T v."""
        return self.c * v[0] + self.s * v[1], self.c * v[1] - self.s * v[0], v[2]

    def out_of(self, v: Vector) -> Vector:
        """R v."""
        return self.c * v[0] - self.s * v[1], self.s * v[0] + self.c * v[1], v[2]


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
        n = len(q)
        self._dq = [zero] * n if dq is None else list(dq)
        self._ddq = [zero] * n if ddq is None else list(ddq)
        gravity = [graph.constant(float(-g)) for g in groups.gravity_m_s2]
        # vertical first axis: nothing depends on the first joint's position, so its angle is omitted
        upright = gravity[0].is_zero and gravity[1].is_zero
        self._turns = [self._angles(group, q, skip_first=upright and i == 0) for i, group in enumerate(self.groups)]
        self._alpha = [_turn_about_x(graph, group.alpha_rad) for group in self.groups]
        self.turned: dict[int, _Motion] = {}
        self.motion = _Motion((zero,) * 3, (zero,) * 3, (gravity[0], gravity[1], gravity[2]))
        for group, turns, alpha in zip(self.groups, self._turns, self._alpha, strict=True):
            self.motion = self._outwards(self.motion, group, turns, alpha)

    def inwards(self, wrenches: Mapping[int, Wrench]) -> list[Expression]:
        """Joint torques of wrenches.

        Args:
            wrenches: Force and moment by joint, about the point and in the axes of `turned`.
        """
        zero = self.graph.constant(0.0)
        nothing: Wrench = ((zero,) * 3, (zero,) * 3)
        torque: dict[int, Expression] = {}
        force, moment = nothing
        for group, turns, alpha in reversed(list(zip(self.groups, self._turns, self._alpha, strict=True))):
            outermost = len(group.joints) - 1
            for k in reversed(range(outermost + 1)):
                joint = group.joints[k]
                own_force, own_moment = wrenches.get(joint.index, nothing)
                if k == outermost:
                    force, moment = turns[k].out_of(plus(force, own_force)), turns[k].out_of(plus(moment, own_moment))
                else:
                    moment = plus(moment, cross(self._shift(joint.shift_m, turns[k]), force))
                    force, moment = plus(force, turns[k].out_of(own_force)), plus(moment, turns[k].out_of(own_moment))
                torque[joint.index] = moment[2] if joint.sign > 0 else -moment[2]
            force, moment = _rotate_x(alpha, force), _rotate_x(alpha, moment)
            moment = plus(moment, cross(self._shift(group.shift_m, None), force))
        return [torque[i] for i in range(len(torque))]

    def screws(self) -> list[tuple[Vector, Vector]]:
        """Axis of each joint, and the flange's velocity per rad/s of the joint, in flange coordinates."""
        graph, flange = self.graph, self.flange
        zero = graph.constant(0.0)
        # columns of the rotation to flange coordinates, and the vector from a frame's origin to the flange's
        x, y, z = (constant_vector(graph, row) for row in flange[:3, :3])
        way = linear((x, y, z), constant_vector(graph, flange[:3, 3]))
        found: dict[int, tuple[Vector, Vector]] = {}
        for group, turns, alpha in reversed(list(zip(self.groups, self._turns, self._alpha, strict=True))):
            x, y = turned_columns(_Turn(turns[-1].c, -turns[-1].s), x, y)
            for k in reversed(range(len(group.joints))):
                joint = group.joints[k]
                way = plus(way, linear((x, y, z), self._shift(joint.shift_m, turns[k])))
                axis = z if joint.sign > 0 else (-z[0], -z[1], -z[2])
                found[joint.index] = (axis, cross(axis, way))
            y, z = turned_columns(_Turn(alpha.c, -alpha.s), y, z)
            way = plus(way, linear((x, (zero,) * 3, z), self._shift(group.shift_m, None)))
        return [found[i] for i in range(len(found))]

    def at_flange(self) -> tuple[Vector, Vector, Vector]:
        """Angular velocity, angular and linear acceleration of the flange, in its coordinates."""
        columns = [constant_vector(self.graph, self.flange[:3, k]) for k in range(3)]
        moved = _acceleration_at(self.motion, constant_vector(self.graph, self.flange[:3, 3]))
        w, e, a = (
            (dot(columns[0], v), dot(columns[1], v), dot(columns[2], v)) for v in (self.motion.w, self.motion.e, moved)
        )
        return w, e, a

    def _outwards(self, motion: _Motion, group: Group, turns: list[_Turn], alpha: _Turn) -> _Motion:
        a = _acceleration_at(motion, self._shift(group.shift_m, None))
        motion = _Motion(*(_rotate_x(_Turn(alpha.c, -alpha.s), v) for v in (motion.w, motion.e, a)))
        for joint, turn in zip(group.joints, turns, strict=True):
            rate, rise = self._dq[joint.index], self._ddq[joint.index]
            if joint.sign < 0:
                rate, rise = -rate, -rise
            w, e = motion.w, motion.e
            motion = _Motion((w[0], w[1], w[2] + rate), (e[0] + w[1] * rate, e[1] - w[0] * rate, e[2] + rise), motion.a)
            self.turned[joint.index] = _Motion(*(turn.into(v) for v in (motion.w, motion.e, motion.a)))
            motion = _Motion(motion.w, motion.e, _acceleration_at(motion, self._shift(joint.shift_m, turn)))
        return _Motion(*(turns[-1].into(v) for v in (motion.w, motion.e, motion.a)))

    def _angles(self, group: Group, q: Sequence[Expression], *, skip_first: bool) -> list[_Turn]:
        """Cosine and sine of every joint's angle, measured from the group's frame."""
        graph = self.graph
        angle, zero, turns = graph.constant(0.0), 0.0, []
        for k, joint in enumerate(group.joints):
            if not (skip_first and k == 0):
                angle = angle + (q[joint.index] if joint.sign > 0 else -q[joint.index])
                zero += joint.sign * joint.zero_rad
            turns.append(_turn(graph, angle, zero))
        return turns

    def _shift(self, shift_m: tuple[float, float], turn: _Turn | None) -> Vector:
        x, z = (self.graph.constant(value) for value in shift_m)
        if turn is None:
            return x, self.graph.constant(0.0), z
        return turn.c * x, turn.s * x, z


def _acceleration_at(motion: _Motion, p: Vector) -> Vector:
    """Acceleration of a point that is fixed in a frame."""
    s = spin_matrix(motion.w, motion.e)
    x, y, z = (dot(row, p) for row in s)
    return plus(motion.a, (x, y, z))


def dot(a: Vector, b: Vector) -> Expression:
    """The scalar product a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def linear(columns: tuple[Vector, Vector, Vector], p: Vector) -> Vector:
    """A matrix of columns times a vector."""
    (x, y, z) = ([column[i] * p[k] for k, column in enumerate(columns)] for i in range(3))
    return x[0] + x[1] + x[2], y[0] + y[1] + y[2], z[0] + z[1] + z[2]


def turned_columns(turn: _Turn, a: Vector, b: Vector) -> tuple[Vector, Vector]:
    """The columns a, b of a matrix after a rotation of the corresponding coordinates."""
    return (
        (turn.c * a[0] + turn.s * b[0], turn.c * a[1] + turn.s * b[1], turn.c * a[2] + turn.s * b[2]),
        (turn.c * b[0] - turn.s * a[0], turn.c * b[1] - turn.s * a[1], turn.c * b[2] - turn.s * a[2]),
    )


def constant_vector(graph: Graph, values: FloatArray) -> Vector:
    """Three numbers as a vector."""
    x, y, z = (graph.constant(float(v)) for v in values)
    return x, y, z


def spin_matrix(w: Vector, e: Vector) -> tuple[Vector, Vector, Vector]:
    """[e]x + [w]x [w]x, the matrix that maps a fixed point to its acceleration relative to the origin."""
    xx, yy, zz = (v * v for v in w)
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    return (
        (-(yy + zz), xy - e[2], xz + e[1]),
        (xy + e[2], -(xx + zz), yz - e[0]),
        (xz - e[1], yz + e[0], -(xx + yy)),
    )


def payload_torque(arm: SpecialisedArm, theta: Sequence[Expression]) -> list[Expression]:
    """Joint torques of a body at the end of the arm.

    Args:
        arm: The arm's motion.
        theta: Ten parameters in the frame after the last group.
    """
    return arm.inwards({len(arm.turned) - 1: _body_wrench(arm.motion, theta)})


def link_torque(arm: SpecialisedArm, links: Sequence[Sequence[Expression]]) -> list[Expression]:
    """Joint torques of the arm's own links.

    Args:
        arm: The arm's motion.
        links: Ten parameters of each link, about the points and in the axes of `arm.turned`.
    """
    return arm.inwards({i: _body_wrench(arm.turned[i], theta) for i, theta in enumerate(links)})


def _body_wrench(motion: _Motion, theta: Sequence[Expression]) -> Wrench:
    """Force and moment, about a moving frame's origin, that accelerate a body of ten parameters with the frame."""
    m, sx, sy, sz, ixx, iyy, izz, ixy, ixz, iyz = theta
    w, e, a = motion.w, motion.e, motion.a
    s = spin_matrix(w, e)
    first = (sx, sy, sz)
    force = plus((m * a[0], m * a[1], m * a[2]), (dot(s[0], first), dot(s[1], first), dot(s[2], first)))
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    xx, yy, zz = (v * v for v in w)
    inertia = (
        ixx * e[0] + (izz - iyy) * yz + ixy * (e[1] - xz) + ixz * (e[2] + xy) + iyz * (yy - zz),
        iyy * e[1] + (ixx - izz) * xz + iyz * (e[2] - xy) + ixy * (e[0] + yz) + ixz * (zz - xx),
        izz * e[2] + (iyy - ixx) * xy + ixz * (e[0] - yz) + iyz * (e[1] + xz) + ixy * (xx - yy),
    )
    return force, plus(inertia, cross(first, a))


def payload_regressor(arm: SpecialisedArm) -> list[list[Expression]]:
    """Ten columns per joint of the regressor of a body in the flange frame.

    Args:
        arm: The arm's motion.

    Returns:
        n lists of ten, tau_i = sum_k row_i[k] theta[k].
    """
    w, e, a = arm.at_flange()
    s = spin_matrix(w, e)
    xy, xz, yz = w[0] * w[1], w[0] * w[2], w[1] * w[2]
    xx, yy, zz = (v * v for v in w)
    inertia: list[Vector] = [
        (e[0], xz, -xy),
        (-yz, e[1], xy),
        (yz, -xz, e[2]),
        (e[1] - xz, e[0] + yz, xx - yy),
        (e[2] + xy, zz - xx, e[0] - yz),
        (yy - zz, e[2] - xy, e[1] + xz),
    ]
    rows = []
    for axis, velocity in arm.screws():
        around = cross(a, axis)  # axis . (e_k x a) = (a x axis)_k
        rows.append(
            [dot(velocity, a)]
            + [dot(velocity, (s[0][k], s[1][k], s[2][k])) + around[k] for k in range(3)]
            + [dot(axis, column) for column in inertia]
        )
    return rows


def _turn(graph: Graph, angle: Expression, zero_rad: float) -> _Turn:
    """Cosine and sine of angle + zero; multiples of a right angle cost nothing."""
    quarter = zero_rad / (math.pi / 2.0)
    whole = round(quarter)
    if abs(quarter - whole) < _ROUNDING * max(1.0, abs(quarter)):
        if angle.is_zero:
            c, s = graph.constant(1.0), graph.constant(0.0)
        else:
            c, s = graph.cosine(angle), graph.sine(angle)
        return [_Turn(c, s), _Turn(-s, c), _Turn(-c, -s), _Turn(s, -c)][whole % 4]
    if angle.is_zero:
        return _Turn(graph.constant(math.cos(zero_rad)), graph.constant(math.sin(zero_rad)))
    moved = angle + graph.constant(zero_rad)
    return _Turn(graph.cosine(moved), graph.sine(moved))


def _turn_about_x(graph: Graph, alpha_rad: float) -> _Turn:
    return _turn(graph, graph.constant(0.0), alpha_rad)


def _rotate_x(turn: _Turn, v: Vector) -> Vector:
    """Rx v."""
    return v[0], turn.c * v[1] - turn.s * v[2], turn.s * v[1] + turn.c * v[2]
