"""Reading a file given by the user: regular files only, with bounded size."""

from __future__ import annotations

import errno
import hashlib
import os
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import Final

LARGEST_BYTES: Final = 2**24
"""Largest accepted file of settings or results; the largest written ones have some 100 kB."""


def require_regular(path: Path) -> None:
    """Raise unless a path is a regular file: opening a pipe waits for a writer, and a device may have no end.

    Args:
        path: The file; a symbolic link is followed.

    Raises:
        OSError: there is no such file, or it is a folder, a pipe, a socket or a device.
    """
    mode = path.stat().st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not stat.S_ISREG(mode):
        raise OSError(errno.EINVAL, "a pipe or device, not a regular file", str(path))


def read_whole(path: Path, largest_bytes: int = LARGEST_BYTES) -> bytes:
    """The content of a file.

    Args:
        largest_bytes: Largest accepted size.

    Raises:
        OSError: it cannot be read, is not a regular file, or is larger.
    """
    require_regular(path)
    with path.open("rb") as file:
        data = file.read(largest_bytes + 1)
    if len(data) > largest_bytes:
        raise OSError(errno.EFBIG, f"larger than {largest_bytes} bytes, so it is not a file of this kind", str(path))
    return data


def hash_of_files(paths: Iterable[Path]) -> str:
    """SHA-256 of the concatenated content of files of any size.

    Raises:
        OSError: one of them cannot be read.
    """
    digest = hashlib.sha256()
    for path in paths:
        with path.open("rb") as file:
            hashlib.file_digest(file, lambda: digest)
    return digest.hexdigest()
