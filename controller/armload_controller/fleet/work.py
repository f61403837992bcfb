"""A worker's processing of a job: copy if necessary, read, identify, and return a row in every case."""

from __future__ import annotations

import os
import socket
import time
from contextlib import ExitStack
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path
from traceback import extract_tb

from armload_controller.analysis.robot_payload import identify
from armload_controller.config.robot import Robot, load_robot, shipped_robots
from armload_controller.config.robot_recordings import read_of
from armload_controller.control_errors import ControlError, FleetError
from armload_controller.fleet.job import Job
from armload_controller.fleet.recording_row import Row, RowOutcome, empty_row, findings_fields, recorded_fields
from armload_controller.fleet.remote_files import local_copy
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.identification_errors import IdentificationError

_ROBOTS = 64
"""Number of robots that a worker caches: reading one takes a fifth as long as identifying a pair."""


def run_job(job: Job) -> Row:
    """Identify the payload of a recording.

    Args:
        job: The recording and the related inputs.

    Returns:
        A row. Its outcome is "refused" if armload refuses the files, which would be refused again. Any other problem,
        such as a server that does not answer or a file that this machine cannot read, is "failed", and the job is
        repeated in the next run of the fleet.
    """
    started, cpu_s = time.monotonic(), time.process_time()
    row = empty_row(job, version("armload"))
    copies: dict[str, str] = {}
    try:
        row |= _identified(job, row, copies)
    except (IdentificationError, ControlError) as problem:
        unread = isinstance(problem.__cause__, OSError)
        outcome = RowOutcome.FAILED if unread else RowOutcome.REFUSED
        row |= {"outcome": outcome.value, "error": _named(str(problem), copies)}
    except Exception as problem:  # noqa: BLE001 - one recording must not stop thousands of others
        where = extract_tb(problem.__traceback__)[-1]
        text = f"{type(problem).__name__}: {problem} ({Path(where.filename).name}, line {where.lineno})"
        row |= {"error": _named(text, copies)}
    row |= {"cpu_s": time.process_time() - cpu_s, "wall_s": time.monotonic() - started}
    return row | {"worker": f"{socket.gethostname()} {os.getpid()}"}


def _identified(job: Job, row: Row, copies: dict[str, str]) -> Row:
    """The fields of an identification; `row` and `copies` are filled in even if the recording is then refused."""
    robot = _robot(job.robot, _changed(job.robot))
    with ExitStack() as stack:

        def here(url: str) -> Path:
            path = stack.enter_context(local_copy(url))
            copies[str(path)] = url
            return path

        loaded, *others = (read_of(robot, here(url)) for url in job.recordings.values())
        row |= recorded_fields(loaded)
        runs = dict(zip(job.recordings, (loaded, *others), strict=True))
        judged = (runs["validation_loaded"], runs["validation_unloaded"]) if "validation_loaded" in runs else None
        findings = identify(
            robot,
            loaded,
            runs.get("unloaded"),
            validation=judged,
            calibration=here(job.calibration) if job.calibration else None,
            known=None if job.mass_kg is None else KnownPayload(mass_kg=job.mass_kg),
        )
    return findings_fields(findings)


def _changed(robot: str) -> int:
    """Time in ns of the last change of a robot's file; 0 for a shipped one.

    Raises:
        FleetError: this machine cannot read the file.
    """
    path = Path(robot)
    if not path.is_absolute():
        return 0
    try:
        return path.stat().st_mtime_ns
    except OSError as problem:
        shipped = ", ".join(shipped_robots())
        raise FleetError(
            f"{robot}: cannot be read ({problem.strerror}), and no shipped robot has that name: {shipped}. "
            "Correct the column robot, or make the file readable for the workers."
        ) from problem


@lru_cache(_ROBOTS)
def _robot(name_or_path: str, _changed_ns: int) -> Robot:
    """A robot; its file is read again if it has changed."""
    return load_robot(name_or_path)


def _named(text: str, copies: dict[str, str]) -> str:
    """A message with the URLs in place of the copies."""
    for copy, url in copies.items():
        text = text.replace(copy, url)
    return text
