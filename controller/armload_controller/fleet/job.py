"""One job: a recording of one arm, and everything required to identify its payload."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True)
class Job:
    """The input of a worker.

    Attributes:
        key: Hash of everything that the result depends on, except for the version of armload: a job whose key has a
            row is done.
        arm: Name of the individual arm.
        robot: A shipped robot, or the path of its file.
        recordings: Path or URL by column of `job_table.RECORDINGS`; "loaded" is always present.
        calibration: Path or URL of a calibration; empty if there is none, or if the robot's file names it.
        payload: Name of the payload; may be empty.
        mass_kg: Its mass; None if unknown.
        modified: Time of the loaded recording's last change; None if its file system does not state it.
    """

    key: str
    arm: str
    robot: str
    recordings: Mapping[str, str]
    calibration: str
    payload: str
    mass_kg: float | None
    modified: datetime | None

    @property
    def loaded(self) -> str:
        """Path or URL of the loaded recording."""
        return self.recordings["loaded"]


def job_key(*inputs: object) -> str:
    """A job's key.

    Args:
        inputs: Names, texts and stamps of files, in any nesting of lists and dictionaries.
    """
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()
