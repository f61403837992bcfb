"""An empty figure in the style of all figures."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Literal

import matplotlib.style
from matplotlib.figure import Figure

from armload_identification.report.figures.figure_style import FIGURE_STYLE


@contextmanager
def styled_figure(width_in: float, height_in: float, layout: Literal["constrained"] | None = None) -> Iterator[Figure]:
    """An empty figure; what is drawn within the block has the style."""
    with matplotlib.style.context(["default", FIGURE_STYLE]):
        yield Figure(figsize=(width_in, height_in), layout=layout)
