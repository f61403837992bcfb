"""Covariance of mass and centre of mass: what two results share, and what their difference leaves."""

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.model.mass_center import MassCenterCovariance, unknown_deviation

pytestmark = pytest.mark.pure

GAINS = np.array([10.0, 20.0])
SLOPE = np.array([[4.0, 1.0], [0.1, 0.0], [0.0, 0.2], [0.05, 0.05]])
OF_GAINS = np.array([[4e-4, 1e-4], [1e-4, 9e-4]])
MEASURED = np.diag([1e-4, 1e-6, 2e-6, 3e-6])


def result(slope=SLOPE, gains=GAINS, covariance=OF_GAINS, freedom=10.0, calibration=None):
    known = MassCenterCovariance(MEASURED, freedom, gains, slope, covariance)
    return known if calibration is None else replace(known, calibration_slope=calibration)


def sampled(known, rng, logs, errors):
    """Deviations of one result for common errors of gains and calibration."""
    own = rng.multivariate_normal(np.zeros(4), known.measured, size=len(logs))
    return own + logs @ known.gain_slope.T + errors[:, : known.calibration_slope.shape[1]] @ known.calibration_slope.T


@pytest.mark.parametrize("calibration", [None, np.array([[0.02, 0.01], [0.0, 0.001], [0.002, 0.0], [0.0, 0.0]])])
def test_everything_and_the_difference_are_those_of_common_errors(calibration):
    one, two = result(calibration=calibration), result(slope=1.3 * SLOPE, calibration=calibration)
    rng = np.random.default_rng(2)
    logs = rng.multivariate_normal(np.zeros(2), OF_GAINS, size=200_000)
    errors = rng.normal(size=(200_000, 2))
    a, b = sampled(one, rng, logs, errors), sampled(two, rng, logs, errors)
    for drawn, covariance in ((a, one.total), (a - b, one.minus(two).total)):
        deviation = np.sqrt(np.diag(covariance))
        assert (np.abs(np.cov(drawn.T) - covariance) < 0.015 * np.outer(deviation, deviation)).all()


def test_the_same_slopes_cancel_and_other_gains_do_not():
    np.testing.assert_allclose(result().minus(result()).total, 2.0 * MEASURED)
    other = result(gains=1.01 * GAINS)
    assert not result().same_gains_as(other)
    np.testing.assert_allclose(result().minus(other).total, result().total + other.total)


def test_calibrations_of_other_sizes_are_independent():
    one = result(calibration=np.full((4, 1), 0.01))
    two = result(calibration=np.full((4, 2), 0.01))
    np.testing.assert_allclose(one.minus(two).total, 2.0 * MEASURED + 3e-4 * np.ones((4, 4)))


def test_the_more_certain_gains_hold_for_neither():
    """Of two statements about the same gains the wider one counts."""
    wide = result(slope=2.0 * SLOPE, covariance=4.0 * OF_GAINS)
    for one, two in ((result(), wide), (wide, result())):
        np.testing.assert_allclose(one.minus(two).held, SLOPE @ (4.0 * OF_GAINS) @ SLOPE.T)


def test_the_freedom_is_that_of_the_less_certain_one():
    assert result(freedom=5.0).minus(result(freedom=9.0)).freedom == 5.0
    assert result(freedom=9.0).minus(result(freedom=5.0, gains=2.0 * GAINS)).freedom == 5.0


def test_without_gains_nothing_is_shared():
    plain = MassCenterCovariance(MEASURED, 3.0)
    assert not plain.same_gains_as(plain)
    np.testing.assert_array_equal(plain.held, np.zeros((4, 4)))
    np.testing.assert_array_equal(plain.minus(plain).total, 2.0 * MEASURED)


def test_intervals_are_deviations_and_what_is_not_determined_affects_no_comparison():
    interval = np.array([[4.0 - 1.959964, 4.0 + 1.959964], [np.nan, np.nan], [-0.01, 0.03], [0.1, 0.1]])
    known = MassCenterCovariance.from_intervals(interval, 4.0)
    np.testing.assert_allclose(np.sqrt(np.diag(known.measured)), [1.0, 1.0, 0.02 / 1.959964, 0.0])
    assert known.freedom == np.inf
    np.testing.assert_array_equal(unknown_deviation(-4.0), [4.0, 1.0, 1.0, 1.0])
