"""Splines, against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline, make_lsq_spline

from armload_identification.identification_errors import RecordingError
from armload_identification.signals.spline import Spline, _knots, fit_motion

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(("samples", "pieces"), [(20, 1), (300, 30), (3000, 500)])
def test_a_fit_is_that_of_scipy(samples, pieces):
    """One block of coefficients and several; outside the knots too, where the end pieces continue."""
    rng = np.random.default_rng(samples)
    x = np.sort(np.concatenate([[0.0, 4.0], rng.uniform(0.0, 4.0, samples)]))
    values = np.sin(np.outer(x, [1.0, 2.0, 5.0])) + 1e-3 * rng.normal(size=(x.size, 3))
    inner = np.sort(rng.choice(np.linspace(0.0, 4.0, pieces + 1)[1:-1], max(0, 4 * pieces // 5 - 1), replace=False))
    knots = np.concatenate([[0.0] * 6, inner, [4.0] * 6])
    found, expected = Spline.fit(x, values, knots, 5), make_lsq_spline(x, values, knots, k=5)
    there = np.linspace(-1e-3, 4.0 + 1e-3, 1000)
    for order in range(4):
        size = np.abs(expected(there, order)).max()
        np.testing.assert_allclose(found(there, order), expected(there, order), atol=1e-7 * size)


def test_with_as_many_coefficients_as_samples_it_passes_through_them():
    x = 0.01 * np.arange(700)
    values = np.sin(np.outer(x, [1.0, 3.0]))
    expected = make_interp_spline(x, values, k=5)
    found = Spline.fit(x, values, expected.t, 5)
    np.testing.assert_allclose(found(x), values, atol=1e-12)
    np.testing.assert_allclose(found(x, 2), expected(x, 2), atol=1e-7)


def test_a_coefficient_without_a_sample_is_an_error():
    x = np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(3.0, 4.0, 50)])
    knots = np.concatenate([[0.0] * 6, np.linspace(0.0, 4.0, 31)[1:-1], [4.0] * 6])
    with pytest.raises(np.linalg.LinAlgError):
        Spline.fit(x, x[:, None], knots, 5)


@pytest.mark.parametrize(
    ("spacing_s", "gap_s", "inner"),
    [
        (2.0, (0.0, 0.0), [2.0, 4.0, 6.0, 8.0]),
        (3.0, (0.0, 0.0), [10.0 / 3.0, 20.0 / 3.0]),
        (2.0, (3.0, 7.0), [2.0, 8.0]),
        (2.0, (4.15, 6.0), [2.0, 4.0, 6.0, 8.0]),
        (2.0, (4.05, 6.0), [2.0, 8.0]),
        (99.0, (0.0, 0.0), []),
    ],
)
def test_knots_are_even_and_each_has_two_samples_on_either_side(spacing_s, gap_s, inner):
    time_s = 0.1 * np.arange(101)
    elapsed = time_s[(time_s <= gap_s[0]) | (time_s >= gap_s[1])]
    np.testing.assert_allclose(_knots(elapsed, spacing_s), [*[0.0] * 6, *inner, *[10.0] * 6])


@pytest.mark.parametrize(("samples", "enough"), [(18, False), (19, True)])
def test_four_pieces_need_more_than_two_samples_for_each_of_nine_coefficients(samples, enough):
    time_s = 5.0 + 0.01 * np.arange(samples)
    if enough:
        found = fit_motion(time_s, time_s[:, None] ** 2)
        np.testing.assert_allclose(found.spline(np.array([0.05]), 1), 2.0 * 5.05, rtol=1e-6)
        assert found.duration_s == pytest.approx(0.18)
        assert len(found.spline.coefficients) == 9
    else:
        with pytest.raises(RecordingError, match=r"18 samples over 0\.17 s are not enough to fit a motion"):
            fit_motion(time_s, time_s[:, None])


def test_a_slow_motion_has_wide_knots_and_its_noise_is_no_motion():
    rng = np.random.default_rng(1)
    time_s = 0.01 * np.arange(3000)
    position = np.sin(np.outer(time_s, [0.3, 0.5])) + 1e-3 * rng.normal(size=(3000, 2))
    found = fit_motion(time_s, position)
    assert len(found.spline.coefficients) == 15 + 5, "a knot every 2 s"
    np.testing.assert_allclose(found.fit_rad, 1e-3, rtol=0.05)


def test_a_motion_that_is_fast_for_its_sampling_has_knots_that_are_finer_than_usual():
    """0.5 Hz at 12.5 Hz: with eight samples between knots a third of the amplitude would be left."""
    rng = np.random.default_rng(2)
    time_s = 0.08 * np.arange(250)
    position = np.sin(np.pi * time_s)[:, None] + 1e-4 * rng.normal(size=(250, 1))
    found = fit_motion(time_s, position)
    assert found.fit_rad[0] < 2e-3
    there = np.linspace(1.0, 18.0, 500)
    np.testing.assert_allclose(found.spline(there)[:, 0], np.sin(np.pi * there), atol=5e-3)
