"""Folders and files of results."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from os.path import realpath
from pathlib import Path
from typing import Final

from armload_controller.control_errors import CommissioningError
from armload_identification.storage.own_file import require_own

_WRITTEN: Final = ("output", "report", "picture", "metrics", "record", "decisions")
"""Parameters of commands that name a file to be written."""


def require_apart(given: Mapping[str, object], names: Mapping[str, str]) -> None:
    """Refuse a file to be written that another option or argument of the command names too.

    Args:
        given: Value by parameter.
        names: Name of the option or argument by parameter, for the message.

    Raises:
        CommissioningError: naming the file and both.
    """
    for key in _WRITTEN:
        file = given.get(key)
        if not isinstance(file, Path) or (file.exists() and not file.is_file()):
            continue
        for other, value in given.items():
            paths = value if isinstance(value, list | tuple) else [value]
            files = {realpath(p) for p in paths if isinstance(p, Path) or (isinstance(p, str) and file.exists())}
            if other != key and realpath(file) in files:
                raise CommissioningError(
                    f"{file} is given as {names[key]}, to be written, and as {names[other]}: give another {names[key]}"
                )


def require_folder(file: Path | None, what: str = "", option: str = "--output") -> None:
    """Create the folder for a result, if one is requested, before the work starts.

    Args:
        what: What is written, if only such a file may be replaced; see `require_own`.
        option: Name of the option, for messages.

    Raises:
        CommissioningError: the folder cannot be created or written to, the file is itself a folder, or another one.
    """
    if file is None:
        return
    if file.is_dir():
        raise CommissioningError(f"{file} is a folder: give the name of a file")
    if what:
        require_own(file, what, CommissioningError, option)
    make_folder(file.parent)
    if file.is_file() or not file.exists():  # /dev/stdout and pipes are written to directly
        require_writable(file.resolve().parent)


def require_drawable(file: Path | None, what: str = "report", option: str = "--report") -> None:
    """Create the folder for a report or picture, if one is requested, and check that the drawing library is installed.

    Args:
        what: A report or a picture.
        option: Name of the option, for messages.

    Raises:
        CommissioningError: the folder cannot be created or written to, the file is itself a folder, or another one.
        ExtraMissing: the drawing library is not installed.
    """
    from armload_identification.extras import Extra, require_extra

    if file is not None:
        require_extra(Extra.REPORT, str(file))
        require_folder(file, what, option)


def require_replaceable(file: Path, hashes: Collection[str]) -> None:
    """Refuse to write a payload over one that was identified from other recordings.

    Args:
        hashes: SHA-256 of each recording of the new one.

    Raises:
        CommissioningError: the file contains another payload, or is not a payload file.
    """
    from armload_identification.files.payload_file import read_payload
    from armload_identification.identification_errors import PayloadFileError

    if not file.is_file():
        return
    try:
        there = read_payload(file)
    except PayloadFileError as problem:
        raise CommissioningError(
            f"{file} already exists and is not a payload file ({problem}): give another --output, or --force"
        ) from problem
    if not set(hashes) <= set(there.provenance.recordings_sha256.values()):
        made_from = ", ".join(there.provenance.recordings_sha256) or "unnamed recordings"
        raise CommissioningError(
            f"{file} holds another payload ({there.model.mass_kg:.3f} kg, from {made_from}): give another --output, or "
            "--force to replace it"
        )


def require_writable(folder: Path) -> None:
    """Refuse an existing folder in which no file can be created.

    A nameless file is created, because permissions do not show this for /proc or a read-only mount.

    Raises:
        CommissioningError: no file can be created there.
    """
    import tempfile

    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise CommissioningError(f"{folder} cannot be written to: {error.strerror}; choose another output") from error


def make_folder(folder: Path) -> None:
    """Create a folder and its parents.

    Raises:
        CommissioningError: it cannot be created.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommissioningError(f"{folder} cannot be created: {error.strerror}; choose another output") from error
