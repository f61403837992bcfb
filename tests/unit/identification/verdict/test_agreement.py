"""The verdict's statistic: rates of false alarms and detection, outcomes, common gains."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.identification_errors import ModelError
from armload_identification.model.mass_center import MassCenterCovariance
from armload_identification.model.payload import InertialParameters
from armload_identification.verdict.agreement import (
    FLOOR,
    KnownMassCenter,
    LengthNeeded,
    Outcome,
    _held,
    compare_known,
    length_needed,
)
from armload_identification.verdict.payload_verdict import with_gains
from armload_identification.verdict.tolerance import Tolerance

pytestmark = pytest.mark.pure

MASS_KG = 10.0
ROOT = np.array([[0.04, 0, 0, 0], [0.0002, 0.0012, 0, 0], [0, 0.0003, 0.001, 0], [-0.0005, 0, 0.0002, 0.002]])
COVARIANCE = ROOT @ ROOT.T
FREEDOM = 12


def payload(values):
    inertia = 0.05 * np.eye(3)
    return InertialParameters.from_center_of_mass(values[0], values[1:4], inertia)


def moved(*by):
    return TRUE + np.array(by)


def known(values, covariance=COVARIANCE, freedom=np.inf):
    return KnownMassCenter(payload(np.asarray(values, dtype=float)), MassCenterCovariance(covariance, freedom))


TRUE = np.array([MASS_KG, 0.02, 0.1, 0.15])


def drawn(rng, error=(0.0, 0.0, 0.0, 0.0)):
    """Payload and measurement as from two identifications, with estimated covariances."""

    def one(values, extra):
        samples = rng.normal(size=(FREEDOM, 4)) @ ROOT.T
        scattered = values + ROOT @ rng.normal(size=4) + extra
        return known(scattered, samples.T @ samples / FREEDOM, FREEDOM)

    return one(TRUE + error, FLOOR * rng.normal(size=4)), one(TRUE, 0.0)


def outcomes(error, count=1500, tolerance=None):
    rng = np.random.default_rng(5)
    return [compare_known(*drawn(rng, error), tolerance or Tolerance()) for _ in range(count)]


@pytest.mark.long
def test_a_right_payload_differs_in_one_of_a_hundred_comparisons():
    differs = np.mean([result.differs for result in outcomes(np.zeros(4))])
    assert 0.002 <= differs <= 0.02


@pytest.mark.parametrize("axis", range(4))
def test_an_error_of_the_noticeable_size_is_noticed(axis):
    """With known covariances, so that the noticeable error is one number."""
    rng = np.random.default_rng(axis)
    exact = compare_known(known(TRUE), known(TRUE), Tolerance())
    error = np.zeros(4)
    if axis == 0:
        error[0] = exact.noticeable_kg
    else:
        error[1:] = exact.noticeable_m * exact.weakest * (1 if axis == 1 else -1)
    total = np.linalg.cholesky(2.0 * COVARIANCE + np.diag(FLOOR**2))
    seen = [
        compare_known(known(TRUE + error), known(TRUE + total @ rng.normal(size=4)), Tolerance()).differs
        for _ in range(700)
    ]
    assert 0.93 <= np.mean(seen) <= 0.97


def test_the_centre_of_mass_is_seen_better_in_every_other_direction():
    exact = compare_known(known(TRUE), known(TRUE), Tolerance())
    precision = np.linalg.inv(2.0 * COVARIANCE + np.diag(FLOOR**2))[1:, 1:]
    worst = exact.weakest @ precision @ exact.weakest
    rng = np.random.default_rng(1)
    for direction in rng.normal(size=(50, 3)):
        assert direction @ precision @ direction >= (1.0 - 1e-9) * worst * (direction @ direction)
    assert np.linalg.norm(exact.weakest) == pytest.approx(1.0)


def test_right_wrong_and_cannot_tell():
    sharp, blunt = 0.01 * COVARIANCE, 30.0 * COVARIANCE
    heavier = moved(0.03 * MASS_KG, 0, 0, 0)
    assert compare_known(known(TRUE, sharp), known(TRUE, sharp), Tolerance()).outcome is Outcome.RIGHT
    assert compare_known(known(heavier, sharp), known(TRUE, sharp), Tolerance()).outcome is Outcome.WRONG
    assert compare_known(known(heavier, blunt), known(TRUE, blunt), Tolerance()).outcome is Outcome.CANNOT_TELL
    assert compare_known(known(TRUE, blunt), known(TRUE, blunt), Tolerance()).outcome is Outcome.CANNOT_TELL


def test_a_difference_that_is_significant_but_small_is_right():
    """0.5 % of a mass known within 0.04 %: significant, but too small to matter."""
    sharp = 1e-3 * COVARIANCE
    result = compare_known(known(moved(0.05, 0, 0, 0), sharp), known(TRUE, sharp), Tolerance())
    assert result.differs
    assert result.outcome is Outcome.RIGHT
    assert compare_known(known(moved(0.05, 0, 0, 0), sharp), known(TRUE, sharp), Tolerance(0.004)).outcome is (
        Outcome.WRONG
    )


def test_an_insignificant_difference_is_right_where_the_tolerance_would_have_been_noticed():
    exact = compare_known(known(TRUE), known(TRUE), Tolerance())
    tolerance = Tolerance(1.01 * exact.noticeable_kg / MASS_KG, 1.01 * exact.noticeable_m)
    error = 0.7 * exact.noticeable_kg
    result = compare_known(known(TRUE), known(moved(error, 0, 0, 0)), tolerance)
    assert not result.differs
    assert abs(error) + result.half_width_95[0] > result.tolerance_kg
    assert result.outcome is Outcome.RIGHT
    stricter = Tolerance(0.99 * tolerance.mass_share, tolerance.center_m)
    assert compare_known(known(TRUE), known(moved(error, 0, 0, 0)), stricter).outcome is Outcome.CANNOT_TELL


@pytest.mark.parametrize("factor", [0.5, 0.9, 1.1])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 30.0, 1e3, 1e6])
def test_a_payload_ten_per_cent_off_is_never_right(factor, scale):
    rng = np.random.default_rng(3)
    for _ in range(100):
        wrong, measured = drawn(rng, [(factor - 1.0) * MASS_KG, 0, 0, 0])
        spread = [
            KnownMassCenter(x.parameters, MassCenterCovariance(scale * COVARIANCE, 40.0)) for x in (wrong, measured)
        ]
        assert compare_known(*spread, Tolerance()).outcome is not Outcome.RIGHT


def test_the_sign_is_that_of_what_was_measured():
    result = compare_known(known(TRUE), known(moved(0.3, 0.001, 0, 0)), Tolerance())
    np.testing.assert_allclose(result.difference, [0.3, 0.001, 0, 0], atol=1e-12)
    assert result.judged.mass_kg == MASS_KG
    assert result.tolerance_kg == pytest.approx(0.2)


def by_gains(values, gain, slope, correlation=0.0):
    """A payload by gains known to 2 %."""
    n = len(gain)
    covariance = 0.02**2 * ((1.0 - correlation) * np.eye(n) + correlation)
    return KnownMassCenter(
        payload(values), MassCenterCovariance(COVARIANCE, np.inf, np.asarray(gain), np.asarray(slope), covariance)
    )


def held(one, other):
    """(4, 4) what the gains add to the covariance of a difference."""
    return _held(one.covariance, other.covariance)


def test_gains_in_common_count_by_what_they_do_differently():
    slope = np.array([[9.0, 1.0], [0.0, 0.05], [0.01, 0.0], [0.0, 0.0]])
    other = slope + np.outer([0.5, 0, 0, 0], [1, 0])
    one = by_gains(TRUE, [100.0, 50.0], slope)
    same = held(one, by_gains(TRUE, [100.0, 50.0], other))
    np.testing.assert_allclose(same[0, 0], (0.02 * 0.5) ** 2)
    np.testing.assert_allclose(same[1:, 1:], 0.0, atol=1e-12)
    apart = held(one, by_gains(TRUE, [100.0, 51.0], other))
    np.testing.assert_allclose(apart, 0.02**2 * (slope @ slope.T + other @ other.T), atol=1e-12)


def test_gains_that_err_together_count_together():
    """Two gains with fully correlated errors act with the sum of their slopes."""
    slope = np.array([[6.0, 4.0], [0.1, -0.1], [0.0, 0.0], [0.0, 0.0]])
    together = held(by_gains(TRUE, [100.0, 50.0], slope, 1.0), known(TRUE))
    np.testing.assert_allclose(together[0, 0], (0.02 * 10.0) ** 2)
    np.testing.assert_allclose(together[1, 1], 0.0, atol=1e-12)


def test_a_payload_moves_with_its_gains():
    slope = np.array([[6.0, 4.0], [0.1, -0.1], [0.0, 0.0], [0.0, 0.0]])
    was = by_gains(TRUE, [100.0, 50.0], slope)
    gain, covariance = np.array([102.0, 50.0]), 1e-6 * np.eye(2)
    now = with_gains(was, gain, covariance)
    np.testing.assert_allclose(
        (now.parameters.values - was.parameters.values)[:4], slope[:, 0] * np.log(1.02), atol=1e-12
    )
    np.testing.assert_allclose(now.parameters.inertia_about_com, was.parameters.inertia_about_com, atol=1e-12)
    assert now.covariance.same_gains_as(by_gains(TRUE, gain, slope).covariance)
    np.testing.assert_allclose(now.covariance.held, 1e-6 * slope @ slope.T)
    with pytest.raises(ModelError, match="gains of 0 axes"):
        with_gains(known(TRUE), gain, covariance)


def test_the_length_needed_makes_the_tolerance_just_noticeable():
    tolerance = Tolerance(0.015, 0.010)
    one, other = known(TRUE, 4.0 * COVARIANCE, 30.0), known(TRUE, 2.0 * COVARIANCE, 20.0)
    length = length_needed(one, other, tolerance)
    assert length.factor > 1.0
    longer = [
        known(TRUE, x.covariance.measured / length.factor, x.covariance.freedom * length.factor) for x in (one, other)
    ]
    result = compare_known(*longer, tolerance)
    worse = max(result.noticeable_kg / result.tolerance_kg, result.noticeable_m / result.tolerance_m)
    assert worse == pytest.approx(1.0, abs=0.01)
    assert length_needed(known(TRUE, 1e-4 * COVARIANCE), known(TRUE, 1e-4 * COVARIANCE), Tolerance()).factor == 1.0


def test_what_no_length_would_show_is_put_down_to_gains_or_floor():
    slope = np.array([[9.0], [0.0], [0.0], [0.0]])
    far = by_gains(TRUE, [100.0], slope), by_gains(TRUE, [120.0], slope)
    assert length_needed(*far, Tolerance()) == LengthNeeded(np.inf, gains_limit=True)
    assert length_needed(known(TRUE), known(TRUE), Tolerance(0.001, 0.01)) == LengthNeeded(np.inf, gains_limit=False)


def test_few_degrees_of_freedom_confirm_nothing():
    vague = known(TRUE, 4.0 * COVARIANCE, 1.0)
    result = compare_known(vague, vague, Tolerance())
    assert result.critical > 99.0
    assert result.noticeable_kg > MASS_KG / 10.0
    assert result.outcome is Outcome.CANNOT_TELL
    assert np.isfinite(result.noticeable_kg)


def test_intervals_stand_in_for_a_covariance():
    interval = np.array([[9.8, 10.2], [0.018, 0.022], [np.nan, np.nan], [0.14, 0.16]])
    covariance = MassCenterCovariance.from_intervals(interval, MASS_KG)
    deviation = np.sqrt(np.diag(covariance.measured))
    np.testing.assert_allclose(deviation, [0.2 / 1.96, 0.002 / 1.96, 1.0, 0.01 / 1.96], rtol=1e-4)
    result = compare_known(KnownMassCenter(payload(TRUE), covariance), known(TRUE), Tolerance())
    assert result.outcome is Outcome.CANNOT_TELL
    np.testing.assert_allclose(np.abs(result.weakest), [0, 1, 0], atol=0.05)
    half = known(TRUE * [0.5, 1, 1, 1])
    assert (
        compare_known(KnownMassCenter(half.parameters, covariance), known(TRUE), Tolerance()).outcome is Outcome.WRONG
    )


@pytest.mark.parametrize("share", [0.0, 2.0, float("nan")])
def test_a_tolerance_that_is_none_is_refused(share):
    with pytest.raises(ModelError, match="tolerance's share of the mass"):
        Tolerance(mass_share=share)
    with pytest.raises(ModelError, match="tolerance's distance"):
        Tolerance(center_m=-0.01)
