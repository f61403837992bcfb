"""A chart in the size of a word: limits, runs and outliers to scale."""

import re
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest

from armload_controller.fleet.arm_runs import Quantity, QuantityKind
from armload_controller.fleet.report import fleet_figures
from armload_controller.fleet.report.fleet_figures import chart_figure, strip
from armload_identification.report.figures.figure_style import BLUE, VERMILION

WIDTH, HEIGHT, MARGIN = 96.0, 18.0, 2.5


def figure(values, limit=1.0, days=None, outside=(), alone=()):
    count = len(values)
    begun = datetime(2026, 3, 1, 10)
    marked = np.zeros((2, count), dtype=bool)
    marked[0, list(outside)] = marked[1, list(alone)] = True
    chart = SimpleNamespace(values=np.array(values), limit=np.full(count, limit), outside=marked[0], alone=marked[1])
    recorded = [begun + timedelta(days=day) for day in (range(count) if days is None else days)]
    return SimpleNamespace(chart=chart, recorded=recorded, quantity="mass <box>")


def drawn(*args, **options):
    svg = strip(figure(*args, **options))
    root = ElementTree.fromstring(svg)
    circles = [(float(c.get("cx")), float(c.get("cy")), c.get("fill")) for c in root.iter() if c.tag.endswith("circle")]
    (band,) = [r for r in root.iter() if r.tag.endswith("rect")]
    return circles, (float(band.get("y")), float(band.get("height"))), svg


def test_runs_are_placed_by_their_day_and_value():
    circles, band, svg = drawn([0.0, 1.0, -1.0], days=(0, 1, 4))
    assert [x for x, _, _ in circles] == pytest.approx(
        [MARGIN, MARGIN + (WIDTH - 2 * MARGIN) / 4, WIDTH - MARGIN], abs=0.06
    )
    assert [y for _, y, _ in circles] == pytest.approx([HEIGHT / 2, MARGIN, HEIGHT - MARGIN], abs=0.06)
    assert band == pytest.approx((MARGIN, HEIGHT - 2 * MARGIN), abs=0.11)
    assert "mass &lt;box&gt; over 3 runs" in svg


def test_what_is_beyond_the_limits_makes_them_narrower():
    circles, (top, height), _ = drawn([0.0, 3.0, 0.0])
    assert circles[1][1] == pytest.approx(MARGIN, abs=0.06)
    assert height == pytest.approx((HEIGHT - 2 * MARGIN) * 2 / 4, abs=0.11)
    assert top == pytest.approx(MARGIN + (HEIGHT - 2 * MARGIN) * 2 / 4, abs=0.06)
    circles, (top, _), _ = drawn([0.0, -3.0, 0.0])
    assert circles[1][1] == pytest.approx(HEIGHT - MARGIN, abs=0.06)
    assert top == pytest.approx(MARGIN, abs=0.06)


def test_outliers_of_either_kind_are_marked():
    circles, _, _ = drawn([0.0, 0.5, 0.2, 0.1], outside=(1,), alone=(3,))
    assert [color for _, _, color in circles] == [BLUE, VERMILION, BLUE, VERMILION]


def test_runs_of_one_moment_are_in_the_middle_and_nothing_divides_by_zero():
    circles, _, svg = drawn([0.0, 0.0], limit=0.0, days=(0, 0))
    assert [x for x, _, _ in circles] == pytest.approx([WIDTH / 2] * 2)
    assert not re.search("nan|inf", svg)


@pytest.mark.parametrize(
    ("kind", "name", "title", "scale"),
    [
        (QuantityKind.MASS, "box", "mass of box, kg", 1.0),
        (QuantityKind.GAIN, "a", "gain of a, %", 100.0),
    ],
)
@pytest.mark.parametrize("twins", [0.5, None])
def test_a_chart_is_in_the_unit_of_its_quantity_about_its_centre(monkeypatch, kind, name, title, scale, twins):
    figures = []
    monkeypatch.setattr(fleet_figures, "inline_svg", lambda figure, *_: figures.append(figure) or "svg")
    shown = figure([0.0, 0.25, -0.25], outside=(1,))
    shown.chart.level, shown.chart.changes = np.zeros(3), ()
    shown.recorded = [moment.replace(tzinfo=UTC) for moment in shown.recorded]
    shown.quantity, shown.center = Quantity(kind, name), 2.0
    shown.twins = twins
    assert chart_figure(shown, "id", "a title") == "svg"
    ((axes,),) = [found.axes for found in figures]
    assert axes.get_title() == title
    _, usual, loud, *level = axes.lines
    np.testing.assert_allclose(usual.get_ydata(), scale * np.array([2.0, 1.75]))
    np.testing.assert_allclose(loud.get_ydata(), scale * np.array([2.25]))
    assert [line.get_ydata()[0] for line in level] == ([scale * twins] if twins else [])
    assert [(line.get_linewidth(), line._unscaled_dash_pattern[1]) for line in level] == [(0.7, (4.0, 3.0))] * len(
        level
    )
    assert axes.figure.get_size_inches().tolist() == [2.6, 1.9]
    np.testing.assert_allclose(axes.get_position().extents, [0.17, 0.24, 0.97, 0.86])
    assert axes.title.get_fontsize() == 7.5
