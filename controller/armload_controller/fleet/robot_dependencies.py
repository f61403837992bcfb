"""A robot's file and the files beside it that the result of a recording depends on, as hashes.

A job is repeated if one of them changes, and a worker reads a robot again if its part of them does. Excitations and
device descriptions are not among them: neither is used to identify a payload. Shipped files change only with armload.
"""

from __future__ import annotations

import hashlib
import tomllib
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Final

from armload_controller.config.drive_profiles import own_profiles
from armload_identification.storage.regular_file import read_whole

_MOST_ROBOTS: Final = 1024
"""Number of robot files whose names of other files are kept: `fleet watch` looks at all of them every minute."""
_UNREADABLE: Final = "cannot be read"


@dataclass(frozen=True)
class RobotFiles:
    """Hashes of the contents.

    Attributes:
        robot: The robot's file and the drive profiles beside it, of which the robot consists; for a shipped robot its
            name.
        calibration: The calibration that the robot's file names; empty if it names none.
    """

    robot: tuple[str, ...]
    calibration: str

    @classmethod
    def of(cls, robot: str) -> RobotFiles:
        """Read a robot's files.

        Args:
            robot: A shipped robot, or the absolute path of a robot's file.

        Raises:
            OSError: the robot's file cannot be read. Another file that cannot be read has a hash of its own.
        """
        path = Path(robot)
        if not path.is_absolute():
            return cls((robot,), "")
        content = read_whole(path)
        calibration, profiles = _named_files(content)
        return cls(
            (hashlib.sha256(content).hexdigest(), *(_hash(path.parent / name) for name in profiles)),
            _hash(path.parent / calibration) if calibration else "",
        )


@lru_cache(_MOST_ROBOTS)
def _named_files(content: bytes) -> tuple[str, tuple[str, ...]]:
    """Names of the calibration and of the profiles in a robot's file; none in a file that is not TOML."""
    try:
        values = tomllib.loads(content.decode())
    except (ValueError, RecursionError):
        return "", ()
    robot = values.get("robot")
    calibration = robot.get("calibration") if isinstance(robot, dict) else None
    return calibration if isinstance(calibration, str) else "", own_profiles(values)


def _hash(path: Path) -> str:
    """Hash of a file's content."""
    try:
        return hashlib.sha256(read_whole(path)).hexdigest()
    except OSError:
        return _UNREADABLE
