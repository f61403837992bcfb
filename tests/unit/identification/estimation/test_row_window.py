"""The window over which rows of any motion are averaged."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from armload_identification.estimation.arm_rows import RowWindow
from armload_identification.signals.signal_constants import RowMean

pytestmark = pytest.mark.pure

INTERVAL_S = 0.01


@pytest.fixture
def window():
    return RowWindow.of(200, INTERVAL_S, 5)


def test_a_row_is_the_mean_about_its_middle(window):
    time_s = np.arange(200) * INTERVAL_S
    values = np.stack([np.ones(200), 3.0 * time_s, np.cos(2.0 * np.pi * 25.0 * time_s)], axis=1)
    rows = window.mean(values)[window.whole]
    middle_s = time_s[window.middle[window.whole]]
    np.testing.assert_allclose(rows[:, 0], 1.0)
    np.testing.assert_allclose(rows[:, 1], 3.0 * middle_s)
    # Signals faster than the window vanish.
    assert np.abs(rows[:, 2]).max() < 0.01
    assert middle_s[0] >= RowMean.half_s - INTERVAL_S
    assert middle_s[-1] <= time_s[-1] - RowMean.half_s + INTERVAL_S


def test_rows_about_a_hole_and_at_the_ends_do_not_count(window):
    valid = np.ones(200, dtype=bool)
    np.testing.assert_array_equal(window.usable(valid), window.whole)
    valid[100] = False
    away = np.abs(window.middle - 100) * INTERVAL_S
    np.testing.assert_array_equal(window.usable(valid), window.whole & (away >= RowMean.half_s))


def test_a_joint_that_turns_within_the_window_does_not_count(window):
    time_s = np.arange(200) * INTERVAL_S
    turning = np.stack([np.ones(200), np.where(time_s < 1.0, 1.0, -1.0), np.zeros(200)], axis=1)
    onward = window.onward(turning)
    np.testing.assert_allclose(onward[window.whole, 0], 1.0)
    np.testing.assert_array_equal(onward[:, 2], 0.0)
    assert onward[np.argmin(np.abs(window.middle - 100)), 1] == 0.0
    np.testing.assert_allclose(onward[np.abs(window.middle - 100) * INTERVAL_S > RowMean.half_s, 1], 1.0)


def test_samples_further_apart_than_the_window_are_rows_themselves():
    values = np.arange(7.0)
    window = RowWindow.of(7, 0.2, 1)
    np.testing.assert_array_equal(window.mean(values), values)
    np.testing.assert_array_equal(window.slope(values), 0.0)
    assert window.whole.all()


def test_the_slope_is_that_of_the_mean(window):
    time_s = np.arange(200) * INTERVAL_S
    values = np.stack([np.ones(200), 3.0 * time_s, np.sin(6.0 * time_s)], axis=1)
    for rows in (window, window.every(2)):
        slope = rows.slope(values)[rows.whole]
        later = replace(rows, middle=rows.middle + 1).mean(values)[rows.whole]
        earlier = replace(rows, middle=rows.middle - 1).mean(values)[rows.whole]
        np.testing.assert_allclose(slope[:, :2], [[0.0, 3.0]] * len(slope), atol=1e-9)
        # The last row's neighbours lack a sample.
        np.testing.assert_allclose(slope[1:-1], (later - earlier)[1:-1] / (2.0 * INTERVAL_S), atol=0.02)


def test_a_period_is_continued_by_itself():
    phase = np.arange(100) / 100.0
    window = RowWindow.of(100, INTERVAL_S, 10, periodic=True)
    rows = window.mean(np.stack([np.sin(2.0 * np.pi * phase), np.cos(2.0 * np.pi * phase)], axis=1))
    assert window.usable(np.ones(100, dtype=bool)).all()
    np.testing.assert_allclose(np.hypot(*rows.T), np.hypot(*rows[5]))


def test_rows_that_are_kept_are_those(window):
    values = np.arange(200.0) ** 2
    np.testing.assert_array_equal(window.only(window.whole).mean(values), window.mean(values)[window.whole])


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_rows_scatter_and_correlate_as_their_windows_overlap_and_as_their_samples_do(window, memory):
    """White samples, and such in which each remembers the one before."""
    fresh = np.sqrt(1.0 - memory**2) * np.random.default_rng(1).normal(size=(300, 10000))
    samples = lfilter([1.0], [1.0, -memory], fresh, axis=0)[100:]
    rows = window.mean(samples)[window.whole]
    expected = window.noise(memory ** np.arange(60))
    found = [np.mean(rows[lag:] * rows[: len(rows) - lag]) for lag in range(12)]
    np.testing.assert_allclose(expected[:12], found, atol=0.015 * found[0])
    assert found[1] > 0.5 * found[0]


def test_rows_of_one_sample_scatter_as_it(window):
    np.testing.assert_array_equal(RowWindow.of(7, 0.2, 1).noise(np.ones(1)), 1.0)
