"""The stored result of a recording: one flat row, whatever the outcome.

Units are in the names; a number that is not determined is null. Lists are by joint, from the base.
"""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from enum import StrEnum
from typing import Any, Final

import numpy as np

from armload_controller.fleet.arm_runs import IN_FUTURE
from armload_controller.fleet.job import Job
from armload_controller.fleet.job_table import RECORDINGS
from armload_identification.model.payload import PARAMETER_NAMES
from armload_identification.recording.recording import Recording
from armload_identification.recording.run_start import run_start
from armload_identification.results.findings import Findings
from armload_identification.results.findings_document import json_number, json_numbers

Row = dict[str, Any]

PARAMETER_UNITS: Final = ("kg", "m", "m", "m", *("kg_m2",) * 6)
_JOINT_COLUMNS: Final = (
    "residual_rms_nm",
    "noise_nm",
    "gain_change",
    "gain_half_width_95",
    "friction_nm",
    "friction_speed_rad_s",
)
_JOB_COLUMNS: Final = ("key", "arm", "payload", "robot", *RECORDINGS, "calibration")
_ORIGIN_COLUMNS: Final = (
    *("validation_outcome", "verdict"),
    *(f"{name}_sha256" for name in ("loaded", "unloaded", "robot", "kinematics", "calibration")),
    *("armload_version", "worker"),
)
_LARGEST_CLOCK_DIFFERENCE: Final = timedelta(days=1)


class RowOutcome(StrEnum):
    """Outcome of a recording."""

    IDENTIFIED = "identified"
    REFUSED = "refused"
    FAILED = "failed"


def value_columns() -> tuple[tuple[str, str, str], ...]:
    """Column names of value, lower and upper end of the 95 % interval, for each of the ten parameters."""
    units = zip(PARAMETER_NAMES, PARAMETER_UNITS, strict=True)
    return tuple((f"{name}_{unit}", f"{name}_low_{unit}", f"{name}_high_{unit}") for name, unit in units)


def column_kinds() -> dict[str, str]:
    """Every column in order with its kind: text, number, count, truth, time, or a list of numbers or texts."""
    kinds = dict.fromkeys(_JOB_COLUMNS, "text")
    kinds |= {"known_mass_kg": "number", "recorded_utc": "time", "recorded_by": "text", "identified_utc": "time"}
    kinds |= {"outcome": "text", "error": "text", "robot_name": "text", "joint_names": "texts"}
    kinds |= {name: "number" for names in value_columns() for name in names}
    kinds |= {"model": "numbers", "feedforward_ready": "truth", "condition_number": "number", "notes": "texts"}
    kinds |= dict.fromkeys(_JOINT_COLUMNS, "numbers")
    kinds |= {"rows_read": "count", "rows_dropped": "count", "cpu_s": "number", "wall_s": "number"}
    return kinds | dict.fromkeys(_ORIGIN_COLUMNS, "text")


def empty_row(job: Job, armload_version: str) -> Row:
    """A row with only the data of the job, and the outcome "failed".

    Args:
        armload_version: Version of the program.
    """
    row: Row = dict.fromkeys(column_kinds())
    row |= {"key": job.key, "arm": job.arm, "payload": job.payload, "robot": job.robot, "calibration": job.calibration}
    row |= dict(job.recordings)
    row |= {"known_mass_kg": job.mass_kg, "armload_version": armload_version}
    now = datetime.now(UTC)
    undated = job.modified is None or job.modified > now + _LARGEST_CLOCK_DIFFERENCE
    recorded = (now, "identification") if undated else (job.modified, "file")
    row |= {"recorded_utc": recorded[0], "recorded_by": recorded[1], "identified_utc": now}
    return row | {"outcome": RowOutcome.FAILED.value}


def recorded_fields(recording: Recording, identified: datetime) -> Row:
    """Time of a recording, if it states a possible one, and its number of rows.

    Args:
        recording: The loaded recording.
        identified: Now: a later time is from a wrong clock, and would make every other arm's recordings old.
    """
    row: Row = {"rows_read": recording.source.rows_read, "rows_dropped": recording.source.rows_dropped}
    row |= {"loaded_sha256": recording.source.sha256}
    start = run_start(recording, identified + _LARGEST_CLOCK_DIFFERENCE)
    if start is None:
        return row if run_start(recording) is None else row | {"recorded_by": IN_FUTURE}
    moment, by = start
    return row | {"recorded_utc": moment, "recorded_by": by}


def findings_fields(findings: Findings) -> Row:
    """The fields of an identification.

    Args:
        findings: Findings from recordings.
    """
    payload, found = findings.payload, findings.identification
    row: Row = {"outcome": RowOutcome.IDENTIFIED.value, "robot_name": findings.arm.name}
    row |= {"joint_names": list(findings.arm.joint_names)}
    for i, names in enumerate(value_columns()):
        known = bool(payload.determined[i])
        values = (payload.values[i], *payload.interval_95[i])
        row |= {name: json_number(value) if known else None for name, value in zip(names, values, strict=True)}
    row |= {"model": payload.model.values.tolist(), "feedforward_ready": bool(payload.feedforward_ready)}
    row |= {"residual_rms_nm": json_numbers(payload.residual_rms_nm), "noise_nm": json_numbers(payload.noise_nm)}
    row |= {"validation_outcome": None if findings.outcome is None else findings.outcome.value}
    row |= {"verdict": findings.verdict.title, "robot_sha256": payload.provenance.configuration_sha256}
    row |= {"kinematics_sha256": payload.provenance.kinematics_sha256}
    row |= {"calibration_sha256": next(iter(payload.provenance.calibration_sha256.values()), None)}
    if found is None:
        return row
    if found.gains is not None:
        row |= {"gain_change": json_numbers(np.expm1(found.gains.log_gain))}
        row |= {"gain_half_width_95": json_numbers(np.exp(found.gains.log_gain) * found.gains.half_width_95)}
    row |= {"friction_nm": json_numbers(found.arm_friction.torque_nm)}
    row |= {"friction_speed_rad_s": json_numbers(found.arm_friction.speed_rad_s)}
    row |= {"condition_number": json_number(found.plain.condition_number), "notes": list(found.notes)}
    unloaded = found.sources[1:]
    return row | {"unloaded_sha256": unloaded[0].sha256 if unloaded else None}
