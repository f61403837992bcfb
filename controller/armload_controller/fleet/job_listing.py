"""From the table of jobs to jobs: patterns are expanded, every recording's metadata are read, and robots' files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from armload_controller.config.robot import shipped_robots
from armload_controller.control_errors import ConfigurationError
from armload_controller.fleet.job import Job, job_key
from armload_controller.fleet.job_table import RECORDINGS, TableEntry
from armload_controller.fleet.remote_files import RemoteFile, is_url, matches, with_stars
from armload_controller.fleet.robot_dependencies import RobotFiles
from armload_identification.numerals import counted

_LOADED = RECORDINGS[0]


@dataclass(frozen=True)
class JobListing:
    """The present jobs of a table.

    Attributes:
        jobs: Jobs in the table's order, each recording once.
        remarks: One sentence for each line that matches no file, for each of its columns whose files are missing, and
            for each folder that may not be listed.
    """

    jobs: tuple[Job, ...]
    remarks: tuple[str, ...]


def list_jobs(entries: Sequence[TableEntry], table: Path) -> JobListing:
    """The jobs of a table.

    Args:
        entries: Its lines.
        table: The file; paths are relative to it.

    Raises:
        ConfigurationError: two lines name the same recording, or a pattern has more stars than that of loaded.
        ListingError: a folder cannot be listed, or no installed library reads such URLs.
    """
    jobs: list[Job] = []
    remarks: list[str] = []
    lines: dict[str, int] = {}
    look = cache(RemoteFile.of)
    shipped = shipped_robots()
    robot_files = cache(_robot_files)
    for entry in entries:
        there, closed = matches(_placed(entry.recordings[_LOADED], table))
        remarks += [
            f"{table}, line {entry.line}: no permission to list the folder {folder}, so nothing in it is processed"
            for folder in closed
        ]
        if not there:
            remarks.append(f"{table}, line {entry.line}: no file matches {entry.recordings[_LOADED]}")
        robot = entry.robot if entry.robot in shipped else _placed(entry.robot, table)
        calibration = _placed(entry.calibration, table) if entry.calibration else ""
        files_of_robot = robot_files(robot)
        content, *beside = files_of_robot.robot
        if files_of_robot.calibration and not calibration:
            beside.append(files_of_robot.calibration)
        missing: dict[str, list[str]] = {name: [] for name in entry.recordings if "*" in entry.recordings[name]}
        for loaded, stars in there:
            if lines.setdefault(loaded, entry.line) != entry.line:
                expected = f"line {lines[loaded]} already names it; remove one of the two, or restrict its *"
                raise ConfigurationError(str(table), f"line {entry.line}, loaded", loaded, expected)
            files = {_LOADED: look(loaded)}
            for name in RECORDINGS[1:]:
                if name in entry.recordings:
                    files[name] = look(_partner(entry, name, stars, table))
                    if name in missing and files[name].is_missing:
                        missing[name].append(files[name].url)
            recordings = {name: file.url for name, file in files.items()}
            stamps = {name: file.stamp for name, file in files.items()}
            known = (content, look(calibration).stamp if calibration else "", entry.payload, entry.mass_kg)
            key = job_key(entry.arm, robot, recordings, stamps, calibration, *known, *([beside] if beside else []))
            modified = files[_LOADED].modified
            jobs.append(Job(key, entry.arm, robot, recordings, calibration, entry.payload, entry.mass_kg, modified))
        remarks += [
            f"{table}, line {entry.line}, {name}: {len(urls)} of {counted(len(there), 'file')} missing, such as "
            f"{urls[0]}; each * stands for the text matched by the * in loaded"
            for name, urls in missing.items()
            if urls
        ]
    return JobListing(tuple(jobs), tuple(remarks))


def _placed(text: str, table: Path) -> str:
    """A path relative to the table's folder; a URL is left unchanged."""
    return text if is_url(text) else str(table.parent.absolute() / text)


def _partner(entry: TableEntry, name: str, stars: tuple[str, ...], table: Path) -> str:
    """The recording that belongs to a loaded one: its stars are replaced by the same texts."""
    filled = with_stars(entry.recordings[name], stars)
    if filled is None:
        most = f"at most as many * as in loaded, {entry.recordings[_LOADED]}"
        expected = f"expected {most}: each stands for the text matched by the * in loaded"
        raise ConfigurationError(str(table), f"line {entry.line}, {name}", entry.recordings[name], expected)
    return _placed(filled, table)


def _robot_files(robot: str) -> RobotFiles:
    """Hashes of a robot's files; the path itself if the robot's file cannot be read."""
    try:
        return RobotFiles.of(robot)
    except OSError:
        return RobotFiles((robot,), "")
