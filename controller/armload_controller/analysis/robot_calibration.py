"""The calibration of a configured arm from its recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version

from armload_controller.config.objects_or_paths import FilePath, arm_of, several_runs
from armload_controller.config.robot_recordings import MeasuredArm
from armload_controller.config.robot_runs import read_runs
from armload_identification.calibration.calibrate_arm import calibrate_arm
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.calibration.mounted_runs import ArmRuns
from armload_identification.extras import Extra, require_extra
from armload_identification.model.payload import Provenance
from armload_identification.recording.recording import Recording
from armload_identification.results.calibrated_arm import CalibratedArm

_PARTS = 100
"""Steps of progress for each half: reading, then calibrating."""


def calibrate(
    robot: MeasuredArm | FilePath,
    runs: Recording | FilePath | Sequence[Recording | FilePath],
    *,
    progress: Callable[[int, int], None] | None = None,
) -> CalibratedArm:
    """Calibrate an arm from all its runs: gains, body and friction, with intervals.

    Args:
        robot: The arm: a robot or a `UrdfArm`, the name of a shipped robot, or the path of its TOML or URDF.
        runs: A table of runs (CSV with the columns recording, mounting, mass_kg, payload), or recordings that state
            what the arm carried, as armload's own do.
        progress: Called with the steps done and their total.

    Raises:
        RunTableError: the table of runs is invalid, or a recording does not state what the arm carried.
        EstimationError: no usable run, a mounting other than entered, or runs that contradict each other.

    Examples:
        >>> import armload
        >>> run = "runs/today/{}_identification.mcap".format
        >>> arm = armload.calibrate("er50", [run("unloaded"), run("loaded")])
        >>> isinstance(arm, armload.CalibratedArm)
        True
        >>> found = armload.identify("er50", run("loaded"), calibration=arm)
        >>> arm.save("arm.calibration.toml")
        >>> armload.read_calibration("arm.calibration.toml").robot
        'er50'
    """
    require_extra(Extra.IDENTIFY, "calibrating an arm")
    arm = arm_of(robot)

    def half(first: int) -> Callable[[int, int], None] | None:
        if progress is None:
            return None
        return lambda done, total: progress(first + _PARTS * done // total, 2 * _PARTS)

    result = calibrate_from_runs(arm, read_runs(arm, several_runs(runs), half(0)), half(_PARTS))
    return CalibratedArm(arm.description, tuple(arm.joint_names), result)


def calibrate_from_runs(
    robot: MeasuredArm, runs: ArmRuns, progress: Callable[[int, int], None] | None = None
) -> ArmCalibration:
    """Calibrate an arm from recordings in memory.

    Args:
        runs: The recordings with their payloads, and those that could not be read.
        progress: Called with the steps done and their total.

    Raises:
        EstimationError: no usable run, a mounting other than entered, or runs that contradict each other.
    """
    made = Provenance(version("armload"), robot.sha256, {})
    return calibrate_arm(runs, robot.chain, robot.transmission, robot=robot.name, made=made, progress=progress)
