"""The figures of a joint: what is drawn where, in which colour and line, and that no peak is lost."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.report.figures import joint_figures
from armload_identification.report.figures.figure_style import BLUE, GREEN, INK, VERMILION
from armload_identification.report.figures.joint_figures import RAW, motion_figure, thin_out, ticks, torque_figure

COUNT = 11
TIME_S = 1.0 * np.arange(COUNT)


@pytest.fixture
def drawn(monkeypatch):
    """The axes of the figure that would be written, upper and lower."""
    figures = []
    monkeypatch.setattr(joint_figures, "inline_svg", lambda figure, *_: figures.append(figure) or "svg")

    def drawn(draw, *given):
        assert draw(*given, 1, "id", "a title") == "svg"
        return figures.pop()

    return drawn


def signal(*, periodic=True):
    """Two joints; the second has a raw torque of 1, 2, ... N m, of which the fourth is not valid."""
    ramp = np.column_stack([np.zeros(COUNT), 1.0 + np.arange(COUNT)])
    states = SimpleNamespace(position_rad=0.1 * ramp, velocity_rad_s=-ramp)
    return SimpleNamespace(
        loaded=SimpleNamespace(time_s=TIME_S, interval_s=1.0, periodic=periodic, states=states),
        raw_nm=ramp,
        torque_nm=ramp + 0.5,
        valid=np.arange(COUNT) != 3,
        averaged_noise_nm=np.array([9.0, 0.25]),
    )


def places(figure):
    """Left, bottom, width and height of the axes, in inches."""
    wide, high = figure.get_size_inches()
    return [np.array(axes.get_position().bounds) * [wide, high, wide, high] for axes in figure.axes]


def test_position_is_above_velocity_on_one_time_axis(drawn):
    figure = drawn(motion_figure, signal().loaded)
    upper, lower = figure.axes
    np.testing.assert_allclose(figure.get_size_inches(), [3.4, 1.95])
    np.testing.assert_allclose(places(figure), [[0.52, 1.19, 2.82, 0.60], [0.52, 0.34, 2.82, 0.60]], atol=1e-9)
    assert [axes.get_title(loc="left") for axes in figure.axes] == ["position, rad", "velocity, rad/s"]
    for axes, values in ((upper, 0.1 * (TIME_S + 1.0)), (lower, -TIME_S - 1.0)):
        np.testing.assert_allclose(axes.lines[0].get_xydata(), np.column_stack([TIME_S, values]))
        assert axes.lines[0].get_color() == BLUE
        assert axes.get_xlim() == (0.0, 11.0)
        assert axes.yaxis.get_major_locator().tick_values(0.0, 3.3).tolist() == [0.0, 2.0, 4.0], "three parts"
        assert axes.xaxis.get_major_locator().tick_values(0.0, 11.0)[1] == 2.5, "five parts"
        assert axes._left_title.get_fontsize() == 7.5
    assert lower.get_xlabel() == "time in the period, s"
    assert (upper.xaxis.get_tick_params()["labelbottom"], upper.get_xlabel()) == (False, "")
    assert not upper.xaxis.get_tick_params()["bottom"]


def test_a_motion_without_a_period_ends_with_its_last_sample(drawn):
    figure = drawn(motion_figure, signal(periodic=False).loaded)
    assert [axes.get_xlim() for axes in figure.axes] == [(0.0, 10.0)] * 2
    assert figure.axes[1].get_xlabel() == "time, s"


def test_torque_is_above_its_residual_between_two_deviations_of_the_noise(drawn):
    figure = drawn(torque_figure, signal(), np.full((COUNT, 2), 4.0))
    upper, lower = figure.axes
    np.testing.assert_allclose(figure.get_size_inches(), [7.0, 2.25])
    np.testing.assert_allclose(places(figure), [[0.52, 1.19, 6.42, 0.91], [0.52, 0.34, 6.42, 0.60]], atol=1e-9)
    measured = np.where(np.arange(COUNT) == 3, np.nan, 1.0 + TIME_S)
    expected = [
        (upper, measured, RAW, 0.6, "-"),
        (upper, measured + 0.5, BLUE, 0.9, "-"),
        (upper, np.full(COUNT, 4.0), VERMILION, 1.5, "--"),
        (lower, measured - 4.0, RAW, 0.6, "-"),
        (lower, measured - 3.5, GREEN, 0.8, "-"),
    ]
    for (axes, values, color, width, style), line in zip(expected, [*upper.lines, *lower.lines[:2]], strict=True):
        assert line.axes is axes
        np.testing.assert_allclose(line.get_xydata(), np.column_stack([TIME_S, values]))
        assert (line.get_color(), line.get_linewidth(), line.get_linestyle()) == (color, width, style)
    assert [line.get_ydata()[0] for line in lower.lines[2:]] == [-0.5, 0.5]
    assert all((line.get_color(), line.get_linewidth()) == (INK, 0.6) for line in lower.lines[2:])
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["payload torque, N m", "measured minus predicted, N m"]
    assert upper.yaxis.get_major_locator().tick_values(0.0, 5.5)[1] == 2.0, "five parts"
    assert lower.yaxis.get_major_locator().tick_values(0.0, 4.5)[1] == 2.0, "four parts"
    assert upper.xaxis.get_major_locator().tick_values(0.0, 11.0)[1] == 2.0, "ten parts of a wide figure"


@pytest.mark.parametrize(
    ("values", "bins", "kept"),
    [
        ([0, 5, 1, 2, -3, 9, 4], 2, [0, 1, 4, 5]),
        ([5, 0, 1, 2, 9, -3], 2, [0, 1, 4, 5]),
        ([0, 5, 1, 2], 2, [0, 1, 2, 3]),
        ([0, 5, 1, 2, 1], 2, [0, 1, 3, 4]),
        ([np.nan, 5, 1, np.nan, np.nan, np.nan, np.nan], 2, [1, 2, 4]),
        ([3, 3, 3, 3, 3], 2, [0, 3]),
    ],
)
def test_of_each_segment_the_least_and_the_greatest_value_are_drawn(values, bins, kept):
    time_s = 0.1 * np.arange(len(values))
    found_s, found = thin_out(time_s, np.array(values, dtype=float), bins)
    np.testing.assert_array_equal(found_s, time_s[kept])
    np.testing.assert_array_equal(found, np.array(values, dtype=float)[kept])


def test_up_to_twelve_hundred_samples_are_all_drawn():
    for count, drawn in ((1200, 1200), (1202, 802)):
        values = np.random.default_rng(1).normal(size=count)
        assert thin_out(np.arange(float(count)), values)[1].size == drawn


@pytest.mark.parametrize(("end", "step"), [(5.0, 1.0), (11.0, 2.5), (12.6, 5.0), (21.0, 5.0), (30.0, 10.0)])
def test_ticks_are_at_round_numbers(end, step):
    assert ticks(5).tick_values(0.0, end)[1] == step
