"""Impacts are left out, and no other samples."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.estimation.blows import struck_samples
from armload_identification.estimation.estimation_constants import Blows

pytestmark = pytest.mark.pure

TIME_S = np.arange(0.0, 20.0, 0.1)


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
