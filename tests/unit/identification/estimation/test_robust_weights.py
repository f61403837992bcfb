"""Impacts are left out, and no other samples; a large residual counts as its size."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.estimation.estimation_constants import Blows
from armload_identification.estimation.robust_weights import huber_weight, struck_samples

pytestmark = pytest.mark.pure

TIME_S = np.arange(0.0, 20.0, 0.1)


def test_the_square_of_a_weighted_residual_grows_as_the_residual_beyond_two_standard_deviations():
    relative = np.array([0.0, -1.0, 2.0, 8.0, -32.0])
    assert huber_weight(relative) ** 2 * relative**2 == pytest.approx([0.0, 1.0, 4.0, 16.0, 64.0])


@pytest.fixture
def quiet():
    return np.random.default_rng(1).normal(size=(TIME_S.size, 6))


def test_noise_is_no_blow(quiet):
    assert not struck_samples(quiet, TIME_S).any()


def test_a_blow_is_left_out_with_what_lies_around_it(quiet):
    quiet[100, [1, 4]] = [3.0 * Blows.struck, -Blows.struck]
    assert TIME_S[struck_samples(quiet, TIME_S)] == pytest.approx(np.arange(9.6, 10.45, 0.1))


def test_one_joint_alone_is_friction_and_no_blow(quiet):
    quiet[100, 1] = 5.0 * Blows.struck
    assert not struck_samples(quiet, TIME_S).any()
    assert struck_samples(quiet[:, 1:2], TIME_S).any()


def test_a_run_that_is_off_everywhere_was_not_struck(quiet):
    quiet[::5] *= 5.0 * Blows.struck
    assert not struck_samples(quiet, TIME_S).any()
