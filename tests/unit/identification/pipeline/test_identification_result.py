"""What an identification consists of, against the torque of Pinocchio's arm."""

from __future__ import annotations

import numpy as np
import pytest

from armload_identification.pipeline.identification_result import Identification
from armload_identification.pipeline.payload_identification import identify_runs

pytestmark = pytest.mark.pure

LOAD_FRICTION = 0.1


def torque_difference(arm, result):
    """(K, n) torque that the payload causes without friction, at the result's samples."""
    states = result.signal.loaded.states
    of = (states.position_rad, states.velocity_rad_s, states.acceleration_rad_s2)
    return arm.torque(*of, arm.payload) - arm.torque(*of)


@pytest.fixture(scope="module")
def found(pair, pinocchio_arm):
    return identify_runs(*pair, pinocchio_arm.chain, pinocchio_arm.transmission)


def relative(found, true):
    return np.sqrt(np.mean((found - true) ** 2, axis=0) / np.mean(true**2, axis=0))


def test_the_prediction_is_the_torque_that_the_payload_causes(found, pinocchio_arm, pair):
    assert isinstance(found, Identification)
    true = torque_difference(pinocchio_arm, found)
    carried = [0, 1, 2]
    assert (relative(found.predicted_nm - found.friction_nm, true)[carried] < 0.03).all()
    assert (np.abs(found.friction_nm).max(axis=0) < 1.0).all(), "the arm's own friction is in both runs"
    assert found.sources == (pair[0].source, pair[1].source)
    assert found.parameters.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.01)
    assert found.plain_parameters.mass_kg == pytest.approx(pinocchio_arm.payload.mass_kg, rel=0.01)
    assert not found.scale_verified


def test_what_is_left_is_noise(found):
    assert (np.sqrt(np.mean(found.residual_nm**2, axis=0)) < found.signal.averaged_noise_nm).all()
    np.testing.assert_allclose(found.residual_rms_nm, found.signal.noise_nm, rtol=0.15)
    assert not found.struck.any()


def test_friction_grows_with_the_load_of_a_gear(pinocchio_arm):
    trajectory = pinocchio_arm.trajectory()
    runs = [pinocchio_arm.run(trajectory, load, seed=21 + load, load_friction=LOAD_FRICTION) for load in (True, False)]
    found = identify_runs(*runs, pinocchio_arm.chain, pinocchio_arm.transmission)
    states = found.signal.loaded.states
    of = (states.position_rad, states.velocity_rad_s, states.acceleration_rad_s2)
    whole = pinocchio_arm.torque(*of, pinocchio_arm.payload, LOAD_FRICTION) - pinocchio_arm.torque(
        *of, None, LOAD_FRICTION
    )
    added = whole - torque_difference(pinocchio_arm, found)
    loaded = np.flatnonzero(np.sqrt(np.mean(added**2, axis=0)) > 2.0)
    assert loaded.size
    for joint in loaded:
        assert np.corrcoef(found.friction_nm[:, joint], added[:, joint])[0, 1] > 0.9
        assert np.std(found.friction_nm[:, joint]) == pytest.approx(np.std(added[:, joint]), rel=0.3)
    assert (relative(found.predicted_nm, whole)[loaded] < 0.1).all()


def test_later_notes_come_first(found):
    noted = found.with_notes("two").with_notes("zero", "one")
    assert noted.notes == ("zero", "one", "two", *found.notes)
    assert noted.plain is found.plain
