"""Constants that are mathematics, and others by what turns at them."""

from __future__ import annotations

from dataclasses import replace
from math import comb
from statistics import NormalDist
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.estimation.uncertainty import NORMAL_HALF_WIDTH
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.identification_errors import RecordingError
from armload_identification.model.joint_states import JointStates
from armload_identification.model.payload import CONFIDENCE
from armload_identification.signals.load_signal import _common_part, load_signal, time_shift
from armload_identification.signals.motion import SCATTER, Motion
from armload_identification.signals.recorded_run import Grid
from armload_identification.signals.signal_constants import SampleNoise
from armload_identification.signals.spline import _knots, fit_motion

pytestmark = pytest.mark.pure


def test_the_median_of_a_normal_magnitude_is_the_quantile_of_three_quarters():
    assert SampleNoise.median_of_normal == pytest.approx(NormalDist().inv_cdf(0.75), rel=1e-15)


def test_the_half_width_of_a_normal_interval_is_its_quantile():
    assert NormalDist().inv_cdf(0.5 + 0.5 * CONFIDENCE) == NORMAL_HALF_WIDTH


def test_the_variance_of_a_third_difference_is_the_sum_of_the_squared_binomials():
    assert SampleNoise.third_difference_gain == sum(comb(3, k) ** 2 for k in range(4))


# Two runs of one motion -----------------------------------------------------------------------------------------------


def motion(raw=0.0, noise=0.0, states=None, **changes):
    """Four samples of one joint."""
    still = JointStates(*np.zeros((3, 4, 1)))
    base = Motion(
        time_s=0.01 * np.arange(4),
        periodic=True,
        states=states or still,
        raw_nm=np.full((4, 1), raw),
        torque_nm=np.full((4, 1), 0.5 * raw),
        valid=np.ones(4, dtype=bool),
        noise_nm=np.array([noise]),
        averaged_noise_nm=np.array([0.5 * noise]),
        noise_source=SCATTER,
        smoothing_loss=np.array([0.1 * noise]),
        periods=2,
        position_fit_rad=np.zeros(1),
        began_s=0.0,
    )
    return replace(base, **changes)


def of_period(position, interval_s=0.01, period_s=1.0, offset_rad=0.0, joints=1, harmonics=2):
    """A run of average periods at positions (K, n)."""
    shape = np.full((1, harmonics), 0.1)
    series = FourierTrajectory(1.0 / period_s, np.array([offset_rad]), shape, shape)
    states = JointStates(position, *np.zeros((2, *position.shape)))
    average = motion(states=states, time_s=interval_s * np.arange(len(position)))
    source = SimpleNamespace(path="a.mcap", truncated=False)
    recording = SimpleNamespace(n=joints, source=source, excitation=SimpleNamespace(trajectory=series))
    return SimpleNamespace(
        recording=recording, periods=2, phases=len(position), motion=average, average_period=lambda _: average
    )


WAVE = 0.5 * np.sqrt(2.0) * np.sin(2.0 * np.pi * np.arange(100) / 100.0)[:, None]
"""Standard deviation 0.5, of which 3 % are 0.015 rad."""


@pytest.mark.parametrize(
    ("path", "apart_rad", "same"),
    [(WAVE, 0.0149, True), (WAVE, 0.0151, False), (0.2 * WAVE, 0.0099, True), (0.2 * WAVE, -0.0101, False)],
)
def test_runs_differ_by_at_most_3_percent_of_the_motion_or_a_hundredth_of_a_radian(path, apart_rad, same):
    pair = of_period(path), of_period(path + apart_rad)
    if same:
        assert load_signal(*pair).mismatch_rad == pytest.approx(abs(apart_rad))
    else:
        with pytest.raises(RecordingError, match=r"not of the same trajectory: .* joint 1 differs by 0\.01\d* rad RMS"):
            load_signal(*pair)


@pytest.mark.parametrize(("interval_s", "same"), [(0.010019, True), (0.010021, False), (0.009979, False)])
def test_periods_of_both_runs_take_as_long_to_two_thousandths(interval_s, same):
    pair = of_period(WAVE, interval_s), of_period(WAVE)
    if same:
        assert load_signal(*pair).shift_s == 0.0
    else:
        with pytest.raises(RecordingError, match=r"one period took (1\.002|0\.9979) s in a\.mcap and 1 s in a\.mcap"):
            load_signal(*pair)


