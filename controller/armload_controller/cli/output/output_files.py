"""Folders and files of results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from armload_controller.control_errors import CommissioningError

if TYPE_CHECKING:
    from armload_identification.model.payload import PayloadResult


def require_folder(file: Path | None) -> None:
    """Create the folder for a result, if one is requested, before the work starts.

    Raises:
        CommissioningError: the folder cannot be created or written to, or the file is itself a folder.
    """
    if file is None:
        return
    if file.is_dir():
        raise CommissioningError(f"{file} is a folder: give the name of a file")
    make_folder(file.parent)
    if file.is_file() or not file.exists():  # /dev/stdout and pipes are written to directly
        require_writable(file.resolve().parent)


def require_drawable(file: Path | None) -> None:
    """Create the folder for a report or picture, if one is requested, and check that the drawing library is installed.

    Raises:
        CommissioningError: the folder cannot be created or written to, or the file is itself a folder.
        ExtraMissing: the drawing library is not installed.
    """
    from armload_identification.extras import Extra, require_extra

    if file is not None:
        require_extra(Extra.REPORT, str(file))
        require_folder(file)


def require_replaceable(file: Path, payload: PayloadResult) -> None:
    """Refuse to write a payload over one that was identified from other recordings.

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
    if not set(payload.provenance.recordings_sha256.values()) <= set(there.provenance.recordings_sha256.values()):
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
