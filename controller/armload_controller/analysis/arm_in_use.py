"""The arm as it is used: by its configuration, or calibrated by a file.

Readers of files are loaded where a file is given: most commands have none.
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from armload_controller.config.robot import Robot
from armload_controller.control_errors import ConfigurationError
from armload_identification.estimation.known_arm import KnownArm
from armload_identification.model.chain import Chain
from armload_identification.signals.joint_torque import Transmission

FilePath = str | PathLike[str]


@dataclass(frozen=True, eq=False)
class ArmInUse:
    """The arm as a file of gains or of a calibration describes it.

    Attributes:
        chain: Kinematics, and gravity as it pulls on a base that may not be level.
        transmission: Gains and coupling.
        known: The empty arm by its calibration; None without one.
    """

    chain: Chain
    transmission: Transmission
    known: KnownArm | None


def arm_in_use(robot: Robot, gains: FilePath | None, calibration: FilePath | None) -> ArmInUse:
    """The robot's arm, calibrated where a file of gains or of a calibration is given.

    Raises:
        ConfigurationError: both files are given.
        CalibrationFileError: it cannot be used.
        ModelError: it belongs to another arm.
    """
    if calibration is None:
        return ArmInUse(robot.chain, transmission_of(robot, gains), None)
    if gains is not None:
        raise ConfigurationError("command line", "--gains / --calibration", None, "one of the two")
    from armload_identification.files.calibration_file import read_calibration

    arm = read_calibration(Path(calibration))
    arm.require_arm(robot.chain, robot.drives.coupling)
    transmission = arm.transmission(robot.drives.transmission)
    return ArmInUse(arm.level(robot.chain), transmission, arm.known_arm(robot.chain))


def transmission_of(robot: Robot, gains: FilePath | None) -> Transmission:
    """The robot's transmission, with calibrated gains where a file of them is given."""
    if gains is None:
        return robot.drives.transmission
    from armload_identification.files.gains_file import read_gains

    return read_gains(Path(gains), robot.drives.coupling)
