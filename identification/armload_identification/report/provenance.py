"""Source of the numbers: the recordings, the rows dropped from them, and the motion."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from armload_identification.excitation.excitation_file import parse_excitation
from armload_identification.model.payload import Provenance
from armload_identification.numerals import NO_BREAK, counted, numeral
from armload_identification.recording.recording import RecordingSource
from armload_identification.recording.run_format import EXCITATION_ATTACHMENT, LATENESS_ATTACHMENT, WAY_ROUND_ATTACHMENT
from armload_identification.signals.load_signal import LoadSignal

_LOADS: Final = ("loaded", "unloaded")


@dataclass(frozen=True)
class FileRow:
    """A recording.

    Attributes:
        role: Its use.
        name: The file's name.
        details: Format, rate and date of the run, as far as the file contains them.
        rows: Rows read and dropped, by reason.
        sha256: Hash of the file.
        lateness: How late the cycles were, if recorded.
    """

    role: str
    name: str
    details: str
    rows: str
    sha256: str
    lateness: str = ""


def file_rows(
    fitted: Sequence[RecordingSource], validating: Sequence[RecordingSource], provenance: Provenance
) -> tuple[FileRow, ...]:
    """The recordings used for the result, those for its validation, and others named in the payload file.

    Args:
        fitted: Sources of the runs of the identification: loaded, and unloaded if there is one.
        validating: Sources of the runs of the validation: loaded and unloaded.
        provenance: Provenance in the payload file.
    """
    rows = [*recording_rows("identification", fitted), *recording_rows("validation", validating)]
    used = {source.sha256 for source in (*fitted, *validating)}
    rows += [
        FileRow("named in the payload file", name, "", "", sha256)
        for name, sha256 in (*provenance.recordings_sha256.items(), *provenance.validation_sha256.items())
        if sha256 not in used
    ]
    return tuple(rows)


def recording_rows(role: str, sources: Sequence[RecordingSource]) -> list[FileRow]:
    """The recordings of a role: the loaded run and, if there is one, the unloaded run."""
    return [
        FileRow(f"{role}, {load}", source.path.name, _details(source), _rows(source), source.sha256, _lateness(source))
        for load, source in zip(_LOADS, sources, strict=False)
    ]


def motion_sentence(source: RecordingSource, signal: LoadSignal) -> str:
    """Description of the motion.

    Args:
        source: Source of the loaded run.
    """
    text = source.attachments.get(EXCITATION_ATTACHMENT)
    span = f"{numeral(signal.time_s[-1] + signal.interval_s, 1)}{NO_BREAK}s"
    if text is None:
        return f"The motion lasts {span}; its planning is not recorded."
    excitation = parse_excitation(text)
    trajectory = excitation.trajectory
    planned = (
        f"A Fourier series with {trajectory.harmonics} harmonics of {trajectory.base_frequency_hz:g}{NO_BREAK}Hz, "
        f"{excitation.periods} periods of {trajectory.period_s:g}{NO_BREAK}s"
    )
    command = excitation.design.get("command")
    return (
        (f"{planned}, designed by “{command}”." if command else f"{planned}.")
        + _slow_round(source)
        + _way_round(source)
    )


def _slow_round(source: RecordingSource) -> str:
    """Description of the slow round before the motion, if recorded."""
    run = source.run()
    lasted_s, speed_m_s = run.get("slow_round_s"), run.get("slow_round_speed_m_s")
    if not isinstance(lasted_s, float) or not isinstance(speed_m_s, float):
        return ""
    return (
        f" The preceding slow round took {numeral(lasted_s, 0)}{NO_BREAK}s; no point of the arm was planned faster "
        f"than {numeral(speed_m_s, 3)}{NO_BREAK}m/s."
    )


def _way_round(source: RecordingSource) -> str:
    """Description of a detour round an obstacle to the start of the motion, if recorded."""
    text = source.attachments.get(WAY_ROUND_ATTACHMENT)
    if text is None:
        return ""
    points = counted(len(json.loads(text)["via_points_rad"]), "point").replace(" ", NO_BREAK)
    return f" The straight path to its start was blocked: the arm went round the obstacle, via {points}."


def comparison_sentence(signal: LoadSignal) -> str:
    """Description of the comparison of the loaded with the unloaded run."""
    noise = f"The noise is from {signal.noise_source}."
    if not signal.periods[1]:
        return (
            "The torque of the payload is that of the loaded run minus that of the arm according to its calibration. "
            + noise
        )
    if signal.periodic:
        loaded, unloaded = (counted(count, "period") for count in signal.periods)
        how = f"compared phase by phase: {loaded} of the loaded and {unloaded} of the unloaded run, averaged. "
    else:
        apart = f"{numeral(abs(signal.shift_s), 3)}{NO_BREAK}s"
        how = (
            f"aligned by position, as they have no common period, with an offset of {apart} between their clocks, and "
            "not averaged. "
        )
    return (
        "The torque of the payload is that of the loaded run minus that of the unloaded one, in which the arm itself "
        f"and nearly all friction cancel. The runs were {how}{noise}"
    )


def _details(source: RecordingSource) -> str:
    """Format, rate and date, as far as the file contains them."""
    run = source.run()
    parts = [source.kind.upper()]
    if "cycle_hz" in run:
        parts.append(f"{run['cycle_hz']}{NO_BREAK}Hz")
    if "created" in run:
        parts.append(str(run["created"]))
    if source.truncated:
        parts.append("ends early")
    return ", ".join(parts)


def _lateness(source: RecordingSource) -> str:
    """How many cycles were late by how much; empty without a record of it."""
    text = source.attachments.get(LATENESS_ATTACHMENT)
    if text is None:
        return ""
    counted = json.loads(text)
    edges = [0.0, *counted["up_to_ms"]]
    bins = [
        f"{count} by {low:g} to {high:g}{NO_BREAK}ms"
        for count, low, high in zip(counted["cycles"][1:], edges[1:], [*edges[2:], counted["greatest_ms"]], strict=True)
        if count
    ]
    in_time = f"of {sum(counted['cycles'])} cycles {counted['cycles'][0]} in time (to {edges[1]:g}{NO_BREAK}ms)"
    return ", ".join([in_time, *(f"late: {text}" if k == 0 else text for k, text in enumerate(bins))])


def _rows(source: RecordingSource) -> str:
    """Rows read and dropped."""
    if not source.rows_dropped:
        return f"{source.rows_read} read, none dropped"
    reasons = ", ".join(f"{count} {reason}" for reason, count in source.reasons.items())
    return f"{source.rows_read} read, {source.rows_dropped} dropped ({reasons})"
