"""What was exported into files, without replacing what is there."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from armload_controller.control_errors import ExportError
from armload_identification.storage.replace_file import replace_file


def write_files(contents: Mapping[str, str | bytes], output: Path) -> dict[Path, bool]:
    """Write all files, or none where one is in the way.

    An existing file with the same content is left alone; one with another content is in the way, and is found before
    anything is written.

    Args:
        contents: Contents by file name; texts are ASCII.
        output: A directory, made if it is not there. For a single file also its path: one with a suffix that is no
            directory.

    Returns:
        The path of each file, and whether it was written; False where it held the same content already.

    Raises:
        ExportError: a file in the way, or one that cannot be written.
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
    """Write one file, and make its folder."""
    at = path.parent
    try:
        at.mkdir(parents=True, exist_ok=True)
        at = path
        replace_file(path, content)
    except OSError as problem:
        raise ExportError(str(at), f"cannot be written: {problem.strerror}") from problem


def _holds(path: Path, content: bytes) -> bool:
    """True where the file has the content, False where there is no file."""
    try:
        there = path.read_bytes() if path.exists() else None
    except OSError as problem:
        raise ExportError(str(path), f"already exists and cannot be read: {problem.strerror}") from problem
    if there is None:
        return False
    if there != content:
        raise ExportError(str(path), "already exists with different content; remove it, or give another --output")
    return True
