"""Atomic writing of a file: a reader finds the old content or the new, never a part of it."""

from __future__ import annotations

import contextlib
import os
import secrets
import shutil
from pathlib import Path


def replace_file(path: Path, content: str | bytes) -> None:
    """Write a temporary file in the same folder, flush it to the disk and rename it to its final name.

    A crash or a full disk leaves the earlier file unchanged. An existing file keeps its permissions, a symbolic link
    remains a link to the new content, and other kinds of file (/dev/stdout, a pipe) are written to directly.

    Args:
        content: Bytes, or text that is written as UTF-8 with its own line ends.

    Raises:
        OSError: the file cannot be written; no temporary file remains.
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
    # Flush the rename itself, on file systems that can flush a folder.
    descriptor = os.open(place.parent, os.O_RDONLY)
    try:
        with contextlib.suppress(OSError):
            os.fsync(descriptor)
    finally:
        os.close(descriptor)
