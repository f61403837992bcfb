"""Control limits: no alarm by chance, a change of level is found with its start, a single run is no change."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.verdict.control_limits import control_chart

pytestmark = pytest.mark.pure

RUNS, CHARTS = 30, 18
NOISE, NOTHING = np.full(RUNS, 0.5), np.zeros(RUNS)


def scatter(seed):
    return np.random.default_rng(seed).normal(scale=np.hypot(1.0, 0.5), size=RUNS)


def chart(values, usual=1.0, doubt=NOTHING):
    return control_chart(values, NOISE[: values.size], doubt[: values.size], usual, CHARTS)


def spread(found, noise=0.5):
    """Standard deviation between runs: of a run, less its own noise."""
    return np.sqrt(found.deviation[0] ** 2 - noise**2)


def test_chance_is_no_change():
    alarms = [chart(scatter(seed)) for seed in range(4 * CHARTS)]
    assert sum(len(found.changes) + int(found.alone.sum()) for found in alarms) == 0
    assert np.mean([spread(found) for found in alarms]) == pytest.approx(1.0, abs=0.15)
    assert np.mean([found.outside for found in alarms]) < 0.01


@pytest.mark.parametrize(("since", "size"), [(2, -7.0), (14, -5.0), (26, -5.0), (28, -7.0)])
def test_a_change_of_level_is_found_where_it_began(since, size):
    values = scatter(3)
    values[since:] += size
    (change,) = chart(values).changes
    assert abs(change.index - since) <= 1
    assert change.after - change.before == pytest.approx(size, abs=3.0 * change.deviation)


def test_a_change_that_is_undone_is_two():
    values = scatter(5)
    values[10:20] += 6.0
    there, back = chart(values).changes
    assert (there.index, back.index) == (10, 20)
    assert np.nanmean(chart(values).level[10:20]) == pytest.approx(6.0, abs=1.5)


def test_a_single_run_that_is_off_is_no_change():
    values = scatter(1)
    values[12] += 12.0
    found = chart(values)
    assert found.changes == ()
    assert np.flatnonzero(found.alone).tolist() == [12]
    assert found.outside[12]
    assert np.abs(found.level).max() < 1.0


@pytest.mark.parametrize("place", [0, 6, 11])
@pytest.mark.parametrize("size", [4.2, 5.0, 5.2, 12.0])
def test_the_first_and_the_last_run_are_judged_as_any_other(place, size):
    values = np.zeros(12)
    values[place] = size
    found = control_chart(values, np.zeros(12), np.zeros(12), 1.0, CHARTS)
    assert found.changes == ()
    assert np.flatnonzero(found.outside).tolist() == [place]
    assert np.flatnonzero(found.alone).tolist() == ([place] if size > 5.1 else [])


def test_two_runs_that_differ_are_one_level():
    assert chart(np.array([0.0, 9.0])).level == pytest.approx([4.5, 4.5])
    assert spread(chart(np.array([0.0, 9.0]))) > 1.0
    assert chart(np.array([9.0])).level == pytest.approx([9.0])


def test_all_runs_may_differ_from_the_calibration_by_what_it_does_not_know():
    values = scatter(2) + 4.0
    (change,) = chart(values).changes
    assert (change.index, change.before) == (0, 0.0)
    assert chart(values, doubt=np.full(RUNS, 2.0)).changes == ()


def test_what_was_expected_counts_where_runs_are_few():
    few = np.array([0.01, -0.01, 0.0])
    assert spread(chart(few)) > 0.8
    assert spread(chart(np.tile(few, 10))) < 0.5
    assert spread(chart(few[:1])) == pytest.approx(1.0)
    nothing = chart(np.full(3, np.nan))
    assert nothing.changes == ()
    assert np.isnan(nothing.level).all()


def test_runs_that_do_not_show_it_are_left_out():
    values = scatter(4)
    values[15:] += 6.0
    values[[0, 14, 15]] = np.nan
    (change,) = chart(values).changes
    assert change.index == 16
    assert np.isnan(chart(values).limit[[0, 14, 15]]).all()


def test_limits_are_three_deviations_of_a_run_and_of_the_calibration():
    doubt = np.linspace(0.0, 3.0, RUNS)
    found = chart(scatter(6), doubt=doubt)
    np.testing.assert_allclose(found.deviation, np.hypot(0.5, spread(found)))
    np.testing.assert_allclose(found.limit, 3.0 * np.hypot(found.deviation, doubt))


@pytest.mark.parametrize(("noise", "usual"), [(0.1, 1.0), (0.5, 0.3), (1.0, 1.0)])
def test_the_spread_is_what_runs_differ_beyond_their_noise_and_five_runs_of_what_was_expected(noise, usual):
    """Runs that alternate by 1.2, of 11 differences; 0.6 is the deviation that they show with their noise."""
    values = np.where(np.arange(12) % 2, 0.6, -0.6)
    found = control_chart(values, np.full(12, noise), np.zeros(12), usual, CHARTS)
    seen = max(2.0 * 0.6**2 - noise**2, 0.0)
    assert spread(found, noise) == pytest.approx(np.sqrt((5.0 * usual**2 + 11.0 * seen) / 16.0))


def test_a_level_is_the_weighted_mean_of_its_runs_and_as_uncertain():
    """The first is compared with the calibration, the second with the first; noisy runs count less."""
    noise = np.where(np.arange(20) % 2, 3.0, 0.2)
    values = np.where(np.arange(20) < 8, 10.0, 30.0) + np.where(np.arange(20) % 2, 0.4, 0.0)
    found = control_chart(values, noise, np.full(20, 0.7), 1.0, CHARTS)
    first, second = found.changes
    weight = found.deviation**-2.0
    parts = [slice(0, 8), slice(8, 20)]
    means = [np.average(values[part], weights=weight[part]) for part in parts]
    own = [1.0 / weight[part].sum() for part in parts]
    assert (first.index, first.before, first.after) == (0, 0.0, pytest.approx(means[0]))
    assert (second.index, second.before, second.after) == (8, pytest.approx(means[0]), pytest.approx(means[1]))
    assert first.deviation == pytest.approx(np.sqrt(own[0] + 0.7**2))
    assert second.deviation == pytest.approx(np.sqrt(own[1] + own[0]))
    np.testing.assert_allclose(found.level, np.repeat(means, [8, 12]))
