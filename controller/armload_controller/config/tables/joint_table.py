"""`[[joints]]`: one joint, its limits, its gear and its drive."""

from __future__ import annotations

import math

from armload_controller.config.tables.drive_tables import DriveTable
from armload_controller.config.tables.table_types import GearRatio, JointPosition, JointSpeed, Positive, Share
from armload_identification.storage.strict_toml import Table


class JointTable(Table):
    """One joint and its limits."""

    name: str
    position_min_rad: JointPosition
    position_max_rad: JointPosition
    velocity_max_rad_s: JointSpeed
    acceleration_max_rad_s2: Positive
    jerk_max_rad_s3: Positive
    torque_max_nm: Positive
    arm_torque_share: Share | None = None
    torque_noise_nm: Positive
    gear_ratio: GearRatio | None = None
    torque_constant_nm_a: Positive | None = None
    drive: DriveTable | None = None

    def __post_init__(self) -> None:
        if self.position_min_rad >= self.position_max_rad:
            raise ValueError(
                f"position_min_rad = {self.position_min_rad} is not below position_max_rad = "
                f"{self.position_max_rad}: exchange them"
            )

    @property
    def axis_torque_max_nm(self) -> float:
        """Greatest torque that the drive allows the axis (6072); inf if the file does not state it."""
        drive = self.drive
        if drive is None or drive.rated_torque_nm is None:
            return math.inf
        return drive.rated_torque_nm * drive.max_torque_permille / 1000.0

    @property
    def added_torque_max_nm(self) -> float:
        """Greatest torque that may be added: the lesser of the joint's limit and its drive's (6072)."""
        return min(self.torque_max_nm, self.axis_torque_max_nm)
