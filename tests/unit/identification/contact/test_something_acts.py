"""The test for a force: its bound, the noise of means, and the two that make it careful: stopping joints and jerk."""

import numpy as np
import pytest
from scipy.stats import chi2, norm

from armload_identification.contact import something_acts
from armload_identification.contact.arm_memory import RememberedState
from armload_identification.contact.contact_levels import TAIL_SIGMAS
from armload_identification.contact.force_rows import ForceRows
from armload_identification.contact.something_acts import ResidualNoise, acting, bounds

N, COUNT = 3, 80
NOISE = ResidualNoise(np.full(N, 0.01), np.full(N, 0.04))
NOTHING = RememberedState(0.0, np.zeros(10 + 3 * N), 1e-12 * np.eye(10 + 3 * N))


def rows(residual_nm, doubt_nm=0.0, acceleration=0.0, inertia=1.0):
    """Rows of 20 ms whose joint 1 has a residual in the last 0.3 s."""
    time_s = 0.02 * np.arange(COUNT)
    residual = np.zeros((COUNT, N))
    residual[-15:, 1] = residual_nm
    swinging = np.zeros((COUNT, N))
    swinging[:, 1] = acceleration * (-1.0) ** np.arange(COUNT)
    return ForceRows(
        time_s,
        np.zeros((COUNT, N)),
        residual,
        np.zeros((COUNT, N, 10 + 3 * N)),
        np.full((COUNT, N), doubt_nm),
        swinging,
        np.ones((COUNT, N)),
        np.full((COUNT, N), inertia),
    )


def ratio(found):
    return acting(found, NOTHING, NOISE)[0]


@pytest.mark.parametrize("freedoms", [3, 6, 7, 16])
def test_the_bounds_are_those_of_chi_squared(freedoms):
    assert bounds(freedoms) == pytest.approx(chi2.isf(norm.sf(TAIL_SIGMAS), freedoms), rel=0.1)


def test_the_noise_of_a_mean_lies_between_its_limits(monkeypatch):
    monkeypatch.setattr(something_acts, "_WINDOWS_S", np.array([1e-6, 1000.0]))
    short, long = ResidualNoise(NOISE.white_nm2, NOISE.coloured_nm2).of_means[:, 0]
    assert short == pytest.approx(0.04 + 0.01 * 0.1 / 1e-6, rel=1e-3)
    assert long == pytest.approx(NOISE.density[0] / 1000.0, rel=1e-2)


def test_a_residual_beyond_its_noise_is_a_force_on_that_joint():
    found, joints = acting(rows(3.0), NOTHING, NOISE)
    assert found > 1.0
    assert np.argmax(np.abs(joints)) == 1
    assert ratio(rows(0.3)) < 1.0


def test_a_joint_that_stops_is_uncertain_for_the_time_that_it_is_slow():
    found = rows(3.0, doubt_nm=3.0)
    assert ratio(found) < 1.0
    found.doubt_nm[-12:] = 0.0
    assert ratio(found) > 1.0


def test_a_joint_whose_acceleration_changes_is_uncertain():
    assert ratio(rows(3.0, acceleration=5.0, inertia=2.0)) < 1.0
    assert ratio(rows(3.0, acceleration=0.19, inertia=2.0)) > 1.0


def test_what_is_not_known_of_the_payload_is_no_force():
    unsure = rows(3.0)
    unsure.columns[:, 1, 0] = 1.0
    unknown = RememberedState(0.0, NOTHING.value, np.eye(10 + 3 * N))
    assert acting(unsure, unknown, NOISE)[0] < 1.0


def test_a_window_with_too_few_rows_says_nothing():
    found = rows(30.0).part(np.arange(COUNT) % 8 == 7)
    assert ratio(found) == 0.0
