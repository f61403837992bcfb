"""The arm model in use: from the robot's file, or corrected by a calibration file.

The readers are imported only if a file is given: most commands have none.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from armload_controller.config.measured_arm import MeasuredArm
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.identification_errors import EstimationError, ModelError
from armload_identification.model.chain import Chain
from armload_identification.signals.joint_torque import Transmission

if TYPE_CHECKING:
    from armload_identification.calibration.calibration_result import ArmCalibration

FilePath = str | PathLike[str]


@dataclass(frozen=True, eq=False)
class ArmInUse:
    """The arm model from the robot's file, or from its calibration.

    Attributes:
        chain: Kinematics and gravity in the base frame; a calibration accounts for a base that is not level.
        transmission: Current-to-torque gains and coupling.
        known: Model of the empty arm from the calibration; None without one.
        calibration: The calibration; None without one.
        calibration_sha256: File name and hash of the calibration; empty without one.
    """

    chain: Chain
    transmission: Transmission
    known: KnownArm | None = None
    calibration: ArmCalibration | None = None
    calibration_sha256: dict[str, str] = field(default_factory=dict)

    def calibrated(self, why: str) -> tuple[ArmCalibration, KnownArm]:
        """The calibration and its model of the empty arm.

        Args:
            why: What they are needed for; starts the error message.

        Raises:
            EstimationError: the arm is not calibrated.
        """
        if self.calibration is None or self.known is None:
            raise EstimationError(
                f"{why}: calibrate it once with `armload calibrate` and give that file as --calibration."
            )
        return self.calibration, self.known


def arm_in_use(robot: MeasuredArm, calibration: FilePath | None = None) -> ArmInUse:
    """The arm model, calibrated if a calibration is given or the robot's file names one.

    Args:
        robot: The arm.
        calibration: Calibration file; takes precedence over the one that the robot's file names.

    Raises:
        ConfigurationError: the calibration that the robot's file names does not exist.
        CalibrationFileError: the calibration cannot be used.
        ModelError: the calibration belongs to another arm.
    """
    path = robot.calibration_file if calibration is None else Path(calibration)
    if path is None:
        return ArmInUse(robot.chain, robot.transmission)
    import hashlib

    arm = calibration_of(robot, path)
    return ArmInUse(
        chain=arm.level(robot.chain),
        transmission=arm.transmission(robot.transmission),
        known=arm.known_arm(robot.chain),
        calibration=arm,
        calibration_sha256={path.name: hashlib.sha256(path.read_bytes()).hexdigest()},
    )


def calibration_of(robot: MeasuredArm, path: Path) -> ArmCalibration:
    """The calibration of an arm, from its file.

    Raises:
        CalibrationFileError: the calibration cannot be used.
        ModelError: the calibration belongs to another arm.
    """
    from armload_identification.files.calibration_file import read_calibration

    arm = read_calibration(path)
    try:
        arm.require_arm(robot.chain, robot.transmission.coupling)
    except ModelError as error:
        raise ModelError(f"{path}: {error}") from error
    return arm
