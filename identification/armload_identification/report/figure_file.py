"""A figure of Matplotlib as a file."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING

from armload_identification.storage.replace_file import replace_file

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def write_figure(path: Path, figure: Figure, dpi: float) -> None:
    """Write a figure; an existing file is replaced whole.

    Args:
        path: Where to; its ending is the format, such as .svg or .png.
        figure: What to write.
        dpi: Resolution of pixels, per inch.

    Raises:
        OSError: the file cannot be written.
    """
    drawn = io.BytesIO()
    figure.savefig(drawn, format=path.suffix.removeprefix(".").lower(), dpi=dpi)
    replace_file(path, drawn.getvalue())
