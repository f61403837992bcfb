"""One job: a recording of one arm, and all that it takes to identify what the arm carried."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime


@dataclass(frozen=True)
class Job:
    """What a worker is given.

    Attributes:
        key: Hash of everything that the result depends on: a job of a key that there is a row of is done.
        arm: Name of the one arm.
        robot: A shipped robot, or the path of its file.
        recordings: Path or URL of each, by column of `job_table.RECORDINGS`; there is a "loaded" one.
        calibration: Path or URL of a calibration; empty where there is none, or the robot's file names it.
        payload: Name of what is carried; may be empty.
        mass_kg: Its mass, where it is known.
        modified: When the loaded recording was last changed, where its file system says it.
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
        """Path or URL of the recording that the job is about."""
        return self.recordings["loaded"]


def job_key(*inputs: object) -> str:
    """A job's key.

    Args:
        inputs: Names, texts and stamps of files, in any nesting of lists and dictionaries.
    """
    return hashlib.sha256(json.dumps(inputs, sort_keys=True).encode()).hexdigest()
