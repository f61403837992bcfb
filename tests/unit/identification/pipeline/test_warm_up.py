"""Friction that decreases with the logarithm of the time in operation: found with its slope, by session."""

from __future__ import annotations

from datetime import datetime, timedelta
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.pipeline.warm_up import WARM_S, _slope, warm_up

pytestmark = pytest.mark.pure

SLOPE_NM = np.array([-2.0, 0.0])
BEGAN = datetime(2024, 3, 4, 8)
NOISE_NM = 0.05


def friction(at_work_s, level=10.0):
    return level + SLOPE_NM * np.log1p(np.asarray(at_work_s)[..., None] / 600.0)


def run(at_work_s, length_s=60.0, level=10.0, course=None, noise=0.0):
    return SimpleNamespace(
        length_s=length_s,
        friction=SimpleNamespace(value=friction(at_work_s + 0.5 * length_s, level) + noise, noise=np.full(2, NOISE_NM)),
        course=course,
    )


def session(level=10.0, starts_s=range(0, 6000, 600)):
    return [run(start, level=level) for start in starts_s], [BEGAN + timedelta(seconds=start) for start in starts_s]


def test_the_slope_of_a_joint_that_warms_is_found_and_no_other():
    runs, began = session()
    found = warm_up(runs, began)
    np.testing.assert_allclose(found.slope_nm, SLOPE_NM, atol=1e-9)
    np.testing.assert_allclose(found.at_work_s, 600.0 * np.arange(10) + 30.0)
    assert set(found.session) == {0}
    expected = friction(found.at_work_s) - friction(WARM_S)
    np.testing.assert_allclose(found.friction_nm, expected, atol=1e-9)
    np.testing.assert_allclose(found.of_runs_nm, expected, atol=1e-9)
    np.testing.assert_allclose(found.curve_nm(np.array([0.0, WARM_S])), [friction(0.0) - friction(WARM_S), [0.0, 0.0]])


def test_each_session_has_its_own_level_after_two_hours_of_rest():
    first, began = session(10.0)
    second, _ = session(14.0)
    for rest_s, sessions in ((7210.0, {0, 1}), (7190.0, {0})):
        start = began[-1] + timedelta(seconds=60.0 + rest_s)
        later = [start + (moment - BEGAN) for moment in began]
        found = warm_up(first + second, began + later)
        if sessions == {0}:
            assert found is None or not np.allclose(found.slope_nm, SLOPE_NM, atol=0.1)
            continue
        np.testing.assert_allclose(found.slope_nm, SLOPE_NM, atol=1e-9)
        assert set(found.session) == sessions
        np.testing.assert_allclose(found.at_work_s[10:], found.at_work_s[:10])
        np.testing.assert_allclose(found.friction_nm[10:], found.friction_nm[:10], atol=1e-9)


def test_a_long_run_alone_shows_it_by_its_course():
    elapsed = np.linspace(100.0, 3500.0, 12)
    course = SimpleNamespace(
        elapsed_s=elapsed,
        friction_nm=np.array([friction(t) for t in elapsed]),
        noise_nm=np.full((12, 2), NOISE_NM),
    )
    found = warm_up([run(0.0, 3600.0, course=course)], [])
    np.testing.assert_allclose(found.slope_nm, SLOPE_NM, atol=1e-9)
    np.testing.assert_allclose(found.at_work_s, elapsed)
    np.testing.assert_allclose(found.of_runs_nm, [friction(1800.0) - friction(WARM_S)], atol=1e-9)


def test_without_dates_runs_are_sessions_and_show_nothing():
    runs, _ = session()
    assert warm_up(runs, []) is None


@pytest.mark.parametrize(
    "starts_s",
    [(0, 600, 1200, 1800), range(0, 200, 20)],
    ids=["too few runs", "too short a time"],
)
def test_too_little_shows_nothing(starts_s):
    assert warm_up(*session(starts_s=starts_s)) is None


