"""Normal equations of unknowns of which some are hardly known; a large residual counts as its size."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.estimation.normal_equations import eliminate, huber_weight

pytestmark = pytest.mark.pure


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
    part = eliminate(whole.T @ whole, np.zeros(12 + own), 12, {})
    root = part.covariance_root(part.information)
    known_best = np.concatenate([axes[:, 0], np.zeros(own)])
    assert np.sum((known_best @ root) ** 2) == pytest.approx(1.0, rel=1e-6)
    assert np.linalg.norm(whole @ root, 2) <= 1.0 + 1e-6, "the rows in this basis are orthonormal, or less"


def test_the_square_of_a_weighted_residual_grows_as_the_residual_beyond_two_standard_deviations():
    relative = np.array([0.0, -1.0, 2.0, 8.0, -32.0])
    assert huber_weight(relative) ** 2 * relative**2 == pytest.approx([0.0, 1.0, 4.0, 16.0, 64.0])
