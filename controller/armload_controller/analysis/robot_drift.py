"""The drift of a configured arm over its recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from armload_controller.analysis.arm_in_use import Calibration, arm_in_use
from armload_controller.config.objects_or_paths import FilePath, arm_of, several_runs
from armload_controller.config.robot_recordings import MeasuredArm
from armload_controller.config.robot_runs import UNLOADED, listed_runs, of_usable
from armload_identification.calibration.run_health import RunHealth, run_health
from armload_identification.files.run_table import TableRow
from armload_identification.identification_errors import EstimationError
from armload_identification.pipeline.arm_drift import arm_drift
from armload_identification.recording.recording import Recording
from armload_identification.results.arm_history import ArmHistory


def drift(
    robot: MeasuredArm | FilePath,
    runs: Recording | FilePath | Sequence[Recording | FilePath],
    *,
    calibration: Calibration | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> ArmHistory:
    """Compare an arm's runs with its calibration, one after the other.

    Args:
        robot: The arm: a robot or a `UrdfArm`, the name of a shipped robot, or the path of its TOML or URDF.
        runs: Recordings of any motions, or one table of runs. A payload that is not named in the table, or is unknown
            to the calibration, is estimated with the run.
        calibration: Calibration of the arm, or its file; if not given, the one that the robot's file names.
        progress: Called with the number of recordings read and their total.

    Raises:
        EstimationError: the arm is not calibrated, or no run can be used.
        RunTableError: the table of runs is invalid, or is given together with recordings.

    Examples:
        >>> import armload
        >>> runs = [f"runs/today/{load}_identification.mcap" for load in ("unloaded", "loaded")]
        >>> armload.drift("er50", runs, calibration=armload.calibrate("er50", runs)).drift.out_of_date
        False
    """
    arm = arm_of(robot)
    used = arm_in_use(arm, calibration)
    known = used.calibrated("comparing runs requires the arm's calibration")
    rows, from_table = listed_runs(several_runs(runs))

    def judged(run: Recording, row: TableRow) -> RunHealth:
        unloaded = run.source.run().get("load") == UNLOADED
        mounting = row.mounting if from_table else "" if unloaded else None
        return run_health(run, known, arm.chain, arm.transmission, mounting=mounting, recorded=row.recorded)

    health, left_out = of_usable(arm, rows, judged, progress)
    if not health:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in left_out)
        raise EstimationError(f"no recording can be used ({reasons})")
    return ArmHistory(
        robot=arm.name,
        description=arm.description,
        joint_names=tuple(arm.joint_names),
        calibration=known,
        calibration_name=next(iter(used.calibration_sha256)),
        drift=arm_drift(known, health),
        left_out=left_out,
    )
