"""Fourier trajectories: derivatives, and bounds between samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armload_identification.excitation.fourier import FourierTrajectory, fourier_basis
from armload_identification.identification_errors import ModelError

pytestmark = pytest.mark.pure


def trajectory(seed: int = 0, n: int = 3, harmonics: int = 4, frequency_hz: float = 0.1) -> FourierTrajectory:
    rng = np.random.default_rng(seed)
    return FourierTrajectory(
        frequency_hz, rng.normal(size=n), rng.normal(size=(n, harmonics)), rng.normal(size=(n, harmonics))
    )


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), t_s=st.floats(-20.0, 40.0), frequency_hz=st.floats(0.02, 1.0))
def test_each_derivative_is_the_finite_difference_of_the_one_below(seed, t_s, frequency_hz):
    motion = trajectory(seed, frequency_hz=frequency_hz)
    step_s = 1e-5 / frequency_hz
    before, here, after = (motion.evaluate(t) for t in (t_s - step_s, t_s, t_s + step_s))
    pairs = (
        ("position_rad", "velocity_rad_s"),
        ("velocity_rad_s", "acceleration_rad_s2"),
        ("acceleration_rad_s2", "jerk_rad_s3"),
    )
    for order, (lower, upper) in enumerate(pairs, start=1):
        difference = (getattr(after, lower) - getattr(before, lower)) / (2 * step_s)
        scale = (2 * np.pi * 4 * frequency_hz) ** order * 10
        np.testing.assert_allclose(difference, getattr(here, upper), rtol=0, atol=1e-6 * scale)


def test_the_series_is_the_papers_equation():
    motion = FourierTrajectory(0.25, [0.5], [[1.0, 0.2]], [[0.0, -0.3]])
    t_s = 0.7
    w = 2 * np.pi * 0.25
    expected = 0.5 + np.sin(w * t_s) + 0.2 * np.sin(2 * w * t_s) - 0.3 * np.cos(2 * w * t_s)
    assert motion.evaluate(t_s).position_rad == pytest.approx([expected], abs=1e-15)
    assert motion.period_s == 4.0


def test_many_times_give_a_row_each():
    motion = trajectory()
    times_s = np.linspace(0.0, 10.0, 7)
    rows = motion.evaluate(times_s)
    assert rows.jerk_rad_s3.shape == (7, 3)
    single = motion.evaluate(times_s[3])
    np.testing.assert_allclose(rows.acceleration_rad_s2[3], single.acceleration_rad_s2, rtol=0, atol=1e-13)
    np.testing.assert_allclose(rows.position_rad[0], rows.position_rad[-1], atol=1e-12)


@pytest.mark.parametrize("samples", [4, 8, 9, 10, 51])
def test_a_period_is_what_its_samples_are_one_by_one(samples):
    motion = trajectory()
    period = motion.period(samples)
    expected = motion.evaluate(np.arange(samples) * (motion.period_s / samples))
    for name in ("position_rad", "velocity_rad_s", "acceleration_rad_s2", "jerk_rad_s3"):
        np.testing.assert_allclose(getattr(period, name), getattr(expected, name), rtol=0, atol=2e-13)


@pytest.mark.parametrize("order", range(4))
def test_the_basis_times_the_coefficients_is_the_trajectory(order):
    motion = trajectory()
    times_s = np.linspace(0.0, 13.0, 50)
    coefficients = np.column_stack([motion.offset_rad, motion.sin_rad, motion.cos_rad]).T
    state = motion.evaluate(times_s)
    expected = (state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2, state.jerk_rad_s3)[order]
    got = fourier_basis(motion.base_frequency_hz, motion.harmonics, times_s)[order] @ coefficients
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-9)


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), harmonics=st.integers(1, 6))
def test_bounds_hold_between_the_samples_and_are_tight(seed, harmonics):
    motion = trajectory(seed, harmonics=harmonics)
    times_s = np.random.default_rng(seed).uniform(0.0, motion.period_s, 20_000)
    state, bounds = motion.evaluate(times_s), motion.bounds()
    assert np.all(state.position_rad <= bounds.position_max_rad)
    assert np.all(state.position_rad >= bounds.position_min_rad)
    for values, bound in (
        (state.velocity_rad_s, bounds.velocity_max_rad_s),
        (state.acceleration_rad_s2, bounds.acceleration_max_rad_s2),
        (state.jerk_rad_s3, bounds.jerk_max_rad_s3),
    ):
        assert np.all(np.abs(values) <= bound)
        np.testing.assert_allclose(np.abs(values).max(axis=0), bound, rtol=1e-3)


def test_the_bound_covers_a_peak_that_lies_between_two_samples():
    samples = 1024
    half_a_step_s = 0.5 / samples
    peak = 2 * np.pi
    motion = FourierTrajectory(1.0, [0.0], [[np.sin(2 * np.pi * half_a_step_s)]], [[np.cos(2 * np.pi * half_a_step_s)]])
    on_grid = np.abs(motion.evaluate(np.arange(samples) / samples).velocity_rad_s).max()
    assert on_grid < peak <= motion.bounds().velocity_max_rad_s[0] * (1 + 1e-12)


@pytest.mark.parametrize(
    "arguments",
    [
        (0.0, [0.0], [[1.0]], [[1.0]]),
        (np.nan, [0.0], [[1.0]], [[1.0]]),
        (0.1, [0.0, 0.0], [[1.0]], [[1.0]]),
        (0.1, [0.0], [[1.0]], [[1.0, 2.0]]),
        (0.1, [0.0], [[]], [[]]),
        (0.1, [np.inf], [[1.0]], [[1.0]]),
    ],
)
def test_a_trajectory_that_makes_no_sense_is_refused(arguments):
    with pytest.raises(ModelError):
        FourierTrajectory(*arguments)
