"""Samples near a reversal, and their weights."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.signals.reversals import reversal_weights

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
