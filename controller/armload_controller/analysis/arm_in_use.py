"""The arm as it is used: by its configuration, or calibrated by a file.

Readers of files are loaded where a file is given: most commands have none.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from armload_controller.config.measured_arm import MeasuredArm
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.identification_errors import EstimationError
from armload_identification.model.chain import Chain
from armload_identification.signals.joint_torque import Transmission

if TYPE_CHECKING:
    from armload_identification.calibration.arm_calibration import ArmCalibration

FilePath = str | PathLike[str]


@dataclass(frozen=True, eq=False)
class ArmInUse:
    """The arm as its configuration, or a calibration of it, describes it.

    Attributes:
        chain: Kinematics, and gravity as it pulls on a base that may not be level.
        transmission: Gains and coupling.
        known: The empty arm by its calibration; None without one.
        calibration: What it was calibrated with; None without.
        calibration_sha256: File name and hash of the calibration; empty without one.
    """

    chain: Chain
    transmission: Transmission
    known: KnownArm | None = None
    calibration: ArmCalibration | None = None
    calibration_sha256: dict[str, str] = field(default_factory=dict)

    def calibrated(self, why: str) -> tuple[ArmCalibration, KnownArm]:
        """The calibration, and the empty arm by it.

        Args:
            why: What they are needed for, as the beginning of a sentence.

        Raises:
            EstimationError: the arm is not calibrated.
        """
        if self.calibration is None or self.known is None:
            raise EstimationError(
                f"{why}: calibrate it once with `armload calibrate` and give that file as --calibration."
            )
        return self.calibration, self.known


def arm_in_use(robot: MeasuredArm, calibration: FilePath | None = None) -> ArmInUse:
    """The arm, calibrated where a calibration is given, or named in the robot's file.

    Args:
        robot: The arm.
        calibration: Calibration file; it wins over the one that the robot's file names.

    Raises:
        ConfigurationError: the robot's file names a calibration that is not there.
        CalibrationFileError: it cannot be used.
        ModelError: it belongs to another arm.
    """
    path = robot.calibration_file if calibration is None else Path(calibration)
    if path is None:
        return ArmInUse(robot.chain, robot.transmission)
    import hashlib

    from armload_identification.files.calibration_file import read_calibration

    arm = read_calibration(path)
    arm.require_arm(robot.chain, robot.transmission.coupling)
    return ArmInUse(
        chain=arm.level(robot.chain),
        transmission=arm.transmission(robot.transmission),
        known=arm.known_arm(robot.chain),
        calibration=arm,
        calibration_sha256={path.name: hashlib.sha256(path.read_bytes()).hexdigest()},
    )
