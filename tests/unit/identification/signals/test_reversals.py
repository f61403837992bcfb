"""Samples near a reversal, and their weights."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.signals.reversals import moving_joints, moving_weights, reversal_speed, reversal_weights

pytestmark = pytest.mark.pure


def test_reversals_weigh_little_and_joints_at_rest_nothing_even_if_they_tremble():
    t = np.linspace(0.0, 1.0, 400, endpoint=False)
    tremble = 1e-4 * np.random.default_rng(1).normal(size=t.size)
    position = np.column_stack([-np.cos(2.0 * np.pi * t) / (2.0 * np.pi), tremble])
    weight = reversal_weights(position, np.column_stack([np.sin(2.0 * np.pi * t), np.gradient(tremble, t)]))
    assert weight[0, 0] == 0.0
    assert weight[100, 0] > 0.999
    assert np.mean(weight[:, 0] ** 2) > 0.92
    assert (weight[:, 1] == 0.0).all()


def test_a_joint_moves_by_its_travel_and_not_by_where_it_is():
    position = np.array([[1.0, 5.0, -3.0], [1.0, 5.0095, -3.0105], [1.0, 5.0, -3.0]])
    np.testing.assert_array_equal(moving_joints(position), [False, False, True])


def test_a_weight_is_the_root_of_a_half_at_its_speed_and_falls_with_the_square():
    slow = np.array([0.2, 0.05])
    weight = moving_weights(np.array([[0.2, -0.05], [0.02, 0.0], [-20.0, 5.0]]), slow)
    np.testing.assert_allclose(weight, [[0.5**0.5, 0.5**0.5], [0.01, 0.0], [1.0, 1.0]], rtol=1e-3)


def test_the_share_of_the_greatest_speed_sets_the_weight():
    velocity = np.array([[0.5, -2.0], [-1.0, 0.4]])
    position = np.array([[0.0, 0.0], [1.0, 1.0]])
    np.testing.assert_allclose(
        reversal_weights(position, velocity, 0.5), moving_weights(velocity, np.array([0.5, 1.0])), rtol=1e-12
    )


def test_the_direction_is_smoothed_in_proportion_to_the_greatest_speed_but_not_below_a_least():
    velocity = np.array([[0.5, -2.0, 0.0], [-1.0, 0.4, 1e-6]])
    speed = reversal_speed(velocity)
    assert speed[1] == pytest.approx(2.0 * speed[0])
    assert speed[0] < 0.05
    assert 0.0 < speed[2] < speed[0]
    np.testing.assert_array_equal(reversal_speed(np.zeros((2, 3)))[0], speed[2])
