"""Limits and noise of a robot's joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_controller.config.robot_source import RobotSource
from armload_controller.config.tables.joint_table import JointTable
from armload_controller.motion.joint_limits import MotionLimits
from armload_identification.excitation.design_envelope import ExcitationLimits
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, SpeedLimit
from armload_identification.float_array import FloatArray


@dataclass(frozen=True, eq=False)
class RobotLimits:
    """Limits and noise of the joints.

    Attributes:
        source: The robot's file.
    """

    source: RobotSource

    @property
    def motion(self) -> MotionLimits:
        """Limits for every motion; a joint without a drive has no following error window."""
        joints = self.source.tables.joints
        return MotionLimits(
            joint_names=self.source.joint_names,
            position_min_rad=np.array([j.position_min_rad for j in joints]),
            position_max_rad=np.array([j.position_max_rad for j in joints]),
            velocity_max_rad_s=np.array([j.velocity_max_rad_s for j in joints]),
            acceleration_max_rad_s2=np.array([j.acceleration_max_rad_s2 for j in joints]),
            jerk_max_rad_s3=np.array([j.jerk_max_rad_s3 for j in joints]),
            following_error_rad=np.array([j.drive.following_error_rad if j.drive else np.inf for j in joints]),
        )

    @property
    def excitation(self) -> ExcitationLimits:
        """Limits for designing an excitation; the following error counts for drives whose lag is known."""
        limits = self.motion
        return ExcitationLimits(
            limits.position_min_rad,
            limits.position_max_rad,
            np.minimum(limits.velocity_max_rad_s, self.following_speed_rad_s),
            limits.acceleration_max_rad_s2,
            limits.jerk_max_rad_s3,
        )

    @property
    def following_speed_rad_s(self) -> FloatArray:
        """(n,) speed at which the following error reaches its window; inf if the drive's lag is unknown."""
        return np.array([_speed_at_following_error(joint) for joint in self.source.tables.joints])

    @property
    def points(self) -> ArmPoints:
        """The points of the arm whose speed is limited; without a `[tool]` the tool centre point is the flange."""
        tool = self.source.tables.tool
        return ArmPoints(self.source.chain, np.zeros(3) if tool is None else np.array(tool.xyz_m))

    @property
    def speed(self) -> SpeedLimit | None:
        """Limit for the speed of these points at full rate; None if the file sets none."""
        limits = self.source.tables.limits
        return None if limits is None else SpeedLimit(self.points, limits.tcp_speed_m_s)

    @property
    def torque_max_nm(self) -> FloatArray:
        """(n,) greatest torque of each joint."""
        return np.array([joint.torque_max_nm for joint in self.source.tables.joints])

    @property
    def added_torque_max_nm(self) -> FloatArray:
        """(n,) greatest torque that may be added: the lesser of the joint's limit and its drive's (6072)."""
        return np.array([joint.added_torque_max_nm for joint in self.source.tables.joints])

    @property
    def torque_noise_nm(self) -> FloatArray:
        """(n,) expected noise of one raw torque sample at 100 Hz."""
        return np.array([joint.torque_noise_nm for joint in self.source.tables.joints])


def _speed_at_following_error(joint: JointTable) -> float:
    """Speed at which the following error reaches its window, rad/s; inf if the drive's lag is unknown."""
    drive = joint.drive
    if drive is None or drive.following_lag_s is None:
        return np.inf
    return drive.following_error_rad / drive.following_lag_s
