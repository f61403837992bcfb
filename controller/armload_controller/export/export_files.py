"""Writes exported texts to files without replacing existing ones."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from armload_controller.control_errors import ExportError
from armload_identification.storage.replace_file import replace_file


def write_files(contents: Mapping[str, str | bytes], output: Path) -> dict[Path, bool]:
    """Write all files, or none if a different file exists under one of the names.

    An existing file with the same content is left alone. One with different content is detected before anything is
    written.

    Args:
        contents: Contents by file name; texts are ASCII.
        output: A directory, created if necessary. For a single file also its path, if it has a suffix and is not a
            directory.

    Returns:
        The path of each file, and whether it was written; False if it already had this content.

    Raises:
        ExportError: a different file exists, or a file cannot be written.
    """
    single = len(contents) == 1 and bool(output.suffix) and not output.is_dir()
    paths = {
        (output if single else output / name): content.encode("ascii") if isinstance(content, str) else content
        for name, content in contents.items()
    }
    changed = {path: not _holds(path, content) for path, content in paths.items()}
    for path, content in paths.items():
        if changed[path]:
            _write(path, content)
    return changed


def _write(path: Path, content: bytes) -> None:
    """Write one file, and create its folder."""
    at = path.parent
    try:
        at.mkdir(parents=True, exist_ok=True)
        at = path
        replace_file(path, content)
    except OSError as problem:
        raise ExportError(str(at), f"cannot be written: {problem.strerror}") from problem


def _holds(path: Path, content: bytes) -> bool:
    """True if the file has this content, False if there is no file; raises if it has different content."""
    try:
        there = path.read_bytes() if path.exists() else None
    except OSError as problem:
        raise ExportError(str(path), f"already exists and cannot be read: {problem.strerror}") from problem
    if there is None:
        return False
    if there != content:
        raise ExportError(str(path), "already exists with different content; remove it, or give another `output=`")
    return True
