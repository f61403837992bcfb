"""Normal equations of unknowns of which some are hardly known; impacts are left out, and no other samples."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.estimation.estimation_constants import Blows
from armload_identification.estimation.normal_equations import eliminate, struck_samples

pytestmark = pytest.mark.pure

TIME_S = np.arange(0.0, 20.0, 0.1)


@pytest.mark.parametrize("least", [1e-6, 1e-10, 1e-13, 1e-16])
@pytest.mark.parametrize("own", [0, 3])
def test_what_is_known_well_keeps_its_variance_however_little_is_known_of_the_rest(least, own):
    rng = np.random.default_rng(1)
    axes = np.linalg.qr(rng.normal(size=(12, 12)))[0]
    rows = np.sqrt(np.geomspace(1.0, least, 12))[:, None] * axes.T
    of_own = rng.normal(size=(40, own))
    of_own[:12] *= 1e-4
    shared = np.vstack([rows, np.zeros((28, 12))])
    whole = np.hstack([shared, of_own])
    part = eliminate(whole.T @ whole, np.zeros(12 + own), 12, ())
    root = part.covariance_root(part.information)
    known_best = np.concatenate([axes[:, 0], np.zeros(own)])
    assert np.sum((known_best @ root) ** 2) == pytest.approx(1.0, rel=1e-6)
    assert np.linalg.norm(whole @ root, 2) <= 1.0 + 1e-6, "the rows in this basis are orthonormal, or less"


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
