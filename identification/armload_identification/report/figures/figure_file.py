"""A figure of Matplotlib as a file."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from armload_identification.identification_errors import ReportError
from armload_identification.storage.own_file import require_own
from armload_identification.storage.replace_file import replace_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_figure(path: Path, figure: Figure, dpi: float = 130.0) -> None:
    """Write a figure; an earlier one is replaced atomically.

    Args:
        path: The file; its suffix is the format, such as .svg or .png.
        dpi: Resolution in pixels per inch.

    Raises:
        ReportError: the file cannot be written or is no picture, or the suffix is that of no format.
    """
    kind, kinds = path.suffix.removeprefix(".").lower(), figure.canvas.get_supported_filetypes()
    if kind not in kinds:
        raise ReportError(
            f"{path}: {path.suffix!r} is not the suffix of a picture; expected one of {', '.join(sorted(kinds))}."
        )
    drawn = io.BytesIO()
    figure.savefig(drawn, format=kind, dpi=dpi)
    write_drawn(path, drawn.getvalue(), "picture")


def write_drawn(path: Path, content: str | bytes, what: str) -> None:
    """Write a report or a picture; an earlier one is replaced atomically.

    Args:
        what: What it is: a report or a picture.

    Raises:
        ReportError: the file cannot be written, or is another one.
    """
    try:
        require_own(path, what, ReportError)
        replace_file(path, content)
    except OSError as problem:
        raise ReportError(
            f"{path}: the {what} cannot be written ({problem.strerror}). Choose a file in an existing, writable folder."
        ) from problem
