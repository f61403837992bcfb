"""Currents, reported torques and gains: what follows from a transmission, and which ones are refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.identification_errors import ModelError, RecordingError
from armload_identification.signals.joint_torque import Transmission, joint_torque, reported_effort
from armload_identification.signals.signal_constants import NominalGain, ReportedTorque

pytestmark = pytest.mark.pure

GAIN = np.array([20.0, 10.0])
COUPLING = np.array([[1.0, 0.0], [0.5, 1.0]])
"""q_2 = q_axis_2 + 0.5 q_axis_1, so tau_axis_1 = tau_1 + 0.5 tau_2."""
PLAIN = Transmission(GAIN, COUPLING)
ALL = np.array([True, True])
OWN = np.array([[0.04, 0.01], [0.01, 0.09]])


def test_what_is_not_given_is_nominal():
    np.testing.assert_array_equal(PLAIN.calibrated, [False, False])
    np.testing.assert_array_equal(PLAIN.covariance, np.diag(np.full(2, NominalGain.deviation) ** 2))
    np.testing.assert_array_equal(PLAIN.torque_gain, [1.0, 1.0])
    known = Transmission(GAIN, COUPLING, np.array([True, False]))
    np.testing.assert_array_equal(known.covariance, np.diag([0.0, NominalGain.deviation**2]))
    np.testing.assert_array_equal(Transmission(GAIN, COUPLING, covariance=OWN).covariance, OWN)


def test_nothing_of_it_can_be_changed():
    for array in (PLAIN.gain_nm_a, PLAIN.coupling, PLAIN.calibrated, PLAIN.covariance, PLAIN.torque_gain):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"gain_nm_a": [[1.0, 2.0]]}, r"gain_nm_a has shape \(1, 2\); expected \(2,\)"),
        ({"gain_nm_a": [1.0, np.inf]}, r"gain_nm_a contains a number that is not finite: \[1.0, inf\]"),
        ({"gain_nm_a": [1.0, 0.0]}, r"gain_nm_a is \[1.0, 0.0\]; expected numbers above 0"),
        ({"coupling": [[1.0, 2.0], [2.0, 4.0]]}, "cannot be inverted; expected q = C q_axis"),
        ({"coupling": [[1.0, np.nan], [2.0, 4.0]]}, "coupling contains a number that is not finite"),
        ({"calibrated": [True]}, r"calibrated has shape \(1,\); expected \(2,\)"),
        ({"covariance": [[0.1]]}, r"covariance of the gains has shape \(1, 1\); expected \(2, 2\)"),
        ({"covariance": [[0.1, np.nan], [0.0, 0.1]]}, "covariance of the gains contains a number that is not finite"),
        ({"torque_gain": [1.0]}, r"torque_gain has shape \(1,\); expected \(2,\)"),
        ({"torque_gain": [1.0, 0.0]}, r"torque_gain is \[1.0, 0.0\]; expected numbers above 0"),
        ({"torque_gain": [1.0, np.inf]}, r"torque_gain contains a number that is not finite: \[1.0, inf\]"),
    ],
)
def test_one_that_makes_no_sense_is_refused_with_the_reason(changes, text):
    with pytest.raises(ModelError, match=text):
        Transmission(**{"gain_nm_a": GAIN, "coupling": COUPLING, **changes})


@pytest.mark.parametrize(
    ("changes", "from_torque", "common", "fitted"),
    [
        ({}, False, NominalGain.common_deviation, True),
        ({}, True, ReportedTorque.common_deviation, True),
        ({"scale_deviation": 0.07}, False, 0.07, True),
        ({"scale_deviation": 0.0}, True, 0.0, True),
        ({"calibrated": [True, False]}, False, 0.0, False),
        ({"covariance": np.zeros((2, 2))}, False, 0.0, False),
        ({"covariance": np.diag([0.0, 0.01])}, False, NominalGain.common_deviation, True),
    ],
)
def test_only_nominal_gains_are_fitted_and_have_an_error_in_common(changes, from_torque, common, fitted):
    transmission = Transmission(GAIN, COUPLING, **changes, torque_gain=[1.5, 1.5])
    gains = transmission.gains(from_torque=from_torque)
    assert (gains.common_deviation, gains.fitted, gains.from_torque) == (common, fitted, from_torque)
    np.testing.assert_array_equal(gains.value, [1.5, 1.5] if from_torque else GAIN)
    np.testing.assert_allclose(gains.covariance, transmission.covariance + common**2)


def test_the_errors_of_gains_that_are_not_fitted_have_their_covariance():
    held = PLAIN.held_at(GAIN, OWN).gains(from_torque=False)
    np.testing.assert_allclose(held.errors.T @ held.errors, OWN)
    one = PLAIN.held_at(GAIN, np.diag([0.04, 0.0])).gains(from_torque=False)
    np.testing.assert_allclose(np.abs(one.errors), [[0.2, 0.0]])
    assert PLAIN.gains(from_torque=False).errors.shape == (0, 2)


@pytest.mark.parametrize(
    ("gain", "of_current", "of_torque"), [([25.0, 9.0], [25.0, 9.0], [1.0, 1.0]), ([1.2, 0.9], GAIN, [1.2, 0.9])]
)
def test_gains_are_held_of_the_quantity_that_they_resemble(gain, of_current, of_torque):
    held = PLAIN.held_at(np.array(gain), OWN)
    np.testing.assert_array_equal(held.gain_nm_a, of_current)
    np.testing.assert_array_equal(held.torque_gain, of_torque)
    assert held.calibrated.all()


def test_torques_pass_through_the_axes():
    """By hand: tau_2 = tau_axis_2, tau_1 = tau_axis_1 - 0.5 tau_axis_2."""
    np.testing.assert_allclose(PLAIN.joint_torque(np.array([2.0, 3.0])), [40.0 - 0.5 * 30.0, 30.0])
    changed = np.array([25.0, 30.0]) @ PLAIN.changed_by(np.log([2.0, 3.0]))
    np.testing.assert_allclose(changed, [80.0 - 0.5 * 90.0, 90.0])
    reported = replace(PLAIN, torque_gain=np.array([2.0, 3.0])).reported_torque(np.array([25.0, 30.0]))
    np.testing.assert_allclose(reported, changed)
    unchanged = np.array([1.0, 2.0])
    assert PLAIN.reported_torque(unchanged) is unchanged
    np.testing.assert_allclose(replace(PLAIN, torque_gain=np.array([1.0, 2.0])).reported_torque(unchanged), [0.0, 4.0])


def test_reported_torque_comes_before_currents():
    current, torque = np.array([2.0, 3.0]), np.array([1.0, 2.0])
    assert PLAIN.measured(torque, current) is torque
    np.testing.assert_array_equal(PLAIN.measured(None, current), PLAIN.joint_torque(current))
    assert PLAIN.measured(None, None) is None


@pytest.mark.parametrize("column", ["current_a", "torque_nm"])
def test_a_run_in_which_no_effort_changes_was_not_measured(pair, pinocchio_arm, column):
    effort = np.ones_like(pair[0].position_rad)
    run = replace(pair[0], **{"current_a": None, column: effort})
    with pytest.raises(RecordingError, match=f"every column of {column} is constant, so nothing was measured"):
        joint_torque(run, pinocchio_arm.transmission)
    effort[0, 3] = 2.0
    assert np.ptp(joint_torque(run, pinocchio_arm.transmission), axis=0).any()
    with pytest.raises(RecordingError, match=r"neither motor current nor joint torque\. Record 6078 or 6077"):
        reported_effort(replace(run, current_a=None, torque_nm=None))
