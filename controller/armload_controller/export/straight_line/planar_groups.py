"""A chain in coordinates that minimise the arithmetic of its dynamics.

Torques depend neither on the position of a joint's frame along its axis nor on its angle about the axis. Both are
chosen so that most numbers of a frame vanish: x along the common normal to the next axis, as in Denavit-Hartenberg, and
the origin at that normal's foot. Joints with parallel axes form a group: inside it everything is expressed in one fixed
frame, which is left by one rotation through the sum of the angles.

    frame of group k  =  previous frame * Translation(offset) * Rx(alpha)
    angle of joint j  =  angle of the previous joint in the group  +-  (q_j + zero_j)

References:
    Craig, Introduction to Robotics, 3rd ed. 2005, section 3.4.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain

_PARALLEL = 1e-9
"""Sine of the angle below which two axes count as parallel."""
_ROUNDING = 4e-15
"""Rounding error of a unit vector's numbers, or of angles in units of right angles."""
_TOUCHING_M = 1e-14
"""Distance below which two axes intersect."""


@dataclass(frozen=True, eq=False)
class PlanarJoint:
    """One joint in its group.

    Attributes:
        index: Index of the joint, from 0.
        sign: 1 if it rotates about the group's z axis, -1 if about the opposite direction.
        zero_rad: Added to q, so that the angle is measured from x of the previous joint.
        link: (4, 4) the chain's frame of this joint in the group's frame rotated by the joint.
        shift_m: Shift along x after the rotation, and along the group's z, to the next joint of the group.
    """

    index: int
    sign: int
    zero_rad: float
    link: FloatArray
    shift_m: tuple[float, float] = (0.0, 0.0)


@dataclass(frozen=True, eq=False)
class PlanarGroup:
    """Joints with parallel axes.

    Attributes:
        shift_m: (x, z) of the group's origin in the previous frame.
        alpha_rad: Rotation about x from the previous frame to the group's.
        joints: Joints from the base outwards.
    """

    shift_m: tuple[float, float]
    alpha_rad: float
    joints: tuple[PlanarJoint, ...]


@dataclass(frozen=True, eq=False)
class PlanarGroups:
    """A chain as groups.

    Attributes:
        gravity_m_s2: (3,) gravity in the first group's frame, before any joint.
        groups: Groups from the base to the flange.
        flange: (4, 4) pose of the flange in the frame after the last group.
    """

    gravity_m_s2: FloatArray
    groups: tuple[PlanarGroup, ...]
    flange: FloatArray


@dataclass(frozen=True, eq=False)
class _Frame:
    """Axis of a joint at q = 0 in base coordinates, and the x axis and origin chosen for it."""

    x: FloatArray
    z: FloatArray
    origin: FloatArray

    def pose(self) -> FloatArray:
        pose = np.eye(4)
        pose[:3, :3] = np.column_stack([self.x, np.cross(self.z, self.x), self.z])
        pose[:3, 3] = self.origin
        return pose


def planar_groups(chain: Chain, about_last_axis_rad: float = 0.0) -> PlanarGroups:
    """Write a chain in groups of parallel joints.

    Args:
        about_last_axis_rad: Rotation of the last frame about its own axis, which can be chosen freely.
    """
    axes = _axes(chain)
    frames = _frames(axes, about_last_axis_rad)
    before = _base_frame(chain, frames[0])
    gravity = before.pose()[:3, :3].T @ chain.gravity_m_s2
    poses = chain.forward(np.zeros(chain.n))
    groups: list[PlanarGroup] = []
    pending_m = 0.0  # along z of the previous frame: from the foot of the last normal to that frame's origin
    flipped = 1
    for i, frame in enumerate(frames):
        relative = np.linalg.inv(before.pose()) @ frame.pose()
        alpha = float(np.arctan2(-relative[1, 2], relative[2, 2]))
        zero = float(np.arctan2(-relative[0, 1], relative[0, 0]))
        along_x = float(relative[0, 3])
        along_z = float(relative[:3, 3] @ relative[:3, 2])
        quarter = alpha / (np.pi / 2.0)
        parallel = abs(quarter - 2.0 * round(quarter / 2.0)) < _ROUNDING
        turn = 1 if round(quarter) % 4 == 0 else -1
        shift = (_without_rounding_m(along_x), _without_rounding_m(pending_m))
        if groups and parallel:
            last = groups[-1].joints[-1]
            joints = (*groups[-1].joints[:-1], replace(last, shift_m=(shift[0], flipped * shift[1])))
            flipped *= turn
            link = _placed(frame, poses[i], along_z, flipped)
            groups[-1] = replace(groups[-1], joints=(*joints, PlanarJoint(i, flipped, zero, link)))
        else:
            # a group that ends with an inverted axis leaves its frame rotated about x by half a turn
            whole = alpha if flipped == 1 else alpha + np.pi
            link = _placed(frame, poses[i], along_z, 1)
            groups.append(PlanarGroup((shift[0], flipped * shift[1]), float(whole), (PlanarJoint(i, 1, zero, link),)))
            flipped = 1
        pending_m = along_z
        before = frame
    flange = _placed(frames[-1], poses[-1], 0.0, flipped)
    # the last frame's origin is at the foot of its normal: no shift is pending
    return PlanarGroups(_without_rounding(gravity, float(np.abs(gravity).max())), tuple(groups), flange)


