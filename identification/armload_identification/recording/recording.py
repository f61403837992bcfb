"""Recordings: the one type that identification sees, whatever the source, and the format armload writes.

The format: one MCAP file per run, one channel `TOPIC` with a JSON message per cycle after `MESSAGE_SCHEMA`,
log time = `time_s` in nanoseconds, and the attachments named here. `armload_controller.cycle.run_recorder` writes it,
`read_mcap` reads it. Attachments should be written first, so that they survive a crash.

Time stamps are used as they are; no interval is ever assumed. Rows that cannot be right are left out and
counted by reason in `RecordingSource.reasons`, never silently.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification.excitation.excitation_file import parse_excitation
from armload_identification.excitation.fourier import Excitation
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.csv_reader import read_columns
from armload_identification.recording.garbage_rows import plausible_rows, refuse_degrees, refuse_mixed_units
from armload_identification.recording.mcap_reader import MAGIC, read_topic

TOPIC: Final = "/joints"
SCHEMA_NAME: Final = "armload.Joints"
SEGMENTS: Final = ("approach", "slow", "ramp_up", "periods", "ramp_down", "return", "hold")
CONFIGURATION_ATTACHMENT: Final = "configuration.toml"
EXCITATION_ATTACHMENT: Final = "excitation.toml"
RUN_ATTACHMENT: Final = "run.json"
"""JSON object: armload_version, robot, load ("unloaded" or "loaded"), cycle_hz, created."""

_NUMBERS: Final[dict[str, Any]] = {"type": "array", "items": {"type": "number"}}
MESSAGE_SCHEMA: Final[dict[str, Any]] = {
    "title": SCHEMA_NAME,
    "description": "One cycle of all joints, units in the names; current_a is per motor, the rest per joint.",
    "type": "object",
    "properties": {
        "cycle": {"type": "integer", "description": "SYNC number since connecting"},
        "time_s": {"type": "number", "description": "time stamp of that SYNC"},
        "phase_s": {
            "type": ["number", "null"],
            "description": "phase along the excitation; null outside the streamed whole periods",
        },
        "segment": {"type": "string", "enum": list(SEGMENTS)},
        "command_position_rad": {**_NUMBERS, "description": "target sent with this SYNC"},
        "position_rad": {**_NUMBERS, "description": "measured at this SYNC"},
        "velocity_rad_s": {**_NUMBERS, "description": "absent where the drives do not tell"},
        "current_a": {**_NUMBERS, "description": "motor current; absent on arms that tell torque"},
        "torque_nm": {**_NUMBERS, "description": "joint torque; absent on arms that tell current"},
        "torque_offset_nm": {**_NUMBERS, "description": "joint torque added in the servo loop (60B2)"},
        "statusword": {"type": "array", "items": {"type": "integer"}},
        "missing": {
            "type": "array",
            "items": {"type": "boolean"},
            "description": "true where this cycle's feedback did not arrive and the last is repeated",
        },
    },
    "required": ["cycle", "time_s", "phase_s", "segment", "position_rad", "missing"],
}

_SHORTEST_ROWS: Final = 20


@dataclass(frozen=True)
class CsvColumns:
    """Which columns of a CSV file hold what: numbers from zero, or names of a header line.

    Attributes:
        time: Column of the time stamp in s.
        position: One column per joint, rad.
        velocity: One per joint, rad/s; None where the log has none.
        current: One per joint, MOTOR current in A; None where the log has torque.
        torque: One per joint, JOINT torque in N m; None where the log has current.
    """

    time: int | str
    position: Sequence[int | str]
    velocity: Sequence[int | str] | None = None
    current: Sequence[int | str] | None = None
    torque: Sequence[int | str] | None = None

    def groups(self) -> dict[str, list[int | str]]:
        """The columns by the name of the quantity, those that are there."""
        groups: dict[str, list[int | str]] = {"time_s": [self.time], "position_rad": list(self.position)}
        for name, columns in (
            ("velocity_rad_s", self.velocity),
            ("current_a", self.current),
            ("torque_nm", self.torque),
        ):
            if columns is not None:
                groups[name] = list(columns)
        return groups


@dataclass(frozen=True)
class RecordingSource:
    """Where a recording came from and what was left out of it.

    Attributes:
        path: The file.
        sha256: Hash of the file.
        kind: "mcap" or "csv".
        rows_read: Rows found, good or bad.
        rows_dropped: Rows left out.
        reasons: Rows left out, by reason.
        attachments: Text of the attachments by name.
        truncated: The file ends in the middle of a record; what came before was read.
    """

    path: Path
    sha256: str
    kind: str
    rows_read: int
    rows_dropped: int
    reasons: Mapping[str, int]
    attachments: Mapping[str, str] = field(default_factory=dict)
    truncated: bool = False

    def run(self) -> dict[str, Any]:
        """The `run.json` attachment; empty where there is none.

        Raises:
            RecordingError: it is not a JSON object.
        """
        try:
            run = json.loads(self.attachments.get(RUN_ATTACHMENT, "{}"))
        except ValueError as error:
            run = error
        if not isinstance(run, dict):
            raise RecordingError(
                f"{self.path}: the attachment {RUN_ATTACHMENT} is damaged, expected a JSON object. "
                "Copy the file again from where it was recorded."
            )
        return run


@dataclass(frozen=True, eq=False)
class Recording:
    """One run of an arm of n joints as N samples in SI units.

    Attributes:
        time_s: (N,) strictly increasing time stamps, irregular as they were.
        position_rad: (N, n) measured joint positions.
        velocity_rad_s: (N, n) measured joint velocities, or None.
        current_a: (N, n) measured MOTOR currents, or None.
        torque_nm: (N, n) measured JOINT torques, or None; there is current or torque.
        phase_s: (N,) phase along the excitation, NaN outside the streamed whole periods; None where the run
            has no known excitation.
        excitation: The trajectory that was streamed, or None.
        source: Where it came from.
    """

    time_s: FloatArray
    position_rad: FloatArray
    velocity_rad_s: FloatArray | None
    current_a: FloatArray | None
    torque_nm: FloatArray | None
    phase_s: FloatArray | None
    excitation: Excitation | None
    source: RecordingSource

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.position_rad.shape[1])

    def rows(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> Recording:
        """The same run with some of its rows.

        Args:
            chosen: (N,) True where a row is kept, or indices in order.
        """
        names = ("time_s", "position_rad", "velocity_rad_s", "current_a", "torque_nm", "phase_s")
        kept = {name: values[chosen] for name in names if (values := getattr(self, name)) is not None}
        return replace(self, **kept)


def read_recording(path: Path, columns: CsvColumns | None = None) -> Recording:
    """Read a recording, MCAP by its first bytes, else CSV through the column map.

    Args:
        path: The file.
        columns: Columns of a CSV file.

    Returns:
        The recording.

    Raises:
        RecordingError: the file is missing, empty, of another kind, or holds nothing usable.
    """
    data = _bytes_of(path)
    if data.startswith(MAGIC):
        return read_mcap(path)
    if columns is None:
        raise RecordingError(
            f"{path}: not an MCAP file, and the configuration has no column map for CSV files. "
            "Give a recording made by armload, or add a [log] table to the robot's configuration."
        )
    return read_csv(path, columns)


def read_mcap(path: Path) -> Recording:
    """Read a recording in armload's own format.

    Args:
        path: The MCAP file; it may be cut short.

    Returns:
        The recording; cycles in which a joint's feedback was missing are left out and counted.

    Raises:
        RecordingError: no MCAP file, or nothing usable in it.
    """
    data = _bytes_of(path)
    arrays = ["position_rad", "velocity_rad_s", "current_a", "torque_nm", "missing"]
    content = read_topic(path, data, TOPIC, ["time_s", "phase_s"], arrays)
    reasons: dict[str, int] = {}
    if content.messages_malformed:
        reasons["malformed message"] = content.messages_malformed
    values = content.values
    rows = values["time_s"].size + content.messages_malformed
    missing = (values["missing"] > 0.5).any(axis=1)
    if missing.any():
        reasons["feedback missing"] = int(missing.sum())
    quantities = {
        name: values[name][~missing]
        for name in arrays[:-1]
        if name == "position_rad" or not np.isnan(values[name]).all()
    }
    quantities["time_s"] = values["time_s"][~missing, None]
    text = content.attachments.get(EXCITATION_ATTACHMENT)
    return _assemble(
        path,
        data=data,
        kind="mcap",
        quantities=quantities,
        rows_read=rows,
        reasons=reasons,
        phase_s=values["phase_s"][~missing] if text is not None else None,
        excitation=parse_excitation(text, f"{path}, attachment {EXCITATION_ATTACHMENT}") if text is not None else None,
        attachments=content.attachments,
        truncated=content.truncated,
    )


def read_csv(path: Path, columns: CsvColumns) -> Recording:
    """Read a foreign log.

    Args:
        path: The CSV file, with or without a header line.
        columns: What stands where.

    Returns:
        The recording, without phase and excitation.

    Raises:
        RecordingError: the file is empty, the columns do not fit, or nothing usable is in it.
    """
    data = _bytes_of(path)
    content = read_columns(path, columns.groups())
    return _assemble(
        path,
        data=data,
        kind="csv",
        quantities=dict(content.values),
        rows_read=content.rows_read,
        reasons=dict(content.reasons),
        truncated=False,
    )


def check_joints(recording: Recording, n: int) -> None:
    """Refuse a recording that was made on another arm.

    Args:
        recording: The recording.
        n: Joints of the arm.

    Raises:
        RecordingError: naming file, found and expected number of joints.
    """
    if recording.n != n:
        raise RecordingError(
            f"{recording.source.path}: the recording has {recording.n} joints, the robot has {n}. "
            "Give the recording and the configuration of the same arm."
        )


def hashes_by_name(sources: Sequence[RecordingSource]) -> dict[str, str]:
    """Hash by file name, with the folder in front where two files have one name.

    Args:
        sources: Of the recordings.
    """
    if len({source.path.name for source in sources}) == len(sources):
        return {source.path.name: source.sha256 for source in sources}
    return {f"{source.path.parent.name}/{source.path.name}": source.sha256 for source in sources}


def _bytes_of(path: Path) -> bytes:
    try:
        data = path.read_bytes()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror}). Check the path.") from error
    if not data.strip():
        raise RecordingError(f"{path}: the file is empty. Give a recording with rows of numbers.")
    return data


def _assemble(
    path: Path,
    *,
    data: bytes,
    kind: str,
    quantities: dict[str, FloatArray],
    rows_read: int,
    reasons: dict[str, int],
    phase_s: FloatArray | None = None,
    excitation: Excitation | None = None,
    attachments: Mapping[str, str] | None = None,
    truncated: bool,
) -> Recording:
    """Clean the rows and make the recording."""
    if "current_a" not in quantities and "torque_nm" not in quantities:
        raise RecordingError(
            f"{path}: the recording has neither motor current nor joint torque. "
            "Nothing can be identified without one of them; record 6078 or 6077, or correct the column map."
        )
    refuse_degrees(path, quantities["position_rad"])
    kept = plausible_rows(quantities, reasons)
    if kept.size < _SHORTEST_ROWS:
        listed = ", ".join(f"{count} {reason}" for reason, count in reasons.items()) or "no row dropped"
        raise RecordingError(
            f"{path}: {kept.size} usable rows of {rows_read} ({listed}), expected {_SHORTEST_ROWS} or more. "
            "Check that the file is complete and that the columns are the right ones."
        )
    source = RecordingSource(
        path=path,
        sha256=hashlib.sha256(data).hexdigest(),
        kind=kind,
        rows_read=rows_read,
        rows_dropped=sum(reasons.values()),
        reasons=dict(reasons),
        attachments=dict(attachments or {}),
        truncated=truncated,
    )
    recording = Recording(
        time_s=quantities["time_s"][kept, 0],
        position_rad=quantities["position_rad"][kept],
        velocity_rad_s=quantities["velocity_rad_s"][kept] if "velocity_rad_s" in quantities else None,
        current_a=quantities["current_a"][kept] if "current_a" in quantities else None,
        torque_nm=quantities["torque_nm"][kept] if "torque_nm" in quantities else None,
        phase_s=phase_s[kept] if phase_s is not None else None,
        excitation=excitation,
        source=source,
    )
    if recording.velocity_rad_s is not None:
        refuse_mixed_units(path, recording.time_s, recording.position_rad, recording.velocity_rad_s)
    return recording
