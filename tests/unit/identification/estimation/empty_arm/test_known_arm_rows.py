"""Rows of a payload on a calibrated arm, against their laws and plain least squares with priors."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.estimation.empty_arm.known_arm_rows import MOVING, KnownArmRows, payload_scale
from armload_identification.model.joint_states import JointStates
from armload_identification.model.regressor import payload_regressor

pytestmark = pytest.mark.pure

N, K = 6, 60
NOISE_NM = np.linspace(0.5, 1.5, N)


@pytest.fixture(scope="module")
def known(calibration, pinocchio_arm):
    chain = calibration.level(pinocchio_arm.chain)
    return chain, calibration.known_arm


@pytest.fixture(scope="module")
def states(pinocchio_arm):
    state = pinocchio_arm.trajectory(3, period_s=10.0).evaluate(np.linspace(0.0, 9.0, K))
    return JointStates(state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)


@pytest.fixture(scope="module")
def rows(known, states, pinocchio_arm):
    return KnownArmRows.of(*known, states, pinocchio_arm.payload.theta, NOISE_NM)


def unscaled(rows):
    """(K, n, 28) columns in SI units and without weights."""
    return rows.tall.reshape(K, N, -1) / rows.weight[:, :, None]


def test_a_row_counts_less_the_slower_its_joint_is(rows, known, states):
    _, arm = known
    x = (states.velocity_rad_s / (MOVING * arm.body.reversal_speed_rad_s)) ** 2
    np.testing.assert_allclose(rows.weight, x / np.sqrt(1.0 + x**2) / NOISE_NM)


def test_columns_of_the_payload_are_its_torque_and_what_the_gears_lose_of_it(rows, known, states, pinocchio_arm):
    chain, arm = known
    theta = pinocchio_arm.payload.theta
    found = unscaled(rows)[:, :, :10] @ (theta / rows.scale)
    load = payload_regressor(chain, *states) @ theta
    whole = arm.body.link_torque(chain, *states) + load
    direction = np.tanh(states.velocity_rad_s / arm.body.reversal_speed_rad_s)
    np.testing.assert_allclose(found, load * (1.0 + arm.body.load_friction * direction * np.sign(whole)))


def test_changes_of_friction_are_coulomb_viscous_and_offset_of_each_joint(rows, known, states):
    _, arm = known
    changes = unscaled(rows)[:, :, 10:]
    direction = np.tanh(states.velocity_rad_s / arm.body.reversal_speed_rad_s)
    for kind, law in enumerate((direction, states.velocity_rad_s, np.ones((K, N)))):
        for joint in range(N):
            expected = np.zeros((K, N))
            expected[:, joint] = law[:, joint] * arm.friction_spread[kind, joint]
            np.testing.assert_allclose(changes[:, :, N * kind + joint], expected)


def test_the_unit_is_a_payload_that_the_strongest_joint_holds_at_half_a_metre():
    scale = payload_scale(np.array([10.0, 98.1, 3.0]))
    np.testing.assert_allclose(scale, 20.0 * np.array([1.0, 0.3, 0.3, 0.3, *[0.09] * 6]))


def covariance_of(rows, repeats):
    """(28, 28) of least squares with a prior of one unit for each unknown."""
    stacked = np.vstack([np.eye(28), *[rows.tall] * repeats])
    return np.linalg.inv(stacked.T @ stacked)


@pytest.mark.parametrize("repeats", [1, 3])
def test_the_covariance_is_that_of_repeated_rows(rows, repeats):
    expected = covariance_of(rows, repeats)[:10, :10] * np.outer(rows.scale, rows.scale)
    np.testing.assert_allclose(rows.covariance(repeats), expected, rtol=1e-8)
    np.testing.assert_array_equal(rows.covariance(), rows.covariance(1.0))


@pytest.mark.parametrize("repeats", [1, 3])
def test_errors_of_the_arms_torque_shift_the_payload_as_in_the_fit(rows, repeats):
    doubts = np.random.default_rng(1).normal(size=(2, K, N))
    for doubt, shift in zip(doubts, rows.shifts(doubts, repeats), strict=True):
        target = np.concatenate([np.zeros(28), *[(doubt * rows.weight).ravel()] * repeats])
        fitted = np.linalg.lstsq(np.vstack([np.eye(28), *[rows.tall] * repeats]), target)[0]
        np.testing.assert_allclose(shift, fitted[:10] * rows.scale, rtol=1e-8, atol=1e-12)


@pytest.mark.parametrize("repeats", [1, 3])
def test_a_further_unknown_is_estimated_beside_payload_and_friction(rows, repeats):
    """Without a prior of its own: the last unknown of a fit with one column more."""
    rng = np.random.default_rng(2)
    torque, others = rng.normal(size=(K, N)), rng.normal(size=(2, K, N))
    prior = np.hstack([np.eye(28), np.zeros((28, 1))])
    column = (torque * rows.weight).reshape(-1, 1)
    matrix = np.vstack([prior, *[np.hstack([rows.tall, column])] * repeats])
    estimates, information = rows.beside(torque, others, repeats)
    covariance = np.linalg.inv(matrix.T @ matrix)
    assert information == pytest.approx(1.0 / covariance[-1, -1], rel=1e-8)
    for other, estimate in zip(others, estimates, strict=True):
        target = np.concatenate([np.zeros(28), *[(other * rows.weight).ravel()] * repeats])
        assert estimate == pytest.approx(np.linalg.lstsq(matrix, target)[0][-1], rel=1e-8)
