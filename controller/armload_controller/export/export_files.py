"""Exported texts into files, without replacing what is there."""

from __future__ import annotations

from pathlib import Path

from armload_controller.control_errors import ExportError
from armload_identification.storage.replace_file import replace_file


def write_texts(texts: dict[str, str], output: Path) -> dict[Path, bool]:
    """Write all texts, or none where a file is in the way.

    An existing file with the same text is left alone; one with another text is in the way, and is found before
    anything is written.

    Args:
        texts: Texts by file name.
        output: A directory, made if it is not there. For a single text also a file: a path with a suffix that is no
            directory.

    Returns:
        The path of each text, and whether it was written; False where the file held the same text already.

    Raises:
        ExportError: a file in the way, or one that cannot be written.
    """
    single = len(texts) == 1 and bool(output.suffix) and not output.is_dir()
    paths = {(output if single else output / name): text for name, text in texts.items()}
    changed = {path: not _holds(path, text) for path, text in paths.items()}
    for path, text in paths.items():
        if changed[path]:
            _write(path, text)
    return changed


def _write(path: Path, text: str) -> None:
    """Write one file, and make its folder."""
    at = path.parent
    try:
        at.mkdir(parents=True, exist_ok=True)
        at = path
        replace_file(path, text.encode("ascii"))
    except OSError as problem:
        raise ExportError(str(at), f"cannot be written: {problem.strerror}") from problem


def _holds(path: Path, text: str) -> bool:
    """True where the file has the text, False where there is no file."""
    try:
        there = path.read_bytes() if path.exists() else None
    except OSError as problem:
        raise ExportError(str(path), f"is there already and cannot be read: {problem.strerror}") from problem
    if there is None:
        return False
    if there != text.encode("ascii"):
        raise ExportError(str(path), "is there already with another content; remove it, or give another --output")
    return True
