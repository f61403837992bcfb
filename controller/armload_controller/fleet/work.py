"""What a worker does with a job: copies if need be, reads, identifies, and gives a row, whatever comes of it."""

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
from armload_controller.control_errors import ControlError
from armload_controller.fleet.job import Job
from armload_controller.fleet.recording_row import Row, RowOutcome, empty_row, findings_fields, recorded_fields
from armload_controller.fleet.remote_files import local_copy
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.identification_errors import IdentificationError

_ROBOTS = 64
"""Robots that a worker keeps: reading one takes a fifth as long as identifying a pair."""


def run_job(job: Job) -> Row:
    """Identify what an arm carried.

    Args:
        job: The recording, and what goes with it.

    Returns:
        A row. What armload refuses is "refused": the same files would be refused again. Anything else that goes wrong,
        such as a server that does not answer or a file that this machine cannot read, is "failed", and is tried again
        when the fleet is identified again.
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
    except Exception as problem:  # noqa: BLE001 - one recording's trouble, and there are thousands of others
        where = extract_tb(problem.__traceback__)[-1]
        text = f"{type(problem).__name__}: {problem} ({Path(where.filename).name}, line {where.lineno})"
        row |= {"error": _named(text, copies)}
    row |= {"cpu_s": time.process_time() - cpu_s, "wall_s": time.monotonic() - started}
    return row | {"worker": f"{socket.gethostname()} {os.getpid()}"}


def _identified(job: Job, row: Row, copies: dict[str, str]) -> Row:
    """The fields of what was found; `row` and `copies` keep what is known of the recording if that is refused."""
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
    """When a robot's file was changed; 0 for a shipped one.

    Raises:
        FileNotFoundError: it is not there, or not on this machine.
    """
    path = Path(robot)
    if not path.is_absolute():
        return 0
    if not path.is_file():
        shipped = ", ".join(shipped_robots())
        raise FileNotFoundError(f"{robot} does not exist, and no shipped robot has that name: {shipped}")
    return path.stat().st_mtime_ns


@lru_cache(_ROBOTS)
def _robot(name_or_path: str, _changed_ns: int) -> Robot:
    """A robot; its file is read again where it has changed."""
    return load_robot(name_or_path)


def _named(text: str, copies: dict[str, str]) -> str:
    """A message with the URLs in place of the copies."""
    for copy, url in copies.items():
        text = text.replace(copy, url)
    return text
