"""What follows from the recordings of a commissioning: payload, verdict, report and a calibration, as files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path

from armload_controller.analysis.robot_calibration import calibrate_from_runs
from armload_controller.analysis.robot_identification import identify
from armload_controller.config.objects_or_paths import FilePath, robot_of
from armload_controller.config.robot import Robot
from armload_controller.config.robot_runs import masses_otherwise_recorded, runs_of_commissioning
from armload_controller.control_errors import CommissioningError, UnsafeBus
from armload_controller.session.arm_access import simulated_arm
from armload_controller.session.commissioning import ROLES, CommissioningPlan, missing_roles, read_pair, record_half
from armload_controller.session.folder_claim import claimed_folder
from armload_controller.session.run_session import no_operator
from armload_controller.session.session_load import SessionLoad
from armload_identification.argument_types import path_of
from armload_identification.files.calibration_file import write_calibration
from armload_identification.identification_errors import EstimationError, RunTableError
from armload_identification.recording.recording import Recording
from armload_identification.results.findings import Findings
from armload_identification.verdict.tolerance import Tolerance

PAYLOAD_NAME, REPORT_NAME, CALIBRATION_NAME = "payload.toml", "report.html", "arm.calibration.toml"


def commission(
    robot: Robot | FilePath,
    output: FilePath,
    *,
    mounted: str | None = None,
    mass_kg: float | None = None,
    calibration: FilePath | None = None,
    tolerance: Tolerance | None = None,
) -> Findings:
    """Commission a simulated arm: run it empty and loaded, identify the payload, validate it, write a report.

    Only an arm that is simulated in this process is moved. For a real one there is the command `armload commission`,
    with an operator at the terminal.

    Args:
        robot: The arm: a robot, the name of a shipped robot, or the path of its TOML.
        output: Folder for recordings, payload.toml, report.html and arm.calibration.toml; runs that it contains are not
            repeated.
        mounted: Payload on the flange, as named under simulation.payloads; the configured one if not given.
        mass_kg: Mass of the payload, if it is to count as weighed.
        calibration: Calibration file of the arm; if not given, the one that the robot's file names.
        tolerance: Permitted error of the payload; 2 % of its mass and 10 mm if not given.

    Raises:
        UnsafeBus: the arm is not simulated in this process.
        CommissioningError: the folder is in use, or contains a finished commissioning.
        ControlError: the arm could not be run.

    Examples:
        >>> import armload
        >>> result = armload.commission("er50", "runs/today")
        >>> result.verdict.title
        'Repeatable within the tolerance'
    """
    arm = robot_of(robot)
    if not arm.bus.in_virtual_time:
        raise UnsafeBus(
            f"{arm.name} is not simulated in this process, but on {arm.bus.interface}: a real arm is commissioned by "
            "the command `armload commission`, with an operator at the terminal"
        )
    if mounted is not None:
        arm = arm.with_simulated_payload(mounted)
    directory = path_of("output", output)
    plan = CommissioningPlan(directory, mass_kg, calibration)
    directory.mkdir(parents=True, exist_ok=True)
    with claimed_folder(directory):
        if (directory / REPORT_NAME).exists():
            raise CommissioningError(f"{directory} contains a finished commissioning: choose another folder")
        for load in SessionLoad:
            if missing_roles(directory, load):
                record_half(arm, load, partial(simulated_arm, arm), no_operator(), plan)
        return evaluate(arm, plan, tolerance)[0]


def evaluate(
    arm: Robot, plan: CommissioningPlan, tolerance: Tolerance | None = None, created: datetime | None = None
) -> tuple[Findings, list[str]]:
    """Identify from the first pair, validate on the second, calibrate from all, and write the results.

    The report is written last: a folder that contains one is complete.

    Args:
        plan: Where the recordings are, and what is known of arm and payload.
        tolerance: Permitted error of the payload; the default if not given.
        created: Date and time on the report; now if not given.

    Returns:
        The findings, and remarks on the calibration, one line each.
    """
    directory = plan.directory
    first, second = (read_pair(arm, directory, role) for role in ROLES)
    findings = identify(
        arm,
        *first,
        validation=second,
        calibration=plan.calibration,
        known=plan.known,
        tolerance=tolerance,
        drift=plan.drift,
    )
    truth = arm.simulation.payload(arm.simulation.payload_name) if arm.bus.in_virtual_time else None
    findings = replace(findings, truth=truth).with_validation_in_provenance()
    findings.save(directory / PAYLOAD_NAME)
    remarks = _calibrate(arm, directory, (*first[::-1], *second[::-1]), plan.mass_kg)
    findings.report(directory / REPORT_NAME, created or datetime.now(UTC))
    return findings, remarks


def _calibrate(arm: Robot, directory: Path, runs: Sequence[Recording], mass_kg: float | None) -> list[str]:
    """Calibrate the arm from the four runs, for the next commissioning, if they suffice; returns lines to show."""
    path = directory / CALIBRATION_NAME
    try:
        result = calibrate_from_runs(arm, runs_of_commissioning(runs, mass_kg))
    except (EstimationError, RunTableError) as problem:
        return [f"warning: no calibration was written: {problem}"]
    write_calibration(path, result)
    notes = [*(f"left out: {name}: {reason}" for name, reason in result.left_out), *result.warnings]
    for recorded_kg in masses_otherwise_recorded(runs, mass_kg):
        notes.append(
            f"the recordings state {recorded_kg:g} kg, which was not used. `armload calibrate` would use it: give it a "
            "table of runs with the correct mass_kg."
        )
    notes.append(f"{path}, for the next payload: --calibration {path}")
    return [f"calibration: {text}" for text in notes]
