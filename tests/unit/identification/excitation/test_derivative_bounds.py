"""Bounds of derivatives hold on random arms, and are not far too large."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.excitation.derivative_bounds import point_rates, rate_bounds, torque_curvature
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.model.dynamics import ArmBody, ArmDynamics

pytestmark = pytest.mark.pure

SEEDS = range(12)
STEP_S = 1e-3


def trajectory(rng: np.random.Generator, n: int) -> FourierTrajectory:
    size = rng.uniform(0.1, 1.5) / np.arange(1, 4)
    return FourierTrajectory(0.5, rng.uniform(-1, 1, n), rng.normal(size=(n, 3)) * size, rng.normal(size=(n, 3)) * size)


def second_difference(values: np.ndarray) -> np.ndarray:
    """Greatest second derivative of a periodic signal, per column."""
    return np.abs(np.roll(values, 1, axis=0) - 2.0 * values + np.roll(values, -1, axis=0)).max(axis=0) / STEP_S**2


@pytest.mark.parametrize("seed", SEEDS)
def test_rates_are_never_exceeded(seed):
    path = trajectory(np.random.default_rng(seed), 3)
    state = path.evaluate(np.arange(0.0, path.period_s, STEP_S))
    happens = [np.abs(a).max(axis=0) for a in (state.velocity_rad_s, state.acceleration_rad_s2, state.jerk_rad_s3)]
    happens.append(second_difference(state.acceleration_rad_s2))
    bounds = rate_bounds(path)
    assert np.all(bounds >= np.array(happens) * (1.0 - 1e-12))
    assert np.all(bounds[:3] <= np.array(happens[:3]) * 1.001)
    assert np.all(bounds[3] <= happens[3] * 4.0)


@pytest.mark.parametrize("seed", SEEDS)
def test_no_point_is_faster_than_its_bound_nor_bends_more(seed, any_arm):
    rng = np.random.default_rng(seed)
    chain, _ = any_arm(rng, 4)
    path, point = trajectory(rng, 4), rng.normal(size=3) * 0.3
    step_s = 3.0 * STEP_S  # poses are slow to compute
    positions = path.evaluate(np.arange(0.0, path.period_s, step_s)).position_rad
    poses = np.array([chain.forward(q)[:4] for q in positions])
    placed = np.einsum("tkij,j->tki", poses[:, :, :3, :3], point) + poses[:, :, :3, 3]
    derivatives = [np.diff(placed, order, axis=0) / step_s**order for order in (1, 2, 3)]
    happens = np.array([np.linalg.norm(derivative, axis=2).max(axis=0) for derivative in derivatives])
    for link in range(1, 5):
        bound = point_rates(chain, rate_bounds(path), link, float(np.linalg.norm(point)))[:3]
        assert np.all(happens[:, link - 1] <= bound)
        assert bound[0] <= 10.0 * happens[0, link - 1]
    assert not point_rates(chain, rate_bounds(path), 0, 1.0).any()


def test_a_single_joint_moves_a_point_at_speed_times_lever(any_arm):
    chain, _ = any_arm(np.random.default_rng(1), 1)
    rates = np.array([[2.0], [0.0], [0.0], [0.0]])
    assert point_rates(chain, rates, 1, 0.5) == pytest.approx([1.0, 2.0, 4.0, 8.0])


@pytest.mark.parametrize("seed", SEEDS)
def test_no_torque_bends_more_than_its_bound(seed, any_arm, any_body):
    rng = np.random.default_rng(seed)
    chain, links = any_arm(rng, 1 + seed % 6)
    n, path = chain.n, trajectory(rng, chain.n)
    body = ArmBody(np.array([link.theta for link in links]), rng.uniform(0, 3, n), np.zeros(n), np.zeros(n), np.eye(n))
    arm = ArmDynamics(chain, body.carrying(chain, any_body(rng)))
    state = path.evaluate(np.arange(0.0, path.period_s, STEP_S))
    moving = arm.torque(state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
    still = np.zeros_like(moving)
    resting = arm.torque(state.position_rad, still, still)
    bound = torque_curvature(arm, rate_bounds(path))
    assert np.all(second_difference(moving) <= bound)
    assert np.all(second_difference(resting) <= bound)


def test_the_bound_of_coupled_rotors_holds_whichever_way_their_joints_turn(any_arm):
    """C^-T I C^-1 has negative elements; joints of opposite velocity add up."""
    chain, _ = any_arm(np.random.default_rng(2), 2)
    coupling = np.array([[1.0, 0.0], [0.5, 1.0]])
    arm = ArmDynamics(chain, ArmBody(np.zeros((2, 10)), np.array([2.0, 3.0]), np.zeros(2), np.zeros(2), coupling))
    rates = np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0], [4.0, 5.0]])
    np.testing.assert_allclose(torque_curvature(arm, rates), [2.75 * 4.0 + 1.5 * 5.0, 1.5 * 4.0 + 3.0 * 5.0])


def test_the_bound_is_exact_where_the_mechanics_is_simple(any_arm):
    """Only a rotor: its torque is inertia times acceleration, so the torque's second derivative is known."""
    chain, _ = any_arm(np.random.default_rng(2), 2)
    arm = ArmDynamics(chain, ArmBody(np.zeros((2, 10)), np.array([2.0, 3.0]), np.zeros(2), np.zeros(2), np.eye(2)))
    rates = np.array([[1.0, 1.0], [2.0, 2.0], [3.0, 3.0], [4.0, 5.0]])
    np.testing.assert_allclose(torque_curvature(arm, rates), [8.0, 15.0])
