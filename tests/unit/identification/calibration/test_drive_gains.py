"""Drive gains from a weighed payload: Pinocchio's torque through wrong gains, found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from armload_identification.calibration.drive_gains import DETERMINED_WITHIN, calibrate_gains
from armload_identification.estimation.prior_knowledge import KnownPayload
from armload_identification.identification_errors import EstimationError, ModelError
from armload_identification.model.payload import InertialParameters
from armload_identification.pipeline.payload_identification import identify
from armload_identification.signals.joint_torque import Transmission

pytestmark = pytest.mark.pure

WRONG = np.array([1.03, 0.96, 1.05, 0.97, 1.02, 0.98])


@pytest.fixture(scope="module")
def nominal(pinocchio_arm):
    """Gains as somebody believes them; the arm's own are these times WRONG."""
    return Transmission(pinocchio_arm.transmission.gain_nm_a / WRONG, pinocchio_arm.transmission.coupling)


@pytest.fixture(scope="module")
def runs(pinocchio_arm):
    trajectory = pinocchio_arm.trajectory()
    return [
        pinocchio_arm.run(trajectory, load, seed=81 + load, periods=10, load_friction=0.06) for load in (True, False)
    ]


@pytest.mark.parametrize("what", ["mass", "mass and centre", "all ten"])
def test_gains_are_found_within_their_intervals(pinocchio_arm, nominal, runs, what):
    body = pinocchio_arm.payload
    known = {
        "mass": KnownPayload(mass_kg=body.mass_kg),
        "mass and centre": KnownPayload(mass_kg=body.mass_kg, center_of_mass_m=body.center_of_mass_m),
        "all ten": KnownPayload.weighed(body),
    }[what]
    result = calibrate_gains(*runs, pinocchio_arm.chain, nominal, known)
    truth = pinocchio_arm.transmission.gain_nm_a
    assert result.determined.all()
    np.testing.assert_allclose(result.gain_nm_a, truth, rtol=0.02)
    assert (np.abs(result.gain_nm_a - truth) < 2.0 * result.half_width_95).all()
    assert result.payload.mass_kg == pytest.approx(body.mass_kg, rel=1e-4)
    np.testing.assert_allclose(result.payload.center_of_mass_m, body.center_of_mass_m, atol=0.002)
    np.testing.assert_array_equal(result.transmission.calibrated, result.determined)


def test_more_knowledge_gives_narrower_intervals(pinocchio_arm, nominal, runs):
    body = pinocchio_arm.payload
    little = calibrate_gains(*runs, pinocchio_arm.chain, nominal, KnownPayload(mass_kg=body.mass_kg))
    everything = calibrate_gains(*runs, pinocchio_arm.chain, nominal, KnownPayload.weighed(body))
    # On the shoulder the mass is all that counts.
    assert (everything.half_width_95[2:] < 0.85 * little.half_width_95[2:]).all()
    np.testing.assert_allclose(everything.half_width_95[:2], little.half_width_95[:2], rtol=0.15)


def test_another_payload_is_then_identified(pinocchio_arm, nominal, runs):
    """Calibrated with one payload, tried on another, on another trajectory."""
    gains = calibrate_gains(*runs, pinocchio_arm.chain, nominal, KnownPayload.weighed(pinocchio_arm.payload))
    trajectory = pinocchio_arm.trajectory(seed=5)
    loaded = pinocchio_arm.run(trajectory, True, seed=91, periods=10)
    unloaded = pinocchio_arm.run(trajectory, False, seed=92, periods=10)
    before = identify(loaded, unloaded, pinocchio_arm.chain, nominal)
    after = identify(loaded, unloaded, pinocchio_arm.chain, gains.transmission)
    truth = pinocchio_arm.payload.mass_kg
    assert abs(before.parameters.mass_kg / truth - 1.0) > 0.01
    assert after.parameters.mass_kg == pytest.approx(truth, rel=0.005)
    assert any("gains are nominal" in note for note in before.notes)
    assert not any("nominal" in note for note in after.notes)
    assert after.uncertainty.half_width_95[0] < before.uncertainty.half_width_95[0]


def test_an_axis_that_the_payload_hardly_pulls_on_is_named(pinocchio_arm, nominal):
    """A payload on the axis of joint 6 does not load it: its gain cannot be determined, the others can."""
    arm = type(pinocchio_arm)()
    axis = pinocchio_arm.chain.flange[:3, :3].T @ pinocchio_arm.chain.axis[5]
    arm.payload = InertialParameters.from_center_of_mass(4.0, 0.08 * axis, 0.002 * np.eye(3))
    trajectory = arm.trajectory()
    runs = [arm.run(trajectory, load, seed=83 + load, periods=10) for load in (True, False)]
    result = calibrate_gains(*runs, arm.chain, nominal, KnownPayload(mass_kg=4.0))
    assert not result.determined[5]
    assert result.determined[1:3].all()
    assert result.gain_nm_a[5] == nominal.gain_nm_a[5]
    np.testing.assert_allclose(result.gain_nm_a[1:3], arm.transmission.gain_nm_a[1:3], rtol=0.02)
    widths = result.half_width_95 / result.gain_nm_a
    assert (widths[result.determined] <= DETERMINED_WITHIN).all()
    notes = identify(*runs, arm.chain, result.transmission).notes
    assert any("6 are nominal" in note or "joint 6" in note for note in notes)


def test_what_cannot_be_calibrated_is_refused(pinocchio_arm, nominal, runs):
    chain = pinocchio_arm.chain
    with pytest.raises(EstimationError, match="Weigh it"):
        calibrate_gains(*runs, chain, nominal, KnownPayload(center_of_mass_m=[0.0, 0.0, 0.1]))
    told = [replace(run, torque_nm=run.current_a, current_a=None) for run in runs]
    with pytest.raises(EstimationError, match="recordings of motor current"):
        calibrate_gains(*told, chain, nominal, KnownPayload(mass_kg=4.2))
    trajectory = pinocchio_arm.trajectory()
    light = type(pinocchio_arm)()
    light.payload = InertialParameters.from_center_of_mass(0.02, [0.0, 0.0, 0.0], 1e-5 * np.eye(3))
    weak = [light.run(trajectory, load, seed=85 + load) for load in (True, False)]
    with pytest.raises(EstimationError, match="no gain can be determined"):
        calibrate_gains(*weak, chain, nominal, KnownPayload(mass_kg=0.02))


@pytest.mark.parametrize(
    "wrong", [{"mass_kg": 0.0}, {"mass_kg": np.nan}, {"confidence": 0.0}, {"center_of_mass_m": [1.0]}]
)
def test_knowledge_must_make_sense(wrong):
    with pytest.raises(ModelError, match="expected"):
        KnownPayload(**wrong)
