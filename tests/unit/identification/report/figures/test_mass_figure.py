"""A payload's mass over time."""

import pytest

from armload_identification.report.figures.mass_figure import mass_figure

pytestmark = pytest.mark.pure


def test_times_without_an_estimate_are_marked_whatever_the_reason():
    """Too little motion, or a mass below zero."""
    (axes,) = mass_figure([(5.0, 1.0, 0.1)], [(10.0, 20.0), (30.0, 40.0)], "a shift").axes
    assert {text.get_text() for text in axes.get_legend().get_texts()} == {"no estimate", "mass, 95 % interval"}
