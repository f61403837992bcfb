"""The one boundary between the libraries that read files and this program: what they raise becomes a `RecordingError`.

Damaged files make libraries raise anything, such as struct.error, MemoryError or RecursionError. Readers therefore list
no exceptions: an error of theirs is a file that cannot be read, and the message names the file.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from armload_identification.identification_errors import IdentificationError, RecordingError

MOST_BYTES: Final = 2**28
"""Most bytes of anything that a file of another program lets a reader hold at once, such as a chunk of a bag."""
_LONGEST_REASON: Final = 200


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn any error within the block into one that names the file.

    Raises:
        RecordingError: the file cannot be read.
    """
    try:
        yield
    except IdentificationError:
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.strerror:
            raise RecordingError(f"{path}: cannot be read ({error.strerror}). Check the path.") from error
        reason = " ".join(str(error).split())[:_LONGEST_REASON].rstrip(".") or type(error).__name__
        raise RecordingError(f"{path}: damaged, {reason}. Copy the file again from where it was recorded.") from error
