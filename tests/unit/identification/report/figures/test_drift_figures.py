"""The control charts: a row for each joint, a column for each quantity, each labelled once."""

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.pipeline.arm_drift import Monitored
from armload_identification.report.figures.drift_figures import charts_drawing
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
