"""Samples near a reversal, and their weights."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.signals.reversals import reversal_weights

pytestmark = pytest.mark.pure


def test_reversals_weigh_little_and_joints_that_stand_still_keep_their_weight():
    t = np.linspace(0.0, 1.0, 400, endpoint=False)
    weight = reversal_weights(np.column_stack([np.sin(2.0 * np.pi * t), np.zeros_like(t)]))
    assert weight[0, 0] == 0.0
    assert weight[100, 0] > 0.999
    assert np.mean(weight[:, 0] ** 2) > 0.92
    assert (weight[:, 1] == 1.0).all()
