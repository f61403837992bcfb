"""Fourier trajectories: derivatives, bounds between samples, and the excitation file."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armload_identification.excitation.excitation_file import (
    format_excitation,
    parse_excitation,
    read_excitation,
    write_excitation,
)
from armload_identification.excitation.fourier import Excitation, FourierTrajectory, fourier_basis
from armload_identification.excitation.limit_margins import LimitMargins
from armload_identification.identification_errors import ExcitationFileError, ModelError

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


@pytest.mark.parametrize("order", range(4))
def test_the_basis_times_the_coefficients_is_the_trajectory(order):
    motion = trajectory()
    times_s = np.linspace(0.0, 13.0, 50)
    coefficients = np.column_stack([motion.offset_rad, motion.sin_rad, motion.cos_rad]).T
    state = motion.evaluate(times_s)
    expected = (state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2, state.jerk_rad_s3)[order]
    got = fourier_basis(motion.base_frequency_hz, motion.harmonics, times_s, order) @ coefficients
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


DESIGN = {
    "criterion": "a-optimal",
    "cost": 1.25e-3,
    "condition_number": 11.0,
    "seed": 3,
    "restarts": 8,
    "command": 'armload design "er50" --seed 3',
    "armload_version": "0.1.0",
}


def test_a_file_reads_back_bit_for_bit(tmp_path):
    motion = trajectory(5)
    path = tmp_path / "excitation.toml"
    write_excitation(path, Excitation(motion, 3, DESIGN))
    got = read_excitation(path)
    assert np.array_equal(got.trajectory.offset_rad, motion.offset_rad)
    assert np.array_equal(got.trajectory.sin_rad, motion.sin_rad)
    assert np.array_equal(got.trajectory.cos_rad, motion.cos_rad)
    assert (got.periods, got.design, got.duration_s) == (3, DESIGN, 30.0)


def test_a_file_without_a_design_reads_back(tmp_path):
    assert parse_excitation(format_excitation(Excitation(trajectory(), 1))).design == {}


MARGINS = LimitMargins(
    np.array([0.1, 0.2, 0.3]),
    np.array([1.0, 2.0, 0.0]),
    np.array([4.0, 5.0, 6.0]),
    np.array([70.0, 80.0, 90.0]),
    np.array([123.4567891, 1e-5, -2.3456789]),
    {"floor": 0.25, "link 1 to tool": 0.0301239},
)


def test_a_file_tells_how_the_design_went_and_what_room_is_left():
    got = parse_excitation(format_excitation(Excitation(trajectory(), 3, DESIGN, (0.0212345678, 0.004), MARGINS)))
    assert got.history == (0.021235, 0.004)
    assert got.margins.clearance_m == {"floor": 0.25, "link 1 to tool": 0.0301239}
    np.testing.assert_array_equal(got.margins.position_rad, MARGINS.position_rad)
    np.testing.assert_array_equal(got.margins.velocity_rad_s, MARGINS.velocity_rad_s)
    # rounded to six digits, and never up
    np.testing.assert_array_equal(got.margins.torque_nm, [123.456, 1e-5, -2.34568])
    assert got.margins.smallest == -2.34568


def test_a_file_without_margins_or_history_has_none():
    got = parse_excitation(format_excitation(Excitation(trajectory(), 3, DESIGN)))
    assert (got.history, got.margins) == ((), None)


GOOD = format_excitation(Excitation(trajectory(), 3, DESIGN, (0.02, 0.004), MARGINS))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            "base_frequency_hz = 0.1",
            "base_frequency_hz = 0.0",
            ("excitation.base_frequency_hz", "0.0", "greater than 0"),
        ),
        (
            "base_frequency_hz = 0.1",
            'base_frequency_hz = "fast"',
            ("excitation.base_frequency_hz", "'fast'", "number"),
        ),
        (
            "base_frequency_hz = 0.1",
            "base_frequency_hz = nan",
            ("excitation.base_frequency_hz", "nan", "finite"),
        ),
        ("base_frequency_hz = 0.1", "", ("excitation.base_frequency_hz", "missing")),
        ("periods = 3", "periods = 0", ("excitation.periods", "0", "at least 1")),
        ("periods = 3", "periods = true", ("excitation.periods", "True", "whole number")),
        ("periods = 3", "periods = 3\nperoids = 4", ("excitation.peroids", "4", "no such key", "periods")),
        ("harmonics = 4", "harmonics = 5", ("excitation.sin_rad", "3 lists of 5 finite numbers")),
        ("offset_rad = [", "offset_rad = [0.0, ", ("excitation.sin_rad", "4 lists of 4")),
        ('criterion = "a-optimal"', 'criterion = "best"', ("design.criterion", "'best'", "condition-number")),
        ("seed = 3", "seed = -1", ("design.seed", "-1")),
        ("history = [0.02, ", 'history = ["low", ', ("design.history", "list of finite numbers")),
        ("[margins]\nposition_rad = [0.1, ", "[margins]\nposition_rad = [", ("margins.position_rad", "3 finite")),
        ("clearance_m = {", "clearance = {", ("margins.clearance", "no such key")),
        ('"floor" = 0.25', '"floor" = "far"', ("margins.clearance_m.floor", "'far'", "number")),
        ("[design]", "[designs]", ("designs", "no such key")),
        ("[excitation]", "[excitement]", ("excitation", "missing", "table")),
        ("[excitation]", "[excitation", ("no TOML",)),
    ],
)
def test_a_bad_file_is_refused_with_file_key_value_and_expectation(tmp_path, old, new, words):
    path = tmp_path / "bad.toml"
    assert old in GOOD
    path.write_text(GOOD.replace(old, new, 1), encoding="utf-8")
    with pytest.raises(ExcitationFileError) as caught:
        read_excitation(path)
    for word in (str(path), *words):
        assert word in str(caught.value)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(ExcitationFileError, match=r"none\.toml: cannot be read"):
        read_excitation(tmp_path / "none.toml")


def test_no_file_is_left_where_it_would_not_read_back(tmp_path):
    path = tmp_path / "excitation.toml"
    with pytest.raises(ExcitationFileError, match=r"design\.command is missing"):
        write_excitation(path, Excitation(trajectory(), 3, {k: v for k, v in DESIGN.items() if k != "command"}))
    assert not path.exists()
