"""The empty arm's body, identified from Pinocchio's torque and friction: it predicts the torque of other motions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from armload_identification.estimation.empty_arm.unloaded_arm import fit_body
from armload_identification.model.base_parameters import base_columns
from armload_identification.model.joint_states import JointStates
from armload_identification.model.regressor import body_regressor, rotor_columns
from armload_identification.signals.motion import SCATTER, Motion
from armload_identification.signals.recorded_run import Run

pytestmark = pytest.mark.pure


@pytest.fixture(scope="module")
def runs(pinocchio_arm):
    return [
        pinocchio_arm.run(pinocchio_arm.trajectory(seed), False, seed=90 + seed, load_friction=0.05) for seed in (3, 4)
    ]


@pytest.fixture(scope="module")
def body(pinocchio_arm, runs):
    motions = [Run.of(run, pinocchio_arm.transmission).motion for run in runs]
    return fit_body(motions, pinocchio_arm.chain, pinocchio_arm.transmission.coupling)


def states(rng, samples=100):
    return rng.uniform(-2.0, 2.0, (3, samples, 6))


def test_the_base_parameters_are_as_many_as_pinocchio_can_tell(pinocchio_arm):
    model = pinocchio_arm._model(None)
    data = model.createData()
    q, dq, ddq = states(np.random.default_rng(1))
    rows = np.vstack([pin.computeJointTorqueRegressor(model, data, *s) for s in zip(q, dq, ddq, strict=True)])
    base = base_columns(pinocchio_arm.chain, np.eye(6))
    assert np.count_nonzero(base[:60]) == np.linalg.matrix_rank(rows / np.abs(rows).max(), tol=1e-9)


def test_base_columns_span_all_columns_and_none_is_idle(pinocchio_arm):
    q, dq, ddq = states(np.random.default_rng(2))
    coupling = pinocchio_arm.transmission.coupling
    rotors = rotor_columns(ddq, coupling).transpose(0, 2, 1)
    everything = np.concatenate([body_regressor(pinocchio_arm.chain, q, dq, ddq), rotors], axis=2).reshape(-1, 66)
    base = base_columns(pinocchio_arm.chain, coupling)
    kept = everything[:, base]
    left = everything - kept @ np.linalg.lstsq(kept, everything, rcond=None)[0]
    assert np.abs(left).max() < 1e-7 * np.abs(everything).max()
    assert np.linalg.matrix_rank(kept) == np.count_nonzero(base)
    # The first rotor and the first link move as one body.
    assert not base[60]


def motion_with(interval_s, states, torque, noise_nm):
    """A periodic motion, exact except for the noise."""
    nothing = np.zeros(len(noise_nm))
    return Motion(
        time_s=interval_s * np.arange(len(torque)),
        periodic=True,
        states=states,
        raw_nm=torque,
        torque_nm=torque,
        valid=np.ones(len(torque), dtype=bool),
        noise_nm=noise_nm,
        averaged_noise_nm=noise_nm,
        noise_source=SCATTER,
        smoothing_loss=nothing,
        periods=1,
        position_fit_rad=nothing,
        began_s=0.0,
    )


def test_rotors_behind_coupled_motors_are_the_derivative_of_their_energy(pinocchio_arm):
    coupling = pinocchio_arm.transmission.coupling
    inertia = np.array([1.0, 2.0, 3.0, 0.5, 0.4, 0.3])
    ddq = np.random.default_rng(3).normal(size=(5, 6))
    torque = np.einsum("tij,i->tj", rotor_columns(ddq, coupling), inertia)
    # Energy 1/2 axis^T I axis with joint = C axis: mass matrix C^-T I C^-1.
    mass = np.linalg.inv(coupling).T @ np.diag(inertia) @ np.linalg.inv(coupling)
    np.testing.assert_allclose(torque, ddq @ mass, rtol=1e-12)


def test_friction_is_found(body):
    model = body.model
    np.testing.assert_allclose(model.coulomb_nm, 4.0, atol=0.4)
    np.testing.assert_allclose(model.viscous_nm_s_rad, 5.0, atol=0.4)
    np.testing.assert_allclose(model.load_friction[:3], 0.05, atol=0.015)
    # Three standard deviations, measured with six other noises; joint 2's offset resembles gravity.
    assert (np.abs(model.offset_nm) < [0.11, 1.4, 0.06, 0.07, 0.03, 0.02]).all(), model.offset_nm


def test_rotor_inertia_is_found(pinocchio_arm):
    arm = pinocchio_arm
    inertia = np.array([0, 0, 0.8, 0.5, 0.3, 0.2])
    samples = []
    for seed in (3, 4, 5):
        state = arm.trajectory(seed).evaluate(np.linspace(0.0, 5.0, 2000, endpoint=False))
        q, dq, ddq = state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2
        torque = arm.torque(q, dq, ddq)
        torque += np.einsum("tij,i->tj", rotor_columns(ddq, arm.transmission.coupling), inertia)
        torque += 0.01 * np.random.default_rng(seed).normal(size=torque.shape)
        samples.append(motion_with(5.0 / 2000, JointStates(q, dq, ddq), torque, np.full(6, 0.01)))
    fit = fit_body(samples, arm.chain, arm.transmission.coupling)
    np.testing.assert_allclose(fit.model.rotor_inertia_kg_m2[2:], inertia[2:], atol=0.05)


def test_load_dependent_friction_shows_the_rotors_that_no_link_torque_can(pinocchio_arm):
    arm = pinocchio_arm
    inertia = np.array([3.0, 2.0, 0.8, 0.5, 0.3, 0.2])
    load, delay_s, interval_s = 0.08, 0.003, 0.005
    trajectory = arm.trajectory(5)
    time_s = np.arange(0.0, 5.0, interval_s)
    then, now = trajectory.evaluate(time_s - delay_s), trajectory.evaluate(time_s)
    q, dq, ddq = then.position_rad, then.velocity_rad_s, then.acceleration_rad_s2
    torque = arm.torque(q, dq, ddq, load_friction=load)
    torque += np.einsum("tij,i->tj", rotor_columns(ddq, arm.transmission.coupling), inertia)
    torque += arm.noise_nm * np.random.default_rng(5).normal(size=torque.shape) / np.sqrt(50.0)
    states = JointStates(now.position_rad, now.velocity_rad_s, now.acceleration_rad_s2)
    samples = motion_with(interval_s, states, torque, arm.noise_nm / np.sqrt(50.0))
    fit = fit_body([samples], arm.chain, arm.transmission.coupling)
    assert fit.model.torque_delay_s == pytest.approx(delay_s, abs=3e-4)
    assert (np.abs(fit.model.rotor_inertia_kg_m2 - inertia)[1:] < [0.2, 0.03, 0.03, 0.03, 0.03]).all()
    np.testing.assert_allclose(fit.model.load_friction[1:4], load, atol=0.01)
    # The links' torque, without friction and the rotors' torque.
    links = arm.torque(q, dq, ddq) - 4.0 * np.tanh(dq / 0.01) - 5.0 * dq
    found = fit.model.link_torque(arm.chain, q, dq, ddq)
    error = np.sqrt(np.mean((found - links) ** 2, axis=0))
    rotors = np.sqrt(np.mean((inertia * ddq) ** 2, axis=0))
    assert (error[:4] < 0.25 * rotors[:4]).all(), (error, rotors)


def test_an_unused_trajectory_is_predicted(pinocchio_arm, body):
    arm = pinocchio_arm
    fresh = arm.run(arm.trajectory(8), False, seed=77, load_friction=0.05, noise=0.0)
    motion = Run.of(fresh, arm.transmission).motion.with_delay(body.model.torque_delay_s)
    measured = motion.torque_nm[motion.valid]

    def left(model):
        error = (motion.torque_nm - model.torque(arm.chain, *motion.states))[motion.valid]
        return np.sqrt(np.mean(error**2, axis=0))

    error = left(body.model)
    assert (error < 0.02 * np.sqrt(np.mean(measured**2, axis=0)) + 0.25).all(), error
    assert left(replace(body.model, links=1.1 * body.model.links))[1] > 3.0 * error[1]
