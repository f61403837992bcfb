"""Arguments and options that several commands share."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from armload_controller.config.robot import Robot
    from armload_identification.calibration.arm_calibration import ArmCalibration
    from armload_identification.estimation.known_arm import KnownArm
    from armload_identification.model.chain import Chain
    from armload_identification.signals.joint_torque import Transmission

RobotArgument = Annotated[str, typer.Argument(metavar="ROBOT", help="A shipped robot, or the path of a robot's TOML.")]
InterfaceOption = Annotated[
    str | None, typer.Option("--interface", help="python-can interface, instead of the configured one.")
]
ChannelOption = Annotated[str | None, typer.Option("--channel", help="Channel of the interface, such as can0.")]
BitrateOption = Annotated[int | None, typer.Option("--bitrate", help="Bit rate of the bus in bit/s.")]
CycleOption = Annotated[float | None, typer.Option("--cycle-hz", help="SYNC rate in Hz.")]
LoadedOption = Annotated[Path, typer.Option("--loaded", help="Recording with the payload (MCAP or CSV).")]
UnloadedOption = Annotated[Path, typer.Option("--unloaded", help="Recording of the same motion without it.")]
SimulatedDrivesOption = Annotated[
    bool, typer.Option("--simulated-drives", help="Drive simulated drives only; each node is asked who it is.")
]
YesOption = Annotated[
    bool,
    typer.Option(
        "--yes", help="Skip prompts. Never the slow round, nor the first question with a payload on a real arm."
    ),
]
GainsOption = Annotated[
    Path | None, typer.Option("--gains", help="Gains file of `armload calibrate-gains`, in place of nominal gains.")
]

CalibrationOption = Annotated[
    Path | None,
    typer.Option("--calibration", help="Calibration file of `armload calibrate`, in place of nominal gains."),
]


@dataclass(frozen=True, eq=False)
class ArmInUse:
    """The arm as the options describe it.

    Attributes:
        chain: Kinematics, and gravity as it pulls on a base that may not be level.
        transmission: Gains and coupling.
        known: The empty arm by its calibration; None without one.
        calibration: The calibration; None without one.
    """

    chain: Chain
    transmission: Transmission
    known: KnownArm | None
    calibration: ArmCalibration | None


def arm_in_use(robot: Robot, gains: Path | None, calibration: Path | None) -> ArmInUse:
    """The robot's arm, calibrated where a file of gains or of a calibration is given.

    Raises:
        ConfigurationError: both files are given.
        CalibrationFileError: it cannot be used.
        ModelError: it belongs to another arm.
    """
    from armload_controller.control_errors import ConfigurationError
    from armload_identification.files.calibration_file import read_calibration

    if calibration is None:
        return ArmInUse(robot.chain, transmission_of(robot, gains), None, None)
    if gains is not None:
        raise ConfigurationError("command line", "--gains / --calibration", None, "one of the two")
    arm = read_calibration(calibration)
    arm.require_arm(robot.chain, robot.drives.coupling)
    return ArmInUse(
        arm.level(robot.chain), arm.transmission(robot.drives.transmission), arm.known_arm(robot.chain), arm
    )


def transmission_of(robot: Robot, gains: Path | None) -> Transmission:
    """The robot's transmission, with calibrated gains where a file of them is given."""
    from armload_identification.files.gains_file import read_gains

    return robot.drives.transmission if gains is None else read_gains(gains, robot.drives.coupling)
