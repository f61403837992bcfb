"""The physically possible estimate: feasible, unchanged if already possible, and provably the nearest."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.estimation.physical_consistency import (
    WRITTEN_MARGIN,
    make_physical,
    possible_spread,
    root_of,
)
from armload_identification.identification_errors import EstimationError
from armload_identification.model.payload import SMALLEST_MARGIN, InertialParameters
from tests.payload_rows import exactly, payload_of

pytestmark = pytest.mark.pure

UNIT_BODIES = np.array([InertialParameters(row).pseudo_inertia for row in np.eye(10)])


def fit_of(theta, rng, unit=None, samples=200, blind=()):
    """A fit whose plain estimate is theta, with a random metric."""
    unit = np.array([1.0, 0.3, 0.3, 0.3, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]) if unit is None else unit
    regressor = rng.normal(size=(samples, 2, 10)) / unit
    for column in blind:
        regressor[:, :, column] = 0.0
    torque = regressor @ theta
    noise = rng.normal(size=torque.shape)
    rows = regressor.reshape(-1, 10)
    projection, *_ = np.linalg.lstsq(rows, noise.reshape(-1), rcond=None)
    torque = torque + noise - (rows @ projection).reshape(torque.shape)
    return payload_of(regressor, torque, exactly(2))


def cost_of(fit, result):
    """||R (theta - theta_hat)||^2, what the possible estimate costs beyond the plain fit."""
    return np.sum((fit.root @ (result.theta - fit.theta[:10])) ** 2)


def optimality_error(fit, theta):
    """Largest violation of the Karush-Kuhn-Tucker conditions, relative to the gradient.

    The multiplier Z must be positive semidefinite, be zero where the constraint is inactive, and balance the gradient.
    """
    constraint = UNIT_BODIES - WRITTEN_MARGIN * np.trace(UNIT_BODIES, axis1=1, axis2=2)[:, None, None] * np.eye(4)
    matrix = np.tensordot(theta, constraint, 1)
    values, vectors = np.linalg.eigh(matrix)
    tight = vectors[:, values < 1e-8 * values[-1]]
    gradient = 2.0 * fit.root.T @ (fit.root @ (theta - fit.theta[:10]))
    pairs = [(i, j) for i in range(tight.shape[1]) for j in range(i, tight.shape[1])]
    columns = []
    for i, j in pairs:
        unit = np.zeros((tight.shape[1],) * 2)
        unit[i, j] = unit[j, i] = 1.0
        columns.append(np.einsum("kab,ab->k", constraint, tight @ unit @ tight.T))
    scale = fit.scale
    coefficients, *_ = np.linalg.lstsq(np.array(columns).T * scale[:, None], gradient * scale, rcond=None)
    multiplier = np.zeros((tight.shape[1],) * 2)
    for (i, j), value in zip(pairs, coefficients, strict=True):
        multiplier[i, j] = multiplier[j, i] = value
    eigenvalues = np.linalg.eigvalsh(multiplier)
    unbalanced = np.abs((np.array(columns).T @ coefficients - gradient) * scale).max()
    return unbalanced / np.abs(gradient * scale).max(), eigenvalues[0] / eigenvalues[-1]


def test_a_possible_estimate_stays_as_it_is():
    body = InertialParameters.from_center_of_mass(3.0, [0.1, 0.0, 0.2], np.diag([0.02, 0.03, 0.04]))
    fit = fit_of(body.theta, np.random.default_rng(1))
    result = make_physical(fit)
    assert (result.theta == fit.theta).all()
    assert cost_of(fit, result) == 0.0
    np.testing.assert_allclose(result.theta, body.theta, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("seed", range(12))
@pytest.mark.parametrize("strength", [1.0, 1e3])
def test_the_nearest_possible_body_is_found(seed, strength):
    rng = np.random.default_rng(100 + seed)
    center = rng.normal(size=3) * 0.3
    inertia = rng.normal(size=(3, 3)) * 0.03
    impossible = InertialParameters.from_center_of_mass(
        rng.uniform(0.5, 10.0), center, inertia + inertia.T - 0.02 * np.eye(3)
    )
    assert impossible.margin < 0.0
    fit = fit_of(impossible.theta, rng, unit=np.array([1.0, 0.3, 0.3, 0.3] + [0.1] * 6) / strength)
    result = make_physical(fit)
    assert (result.theta != fit.theta).any()
    assert InertialParameters(fit.theta).margin == pytest.approx(impossible.margin, rel=1e-6)
    assert result.margin == pytest.approx(WRITTEN_MARGIN, rel=1e-3)
    balance, sign = optimality_error(fit, result.theta)
    assert balance < 1e-9
    assert sign > -1e-9


def test_the_papers_own_estimate_is_made_possible():
    """Chen 2016, Table 2, products of inertia as tensor elements: eigenvalues -3.18, -2.83, 0.13."""
    mass, center = 9.323, np.array([0.149, 1.081, -0.125])
    theta = np.concatenate([[mass], mass * center, [7.917, 0.420, 8.281, -1.068, 0.158, 1.105]])
    eigenvalues = np.linalg.eigvalsh(InertialParameters(theta).inertia_about_com)
    np.testing.assert_allclose(eigenvalues, [-3.18, -2.83, 0.13], atol=0.01)
    fit = fit_of(theta, np.random.default_rng(3))
    result = make_physical(fit)
    assert result.margin >= SMALLEST_MARGIN
    assert cost_of(fit, result) > 0.0


def test_undetermined_directions_go_to_a_compact_body():
    body = InertialParameters.from_center_of_mass(3.0, [0.1, -0.05, 0.2], np.diag([0.02, 0.03, 0.04]))
    fit = fit_of(body.theta, np.random.default_rng(4), blind=(4, 5, 6, 7, 8, 9))
    assert fit.rank == 4
    result = make_physical(fit)
    assert (result.theta != fit.theta).any()
    assert result.margin >= WRITTEN_MARGIN * 0.999
    assert result.mass_kg == pytest.approx(3.0, rel=1e-4)
    np.testing.assert_allclose(result.center_of_mass_m, [0.1, -0.05, 0.2], atol=1e-4)
    radius = np.sqrt(np.trace(result.inertia_about_com) / 3.0)
    assert 0.01 < radius < 0.2


def test_a_direction_without_data_is_filled_in_beside_what_the_data_tell():
    """Even if the least-norm solution happens to be a possible body; determined values do not change."""
    body = InertialParameters.from_center_of_mass(3.0, [0.1, -0.05, 0.2], np.diag([0.2, 0.3, 0.25]))
    fit = fit_of(body.theta, np.random.default_rng(7), blind=(9,))
    assert InertialParameters(fit.theta).margin > WRITTEN_MARGIN
    result = make_physical(fit)
    assert (result.theta != fit.theta).any()
    assert cost_of(fit, result) < 1e-4
    assert result.theta[9] == pytest.approx(-3.0 * -0.05 * 0.2, abs=1e-4), "as of a ball about the centre"


def test_other_unknowns_are_left_free():
    rng = np.random.default_rng(5)
    impossible = InertialParameters.from_center_of_mass(2.0, [0.1, 0.2, 0.0], -0.02 * np.eye(3))
    regressor = rng.normal(size=(300, 2, 12)) / np.array([1.0, 0.3, 0.3, 0.3] + [0.1] * 6 + [1.0, 1.0])
    theta = np.concatenate([impossible.theta, [5.0, -3.0]])
    fit = payload_of(regressor[..., :10], regressor @ theta, exactly(2), links=regressor[..., 10:])
    result = make_physical(fit)
    rows = regressor.reshape(-1, 12)

    def least_cost(payload):
        left = rows @ theta - rows[:, :10] @ payload
        extra, *_ = np.linalg.lstsq(rows[:, 10:], left, rcond=None)
        return np.sum((left - rows[:, 10:] @ extra) ** 2)

    assert cost_of(fit, result) == pytest.approx(least_cost(result.theta), rel=1e-6)


def test_a_search_that_does_not_settle_is_refused(monkeypatch):
    monkeypatch.setattr("armload_identification.estimation.physical_consistency._NEWTON_STEPS", 2)
    impossible = InertialParameters.from_center_of_mass(3.0, [0.1, 0.0, 0.2], -0.02 * np.eye(3))
    with pytest.raises(EstimationError, match="no physically possible payload was found near the estimate"):
        make_physical(fit_of(impossible.theta, np.random.default_rng(7)))


def test_no_body_is_near_a_negative_mass():
    theta = np.zeros(10)
    theta[0] = -1.0
    with pytest.raises(EstimationError, match="exchanged"):
        make_physical(fit_of(theta, np.random.default_rng(6)))


PLATE = InertialParameters.from_center_of_mass(2.0, [0.05, 0.0, 0.1], np.diag([0.010, 0.015, 0.02499]))
BLOCK = InertialParameters.from_center_of_mass(2.0, [0.05, 0.0, 0.1], np.diag([0.02, 0.02, 0.02]))


def errors_of(seed):
    """(10, 10) covariance of a tenth of a kilogram, 10 mm, and 0.004 kg m2, correlated at random."""
    size = np.array([0.1, *[0.02] * 3, *[0.2 * 0.02] * 6])
    turn = np.random.default_rng(seed).normal(size=(10, 30)) / np.sqrt(30.0)
    return turn @ turn.T * np.outer(size, size)


@pytest.mark.parametrize(("body", "seed"), [(body, seed) for body in (PLATE, BLOCK) for seed in range(3)])
def test_the_spread_of_possible_bodies_is_that_of_samples(body, seed):
    """Errors of the normal distribution, without those that leave no possible body."""
    covariance = errors_of(seed)
    rng = np.random.default_rng(seed)
    plain = rng.multivariate_normal(body.theta, covariance)
    drawn = rng.multivariate_normal(plain, covariance, 40_000)
    bodies = np.tensordot(drawn, UNIT_BODIES, 1)
    kept = drawn[np.linalg.eigvalsh(bodies)[:, 0] > 0.0]
    assert len(kept) > 400
    mean, spread = possible_spread(InertialParameters(plain), root_of(covariance))
    size = np.sqrt(np.diag(covariance))
    np.testing.assert_array_less(np.abs(kept.mean(axis=0) - mean.theta), 0.35 * size)
    longer = np.sqrt(np.diag(spread)) / kept.std(axis=0)
    assert longer.min() > 0.95
    assert longer.max() < 1.3
    assert np.linalg.eigvalsh((covariance - spread) / np.outer(size, size))[0] > -1e-9
