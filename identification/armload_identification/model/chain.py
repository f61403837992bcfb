"""The arm as a chain of revolute joints, and its poses.

A joint FRAME is located at the joint and rotates with it: at q = 0 its pose in the previous joint's frame is
`placement`, and q rotates it about `axis`. The flange is fixed in the last joint's frame.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from armload_core import kernels
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import ModelError
from armload_identification.model.finite_array import finite_array, set_fields

_GIMBAL_LOCK = 1e-9
_ROTATION_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False)
class Chain:
    """Kinematics of an arm with n revolute joints, at most 16, and gravity.

    Attributes:
        placement: (n, 4, 4) joint frame at q = 0 in the previous joint's frame (of the first joint: in the base).
        axis: (n, 3) unit vector of the joint axis in its own frame.
        flange: (4, 4) flange in the last joint's frame.
        gravity_m_s2: (3,) acceleration of gravity in the base frame, (0, 0, -9.81) on an upright arm.
        packed: Everything above as one array for the kernels of `armload_core`; read-only.

    Raises:
        ModelError: a wrong shape, too many joints for the kernels, an axis without direction, a matrix that is not a
            pose, a number that is not finite.
    """

    placement: FloatArray
    axis: FloatArray
    flange: FloatArray
    gravity_m_s2: FloatArray
    packed: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        placement = finite_array("placement", self.placement, (None, 4, 4))
        n = placement.shape[0]
        if n == 0:
            raise ModelError("a chain needs at least one joint; placement is empty")
        if n > kernels.MOST_JOINTS:
            raise ModelError(f"a chain of {n} joints; expected at most {kernels.MOST_JOINTS}")
        axis = finite_array("axis", self.axis, (n, 3))
        flange = finite_array("flange", self.flange, (4, 4))
        gravity = finite_array("gravity_m_s2", self.gravity_m_s2, (3,))
        _require_poses(np.concatenate([placement, flange[None]]))
        length = np.sqrt(np.sum(axis**2, axis=1))
        for i in np.flatnonzero(length < _ROTATION_TOLERANCE):
            raise ModelError(f"axis of joint {i + 1} is {axis[i].tolist()}; expected a direction, such as [0, 0, 1]")
        axis /= length[:, None]
        arrays = {"placement": placement, "axis": axis, "flange": flange, "gravity_m_s2": gravity}
        set_fields(self, arrays | {"packed": _pack(placement, axis, flange, gravity)})

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.placement.shape[0])

    @property
    def kinematics_sha256(self) -> str:
        """Hash of the kinematics from base to flange, to a nanometre and a nanoradian; independent of gravity."""
        places = np.concatenate([self.placement.ravel(), self.axis.ravel(), self.flange.ravel()])
        return hashlib.sha256((np.round(places, 9) + 0.0).astype("<f8").tobytes()).hexdigest()

    def turned_back(self, joint: int) -> FloatArray:
        """Rotation from a joint frame to the turned one of `packed`, whose z is the joint's axis.

        Args:
            joint: Index from 0.

        Returns:
            (3, 3) rotation of coordinates in the joint frame to coordinates in the turned one.
        """
        start = 3 + 12 * self.n + 9 * joint
        return np.array(self.packed[start : start + 9].reshape(3, 3))

    @classmethod
    def from_modified_dh(cls, rows: ArrayLike, flange: ArrayLike, gravity_m_s2: ArrayLike) -> Chain:
        """Chain from modified (Craig) Denavit-Hartenberg rows.

            T_i = Rx(alpha_{i-1}) Tx(a_{i-1}) Tz(d_i) Rz(theta_i)

        Args:
            rows: (n, 4) alpha_{i-1} in rad, a_{i-1} in m, d_i in m, and the angle in rad added to q_i.
            flange: (4, 4) flange in the last link's frame.
            gravity_m_s2: (3,) acceleration of gravity in the base frame.

        Raises:
            ModelError: as the class.

        References:
            Craig, Introduction to Robotics, 3rd ed. 2005, eq. (3.6).
        """
        table = finite_array("rows", rows, (None, 4))
        x, _, z = np.eye(3)
        placement = np.array([_rotation(x, al) @ _shift(a, 0.0, d) @ _rotation(z, off) for al, a, d, off in table])
        return cls(placement.reshape(-1, 4, 4), _z_axes(len(table)), np.asarray(flange), np.asarray(gravity_m_s2))

    @classmethod
    def from_standard_dh(cls, rows: ArrayLike, flange: ArrayLike, gravity_m_s2: ArrayLike) -> Chain:
        """Chain from standard (distal) Denavit-Hartenberg rows.

            T_i = Rz(theta_i) Tz(d_i) Tx(a_i) Rx(alpha_i)

        A standard D-H frame i is located at the far end of link i, but the joint frames of the chain at the joints:
        joint frame i is D-H frame i-1 rotated by q_i, and the last row becomes part of the flange.

        Args:
            rows: (n, 4) alpha_i in rad, a_i in m, d_i in m, and the angle in rad added to q_i.
            flange: (4, 4) flange in D-H frame n.
            gravity_m_s2: (3,) acceleration of gravity in the base frame.

        Raises:
            ModelError: as the class.

        References:
            Siciliano et al., Robotics: Modelling, Planning and Control, 2009, eq. (2.52).
        """
        table = finite_array("rows", rows, (None, 4))
        x, _, z = np.eye(3)
        link = [_rotation(z, off) @ _shift(a, 0.0, d) @ _rotation(x, al) for al, a, d, off in table]
        placement = np.array([np.eye(4), *link[:-1]][: len(link)]).reshape(-1, 4, 4)
        end = finite_array("flange", flange, (4, 4))
        return cls(placement, _z_axes(len(table)), link[-1] @ end if link else end, np.asarray(gravity_m_s2))

    @classmethod
    def from_origins(
        cls,
        xyz_m: ArrayLike,
        rpy_rad: ArrayLike,
        axis: ArrayLike,
        flange: ArrayLike,
        gravity_m_s2: ArrayLike,
    ) -> Chain:
        """Chain from the origins and axes of a URDF.

        Args:
            xyz_m: (n, 3) origin of each joint in the previous joint's frame.
            rpy_rad: (n, 3) its orientation, Rz(yaw) Ry(pitch) Rx(roll).
            axis: (n, 3) joint axis in the joint's frame, of any length.
            flange: (4, 4) flange in the last joint's frame.
            gravity_m_s2: (3,) acceleration of gravity in the base frame.

        Raises:
            ModelError: as the class.
        """
        origin = finite_array("xyz_m", xyz_m, (None, 3))
        angles = finite_array("rpy_rad", rpy_rad, (len(origin), 3))
        placement = np.array([pose_from_xyz_rpy(p, a) for p, a in zip(origin, angles, strict=True)])
        return cls(placement.reshape(-1, 4, 4), np.asarray(axis), np.asarray(flange), np.asarray(gravity_m_s2))

    def head(self, joints: int) -> Chain:
        """The chain of the first joints, with the flange at the last of these.

        Args:
            joints: Number of joints, 1 to n.

        Raises:
            ModelError: not 1 to n.
        """
        if not 1 <= joints <= self.n:
            raise ModelError(f"head of {joints} joints requested from a chain of {self.n}; expected 1 to {self.n}")
        return Chain(self.placement[:joints], self.axis[:joints], np.eye(4), self.gravity_m_s2)

    def under(self, gravity_m_s2: FloatArray) -> Chain:
        """The same arm under another gravity, (3,) in the base frame."""
        return Chain(self.placement, self.axis, self.flange, gravity_m_s2)

    def forward(self, q: ArrayLike) -> FloatArray:
        """Poses of all joint frames and of the flange.

        Args:
            q: (n,) or (N, n) joint positions in rad.

        Returns:
            (n + 1, 4, 4) or (N, n + 1, 4, 4) poses in the base frame; the last is the flange.

        Raises:
            ModelError: q has another shape or is not finite.
        """
        angle = finite_array("q", q, (*np.shape(q)[:-1], self.n))
        flange = np.broadcast_to(self.flange, (*angle.shape[:-1], 1, 4, 4))
        poses = np.concatenate([self.placement @ _rotation(self.axis, angle), flange], axis=-3)
        for i in range(self.n):
            poses[..., i + 1, :, :] = poses[..., i, :, :] @ poses[..., i + 1, :, :]
        return poses

    def axes(self, poses: FloatArray) -> FloatArray:
        """(..., n, 3) the joints' axes in the base frame, in (..., n + 1, 4, 4) poses of `forward`."""
        return np.asarray((poses[..., :-1, :3, :3] @ self.axis[:, :, None])[..., 0])

    def jacobian(self, q: FloatArray) -> FloatArray:
        """(..., 6, n) velocity of the flange per joint velocity, linear part first, in the base frame, at (..., n)."""
        poses = self.forward(q)
        place, axes = poses[..., :3, 3], self.axes(poses)
        linear = cross(axes, place[..., -1:, :] - place[..., :-1, :])
        return np.concatenate([linear, axes], axis=-1).swapaxes(-1, -2)


