"""The calibration of a configured arm from its recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

from armload_controller.config.robot import Robot
from armload_controller.config.robot_runs import ArmRuns, read_runs
from armload_identification.calibration.calibrate_arm import calibrate_arm
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.extras import Extra, require_extra

_PARTS = 100
"""Steps of progress for each half: reading, then calibrating."""


def calibrate_from_files(
    robot: Robot, paths: Sequence[Path], progress: Callable[[int, int], None] | None = None
) -> ArmCalibration:
    """Calibrate an arm from files.

    Args:
        robot: The arm.
        paths: One table of runs, or recordings that state their payload.
        progress: Called with the steps done and their total.

    Raises:
        RunTableError: the table of runs is invalid.
        EstimationError: no usable run, a mounting other than entered, or runs that contradict each other.
    """
    require_extra(Extra.IDENTIFY, "calibrating an arm")

    def half(first: int) -> Callable[[int, int], None] | None:
        if progress is None:
            return None
        return lambda done, total: progress(first + _PARTS * done // total, 2 * _PARTS)

    return calibrate_from_runs(robot, read_runs(robot, paths, half(0)), half(_PARTS))


def calibrate_from_runs(
    robot: Robot, runs: ArmRuns, progress: Callable[[int, int], None] | None = None
) -> ArmCalibration:
    """Calibrate an arm from recordings in memory.

    Args:
        robot: The arm.
        runs: The recordings with their payloads, and those that could not be read.
        progress: Called with the steps done and their total.

    Raises:
        EstimationError: no usable run, a mounting other than entered, or runs that contradict each other.
    """
    require_extra(Extra.IDENTIFY, "calibrating an arm")
    return calibrate_arm(
        runs.runs,
        runs.weighed,
        robot.chain,
        robot.transmission,
        robot=robot.name,
        armload_version=version("armload"),
        configuration_sha256=robot.sha256,
        left_out=runs.left_out,
        progress=progress,
    )
