"""Content of the report of an arm's drift, without its layout: the arm, its calibration, and the compared runs."""

from __future__ import annotations

from dataclasses import dataclass

from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.pipeline.arm_drift import ArmDrift


@dataclass(frozen=True, eq=False)
class ComparedRuns:
    """Runs of an arm that were compared with its calibration.

    Attributes:
        robot: Name of the arm.
        description: Its description, in one line.
        calibration: The calibration with which the runs were compared.
        calibration_name: Its file.
        drift: The result of the comparison.
        left_out: Name and reason of the runs that could not be used.
    """

    robot: str
    description: str
    joint_names: tuple[str, ...]
    calibration: ArmCalibration
    calibration_name: str
    drift: ArmDrift
    left_out: tuple[tuple[str, str], ...]

    @property
    def advice(self) -> str:
        """Recommended action, in one or two sentences."""
        if self.drift.out_of_date:
            return "Find out what changed on the arm, and calibrate it again from runs since then."
        if any(not found.alone for found in self.drift.findings):
            return (
                "The calibration is still valid: friction is fitted with every payload. Look for new grease, a "
                "dragging brake or wear."
            )
        if self.drift.findings:
            return (
                "Single runs are off: an impact, a cold arm, or a payload other than stated. The calibration is still "
                "valid."
            )
        return "The calibration is still valid."
