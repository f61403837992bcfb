"""Constants that are mathematics, and others by what turns at them."""

from __future__ import annotations

from math import comb
from statistics import NormalDist
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.estimation.arm_rows import RowWindow
from armload_identification.estimation.payload_intervals import NORMAL_HALF_WIDTH
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.identification_errors import RecordingError
from armload_identification.model.joint_states import JointStates
from armload_identification.model.payload import CONFIDENCE
from armload_identification.pipeline.operator_notes import _on_signal
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import _common_part, load_signal, time_shift
from armload_identification.signals.periods import _on_grid, _supported_harmonics
from armload_identification.signals.recorded_run import Grid
from armload_identification.signals.repetition import repeated_after
from armload_identification.signals.reversals import reversal_speed, reversal_weights
from armload_identification.signals.signal_constants import SampleNoise
from armload_identification.signals.spline import _knots, fit_motion
from tests.four_samples import motion

pytestmark = pytest.mark.pure


def test_the_median_of_a_normal_magnitude_is_the_quantile_of_three_quarters():
    assert SampleNoise.median_of_normal == pytest.approx(NormalDist().inv_cdf(0.75), rel=1e-15)


def test_the_half_width_of_a_normal_interval_is_its_quantile():
    assert NormalDist().inv_cdf(0.5 + 0.5 * CONFIDENCE) == NORMAL_HALF_WIDTH


def test_the_variance_of_a_third_difference_is_the_sum_of_the_squared_binomials():
    assert SampleNoise.third_difference_gain == sum(comb(3, k) ** 2 for k in range(4))


# Two runs of one motion -----------------------------------------------------------------------------------------------


def of_period(position, interval_s=0.01, period_s=1.0, offset_rad=0.0, joints=1, harmonics=2):
    """A run of average periods at positions (K, n)."""
    shape = np.full((1, harmonics), 0.1)
    series = FourierTrajectory(1.0 / period_s, np.array([offset_rad]), shape, shape)
    states = JointStates(position, *np.zeros((2, *position.shape)))
    valid = np.ones(len(position), dtype=bool)
    average = motion(states=states, time_s=interval_s * np.arange(len(position)), valid=valid)
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
        assert len(found.spline.c) == 9
    else:
        with pytest.raises(RecordingError, match=r"18 samples over 0\.17 s are not enough to fit a motion"):
            fit_motion(time_s, time_s[:, None])


def test_a_slow_motion_has_wide_knots_and_its_noise_is_no_motion():
    rng = np.random.default_rng(1)
    time_s = 0.01 * np.arange(3000)
    position = np.sin(np.outer(time_s, [0.3, 0.5])) + 1e-3 * rng.normal(size=(3000, 2))
    found = fit_motion(time_s, position)
    assert len(found.spline.c) == 15 + 5, "a knot every 2 s"
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


# Periods ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("gap", "empty"), [(1.64, 0), (1.66, 2)])
def test_a_phase_is_interpolated_between_samples_one_and_a_half_intervals_apart(gap, empty):
    """Samples 1.1 steps apart lie on no grid; after the third one the next comes later, and the last is the 20th."""
    place = np.cumsum([0.0, 1.1, 1.1, gap, *[1.1] * 15])
    table = _on_grid(place, 3.0 * place[:, None], 1, 18)
    assert np.flatnonzero(np.isnan(table[0, :, 0])).tolist() == [3][:empty]
    known = ~np.isnan(table[0, :, 0])
    np.testing.assert_allclose(table[0, known, 0], 3.0 * np.arange(18)[known])


@pytest.mark.parametrize(("last", "known"), [(19, True), (18, True), (17, False)])
def test_half_an_interval_after_the_last_sample_a_phase_is_still_its_own(last, known):
    """Samples 1.04 steps apart; the last of 20 phases is 19."""
    place = 1.04 * np.arange(last + 1)
    table = _on_grid(place, place[:, None], 1, 20)
    assert bool(np.isfinite(table[0, 19, 0])) is known


