"""Constraints on every motion of an arm."""

from __future__ import annotations

from dataclasses import dataclass

from armload_controller.motion.joint_limits import MotionLimits
from armload_controller.motion.obstacles import Obstacles
from armload_controller.motion.slow_round_pace import REDUCED_SPEED_M_S
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints, SpeedLimit
from armload_identification.excitation.torque_limits import TorqueLimits
from armload_identification.float_array import FloatArray


@dataclass(frozen=True, eq=False)
class MotionConstraints:
    """Constraints of one arm of n joints in its workspace.

    Attributes:
        robot_sha256: Hash of the robot's file; a motion checked against these constraints is valid for that robot only.
        limits: Position, velocity, acceleration and jerk limits, and following error windows.
        following_speed_rad_s: (n,) speed at which a servo's lag fills its following error window; inf if the lag is
            unknown.
        torque: Torque of the joints, and what the arm and its heaviest payload require; None if the robot's file does
            not specify them.
        axis_torque: The same for the motors' axes, which drives limit (6072); None if the joints' limits imply it.
        obstacles: Obstacles that the arm must not touch.
        points: Points of the arm, and spheres around what it carries, whose speed is limited at reduced speed.
        speed: Speed limit of the arm's own points that the file sets; None if it sets none.
    """

    robot_sha256: str
    limits: MotionLimits
    following_speed_rad_s: FloatArray
    torque: TorqueLimits | None
    axis_torque: TorqueLimits | None
    obstacles: Obstacles
    points: ArmPoints
    speed: SpeedLimit | None

    @property
    def reduced_speed(self) -> SpeedLimit:
        """Speed limit on approaches and slow rounds: reduced speed, or the file's limit if that is lower."""
        own_m_s = REDUCED_SPEED_M_S if self.speed is None else self.speed.speed_m_s
        return SpeedLimit(self.points, min(REDUCED_SPEED_M_S, own_m_s))
