"""The control charts: a row for each joint, a column for each quantity, each labelled once."""

from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.pipeline.arm_drift import Monitored
from armload_identification.pipeline.warm_up import WARM_S
from armload_identification.report.figures.drift_figures import charts_drawing, warm_up_drawing
from armload_identification.verdict.control_limits import control_chart

NAMES = ("shoulder", "elbow", "wrist")
RUNS = 8


def drift():
    rng = np.random.default_rng(3)
    ones = np.full(RUNS, 0.1)
    charts = {
        quantity: tuple(control_chart(0.1 * rng.normal(size=RUNS), ones, ones, 0.1, 9) for _ in NAMES)
        for quantity in Monitored
    }
    return SimpleNamespace(runs=range(RUNS), began=(), charts=charts)


@pytest.fixture(scope="module")
def grid():
    axes = charts_drawing(drift(), NAMES).axes
    return [axes[len(Monitored) * row : len(Monitored) * (row + 1)] for row in range(len(NAMES))]


def test_joints_are_named_at_the_left_quantities_above_and_runs_below(grid):
    assert [[axes.get_ylabel() for axes in row] for row in grid] == [
        ["1 shoulder", "", ""], ["2 elbow", "", ""], ["3 wrist", "", ""]
    ]  # fmt: skip
    titles = [[axes.get_title() for axes in row] for row in grid]
    assert titles == [["change of friction, N m", "change of gain, %", "relative residual"], [""] * 3, [""] * 3]
    assert [[axes.get_xlabel() for axes in row] for row in grid] == [[""] * 3, [""] * 3, ["run"] * 3]


def test_a_gain_is_drawn_in_per_cent_and_a_residual_as_a_ratio(grid):
    charts = drift().charts
    for column, drawn in ((0, lambda x: x), (1, lambda x: 100.0 * x), (2, np.exp)):
        points = np.concatenate([line.get_ydata() for line in grid[1][column].lines if line.get_marker() in {"o", "D"}])
        values = charts[tuple(Monitored)[column]][1].values
        np.testing.assert_allclose(np.sort(points), np.sort(drawn(values)))


@pytest.mark.parametrize(
    ("hours", "label", "places"),
    [
        ((0, 24, 72), "", [0.0, 1.0, 3.0]),
        ((0, 0, 0), "run", [1.0, 2.0, 3.0]),
        ((), "run", [1.0, 2.0, 3.0]),
    ],
)
def test_runs_stand_at_their_days_if_these_differ_else_at_their_numbers(hours, label, places):
    begun = datetime(2026, 3, 1, tzinfo=UTC)
    found = drift()
    found.runs, found.began = range(3), tuple(begun + timedelta(hours=each) for each in hours)
    found.charts = {
        quantity: tuple(control_chart(np.array([0.1, 0.2, 0.3]), *[np.full(3, 0.1)] * 2, 0.1, 9) for _ in NAMES)
        for quantity in Monitored
    }
    axes = charts_drawing(found, NAMES).axes[-1]
    x = np.concatenate([line.get_xdata() for line in axes.lines if line.get_marker() in {"o", "D"}])
    np.testing.assert_allclose(np.sort(x) - (np.min(x) if len(set(hours)) > 1 else 0.0), places, atol=1e-9)
    assert axes.get_xlabel() == label
    assert axes.get_yscale() == "linear"


class Warming:
    """Two of four joints warm up; the runs lasted up to `longest_s`."""

    slope_nm = np.array([0.5, 0.0, 0.2, 0.0])

    def __init__(self, longest_s):
        self.at_work_s = np.array([60.0, longest_s])
        self.friction_nm = np.arange(8.0).reshape(2, 4)

    def curve_nm(self, work_s):
        return work_s[:, None] * np.ones(4)


@pytest.mark.parametrize(("longest_s", "until_min"), [(300.0, WARM_S / 60.0), (2.0 * WARM_S, WARM_S / 30.0)])
def test_friction_is_drawn_over_the_minutes_in_operation_with_a_curve_where_it_changes(longest_s, until_min):
    axes = warm_up_drawing(Warming(longest_s), ("a", "b", "c", "d")).axes
    assert [each.get_title() for each in axes[:4]] == ["1 a", "2 b", "3 c", "4 d"]
    assert [each.axison for each in axes] == [True] * 4 + [False] * 2
    for joint, each in enumerate(axes[:4]):
        points, *curve = each.lines
        np.testing.assert_allclose(points.get_xydata(), [[1.0, joint], [longest_s / 60.0, 4.0 + joint]])
        assert len(curve) == (joint in (0, 2))
        assert (each.get_ylabel(), each.get_xlabel()) == ("friction, N m", "minutes in operation")
        for line in curve:
            np.testing.assert_allclose(line.get_xdata()[[0, -1]], [0.0, until_min])
            np.testing.assert_allclose(line.get_ydata(), 60.0 * line.get_xdata())


def test_charts_fill_a_page_of_seven_inches_with_an_inch_and_a_quarter_per_joint():
    drawing = charts_drawing(drift(), NAMES)
    high = 3 * 1.25 + 0.6
    np.testing.assert_allclose(drawing.get_size_inches(), [7.0, high])
    first, last = (drawing.axes[place].get_position() for place in (0, -1))
    assert (first.x0, first.y1) == pytest.approx((0.1, 1.0 - 0.2 / high))
    assert (last.x1, last.y0) == pytest.approx((0.97, 0.4 / high))
    second, below = (drawing.axes[place].get_position() for place in (1, 3))
    assert second.x0 - first.x1 == pytest.approx(0.3 * first.width)
    assert first.y0 - below.y1 == pytest.approx(0.3 * first.height)
    assert drawing.axes[0].title.get_fontsize() == 7.5
    assert drawing.axes[-1].xaxis.get_major_locator().tick_values(0.0, 8.5)[1] == 2.5, "four parts"


def test_panels_of_friction_are_three_in_a_row_of_1_6_inches():
    drawing = warm_up_drawing(Warming(300.0), ("a", "b", "c", "d"))
    np.testing.assert_allclose(drawing.get_size_inches(), [7.0, 3.2])
    assert len(drawing.axes) == 6
    axes = drawing.axes[0]
    points, curve = axes.lines
    assert (points.get_markersize(), len(curve.get_xdata()), axes.title.get_fontsize()) == (2.0, 100, 7.5)
    assert axes.yaxis.get_major_locator().tick_values(0.0, 8.5)[1] == 2.5, "four parts"
    assert len(warm_up_drawing(Warming(300.0), ("a", "b", "c")).axes) == 3