def test_scatter_larger_than_the_noise_counts():
    starts = range(0, 6000, 600)
    wild = 4.0 * (-1.0) ** np.arange(10)
    runs = [run(start, noise=odd) for start, odd in zip(starts, wild, strict=True)]
    assert warm_up(runs, session()[1]) is None


def test_a_joint_that_hardly_moves_is_left_out_where_it_has_no_friction():
    runs, began = session()
    for odd in runs[::2]:
        odd.friction.value[0] = np.nan
    found = warm_up(runs, began)
    np.testing.assert_allclose(found.slope_nm, SLOPE_NM, atol=1e-9)
    assert np.isnan(found.friction_nm[::2, 0]).all()
    expected = friction(found.at_work_s) - friction(WARM_S)
    np.testing.assert_allclose(found.friction_nm[1::2], expected[1::2], atol=1e-9)


def slope(log_time, values, noise=0.1, sessions=0):
    log_time = np.asarray(log_time, dtype=float)
    where = np.broadcast_to(sessions, log_time.shape)
    return _slope(log_time, where, np.asarray(values, dtype=float), np.broadcast_to(noise, log_time.shape))


def test_the_slope_is_that_of_weighted_least_squares_with_a_level_for_each_session():
    log_time, sessions = np.array([0.0, 1.0, 2.0, 0.0, 1.0, 2.0]), np.array([4, 4, 4, 9, 9, 9])
    values = np.array([0.0, 2.1, 4.0, 10.0, 11.9, 14.0])
    found, deviation = slope(log_time, values, sessions=sessions)
    # Information is 2 + 2 over the square of the noise; the residuals are less than that.
    assert (found, deviation) == pytest.approx((2.0, 0.1 / 2.0))
    noise = np.array([0.1, 0.1, 0.1, 0.2, 0.2, 0.2])
    found, deviation = slope(log_time, np.array([0.0, 2.0, 4.0, 0.0, 1.0, 2.0]), noise, sessions)
    # The steeper session counts four times as much; residuals of 0.2 and 0.8 per unit of time on either side.
    scatter = (2.0 * 100.0 * 0.2**2 + 2.0 * 25.0 * 0.8**2) / 3.0
    assert (found, deviation) == pytest.approx((1.8, np.sqrt(scatter / 250.0)))


@pytest.mark.parametrize(
    ("log_time", "known"),
    [
        (np.linspace(0.0, 0.51, 5), True),
        (np.linspace(0.0, 0.49, 5), False),
        (np.linspace(0.0, 2.0, 4), False),
        (np.full(9, 1.0), False),
    ],
)
def test_a_slope_needs_five_points_of_a_session_over_half_of_the_logarithm(log_time, known):
    deviation = 0.1 / max(float(np.linalg.norm(log_time - log_time.mean())), 1e-9)
    assert slope(log_time, 2.0 * log_time) == (pytest.approx((2.0, deviation)) if known else (0.0, np.inf))


def test_points_without_a_value_or_noise_do_not_count():
    log_time = np.arange(7.0)
    values = np.where(log_time == 3.0, np.nan, 2.0 * log_time + 5.0 * (log_time == 6.0))
    found, _ = slope(log_time, values, np.where(log_time == 6.0, 0.0, 0.1))
    assert found == pytest.approx(2.0)


@pytest.mark.parametrize(("size", "found"), [(3.9, False), (4.1, True)])
def test_a_slope_counts_from_four_deviations_on(size, found):
    at_work = np.array([30.0, 630.0, 1230.0, 1830.0, 2430.0, 3030.0])
    log_time = np.log1p(at_work / 600.0)
    of_joint = size * 0.05 / np.linalg.norm(log_time - log_time.mean())
    runs, began = session(starts_s=range(0, 3600, 600))
    for each, log in zip(runs, log_time, strict=True):
        each.friction.value = np.array([0.0, of_joint * log])
    warming = warm_up(runs, began)
    assert (warming is not None) is found
    if found:
        assert warming.slope_nm == pytest.approx([0.0, of_joint])
        assert warming.friction_nm[:, 1] == pytest.approx(of_joint * (log_time - np.log(7.0)))
