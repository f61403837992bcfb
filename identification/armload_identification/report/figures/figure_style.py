"""Colours and style of all figures, which are drawn without pyplot and its global state.

References:
    Okabe, Ito, Color Universal Design, 2008: colours that colour-blind readers can distinguish.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Final, Literal

import matplotlib.style
from matplotlib.figure import Figure

INK: Final = "#1a1a1a"
GREY: Final = "#8c8c8c"
LIGHT_GREY: Final = "#e3e3e3"
BLUE: Final = "#0072b2"
VERMILION: Final = "#d55e00"
GREEN: Final = "#009e73"
PURPLE: Final = "#cc79a7"
ORANGE: Final = "#e69f00"
SKY_BLUE: Final = "#56b4e9"

WIDE_IN: Final = 7.0
NARROW_IN: Final = 3.4
"""Width of a figure that has a page's width to itself, and of one beside another."""
FIGURE_STYLE: Final = Path(__file__).with_name("figures.mplstyle")
"""Matplotlib's parameters."""


@contextmanager
def styled_figure(width_in: float, height_in: float, layout: Literal["constrained"] | None = None) -> Iterator[Figure]:
    """An empty figure; what is drawn within the block has the style."""
    with matplotlib.style.context(["default", FIGURE_STYLE]):
        yield Figure(figsize=(width_in, height_in), layout=layout)