def pose_from_xyz_rpy(xyz_m: ArrayLike, rpy_rad: ArrayLike) -> FloatArray:
    """Pose from a URDF origin.

    Args:
        xyz_m: (3,) position.
        rpy_rad: (3,) roll, pitch, yaw about the fixed axes: R = Rz(yaw) Ry(pitch) Rx(roll).

    Returns:
        (4, 4) homogeneous matrix.

    Raises:
        ModelError: another shape, or not finite.
    """
    position = finite_array("xyz_m", xyz_m, (3,))
    roll, pitch, yaw = finite_array("rpy_rad", rpy_rad, (3,))
    x, y, z = np.eye(3)
    pose = _rotation(z, yaw) @ _rotation(y, pitch) @ _rotation(x, roll)
    pose[:3, 3] = position
    return pose


def rpy_rad(rotation: FloatArray) -> FloatArray:
    """(3,) roll, pitch and yaw about the fixed axes, R = Rz(yaw) Ry(pitch) Rx(roll); yaw is 0 in gimbal lock.

    Args:
        rotation: (3, 3).
    """
    level = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    pitch = np.arctan2(-rotation[2, 0], level)
    if level < _GIMBAL_LOCK:
        return np.array([np.arctan2(-rotation[1, 2], rotation[1, 1]), pitch, 0.0])
    return np.array([np.arctan2(rotation[2, 1], rotation[2, 2]), pitch, np.arctan2(rotation[1, 0], rotation[0, 0])])


