"""Friction far from the calibrated arm's is named; the usual drift is not."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.verdict.recording_checks.friction_validity import friction_notes, standard_deviations

pytestmark = pytest.mark.pure

DRIFT = np.array([[0.5, 0.3], [1.0, 0.8]])


def test_a_change_is_measured_by_drift_and_fit_together():
    exact, as_uncertain = np.zeros((2, 2, 2)), DRIFT.T[:, :, None] ** 2 * np.eye(2)
    change = np.array([[0.0, 3.0], [2.0, 0.0]])
    np.testing.assert_allclose(standard_deviations(change, exact, DRIFT), [2.0, 10.0])
    np.testing.assert_allclose(standard_deviations(change, as_uncertain, DRIFT), np.array([2.0, 10.0]) / np.sqrt(2.0))


def test_changes_of_opposite_signs_do_not_hide_each_other():
    """At 0.25 rad/s their torques cancel."""
    change = np.array([[0.0, 2.4], [0.0, -9.6]])
    assert standard_deviations(change, np.zeros((2, 2, 2)), DRIFT)[1] > 10.0


def test_what_the_fit_does_not_separate_is_not_far():
    """An error in a direction that a short run does not determine is the fit's; one across it is a change."""
    drift, open_, across = np.array([[0.1], [0.1]]), np.array([[1.0], [-2.0]]), np.array([[2.0], [1.0]])
    covariance = (open_ @ open_.T)[None]
    assert standard_deviations(open_, covariance, drift)[0] < 1.01
    assert standard_deviations(across, covariance, drift)[0] == pytest.approx(np.sqrt(5.0) / 0.1)
    assert standard_deviations(open_, 0.0 * covariance, drift)[0] == pytest.approx(np.sqrt(5.0) / 0.1)


def test_only_what_is_far_outside_is_worth_a_note():
    assert list(friction_notes(np.array([4.9, 0.1]))) == []
    (note,) = friction_notes(np.array([0.1, 9.0]))
    assert "joint 2 (9 standard deviations)" in note
    assert "calibrate it again" in note
