"""One program at a time in a folder: a lock of the operating system, released when the process ends."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from armload_controller.control_errors import CommissioningError


@contextmanager
def claimed_folder(directory: Path, work: str = "commissioning") -> Iterator[None]:
    """Lock a folder within a `with` block; no lock file is left behind, not even after kill -9.

    Some network file systems cannot lock folders; on them nothing is locked.

    Args:
        directory: An existing folder.
        work: Kind of work done there, for the message.

    Raises:
        CommissioningError: another process has locked it.
    """
    descriptor = os.open(directory, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise CommissioningError(
                f"another {work} is using {directory}: wait until it has finished, or choose another `output=`"
            ) from error
        except OSError:
            pass
        yield
    finally:
        os.close(descriptor)
