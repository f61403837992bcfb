"""The minimiser on functions whose minimum is known."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.lbfgs import minimise

pytestmark = pytest.mark.pure


def rosenbrock(x: np.ndarray) -> tuple[float, np.ndarray]:
    a, b = 1.0 - x[:-1], x[1:] - x[:-1] ** 2
    gradient = np.zeros_like(x)
    gradient[:-1] = -2.0 * a - 400.0 * x[:-1] * b
    gradient[1:] += 200.0 * b
    return float(np.sum(a**2 + 100.0 * b**2)), gradient


def test_the_minimum_of_a_curved_valley_is_found():
    np.testing.assert_allclose(minimise(rosenbrock, np.full(10, -0.5), 500), np.ones(10), atol=1e-4)


def test_a_badly_scaled_quadratic_is_solved():
    scale, centre = np.logspace(0, 4, 30), np.linspace(-1, 1, 30)

    def function(x: np.ndarray) -> tuple[float, np.ndarray]:
        return float(0.5 * np.sum(scale * (x - centre) ** 2)), scale * (x - centre)

    np.testing.assert_allclose(minimise(function, np.zeros(30), 300), centre, atol=1e-3)


def test_a_function_that_ends_somewhere_is_not_left():
    def barrier(x: np.ndarray) -> tuple[float, np.ndarray]:
        if x[0] <= 0.0:
            return np.inf, np.zeros(1)
        return float(x[0] - 0.01 * np.log(x[0])), 1.0 - 0.01 / x

    assert minimise(barrier, np.array([5.0]), 100)[0] == pytest.approx(0.01, rel=1e-2)


def test_a_minimum_is_not_left():
    np.testing.assert_array_equal(minimise(rosenbrock, np.ones(4), 10), np.ones(4))


def test_the_iterations_are_bounded():
    calls = []

    def counted(x: np.ndarray) -> tuple[float, np.ndarray]:
        calls.append(x)
        return rosenbrock(x)

    minimise(counted, np.full(10, -0.5), 3)
    assert len(calls) <= 1 + 3 * 20
