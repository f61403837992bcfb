"""Colours and style of all figures, which are drawn without pyplot and its global state.

References:
    Okabe, Ito, Color Universal Design, 2008: colours that colour-blind readers can distinguish.
"""

from __future__ import annotations

from typing import Final

INK: Final = "#1a1a1a"
GREY: Final = "#8c8c8c"
LIGHT_GREY: Final = "#e3e3e3"
BLUE: Final = "#0072b2"
VERMILION: Final = "#d55e00"
GREEN: Final = "#009e73"
PURPLE: Final = "#cc79a7"
ORANGE: Final = "#e69f00"
SKY_BLUE: Final = "#56b4e9"

FIGURE_STYLE: Final = {
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 7.5,
    "axes.linewidth": 0.6,
    "axes.edgecolor": GREY,
    "axes.labelcolor": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.titley": 1.0,  # otherwise placing the title takes a fifth of the time
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": LIGHT_GREY,
    "grid.linewidth": 0.5,
    "xtick.color": GREY,
    "ytick.color": GREY,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "lines.linewidth": 1.0,
}
