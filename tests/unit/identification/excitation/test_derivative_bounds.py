"""Bounds of derivatives hold on random arms, and are not far too large."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.excitation.derivative_bounds import (
    _fixed_vector,
    _leibniz_product,
    point_rates,
    rate_bounds,
    torque_curvature,
)
from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.model.chain import Chain
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


def test_products_obey_leibniz_and_a_vector_turns_with_its_link():
    """Derivatives of a turning vector of length 1 with every rate 1 are the Bell numbers."""
    assert _leibniz_product(np.array([1.0, 2.0, 3.0]), np.array([4.0, 5.0, 6.0])).tolist() == [4.0, 13.0, 38.0]
    assert _fixed_vector(1.0, np.ones(4)).tolist() == [1.0, 1.0, 2.0, 5.0, 15.0]
    assert _fixed_vector(2.0, np.array([3.0, 0.0, 0.0, 0.0])).tolist() == [2.0, 6.0, 18.0, 54.0, 162.0]


def test_the_bound_of_a_link_that_a_first_joint_carries_is_that_of_the_rules_by_hand():
    """Joint 1 turns at 1 rad/s; joint 2, 0.4 m away, has 2 kg with moments of 0.5 kg m and 0.6 kg m2.

    Of joint 1 both terms of the moment, about joint 2 and by the force there; joint 2's axis turns as well.
    """
    chain = Chain.from_origins(
        [[0.0, 0.0, 0.7], [0.4, 0.0, 0.0]], np.zeros((2, 3)), [[0, 0, 1.0], [0, 0, 1.0]], np.eye(4), [0.0, 0.0, -10.0]
    )
    link = np.array([2.0, 0.3, 0.0, 0.4, 0.1, 0.2, 0.3, 0.0, 0.0, 0.0])
    arm = ArmDynamics(chain, ArmBody(np.array([np.zeros(10), link]), *np.zeros((3, 2)), np.eye(2)))
    rates = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]])
    mass, moment, inertia, apart, gravity = 2.0, 0.5, 0.6, 0.4, 10.0
    about = moment * (gravity + 4.0 * apart) + 8.0 * inertia
    first = about + apart * (4.0 * mass * apart + 4.0 * moment + mass * gravity)
    second = moment * (4.0 * gravity + 9.0 * apart) + 18.0 * inertia
    np.testing.assert_allclose(torque_curvature(arm, rates), [first, second])
    # Of a point 0.3 m from joint 2 the ways from both joints; the first is not moved by where joint 1 is.
    assert point_rates(chain, rates, 2, 0.3) == pytest.approx([0.7] * 4)
