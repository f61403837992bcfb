"""A control chart in its axes: what is drawn where, in which colour, and how its dates are written."""

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest
from matplotlib.figure import Figure

from armload_identification.report.figures.control_chart_axes import days_of, draw_control_chart, draw_dates
from armload_identification.report.figures.figure_style import BLUE, INK, VERMILION

PLACE = np.array([1.0, 2.0, 4.0, 8.0])
CHART = SimpleNamespace(
    values=np.array([0.1, -3.0, np.nan, 0.2]),
    limit=np.array([1.0, 1.5, 9.0, 2.0]),
    level=np.array([0.0, 0.1, 0.2, 0.3]),
    outside=np.array([False, True, True, False]),
    alone=np.array([False, False, False, True]),
    changes=(SimpleNamespace(index=3),),
)


@pytest.fixture
def axes():
    return Figure().subplots()


def test_limits_levels_runs_and_changes_are_drawn_in_the_units_of_the_axis(axes):
    draw_control_chart(axes, PLACE, CHART, lambda values: 10.0 + 2.0 * values)
    (band,) = axes.collections
    corners = {(float(x), float(y)) for x, y in band.get_paths()[0].vertices}
    assert {(1.0, 8.0), (1.0, 12.0), (2.0, 7.0), (2.0, 13.0), (8.0, 6.0), (8.0, 14.0)} <= corners
    assert not any(x == 4.0 for x, _ in corners), "a run that does not determine the value"
    level, usual, loud, change = axes.lines
    assert (level.get_color(), usual.get_color(), loud.get_color(), change.get_color()) == (INK, BLUE, *[VERMILION] * 2)
    assert level.get_drawstyle() == "steps-post"
    np.testing.assert_allclose(level.get_xydata(), [[1.0, 10.0], [2.0, 10.2], [8.0, 10.6]])
    np.testing.assert_allclose(usual.get_xydata(), [[1.0, 10.2]])
    np.testing.assert_allclose(loud.get_xydata(), [[2.0, 4.0], [8.0, 10.4]])
    assert (usual.get_marker(), loud.get_marker()) == ("o", "D")
    assert list(change.get_xdata()) == [8.0, 8.0]


def test_moments_are_days():
    first = datetime(2026, 3, 1, 12, tzinfo=UTC)
    np.testing.assert_allclose(np.diff(days_of([first, first + timedelta(hours=6)])), [0.25])
    assert days_of([datetime(1970, 1, 2, tzinfo=UTC)]).tolist() == [1.0]


@pytest.mark.parametrize(
    ("span", "text"),
    [
        (timedelta(days=3), "01 Mar\n2026"),
        (timedelta(days=2.99), "01 Mar\n10:30"),
        (timedelta(minutes=5), "01 Mar\n10:30"),
        (timedelta(minutes=4.9), "01 Mar\n10:30:15"),
        (timedelta(0), "01 Mar\n10:30:15"),
    ],
)
def test_the_shorter_the_span_the_finer_the_dates(axes, span, text):
    first = datetime(2026, 3, 1, 10, 30, 15, tzinfo=UTC)
    place = days_of([first, first + span])
    axes.plot(place, [0.0, 1.0])
    draw_dates(axes, place)
    assert axes.xaxis.get_major_formatter()(place[0] + 1e-9, None) == text
    if not span:
        assert axes.get_xlim() == pytest.approx((place[0] - 0.5, place[0] + 0.5))


@pytest.mark.parametrize(
    ("spacing_s", "pattern"),
    [(7.0, "10:00:"), (200.0, "10:"), (36_000.0, "01 Mar\n"), (864_000.0, "\n2026")],
    ids=["simulated commissioning", "commissioning", "day", "month"],
)
def test_labels_differ_and_are_no_more_precise_than_necessary(spacing_s, pattern):
    first = datetime(2026, 3, 1, 10, tzinfo=UTC)
    place = days_of([first + timedelta(seconds=spacing_s * run) for run in range(4)])
    axes = Figure().add_subplot()
    axes.plot(place, np.zeros(4))
    draw_dates(axes, place)
    low, high = axes.get_xlim()
    labels = [axes.xaxis.get_major_formatter()(tick, 0) for tick in axes.get_xticks() if low <= tick <= high]
    assert len(labels) > 1
    assert len(set(labels)) == len(labels)
    assert any(pattern in label for label in labels)
    assert (labels[0].count(":") == 2) == (spacing_s < 60.0)


def test_lines_and_marks_are_small_and_there_are_at_most_five_ticks(axes):
    draw_control_chart(axes, PLACE, CHART, lambda values: values)
    draw_dates(axes, PLACE)
    level, usual, loud, change = axes.lines
    assert [line.get_linewidth() for line in (level, change)] == [0.7, 0.8]
    assert [line.get_markersize() for line in (usual, loud)] == [2.8, 2.8]
    assert change._unscaled_dash_pattern == (0.0, (3.0, 2.0))
    assert axes.collections[0].get_linewidth() == 0
    for axis in (axes.xaxis, axes.yaxis):
        assert axis.get_major_locator().tick_values(0.0, 8.5)[1] == 2.5, "four parts"
