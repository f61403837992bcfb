"""Existing files that may be replaced: only those that were written here before, as the same thing."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Final

_MARKS: Final = {
    "report": b'<meta name="generator" content="armload ',
    "picture": b"atplotlib",  # "Matplotlib", with its m in some formats
    "calibration": b"\n[gains]",
    "excitation": b"[excitation]\nbase_frequency_hz",
    "metrics": b"# HELP armload_",
    "EDS": b"VendorName=armload",
    "decisions": b'{"robot": ',
}
"""What a file contains that was written here, by what it is."""
_SEARCHED_BYTES: Final = 2**24
"""More than any of them has; a recording may be larger than the memory."""


def require_own(path: Path, what: str, error: Callable[[str], Exception], option: str = "file") -> None:
    """Refuse to replace an existing file that is not the same thing, such as a recording by a report.

    An empty file is replaced; devices and pipes are written to.

    Args:
        what: What is written: a report, picture, calibration, excitation, metrics, decisions or EDS.
        error: Makes the error that is raised.
        option: Name of the option that names the file, for the message.

    Raises:
        Exception: made by `error`, naming the file.
    """
    if not path.is_file():
        return
    with suppress(OSError), path.open("rb") as file:  # what cannot be read is refused, too
        there = file.read(_SEARCHED_BYTES)
        if not there or _MARKS[what] in there:
            return
    raise error(
        f"{path} exists and is not armload's {what}: it is not overwritten. Give another {option}, or remove the file."
    )
