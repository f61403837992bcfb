"""The spline of a motion, against SciPy's with the same knots by another way."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline, make_lsq_spline

from armload_identification.signals.spline import fitted_spline

pytestmark = pytest.mark.pure


@pytest.mark.parametrize(("samples", "pieces"), [(20, 1), (300, 30), (3000, 500)])
def test_a_fit_is_that_of_scipy(samples, pieces):
    """Outside the knots too, where the end pieces continue."""
    rng = np.random.default_rng(samples)
    x = np.sort(np.concatenate([[0.0, 4.0], rng.uniform(0.0, 4.0, samples)]))
    values = np.sin(np.outer(x, [1.0, 2.0, 5.0])) + 1e-3 * rng.normal(size=(x.size, 3))
    inner = np.sort(rng.choice(np.linspace(0.0, 4.0, pieces + 1)[1:-1], max(0, 4 * pieces // 5 - 1), replace=False))
    knots = np.concatenate([[0.0] * 6, inner, [4.0] * 6])
    found, expected = fitted_spline(x, values, knots), make_lsq_spline(x, values, knots, k=5)
    there = np.linspace(-1e-3, 4.0 + 1e-3, 1000)
    for order in range(4):
        size = np.abs(expected(there, order)).max()
        np.testing.assert_allclose(found(there, order), expected(there, order), atol=1e-7 * size)


def test_with_as_many_coefficients_as_samples_it_passes_through_them():
    x = 0.01 * np.arange(700)
    values = np.sin(np.outer(x, [1.0, 3.0]))
    expected = make_interp_spline(x, values, k=5)
    found = fitted_spline(x, values, expected.t)
    np.testing.assert_allclose(found(x), values, atol=1e-12)
    np.testing.assert_allclose(found(x, 2), expected(x, 2), atol=1e-7)


def test_a_coefficient_without_a_sample_is_an_error():
    x = np.concatenate([np.linspace(0.0, 1.0, 50), np.linspace(3.0, 4.0, 50)])
    knots = np.concatenate([[0.0] * 6, np.linspace(0.0, 4.0, 31)[1:-1], [4.0] * 6])
    with pytest.raises(np.linalg.LinAlgError):
        fitted_spline(x, x[:, None], knots)
