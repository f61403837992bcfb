"""The subject of an export: a payload, the arm that carries it, and the origin of both."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import version

import numpy as np

from armload_controller.config.robot import Robot
from armload_controller.control_errors import ExportError
from armload_controller.cycle.torque_gate import FULL_SWING_S
from armload_controller.export.licence import DEFAULT_LICENCE
from armload_controller.feedforward.payload_use import why_not_usable
from armload_controller.motion.joint_limits import MotionLimits
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.payload import PayloadResult
from armload_identification.pipeline.estimator_constants import EstimatorConstants, estimator_constants

_LICENCE = re.compile(r"[A-Za-z0-9.+-]+(?: (?:AND|OR|WITH) [A-Za-z0-9.+-]+)*")
"""SPDX expressions without brackets; nothing that could end a comment."""


@dataclass(frozen=True, eq=False)
class ExportSubject:
    """A payload that may be exported; for any other the constructor raises.

    Attributes:
        robot: Name of the robot.
        robot_sha256: Hash of its file.
        chain: Kinematics up to the flange, and gravity.
        limits: Limits of its joints.
        torque_max_nm: (n,) greatest torque of each joint, including its drive's limit.
        payload: The payload, in the flange frame.
        payload_file: The file it was read from, for messages; exported texts contain its name without folders.
        payload_sha256: Hash of that file.
        armload_version: Version of the program.
        permille_per_nm: (n, n) torque offset (60B2) of each axis, in per mille of its drive's rated torque, for torques
            of the joints; None if the robot's file does not state the rated torques.
        calibration: The arm's gains, links and friction; None if it is not calibrated.
        estimator: Constants of the recursive estimator; None if the arm is not calibrated.
        calibration_sha256: Hash of the calibration file by its name.
        flange_rpy_rad: Roll, pitch and yaw of the maker's flange in the configuration's, for load data; None for the
            same axes.
        licence: SPDX expression for generated source code.

    Raises:
        ExportError: mass or centre of mass is not determined, the payload is not in the flange frame, was identified on
            another arm, or is not physically possible.

    Examples:
        >>> import armload
        >>> def export_mass(subject: armload.ExportSubject) -> dict[str, str]:
        ...     return {f"{subject.identifier}_mass.txt": f"{subject.payload.model.mass_kg:.3f} kg"}
        >>> callable(export_mass)  # an entry point of `armload.exports`
        True
    """

    robot: str
    robot_sha256: str
    chain: Chain
    limits: MotionLimits
    torque_max_nm: FloatArray
    payload: PayloadResult
    payload_file: str
    payload_sha256: str
    armload_version: str
    permille_per_nm: FloatArray | None = None
    calibration: ArmCalibration | None = None
    estimator: EstimatorConstants | None = None
    calibration_sha256: Mapping[str, str] = field(default_factory=dict)
    flange_rpy_rad: tuple[float, float, float] | None = None
    licence: str = DEFAULT_LICENCE

    def __post_init__(self) -> None:
        problem = why_not_usable(self.payload, self.chain, self.robot, "exported")
        if problem is not None:
            raise ExportError(self.payload_file, problem)
        if not _LICENCE.fullmatch(self.licence):
            raise ExportError(
                self.payload_file,
                f"the licence {self.licence!r} is no SPDX expression; expected one such as {DEFAULT_LICENCE}, "
                "BSD-3-Clause or 'MIT OR Apache-2.0'",
            )

    @staticmethod
    def of(
        robot: Robot,
        payload: PayloadResult,
        payload_file: str,
        payload_sha256: str,
        calibration: ArmCalibration | None = None,
        calibration_sha256: Mapping[str, str] | None = None,
    ) -> ExportSubject:
        """A payload on a robot, in its flange frame and under the default licence.

        Args:
            robot: The arm.
            payload: What is exported.
            payload_file: The file that it was read from.
            payload_sha256: Hash of that file.
            calibration: The arm's calibration, if any.
            calibration_sha256: Hash of the calibration file by its name.
        """
        constants = None
        if calibration is not None:
            constants = estimator_constants(calibration, robot.chain, robot.transmission)
        return ExportSubject(
            robot=robot.name,
            robot_sha256=robot.sha256,
            chain=robot.chain if calibration is None else calibration.level(robot.chain),
            limits=robot.limits.motion,
            torque_max_nm=robot.limits.added_torque_max_nm,
            payload=payload,
            payload_file=payload_file,
            payload_sha256=payload_sha256,
            armload_version=version("armload"),
            permille_per_nm=_permille_per_nm(robot, calibration),
            calibration=calibration,
            estimator=constants,
            calibration_sha256=calibration_sha256 or {},
        )

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, from the base to the flange."""
        return self.limits.joint_names

    @property
    def torque_rate_nm_s(self) -> FloatArray:
        """(n,) greatest rate of each joint's added torque, the same as armload's own limit."""
        return self.torque_max_nm / FULL_SWING_S

    @property
    def identifier(self) -> str:
        """The robot's name as an identifier of C, RAPID and file systems: lower case, digits, underscores."""
        return identifier_of(self.robot)


def _permille_per_nm(robot: Robot, calibration: ArmCalibration | None) -> FloatArray | None:
    """(n, n) 60B2 of the axes per torque of the joints; None if a rated torque is not stated.

    A drive uses its nominal gain; if a calibration found another, the values are corrected for it.
    """
    if not robot.has_bus:
        return None
    rated_nm = [drive.rated_torque_nm for drive in robot.drives.settings.drives]
    stated_nm = [value for value in rated_nm if value is not None]
    if len(stated_nm) < len(rated_nm):
        return None
    given_nm = np.array(stated_nm)
    if calibration is not None:
        given_nm = given_nm * (calibration.gain_nm_a / calibration.nominal)
    permille: FloatArray = robot.drives.coupling.T * (1e3 / given_nm)[:, None]
    return permille


def identifier_of(robot: str) -> str:
    """A robot's name as an identifier of C, RAPID and file systems: lower case, digits, underscores."""
    name = re.sub(r"[^0-9a-z]+", "_", robot.lower()).strip("_")
    return name if name[:1].isalpha() else f"robot_{name}".rstrip("_")
