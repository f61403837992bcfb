"""The drift of a configured arm over its recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

from armload_controller.analysis.arm_in_use import FilePath, arm_in_use
from armload_controller.config.robot import Robot
from armload_controller.config.robot_recordings import read_of
from armload_controller.config.robot_runs import UNLOADED, listed_runs
from armload_controller.control_errors import CommissioningError
from armload_identification.calibration.run_health import RunHealth, run_health
from armload_identification.identification_errors import EstimationError, IdentificationError
from armload_identification.pipeline.arm_drift import arm_drift
from armload_identification.results.arm_history import ArmHistory


def drift(
    robot: Robot,
    paths: Sequence[Path],
    *,
    calibration: FilePath | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> ArmHistory:
    """Compare an arm's runs with its calibration, one after the other.

    Args:
        robot: The arm.
        paths: Recordings of any motions, or one table of runs. A payload that is not named in the table, or is unknown
            to the calibration, is estimated with the run.
        calibration: Calibration file of `armload calibrate`; if not given, the one that the robot's file names.
        progress: Called with the number of recordings read and their total.

    Raises:
        EstimationError: the arm is not calibrated, or no run can be used.
        RunTableError: the table of runs is invalid, or is given together with recordings.
    """
    used = arm_in_use(robot, calibration)
    known, _ = used.calibrated("comparing runs requires the arm's calibration")
    rows, from_table = listed_runs(paths)
    health: list[RunHealth] = []
    left_out: list[tuple[str, str]] = []
    for done, row in enumerate(rows, 1):
        name = row.recording.name
        try:
            run = read_of(robot, row.recording)
            unloaded = run.source.run().get("load") == UNLOADED
            mounting = row.mounting if from_table else "" if unloaded else None
            arm = (known, robot.chain, robot.transmission)
            health.append(run_health(run, *arm, name=name, mounting=mounting, recorded=row.recorded))
        except (IdentificationError, CommissioningError) as problem:
            left_out.append((name, str(problem).removeprefix(f"{row.recording}: ")))
        if progress is not None:
            progress(done, len(rows))
    if not health:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in left_out)
        raise EstimationError(f"no recording can be used ({reasons})")
    return ArmHistory(
        robot=robot.name,
        description=robot.description,
        joint_names=robot.joint_names,
        calibration=known,
        calibration_name=next(iter(used.calibration_sha256)),
        drift=arm_drift(known, health),
        left_out=tuple(left_out),
        armload_version=version("armload"),
    )
