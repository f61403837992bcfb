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

from armload_controller.analysis.robot_identification import identify
from armload_controller.config.robot import Robot, load_robot, shipped_robots
from armload_controller.config.robot_recordings import read_of
from armload_controller.control_errors import FleetError
from armload_controller.fleet.job import Job
from armload_controller.fleet.recording_row import Row, empty_row, findings_fields, recorded_fields
from armload_controller.fleet.remote_files import local_copy
from armload_controller.fleet.repeatable import is_own, outcome_of
from armload_controller.fleet.robot_dependencies import RobotFiles
from armload_identification.estimation.prior_knowledge import KnownPayload

_MOST_ROBOTS = 64
"""Number of robots that a worker caches: reading one takes a fifth as long as identifying a pair."""


def run_job(job: Job, folder: str | None = None) -> Row:
    """Identify the payload of a recording.

    Args:
        job: The recording and the related inputs.
        folder: Folder for copies of remote files; by default the system's for temporary files.

    Returns:
        A row, whatever happens; `repeatable` decides between "refused" and "failed".
    """
    started, cpu_s = time.monotonic(), time.process_time()
    row = empty_row(job, version("armload"))
    copies: dict[str, str] = {}
    try:
        row |= _identified(job, row, copies, folder)
    except Exception as problem:  # noqa: BLE001 - one recording must not stop thousands of others
        row |= {"outcome": outcome_of(problem).value, "error": _with_urls(_error_text(problem), copies)}
    row |= {"cpu_s": time.process_time() - cpu_s, "wall_s": time.monotonic() - started}
    return row | {"worker": f"{socket.gethostname()} {os.getpid()}"}


def run_on_worker(job: Job, wanted: str) -> Row:
    """As `run_job`, on a Dask worker that may have joined after the workers' versions were compared.

    Copies of remote files are made in the worker's own folder, which Dask removes after the worker was killed.

    Args:
        job: The recording and the related inputs.
        wanted: The coordinator's version of armload.

    Raises:
        FleetError: this worker has another version.
    """
    own = version("armload")
    if own != wanted:
        raise FleetError(
            f"the worker on {socket.gethostname()} has armload {own}, the coordinator {wanted}; install the same "
            "version everywhere"
        )
    from distributed import get_worker

    return run_job(job, get_worker().local_directory)


def _identified(job: Job, row: Row, copies: dict[str, str], folder: str | None) -> Row:
    """The fields of an identification; `row` and `copies` are filled in even if the recording is then refused."""
    robot = _robot_of(job)
    with ExitStack() as stack:

        def here(url: str) -> Path:
            path = stack.enter_context(local_copy(url, folder))
            copies[str(path)] = url
            return path

        loaded = read_of(robot, here(job.loaded))
        row |= recorded_fields(loaded, row["identified_utc"])
        runs = {name: read_of(robot, here(url)) for name, url in job.recordings.items() if name != "loaded"}
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


def _robot_of(job: Job) -> Robot:
    """The robot of a job, read again if its file or one of its profiles has changed."""
    try:
        return _cached_robot(job.robot, RobotFiles.of(job.robot).robot)
    except OSError as problem:
        shipped = ", ".join(shipped_robots())
        raise FleetError(
            f"{job.robot}: cannot be read ({problem.strerror}), and no shipped robot has that name: {shipped}. "
            "Correct the column robot, or make the file readable for the workers."
        ) from problem


@lru_cache(_MOST_ROBOTS)
def _cached_robot(name_or_path: str, _contents: tuple[str, ...]) -> Robot:
    """A robot; cached by the contents of its files."""
    return load_robot(name_or_path)


def _error_text(problem: Exception) -> str:
    """An error in a sentence; one that armload did not raise itself with its type and place."""
    if is_own(problem):
        return str(problem)
    where = extract_tb(problem.__traceback__)[-1]
    return f"{type(problem).__name__}: {problem} ({Path(where.filename).name}, line {where.lineno})"


def _with_urls(text: str, copies: dict[str, str]) -> str:
    """A message with the URLs in place of the copies."""
    for copy, url in copies.items():
        text = text.replace(copy, url)
    return text