@pytest.mark.parametrize(
    ("phases", "period_s", "most"), [(200, 1.0, 24), (40, 4.0, 8), (400, 10.0, 61), (401, 10.0, 61), (40, 0.9, 4)]
)
def test_a_series_has_an_eighth_of_the_samples_or_up_to_6_25_hz(phases, period_s, most):
    """At low rates not more than 0.225 of the samples; what is above that is noise."""
    for harmonic, found in ((most, most), (most + 1, 2)):
        spectrum = 1e-3 * np.random.default_rng(1).normal(size=(phases // 2 + 1, 1)).astype(complex)
        spectrum[[1, harmonic]] = 1.0
        assert _supported_harmonics(spectrum, 2, phases, period_s) == found


def swing(time_s):
    return np.sin(2.0 * np.pi * time_s / 5.0)[:, None]


@pytest.mark.parametrize(("samples", "found"), [(15, False), (16, True)])
def test_a_period_is_looked_for_in_sixteen_samples(samples, found):
    time_s = np.arange(float(samples))
    period_s = repeated_after(time_s, swing(time_s))
    assert (period_s == pytest.approx(5.0, rel=0.01)) if found else period_s is None


@pytest.mark.parametrize(("travel_rad", "found"), [(0.0099, False), (0.0101, True)])
def test_a_joint_that_travels_a_hundredth_of_a_radian_has_a_period(travel_rad, found):
    time_s = 0.01 * np.arange(1300)
    assert (repeated_after(time_s, 0.5 * travel_rad * swing(time_s)) is not None) is found


@pytest.mark.parametrize(("apart", "found"), [(0.058, True), (0.068, False)])
def test_a_motion_repeats_to_6_percent_of_its_deviation(apart, found):
    """Of the periods the second has a third harmonic of that share: 1 - d^2 / 2 is 0.998 at 0.0632."""
    time_s = 0.005 * np.arange(2200)
    other = apart * np.sin(6.0 * np.pi * time_s / 5.0) * ((time_s >= 5.0) & (time_s < 10.0))
    assert (repeated_after(time_s, swing(time_s) + other[:, None]) is not None) is found


# Joints and gains ------------------------------------------------------------------------------------------------


def test_near_a_reversal_is_a_tenth_of_the_greatest_speed_and_its_direction_turns_within_a_hundredth():
    velocity = np.array([[2.0, 0.0], [0.2, 0.0], [0.0, 0.0]])
    position = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    np.testing.assert_allclose(reversal_weights(position, velocity)[1], [np.sqrt(0.5), 0.0])
    np.testing.assert_allclose(reversal_speed(velocity), [0.02, 1e-4])


def test_nominal_gains_are_known_to_2_percent_and_all_together_to_0_8_or_as_reported_to_2():
    transmission = Transmission(np.ones(2), np.eye(2))
    np.testing.assert_allclose(np.sqrt(np.diag(transmission.covariance)), 0.02)
    assert transmission.gains(from_torque=False).common_deviation == 0.008
    assert transmission.gains(from_torque=True).common_deviation == 0.02


@pytest.mark.parametrize(("ratio", "held"), [(2.7, True), (0.37, True), (2.75, False), (0.36, False)])
def test_gains_of_one_quantity_differ_by_less_than_a_factor_of_e(ratio, held):
    found = Transmission(np.full(2, 50.0), np.eye(2)).held_at(np.array([50.0, 50.0 * ratio]), np.eye(2))
    assert bool(found.gain_nm_a[1] == 50.0 * ratio) is held


def test_rows_are_means_over_a_third_of_a_second_of_joints_that_hardly_turn():
    window = RowWindow.of(200, 0.01, 50)
    assert window.offset.tolist() == list(range(-16, 17))
    directions = np.ones((200, 1)) * [1.0, -0.975, 0.95, 0.9, 0.96]
    np.testing.assert_allclose(window.onward(directions)[1], [1.0, 0.5, 0.0, 0.0, 0.2], atol=1e-9)


@pytest.mark.parametrize(("loss", "said"), [(0.099, False), (0.101, True)])
def test_smoothing_that_removes_a_tenth_is_noted(loss, said):
    run = SimpleNamespace(periods=1, periodic=False)
    signal = SimpleNamespace(
        smoothing_loss=np.array([0.0, loss]), valid=np.ones(4, dtype=bool), loaded=run, unloaded=run
    )
    found = list(_on_signal(signal, np.zeros(4, dtype=bool)))
    assert bool(found) is said
    assert not said or "more than 10 % of the signal of joint 2 (10 %)" in found[0]
