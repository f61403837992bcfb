"""Where results go."""

from __future__ import annotations

from pathlib import Path

from armload_controller.control_errors import CommissioningError


def require_folder(file: Path) -> None:
    """Make the folder that a result goes to, before the work is done.

    Raises:
        CommissioningError: it cannot be made, or the file is a folder itself.
    """
    if file.is_dir():
        raise CommissioningError(f"{file} is a folder: give the name of a file")
    make_folder(file.parent)


def make_folder(folder: Path) -> None:
    """Make a folder and those above it.

    Raises:
        CommissioningError: it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CommissioningError(f"{folder} cannot be made: {error.strerror}; choose another output") from error
