"""Friction far from the calibrated arm's is named; the usual drift is not."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.verdict.recording_checks.friction_validity import (
    friction_difference,
    friction_notes,
    standard_deviations,
)

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
    return friction_difference(ARM, SPEED, left, used, 0.01)


def far(found):
    return standard_deviations(*found, ARM.drift[:2])


def test_a_change_is_found_with_its_covariance():
    assert (far(changed(np.zeros(2), np.zeros(2))) < 1.0).all()
    found, covariance = changed(np.array([0.0, 3.0]), np.array([2.0, 0.0]))
    truth = np.array([[0.0, 3.0], [2.0, 0.0]])
    assert (np.abs(found - truth) < 3.0 * np.sqrt(np.diagonal(covariance, axis1=1, axis2=2).T)).all()
    assert (np.abs(found - truth) < ARM.drift[:2]).all()
    assert (covariance[:, 0, 1] < 0.0).all(), "too much of one is too little of the other"
    np.testing.assert_allclose(far((found, covariance)), [2.0, 10.0], rtol=0.25)


def test_changes_of_opposite_signs_do_not_hide_each_other():
    """At 0.25 rad/s their torques cancel."""
    assert far(changed(np.array([0.0, 2.4]), np.array([0.0, -9.6])))[1] > 10.0


def test_what_the_fit_does_not_separate_is_not_far():
    """An error in a direction that a short run does not determine is the fit's; one across it is a change."""
    drift, open_, across = np.array([[0.1], [0.1]]), np.array([[1.0], [-2.0]]), np.array([[2.0], [1.0]])
    covariance = (open_ @ open_.T)[None]
    assert standard_deviations(open_, covariance, drift)[0] < 1.01
    assert standard_deviations(across, covariance, drift)[0] == pytest.approx(np.sqrt(5.0) / 0.1)
    assert standard_deviations(open_, 0.0 * covariance, drift)[0] == pytest.approx(np.sqrt(5.0) / 0.1)


def test_samples_that_are_not_used_say_nothing():
    assert (far(changed(np.full(2, 9.0), np.zeros(2), used=np.zeros_like(USED))) == 0.0).all()


def test_only_what_is_far_outside_is_worth_a_note():
    assert friction_notes(np.array([4.9, 0.1])) == ()
    (note,) = friction_notes(np.array([0.1, 9.0]))
    assert "joint 2 (9 standard deviations)" in note
    assert "calibrate it again" in note
