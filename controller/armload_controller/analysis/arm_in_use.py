"""The arm as it is used: by its configuration, or calibrated by a file.

Readers of files are loaded where a file is given: most commands have none.
"""

from __future__ import annotations

from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from armload_controller.config.measured_arm import MeasuredArm
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


def arm_in_use(arm: MeasuredArm, gains: FilePath | None, calibration: FilePath | None) -> ArmInUse:
    """The arm, calibrated where a file of gains or of a calibration is given.

    Raises:
        ConfigurationError: both files are given.
        CalibrationFileError: it cannot be used.
        ModelError: it belongs to another arm.
    """
    if calibration is None:
        return ArmInUse(arm.chain, transmission_of(arm, gains), None)
    if gains is not None:
        raise ConfigurationError("command line", "--gains / --calibration", None, "one of the two")
    from armload_identification.files.calibration_file import read_calibration

    known = read_calibration(Path(calibration))
    known.require_arm(arm.chain, arm.transmission.coupling)
    return ArmInUse(known.level(arm.chain), known.transmission(arm.transmission), known.known_arm(arm.chain))


def transmission_of(arm: MeasuredArm, gains: FilePath | None) -> Transmission:
    """The arm's transmission, with calibrated gains where a file of them is given."""
    if gains is None:
        return arm.transmission
    from armload_identification.files.gains_file import read_gains

    return read_gains(Path(gains), arm.transmission.coupling)
