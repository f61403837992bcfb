"""Servo sag under the payload: the arm's own torque at the changed position is corrected; a stiff servo needs none."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload_identification.estimation.empty_arm.unloaded_arm import fit_body
from armload_identification.model.joint_states import JointStates
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.signals.filters import low_pass, low_pass_cutoff
from armload_identification.signals.load_signal import load_signal
from armload_identification.signals.recorded_run import Run
from benchmarks.arms.sagging_panda import PAYLOAD, SAG_RAD, Effects, SaggingPanda, chain, nominal_transmission

QUIET = 0.02
"""Factor on the noise, so that the model's error remains."""


@pytest.fixture(scope="module")
def sagging():
    return SaggingPanda(Effects(noise=QUIET)).pair(1, with_phase=True)


def test_the_runs_are_as_far_apart_as_a_servo_lets_them(sagging):
    signal = load_signal(*(Run.of(run, nominal_transmission(exact=True)) for run in sagging))
    apart = np.abs(signal.loaded.states.position_rad - signal.unloaded.states.position_rad).max(axis=0)
    np.testing.assert_allclose(apart, SAG_RAD, rtol=0.1)


def test_what_the_arm_does_elsewhere_is_not_taken_for_payload(sagging):
    """Without the correction the mass is 0.06 to 0.08 % off, four times its interval here."""
    result = identify_runs(*sagging, chain(), nominal_transmission(exact=True))
    assert result.parameters.mass_kg == pytest.approx(PAYLOAD.mass_kg, rel=2e-4)
    assert (np.abs(result.uncertainty.values - PAYLOAD.values) <= 1.5 * result.uncertainty.half_width_95).all()


def test_a_stiff_servo_needs_next_to_none_of_it():
    stiff = SaggingPanda(Effects(noise=QUIET, sag_rad=0.0)).pair(1, with_phase=True)
    signal = load_signal(*(Run.of(run, nominal_transmission(exact=True)) for run in stiff))
    body = fit_body([signal.empty_arm], chain(), np.eye(7)).model
    moved = signal.on_one_motion(chain(), body)
    change = np.sqrt(np.mean((moved.torque_nm - signal.torque_nm) ** 2, axis=0))
    assert (change < 1e-3 * np.sqrt(np.mean(signal.torque_nm**2, axis=0)) + 5e-4).all()
    np.testing.assert_array_equal(moved.unloaded.states.position_rad, signal.loaded.states.position_rad)


def linear_body(stiffness_nm_rad, rotor_kg_m2, load_friction):
    """A body whose links' torque is K q, so that the sag's torque can be written down."""
    return SimpleNamespace(
        link_torque=lambda chain, q, dq, ddq: q @ stiffness_nm_rad,
        load_friction=load_friction,
        reversal_speed_rad_s=np.full(2, 1e-9),
        rotor_mass_kg_m2=rotor_kg_m2,
    )


@pytest.mark.parametrize("periodic", [True, False])
def test_the_correction_is_that_of_links_their_friction_and_rotors(sagging, periodic):
    """(1 + mu s sgn tau) (tau(q_loaded) - tau(q_unloaded)) + (ddq_loaded - ddq_unloaded) M, on both torques."""
    whole = load_signal(*(Run.of(run, nominal_transmission(exact=True)) for run in sagging))
    rng = np.random.default_rng(2)
    loaded, unloaded = (JointStates(*rng.normal(size=(3, 200, 2))) for _ in range(2))
    torque = rng.normal(size=(2, 200, 2))
    signal = replace(
        whole,
        loaded=replace(whole.loaded, states=loaded, periodic=periodic),
        unloaded=replace(whole.unloaded, states=unloaded, raw_nm=torque[0], torque_nm=torque[1], periodic=periodic),
    )
    stiffness, rotors = rng.normal(size=(2, 2, 2))
    friction = np.array([0.0, 0.3])
    found = signal.on_one_motion(chain(), linear_body(stiffness, rotors, friction)).unloaded
    here, there = loaded.position_rad @ stiffness, unloaded.position_rad @ stiffness
    more = 1.0 + friction * np.sign(loaded.velocity_rad_s) * np.sign(here)
    expected = more * (here - there) + (loaded.acceleration_rad_s2 - unloaded.acceleration_rad_s2) @ rotors
    if not periodic:
        expected = low_pass(
            expected, signal.loaded.interval_s, low_pass_cutoff(loaded.velocity_rad_s, signal.loaded.interval_s)
        )
    np.testing.assert_allclose(found.raw_nm, torque[0] + expected, atol=1e-9)
    np.testing.assert_allclose(found.torque_nm, torque[1] + expected, atol=1e-9)
    assert found.states is loaded
