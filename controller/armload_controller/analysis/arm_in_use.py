"""The arm model in use: from the robot's file, or corrected by a calibration file.

The readers are imported only if a file is given: most commands have none.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from armload_controller.config.objects_or_paths import FilePath
from armload_controller.config.robot_recordings import MeasuredArm
from armload_identification.argument_types import wrong_type
from armload_identification.estimation.empty_arm.known_arm import KnownArm
from armload_identification.identification_errors import EstimationError, ModelError
from armload_identification.model.chain import Chain
from armload_identification.signals.joint_torque import Transmission

if TYPE_CHECKING:
    from armload_identification.calibration.calibration_result import ArmCalibration
    from armload_identification.results.calibrated_arm import CalibratedArm

Calibration: TypeAlias = "ArmCalibration | CalibratedArm | FilePath"
"""A calibration, or the path of its file."""


@dataclass(frozen=True, eq=False)
class ArmInUse:
    """The arm model from the robot's file, or from its calibration.

    Attributes:
        chain: Kinematics and gravity in the base frame; a calibration accounts for a base that is not level.
        transmission: Current-to-torque gains and coupling.
        calibration: The calibration; None without one.
        calibration_sha256: File name and hash of the calibration; empty without one.
    """

    chain: Chain
    transmission: Transmission
    calibration: ArmCalibration | None = None
    calibration_sha256: dict[str, str] = field(default_factory=dict)

    @property
    def known(self) -> KnownArm | None:
        """Model of the empty arm from the calibration; None without one."""
        return None if self.calibration is None else self.calibration.known_arm

    def calibrated(self, why: str) -> ArmCalibration:
        """The calibration.

        Args:
            why: What it is needed for; starts the error message.

        Raises:
            EstimationError: the arm is not calibrated.
        """
        if self.calibration is None:
            raise EstimationError(
                f"{why}: calibrate it once with `armload calibrate` and give that file as `calibration=`."
            )
        return self.calibration


def arm_in_use(robot: MeasuredArm, calibration: Calibration | None = None) -> ArmInUse:
    """The arm model, calibrated if a calibration is given or the robot's file names one.

    Args:
        calibration: Calibration or its file; takes precedence over the one that the robot's file names.

    Raises:
        ConfigurationError: the calibration that the robot's file names does not exist.
        CalibrationFileError: the calibration cannot be used.
        ModelError: the calibration belongs to another arm.
    """
    given = robot.calibration_file if calibration is None else calibration
    if given is None:
        return ArmInUse(robot.chain, robot.transmission)
    import hashlib

    from armload_identification.files.calibration_file import format_calibration

    arm = calibration_of(robot, given)
    name, content = f"calibration of {arm.robot}", format_calibration(arm).encode()
    if isinstance(given, str | PathLike):
        name, content = Path(given).name, Path(given).read_bytes()
    return ArmInUse(
        chain=arm.level(robot.chain),
        transmission=arm.transmission(robot.transmission),
        calibration=arm,
        calibration_sha256={name: hashlib.sha256(content).hexdigest()},
    )


def calibration_of(robot: MeasuredArm, given: Calibration) -> ArmCalibration:
    """The calibration of an arm, from its file if that is given.

    Raises:
        CalibrationFileError: the calibration cannot be used.
        ModelError: the calibration belongs to another arm.
        TypeError: it is something else.
    """
    arm = calibration_from(given)
    try:
        arm.require_arm(robot.chain, robot.transmission.coupling)
    except ModelError as error:
        raise ModelError(f"{given if isinstance(given, str | PathLike) else '`calibration=`'}: {error}") from error
    return arm


def calibration_from(given: Calibration) -> ArmCalibration:
    """A calibration, read if its file is given.

    Raises:
        CalibrationFileError: the file cannot be used.
        TypeError: it is something else.
    """
    from armload_identification.calibration.calibration_result import ArmCalibration
    from armload_identification.files.calibration_file import read_calibration
    from armload_identification.results.calibrated_arm import CalibratedArm

    if isinstance(given, CalibratedArm):
        return given.calibration
    if isinstance(given, ArmCalibration):
        return given
    if isinstance(given, str | PathLike):
        return read_calibration(given)
    raise wrong_type("calibration", given, "a calibration (calibrate, read_calibration) or the path of its file")
