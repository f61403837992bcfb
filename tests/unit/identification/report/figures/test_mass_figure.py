"""A payload's mass over time."""

import pytest

from armload_identification.report.figures.mass_figure import mass_figure

pytestmark = pytest.mark.pure


def test_times_without_an_estimate_are_marked_whatever_the_reason():
    """Too little motion, or a mass below zero."""
    (axes,) = mass_figure([(5.0, 1.0, 0.1)], [(10.0, 20.0), (30.0, 40.0)], "a shift").axes
    assert {text.get_text() for text in axes.get_legend().get_texts()} == {"no estimate", "mass, 95 % interval"}


def test_marks_have_their_intervals_and_gaps_their_times():
    figure = mass_figure([(5.0, 1.0, 0.1), (9.0, 2.0, 0.5)], [(10.0, 20.0)], "a shift")
    (axes,) = figure.axes
    assert figure.get_size_inches().tolist() == [9.0, 3.6]
    (bars,) = axes.containers
    assert bars[0].get_xydata().tolist() == [[5.0, 1.0], [9.0, 2.0]]
    assert [end.tolist() for end in bars[2][0].get_segments()[1]] == [[9.0, 1.5], [9.0, 2.5]]
    (gap,) = axes.patches
    assert (gap.get_x(), gap.get_x() + gap.get_width(), gap.get_linewidth()) == (10.0, 20.0, 0)
    assert (axes.get_title(), axes.title.get_fontsize()) == ("a shift", 10)
    assert {text.get_fontsize() for text in axes.get_legend().get_texts()} == {8}
    assert bars[1][0].get_markersize() == 6, "caps of 3 points on either side"


def test_a_shift_without_an_estimate_has_no_legend_unless_there_are_gaps():
    assert mass_figure([], [], "nothing").axes[0].get_legend() is None
    assert len(mass_figure([], [(1.0, 2.0), (3.0, 4.0)], "gaps").axes[0].get_legend().get_texts()) == 1
    assert len(mass_figure([(5.0, 1.0, 0.1)], [], "a shift").axes[0].get_legend().get_texts()) == 1
