"""Figures inside a page: their text is text, whatever style is in force when they are written."""

from __future__ import annotations

import matplotlib as mpl
import pytest
from matplotlib.figure import Figure

from armload_identification.report.figures.svg import inline_svg


@pytest.mark.parametrize("font_type", ["path", "none"])
def test_text_stays_text_and_keeps_its_size(font_type):
    """As outlines, the letters of the drift's charts were drawn at two thirds of their size."""
    with mpl.rc_context({"svg.fonttype": font_type}):
        figure = Figure(figsize=(2.0, 1.0))
        figure.text(0.1, 0.5, "change of gain, %", fontsize=7.5)
        written = inline_svg(figure, "gain", "Change of a gain.")
    assert ">change of gain, %</text>" in written
    assert "font-size: 7.5px" in written
    assert "<use" not in written