def _placed(frame: _Frame, pose: FloatArray, along_z_m: float, flipped: int) -> FloatArray:
    """A pose from base coordinates to a joint's axis: from the foot of the previous normal, upright in its group."""
    seen = np.linalg.inv(frame.pose()) @ pose
    seen[2, 3] += along_z_m
    seen = np.diag([1.0, flipped, flipped, 1.0]) @ seen
    seen[:3, :3] = _without_rounding(seen[:3, :3], 1.0)
    seen[:3, :3] = np.where(np.abs(np.abs(seen[:3, :3]) - 1.0) < _ROUNDING, np.sign(seen[:3, :3]), seen[:3, :3])
    seen[:3, 3] = [_without_rounding_m(float(value)) for value in seen[:3, 3]]
    return seen


def _axes(chain: Chain) -> list[tuple[FloatArray, FloatArray]]:
    """Direction and a point of every joint's axis at q = 0, in base coordinates."""
    poses = chain.forward(np.zeros(chain.n))
    return [
        (_without_rounding(pose[:3, :3] @ axis, 1.0), pose[:3, 3])
        for pose, axis in zip(poses, chain.axis, strict=False)
    ]


def _frames(axes: list[tuple[FloatArray, FloatArray]], about_last_axis_rad: float) -> list[_Frame]:
    """Frames with x along the normal to the next axis and the origin at its foot; the last uses the previous normal."""
    frames: list[_Frame] = []
    for i in range(len(axes) - 1):
        (z, point), (other, beyond) = axes[i], axes[i + 1]
        normal = np.cross(z, other)
        between = beyond - point
        size = float(np.sqrt(normal @ normal))
        if size > _PARALLEL:
            x = normal / size
            along = float(np.cross(between, other) @ normal) / size**2
            distance = float(between @ x)
            x = -x if distance < 0.0 else x
            origin = point + along * z
        else:
            previous = frames[-1].origin if frames else point
            along = float((previous - point) @ z)
            # level with the previous frame, so that its shift along z vanishes if the axes intersect
            origin = point + along * z
            across = (beyond - origin) - float((beyond - origin) @ z) * z
            distance = float(np.sqrt(across @ across))
            x = across / distance if distance > _TOUCHING_M else (frames[-1].x if frames else _any_normal(z))
            x = x - (x @ z) * z
            x /= np.sqrt(x @ x)
        frames.append(_Frame(_without_rounding(x, 1.0), z, origin))
    z, point = axes[-1]
    if frames:
        last = frames[-1]
        normal = np.cross(last.z, z)
        if float(np.sqrt(normal @ normal)) > _PARALLEL:
            origin = (
                point + float(np.cross(last.origin - point, last.z) @ np.cross(z, last.z)) / float(normal @ normal) * z
            )
        else:
            origin = point + float((last.origin - point) @ z) * z
        x = last.x - (last.x @ z) * z
        x = x / np.sqrt(x @ x) if float(np.sqrt(x @ x)) > 0.5 else _any_normal(z)
    else:
        x, origin = _any_normal(z), point
    turned = np.cos(about_last_axis_rad) * x + np.sin(about_last_axis_rad) * np.cross(z, x)
    return [*frames, _Frame(_without_rounding(turned, 1.0), z, origin)]


def _base_frame(chain: Chain, first: _Frame) -> _Frame:
    """A fixed frame about the first axis with gravity in its x z plane; x of the first joint if gravity is along z."""
    g = chain.gravity_m_s2
    level = g - (g @ first.z) * first.z
    size = float(np.sqrt(level @ level))
    x = first.x if size <= _ROUNDING * float(np.sqrt(g @ g)) else level / size
    return _Frame(x, first.z, first.origin)


def _any_normal(z: FloatArray) -> FloatArray:
    """A unit vector perpendicular to z."""
    other = np.zeros(3)
    other[int(np.argmin(np.abs(z)))] = 1.0
    x = np.cross(other, z)
    return np.asarray(x / np.sqrt(x @ x))


def _without_rounding(vector: FloatArray, size: float) -> FloatArray:
    """A vector without rounding errors around zero."""
    return np.where(np.abs(vector) < _ROUNDING * size, 0.0, vector)


def _without_rounding_m(value_m: float) -> float:
    return 0.0 if abs(value_m) < _TOUCHING_M else value_m
