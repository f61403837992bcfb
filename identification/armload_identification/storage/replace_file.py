"""Writing a file so that a reader finds the old content or the new, never a part of it."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from pathlib import Path


def replace_file(path: Path, content: str | bytes) -> None:
    """Write a file beside its place, flush it to the disk and rename it into place.

    A crash or a full disk leaves the earlier file as it was. An existing file keeps its permissions, a symbolic link
    stays a link to the new content, and what is no regular file (/dev/stdout, a pipe) is written to directly.

    Args:
        path: Where to.
        content: Text is written as UTF-8, with the line ends it has.

    Raises:
        OSError: the file cannot be written; nothing is left beside its place.
    """
    data = content.encode() if isinstance(content, str) else content
    place = path.resolve()
    if place.exists() and not place.is_file():
        place.write_bytes(data)
        return
    beside = place.with_name(f".{place.name}.{secrets.token_hex(4)}.tmp")
    try:
        with beside.open("xb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        if place.exists():
            shutil.copymode(place, beside)
        beside.replace(place)
    except BaseException:
        with contextlib.suppress(OSError):
            beside.unlink()
        raise
    _flush_folder(place.parent)


def _flush_folder(folder: Path) -> None:
    """Flush the rename itself; file systems that cannot flush a folder are left to their own timing."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):
            os.fsync(descriptor)
    finally:
        os.close(descriptor)
