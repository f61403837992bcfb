"""Converts the rows of a fleet to the quantities tracked for every arm."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from armload_controller.control_errors import FleetError
from armload_controller.fleet.arm_runs import ArmRun, Quantity, QuantityKind
from armload_controller.fleet.recording_row import Row, RowOutcome, value_columns
from armload_controller.fleet.row_store import latest_rows, precedence
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH

_PAYLOAD_KINDS: Final = (QuantityKind.MASS, QuantityKind.CENTER_X, QuantityKind.CENTER_Y, QuantityKind.CENTER_Z)
_COLUMNS: Final = (
    *(name for names in value_columns()[: len(_PAYLOAD_KINDS)] for name in names),
    *("payload", "robot", "robot_name", "outcome", "error", "joint_names", "loaded_sha256", "recorded_by"),
    *("gain_change", "gain_half_width_95", "friction_nm", "residual_rms_nm", "noise_nm"),
)


def runs_of(folder: Path) -> list[ArmRun]:
    """The recordings of a fleet, each once, with its latest identification.

    Args:
        folder: Folder of the rows.

    Raises:
        FleetError: there are no rows, or a file cannot be read.
    """
    rows = latest_rows(folder, _COLUMNS)
    if not rows:
        raise FleetError(
            f"{folder}: no rows there; `armload fleet identify JOBS --output {folder}` creates them, and writes them "
            "in parts while it runs"
        )
    models = {row["arm"]: row["robot_name"] for row in rows if row["robot_name"]}  # a refused recording may lack it
    return [
        ArmRun(
            arm=row["arm"],
            model=row["robot_name"] or models.get(row["arm"]) or row["robot"],
            recorded=row["recorded_utc"],
            recording=row["loaded"],
            problem="" if row["outcome"] == RowOutcome.IDENTIFIED else row["error"] or row["outcome"],
            figures=dict(_figures(row)),
            dated_by=row["recorded_by"] or "identification",
        )
        for row in _each_once(rows)
    ]


def _each_once(rows: list[Row]) -> list[Row]:
    """The rows without earlier ones of the same content: a recording that was moved or copied has one for each path.

    The spread between runs is taken from successive runs, so with every recording twice it would be zero.
    """
    latest: dict[tuple[str, str], Row] = {}
    for row in sorted(rows, key=precedence):
        latest[row["arm"], row["loaded_sha256"] or row["loaded"]] = row
    return [row for row in rows if latest[row["arm"], row["loaded_sha256"] or row["loaded"]] is row]


def _figures(row: Row) -> Iterator[tuple[Quantity, tuple[float, float]]]:
    """Value and standard deviation of everything that is determined."""
    for kind, (value, low, high) in zip(_PAYLOAD_KINDS, value_columns(), strict=False):
        if row[value] is not None:
            yield Quantity(kind, row["payload"]), (row[value], 0.5 * (row[high] - row[low]) / NORMAL_HALF_WIDTH)
    for joint, name in enumerate(row["joint_names"] or ()):
        gain, width = _of_joint(row, "gain_change", joint), _of_joint(row, "gain_half_width_95", joint)
        if gain is not None and width is not None:
            yield Quantity(QuantityKind.GAIN, name), (gain, width / NORMAL_HALF_WIDTH)
        friction = _of_joint(row, "friction_nm", joint)
        if friction is not None:
            yield Quantity(QuantityKind.FRICTION, name), (friction, 0.0)
        residual, noise = _of_joint(row, "residual_rms_nm", joint), _of_joint(row, "noise_nm", joint)
        if residual is not None and noise:
            yield Quantity(QuantityKind.RESIDUAL, name), (residual / noise, 0.0)


def _of_joint(row: Row, column: str, joint: int) -> float | None:
    """A joint's number; None if there is none."""
    values = row[column]
    value = None if values is None else values[joint]
    return None if value is None or not math.isfinite(value) else float(value)
