"""Constraints on every motion of an arm, under any master."""

from __future__ import annotations

from dataclasses import dataclass

from armload_controller.motion.joint_limits import MotionLimits
from armload_controller.motion.obstacles import Obstacles
from armload_core.arrays import FloatArray
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, SpeedLimit
from armload_identification.excitation.joint_strength import TorqueLimits


@dataclass(frozen=True, eq=False)
class MotionConstraints:
    """Constraints of one arm of n joints in its workspace.

    Attributes:
        robot_sha256: Hash of the file that they come from; what is checked against them is for that robot.
        limits: Position, velocity, acceleration and jerk limits, and following-error windows.
        following_speed_rad_s: (n,) speed at which a servo's lag fills its following-error window; inf where the lag
            is not known.
        torque: What the joints can give, and what the arm and its heaviest payload require; None where the robot's
            file specifies neither.
        axis_torque: The same of the motors' axes, which drives limit (6072); None where the joints' limits imply it.
        obstacles: What the arm must not touch.
        points: Of the arm, whose speed is limited.
        speed: What none of them exceeds at full speed; None where the file sets no limit.
    """

    robot_sha256: str
    limits: MotionLimits
    following_speed_rad_s: FloatArray
    torque: TorqueLimits | None
    axis_torque: TorqueLimits | None
    obstacles: Obstacles
    points: ArmPoints
    speed: SpeedLimit | None