def _pack(placement: FloatArray, axis: FloatArray, flange: FloatArray, gravity: FloatArray) -> FloatArray:
    """One array for the kernels, with every joint frame rotated such that its axis is z; layout: `chain.h`."""
    n = placement.shape[0]
    turn = [_turn_z_onto(a) for a in axis]
    before = [np.eye(3), *turn]
    parts = [-gravity]
    for i in range(n):
        parts += [(before[i].T @ placement[i, :3, :3] @ turn[i]).ravel(), before[i].T @ placement[i, :3, 3]]
    parts += [r.T.ravel() for r in turn]
    parts += [(turn[-1].T @ flange[:3, :3]).ravel(), turn[-1].T @ flange[:3, 3]]
    return np.concatenate(parts)


def _turn_z_onto(axis: FloatArray) -> FloatArray:
    """(3, 3) rotation that takes z to the axis; the identity for z itself."""
    if axis[0] == 0.0 and axis[1] == 0.0 and axis[2] > 0.0:
        return np.eye(3)
    other = np.zeros(3)
    other[int(np.argmin(np.abs(axis)))] = 1.0
    x = cross(other, axis)
    x /= np.sqrt(np.sum(x**2))
    return np.column_stack([x, cross(axis, x), axis])


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """(..., 3) cross products; NumPy's takes several times as long for up to some hundred of them."""
    after, last = (1, 2, 0), (2, 0, 1)
    return np.asarray(a[..., after] * b[..., last] - a[..., last] * b[..., after])


def _require_poses(poses: FloatArray) -> None:
    """Raise unless the matrices of the joints and of the flange are poses."""
    rotation = poses[:, :3, :3]
    skew = np.abs(rotation.transpose(0, 2, 1) @ rotation - np.eye(3)).max(axis=(1, 2))
    proper = (skew <= _ROTATION_TOLERANCE) & (np.linalg.det(rotation) >= 0.0)
    proper &= (poses[:, 3] == (0.0, 0.0, 0.0, 1.0)).all(axis=1)
    if not proper.all():
        i = int(np.argmin(proper))
        name = "flange" if i == len(poses) - 1 else f"placement of joint {i + 1}"
        raise ModelError(
            f"{name} is not a pose: {poses[i].tolist()}; expected a right-handed rotation, a position and the row 0 0 "
            "0 1"
        )


def _rotation(axis: FloatArray, angle_rad: ArrayLike) -> FloatArray:
    """(..., 4, 4) rotations about (..., 3) unit axes (Rodrigues)."""
    angle = np.asarray(angle_rad)[..., None, None]
    outer, across = axis[..., :, None] * axis[..., None, :], cross(np.eye(3), axis[..., None, :])
    pose = np.zeros((*np.shape(angle_rad), 4, 4))
    pose[..., :3, :3] = np.cos(angle) * np.eye(3) + np.sin(angle) * across + (1.0 - np.cos(angle)) * outer
    pose[..., 3, 3] = 1.0
    return pose


def _shift(x: float, y: float, z: float) -> FloatArray:
    pose = np.eye(4)
    pose[:3, 3] = (x, y, z)
    return pose


def _z_axes(n: int) -> FloatArray:
    return np.tile([0.0, 0.0, 1.0], (n, 1))
