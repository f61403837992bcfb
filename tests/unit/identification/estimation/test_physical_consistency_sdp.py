"""The physical estimate against an independent semidefinite program: cvxpy with Clarabel.

The program is formulated independently, in the pseudo-inertia and from the raw equations; it shares only the margin
with `physical_consistency`.
"""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.estimation.physical_consistency import WRITTEN_MARGIN, make_physical
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.model.payload import InertialParameters
from tests.payload_rows import exactly, payload_of

pytestmark = pytest.mark.pure

cp = pytest.importorskip("cvxpy", reason="cvxpy comes with the development requirements")

UNIT = np.array([1.0, 0.3, 0.3, 0.3] + [0.1] * 6)
RELATIVE = 1e-6


def system(theta, seed, noise=1.0):
    """Raw equations of a payload with parameters of ordinary size."""
    rng = np.random.default_rng(seed)
    rows = rng.normal(size=(60, 3, 10)) / UNIT
    return rows, rows @ theta + noise * rng.normal(size=(60, 3))


def semidefinite(rows, torque, prior=None):
    """The least squares parameters of a possible body, from the equations.

    The unknown is the whitened distance z to the plain solution, theta = plain + R^-1 z, for the solver's accuracy.
    """
    flat, target = rows.reshape(-1, 10), torque.reshape(-1)
    if prior is not None:
        flat, target = np.vstack([flat, prior.rows]), np.concatenate([target, prior.target])
    plain = np.linalg.lstsq(flat, target, rcond=None)[0]
    back = np.linalg.inv(np.linalg.qr(flat, mode="r"))
    size = max(np.sqrt(np.sum((flat @ plain) ** 2)) * 1e-2, 1e-9)
    z = cp.Variable(10)
    theta = plain + size * back @ z
    m, sx, sy, sz, ixx, iyy, izz, ixy, ixz, iyz = (theta[i] for i in range(10))
    half = 0.5 * (ixx + iyy + izz)
    pseudo = cp.bmat(
        [
            [half - ixx, -ixy, -ixz, sx],
            [-ixy, half - iyy, -iyz, sy],
            [-ixz, -iyz, half - izz, sz],
            [sx, sy, sz, m],
        ]
    )
    constraint = pseudo >> WRITTEN_MARGIN * cp.trace(pseudo) * np.eye(4)
    problem = cp.Problem(cp.Minimize(cp.sum_squares(z)), [constraint])
    problem.solve(solver=cp.CLARABEL, tol_gap_abs=1e-10, tol_gap_rel=1e-10, tol_feas=1e-10)
    assert problem.status == cp.OPTIMAL
    return theta.value


def assert_equal(found, expected):
    """Equal to 1e-6 of the parameters' size."""
    difference = np.linalg.norm((found - expected) / UNIT) / np.linalg.norm(expected / UNIT)
    assert difference < RELATIVE, difference


def possible(seed):
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(20, 3)) * [0.1, 0.15, 0.1] + rng.normal(size=3) * 0.2
    mass = rng.uniform(0.5, 6.0) / 20
    lifted = np.column_stack([points, np.ones(20)])
    return InertialParameters.from_pseudo_inertia(mass * lifted.T @ lifted)


def impossible(seed):
    rng = np.random.default_rng(seed)
    inertia = rng.normal(size=(3, 3)) * 0.05
    return InertialParameters.from_center_of_mass(
        rng.uniform(1.0, 6.0), rng.normal(size=3) * 0.3, inertia + inertia.T - 0.05 * np.eye(3)
    )


@pytest.mark.parametrize("seed", range(6))
def test_feasible_data(seed):
    rows, torque = system(possible(seed).theta, seed, noise=0.01)
    fit = payload_of(rows, torque, exactly(3))
    result = make_physical(fit)
    assert (result.theta == fit.theta).all()
    assert_equal(result.theta, semidefinite(rows, torque))


@pytest.mark.parametrize("seed", range(12))
def test_infeasible_data(seed):
    rows, torque = system(impossible(seed).theta, seed, noise=0.1)
    fit = payload_of(rows, torque, exactly(3))
    result = make_physical(fit)
    assert (result.theta != fit.theta).any()
    assert InertialParameters(fit.theta).margin < 0.0
    assert_equal(result.theta, semidefinite(rows, torque))


@pytest.mark.parametrize("seed", range(4))
def test_infeasible_data_with_a_cad_model(seed):
    rows, torque = system(impossible(seed).theta, seed, noise=0.1)
    prior = KnownPayload(cad=possible(100 + seed), confidence=0.02).prior()
    fit = payload_of(rows, torque, exactly(3), prior=prior)
    result = make_physical(fit)
    assert_equal(result.theta, semidefinite(rows, torque, prior))
