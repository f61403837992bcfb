"""Friction far from the calibrated arm's is named; what drifts as usual is not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.verdict.friction_validity import friction_change, friction_notes

pytestmark = pytest.mark.pure

TIME_S = np.arange(0.0, 20.0, 0.01)
SPEED = np.column_stack([np.sin(0.8 * TIME_S), 0.5 * np.cos(1.1 * TIME_S)])
USED = np.ones(len(TIME_S), dtype=bool)
ARM = SimpleNamespace(
    fit=SimpleNamespace(
        model=SimpleNamespace(reversal_speed_rad_s=np.array([0.01, 0.005])), residual_rms_nm=np.array([0.5, 0.2])
    ),
    drift=np.array([[0.5, 0.3], [1.0, 0.8], [0.2, 0.1]]),
)


def changed(coulomb_nm, viscous_nm_s_rad, used=USED):
    noise = np.random.default_rng(1).normal(size=SPEED.shape) * [0.5, 0.2]
    left = coulomb_nm * np.tanh(SPEED / [0.01, 0.005]) + viscous_nm_s_rad * SPEED + noise
    return friction_change(ARM, SPEED, left, used, 0.01)


def test_a_change_is_found_in_standard_deviations_of_the_drift():
    assert (np.abs(changed(np.zeros(2), np.zeros(2))) < 1.0).all()
    found = changed(np.array([0.0, 3.0]), np.array([2.0, 0.0]))
    assert found[1, 0] == pytest.approx(2.0, rel=0.3)
    assert found[0, 1] == pytest.approx(10.0, rel=0.2)
    assert (np.abs(found[[0, 1], [0, 1]]) < 1.0).all()


def test_samples_that_are_not_used_say_nothing():
    assert (changed(np.full(2, 9.0), np.zeros(2), used=np.zeros_like(USED)) == 0.0).all()


def test_only_what_is_far_outside_is_worth_a_note():
    assert friction_notes(np.array([4.9, 0.1])) == ()
    (note,) = friction_notes(np.array([0.1, 9.0]))
    assert "joint 2 (9 standard deviations)" in note
    assert "calibrate it again" in note
