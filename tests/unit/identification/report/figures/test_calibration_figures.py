"""The figures of a calibration: gains with intervals in percent, and friction by day between what is usual."""

import numpy as np
import pytest
from matplotlib.axes import Axes

from armload_identification.report.figures import calibration_figures
from armload_identification.report.figures.calibration_figures import drift_figure, gains_figure
from armload_identification.report.figures.figure_style import BLUE, VERMILION


@pytest.fixture
def drawn(monkeypatch):
    """Calls of the axes by name."""
    calls = {}

    def note(name):
        method = getattr(Axes, name)

        def noted(axes, *values, **style):
            calls.setdefault(name, []).append((*values, style))
            return method(axes, *values, **style)

        monkeypatch.setattr(Axes, name, noted)

    for name in ("errorbar", "plot", "axhspan", "axhline", "set_xticks", "set_xlim"):
        note(name)
    return calls


def test_gains_are_drawn_in_percent_and_those_not_determined_in_another_colour(drawn):
    svg = gains_figure(np.array([0.02, -0.01]), np.array([0.004, 0.05]), [True, False], "two gains")
    found = [(joint, middle, width, style["color"]) for joint, middle, width, style in drawn["errorbar"]]
    assert found == [(1, pytest.approx(2.0), pytest.approx(0.4), BLUE), (2, -1.0, 5.0, VERMILION)]
    places, labels, _ = drawn["set_xticks"][0]
    assert (list(places), labels) == ([1, 2], ["joint 1", "joint 2"])
    assert drawn["set_xlim"][-1][:2] == (0.5, 2.5)
    assert "two gains" in svg
    assert "<svg" in svg


def test_friction_is_drawn_over_two_usual_deviations_at_dates_or_numbers(drawn):
    days = np.array([20000.0, 20000.0, 20003.0])
    svg = drift_figure(days, np.array([0.1, 0.2, -0.3]), 0.25, 2, "friction of c", dated=True)
    assert drawn["axhspan"][0][:2] == (-0.5, 0.5)
    x, y, *_ = drawn["plot"][0]
    np.testing.assert_array_equal([x, y], [days, [0.1, 0.2, -0.3]])
    assert "drift-3" in svg
    assert "04 Oct" in svg
    numbered = drift_figure(np.arange(1.0, 4.0), np.array([0.1, 0.2, -0.3]), 0.25, 2, "friction of c", dated=False)
    assert ">run<" in numbered
    assert "Oct" not in numbered


def test_lines_marks_and_sizes_of_both_figures(drawn, monkeypatch):
    """Gains fill a page of 7 inches, friction a half of it; a line at no change."""
    figures = []
    monkeypatch.setattr(calibration_figures, "inline_svg", lambda figure, *_: figures.append(figure))
    gains_figure(np.array([0.02]), np.array([0.004]), [True], "gains")
    drift_figure(np.arange(2.0), np.arange(2.0), 0.25, 0, "friction", dated=False)
    assert [figure.get_size_inches().tolist() for figure in figures] == [[7.0, 2.1], [3.4, 1.6]]
    assert [(call[0], call[-1]["linewidth"]) for call in drawn["axhline"]] == [(0.0, 0.7)] * 2
    style = {"color": BLUE, "marker": "o", "markersize": 4, "capsize": 4, "linewidth": 1.4}
    assert drawn["errorbar"][0][-1] == style
    assert drawn["plot"][-1][-1]["markersize"] == 3.5
    assert drawn["axhspan"][0][-1]["linewidth"] == 0
    gains, friction = (figure.axes[0].yaxis.get_major_locator() for figure in figures)
    assert (gains.tick_values(0.0, 5.5)[1], friction.tick_values(0.0, 4.5)[1]) == (2.0, 2.0), "five and four parts"
    assert gains.tick_values(0.0, 5.0)[1] == 1.0
    assert friction.tick_values(0.0, 4.0)[1] == 1.0
    assert not any(line.get_visible() for line in figures[0].axes[0].get_xgridlines())