@pytest.mark.parametrize("other", [{"period_s": 1.1}, {"offset_rad": 0.1}, {"harmonics": 3}])
def test_runs_of_other_excitations_or_joints_are_refused(other):
    with pytest.raises(
        RecordingError, match=r"different excitations \(2 harmonics of 1 Hz and \d harmonics? ?of|and \d of"
    ):
        load_signal(of_period(WAVE), of_period(WAVE, **other))
    with pytest.raises(RecordingError, match=r"has 1 joints, a\.mcap has 2"):
        load_signal(of_period(WAVE), of_period(WAVE, joints=2))


# Alignment by position -------------------------------------------------------------------------------------------


def measured(path, begin_s=0.0, lasts_s=8.0, rate_hz=100.0):
    time_s = begin_s + np.arange(round(lasts_s * rate_hz)) / rate_hz
    return fit_motion(time_s, path(time_s))


def wandering(time_s):
    """Two joints whose motion does not repeat itself within 20 s."""
    return np.column_stack([np.sin(0.9 * time_s + 0.05 * time_s**2), 0.7 * np.cos(1.7 * time_s)])


@pytest.mark.parametrize("begin_s", [-1.234, -0.3, 0.0, 0.3, 2.0])
def test_the_shift_is_the_time_that_one_run_began_earlier(begin_s):
    shift_s = time_shift(measured(wandering), measured(wandering, begin_s))
    assert shift_s == pytest.approx(-begin_s, abs=1e-5)


def test_while_one_arm_is_elsewhere_its_run_does_not_count():
    """Up to 0.1 rad it does; a quarter of the run, 0.3 rad away and moving, would otherwise draw the shift."""

    def jogged(time_s):
        return (
            wandering(time_s) + 0.3 * (1.0 + np.sin(time_s))[:, None] / (1.0 + np.exp(40.0 * (time_s - 2.0)))[:, None]
        )

    assert time_shift(measured(wandering), measured(jogged)) == pytest.approx(0.0, abs=3e-3)


@pytest.mark.parametrize(("at_s", "common"), [(4.4, True), (4.6, False)])
def test_a_second_of_common_motion_is_required(at_s, common):
    """A jerk at the end of one run of 5 s and at the start of the other: 1.2 s in common, or 0.8 s."""

    def jerk(time_s):
        return 0.2 * np.exp(-(((time_s - at_s) / 0.1) ** 2))[:, None]

    pair = measured(jerk, 0.0, 5.0), measured(jerk, 2.0 * at_s - 5.0, 5.0)
    if common:
        assert time_shift(*pair) == pytest.approx(5.0 - 2.0 * at_s, abs=1e-3)
    else:
        with pytest.raises(RecordingError, match="have no common motion"):
            time_shift(*pair)


def test_runs_at_rest_are_not_shifted():
    still = measured(lambda time_s: np.zeros((time_s.size, 2)))
    assert time_shift(still, still) == 0.0


@pytest.mark.parametrize(
    ("apart_rad", "until_s", "part_s"),
    [
        (0.054, 6.0, (1.0, 6.0)),
        (0.052, 6.0, (0.0, 10.0)),
        (-0.054, 6.0, (1.0, 6.0)),
        (0.054, 4.1, (1.0, 4.1)),
        (0.054, 3.9, (0.0, 10.0)),
        (0.054, 1.0, (0.0, 10.0)),
    ],
)
def test_the_part_in_which_both_motions_agree_is_used_if_it_is_long_enough(apart_rad, until_s, part_s):
    """To five times the 0.0106 rad that are allowed, and three tenths of 10 s."""
    one = SimpleNamespace(path=SimpleNamespace(spline=lambda time_s: 0.5 * np.sin(2.0 * np.pi * time_s)[:, None]))

    def other(time_s):
        there = (time_s < 0.99 + 2.0) | (time_s > until_s - 0.005 + 2.0)
        return one.path.spline(time_s - 2.0) + apart_rad * there[:, None]

    grid = Grid(0.01 * np.arange(1000), 0.01, 5.0)
    found = _common_part(one, SimpleNamespace(path=SimpleNamespace(spline=other)), grid, 2.0)
    assert found == pytest.approx(part_s, abs=0.011)


# The spline of a motion -----------------------------------------------------------------------------------------------


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
