"""The verdict on a second trajectory: noise compared with noise, like with like."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.identification_errors import RecordingError
from armload_identification.model.payload import InertialParameters
from armload_identification.verdict.validation import validate

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def second_pair(pinocchio_arm):
    trajectory = pinocchio_arm.trajectory(seed=8)
    return pinocchio_arm.run(trajectory, True, seed=31), pinocchio_arm.run(trajectory, False, seed=32)


def test_the_true_payload_leaves_only_noise(second_pair, pinocchio_arm):
    result = validate(*second_pair, pinocchio_arm.chain, pinocchio_arm.transmission, pinocchio_arm.payload)
    np.testing.assert_allclose(result.noise_rms_nm, np.sqrt(2.0) * pinocchio_arm.noise_nm, rtol=0.08)
    np.testing.assert_allclose(result.ratio, 1.0, atol=0.05)
    assert result.passed
    assert result.failed_joints == ()


def test_the_residual_is_that_of_single_samples(second_pair, pinocchio_arm):
    """Put together from averages, it equals the RMS over every raw sample of paired periods."""
    wrong = InertialParameters(pinocchio_arm.payload.theta * 1.2)
    loaded, unloaded = second_pair
    result = validate(loaded, unloaded, pinocchio_arm.chain, pinocchio_arm.transmission, wrong)
    raw = pinocchio_arm.transmission.joint_torque(loaded.current_a - unloaded.current_a)
    predicted = np.tile(np.roll(result.predicted_nm, -1, axis=0), (3, 1))
    np.testing.assert_allclose(result.residual_rms_nm, np.sqrt(np.mean((raw - predicted) ** 2, axis=0)), rtol=0.01)


def test_a_wrong_payload_fails_and_the_joints_are_named(second_pair, pinocchio_arm):
    wrong = InertialParameters(pinocchio_arm.payload.theta * 1.5)
    result = validate(*second_pair, pinocchio_arm.chain, pinocchio_arm.transmission, wrong)
    assert not result.passed
    assert 2 in result.failed_joints
    assert result.failed_joints == tuple(np.flatnonzero(result.ratio > 2.0) + 1)


def test_one_period_takes_its_noise_from_above_the_band(pinocchio_arm):
    trajectory = pinocchio_arm.trajectory(seed=8)
    pair = [pinocchio_arm.run(trajectory, load, seed=41 + load, periods=1) for load in (True, False)]
    result = validate(*pair, pinocchio_arm.chain, pinocchio_arm.transmission, pinocchio_arm.payload)
    np.testing.assert_allclose(result.noise_rms_nm, np.sqrt(2.0) * pinocchio_arm.noise_nm, rtol=0.15)
    assert result.passed


def test_recordings_of_another_arm_are_refused(second_pair, pinocchio_arm):
    with pytest.raises(RecordingError, match="has 6 joints, the robot has 3"):
        validate(*second_pair, pinocchio_arm.chain.head(3), pinocchio_arm.transmission, pinocchio_arm.payload)
