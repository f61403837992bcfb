"""The regressor kernels against Pinocchio, Lagrange's equations and the payload's energy."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest

from armload_core import kernels
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain, pose_from_xyz_rpy
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import (
    body_regressor,
    feedforward_model,
    payload_regressor,
    payload_torque,
)

PINOCCHIO_ORDER = [0, 1, 2, 3, 4, 6, 9, 5, 7, 8]
"""Pinocchio's dynamic parameters are m, m c, Ixx, Ixy, Iyy, Ixz, Iyz, Izz."""


def random_chain(rng: np.random.Generator, n: int) -> Chain:
    return Chain.from_origins(
        rng.uniform(-0.6, 0.6, (n, 3)),
        rng.uniform(-np.pi, np.pi, (n, 3)),
        rng.normal(size=(n, 3)),
        pose_from_xyz_rpy(rng.uniform(-0.3, 0.3, 3), rng.uniform(-np.pi, np.pi, 3)),
        rng.uniform(-10.0, 10.0, 3),
    )


def random_body(rng: np.random.Generator) -> InertialParameters:
    points = rng.normal(size=(8, 3)) * 0.2 + rng.normal(size=3) * 0.2
    homogeneous = np.column_stack([points, np.ones(8)]) * np.sqrt(rng.uniform(0.1, 2.0, (8, 1)))
    return InertialParameters.from_pseudo_inertia(homogeneous.T @ homogeneous)


def random_states(rng: np.random.Generator, samples: int, n: int) -> np.ndarray:
    return np.stack([rng.uniform(-np.pi, np.pi, (samples, n)), *rng.normal(size=(2, samples, n)) * 3.0])


class Reference:
    """The same chain in Pinocchio, massless, with the flange as an additional body fixed to the last joint."""

    def __init__(self, chain: Chain) -> None:
        self.pin = pytest.importorskip("pinocchio", reason="needs pin")
        self.model = self.pin.Model()
        self.model.gravity = self.pin.Motion(chain.gravity_m_s2, np.zeros(3))
        joint = 0
        for i in range(chain.n):
            joint = self.model.addJoint(
                joint,
                self.pin.JointModelRevoluteUnaligned(chain.axis[i]),
                self.pin.SE3(chain.placement[i][:3, :3], chain.placement[i][:3, 3]),
                f"joint_{i}",
            )
        self.flange = self.pin.SE3(chain.flange[:3, :3], chain.flange[:3, 3])
        self.last = joint
        self.data = self.model.createData()

    def body_regressor(self, q, dq, ddq):
        raw = self.pin.computeJointTorqueRegressor(self.model, self.data, q, dq, ddq)
        raw = np.reshape(raw, (self.last, -1))
        return np.hstack([raw[:, 10 * i : 10 * i + 10][:, PINOCCHIO_ORDER] for i in range(self.last)])

    def payload_torque(self, payload, q, dq, ddq):
        center, inertia = payload.center_of_mass_m, payload.inertia_about_com
        body = self.pin.Inertia(payload.mass_kg, center, inertia)
        self.model.inertias[self.last] = self.flange.act(body)
        return self.pin.rnea(self.model, self.data, q, dq, ddq).copy()


@pytest.mark.parametrize("seed", range(25))
def test_equal_to_pinocchio_on_random_chains_states_and_payloads(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    chain, payload = random_chain(rng, n), random_body(rng)
    q, dq, ddq = random_states(rng, 20, n)
    reference = Reference(chain)
    torque, regressor = payload_torque(chain, payload.theta, q, dq, ddq), payload_regressor(chain, q, dq, ddq)
    bodies = body_regressor(chain, q, dq, ddq)
    for t in range(20):
        expected = reference.payload_torque(payload, q[t], dq[t], ddq[t])
        np.testing.assert_allclose(torque[t], expected, rtol=0, atol=1e-9)
        np.testing.assert_allclose(regressor[t] @ payload.theta, expected, rtol=0, atol=1e-9)
        reference.model.inertias[n] = reference.pin.Inertia.Zero()
        np.testing.assert_allclose(bodies[t], reference.body_regressor(q[t], dq[t], ddq[t]), rtol=0, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_every_column_of_the_payload_regressor_equals_pinocchios(seed):
    # The flange becomes the last joint's frame, so that Pinocchio's last ten columns are the payload's.
    rng = np.random.default_rng(100 + seed)
    chain = random_chain(rng, 6)
    placement = chain.placement.copy()
    turned = chain.flange[:3, :3].T @ chain.axis[-1]
    # joint 6 gets the flange's orientation; a pure rotation keeps its origin on the axis
    flange = np.eye(4)
    flange[:3, :3] = chain.flange[:3, :3]
    placement[-1] = placement[-1] @ flange
    moved = Chain(placement, np.vstack([chain.axis[:-1], turned]), np.eye(4), chain.gravity_m_s2)
    same = Chain(chain.placement, chain.axis, flange, chain.gravity_m_s2)
    q, dq, ddq = random_states(rng, 10, 6)
    got = payload_regressor(same, q, dq, ddq)
    reference = Reference(moved)
    for t in range(10):
        expected = reference.body_regressor(q[t], dq[t], ddq[t])[:, -10:]
        np.testing.assert_allclose(got[t], expected, rtol=0, atol=1e-9)


def test_links_side_by_side_are_the_body():
    rng = np.random.default_rng(3)
    chain = random_chain(rng, 5)
    q, dq, ddq = random_states(rng, 12, 5)
    bodies = body_regressor(chain, q, dq, ddq)
    for link in range(1, 6):
        columns = bodies[:, :, 10 * (link - 1) : 10 * link]
        assert np.all(columns[:, link:, :] == 0.0)
        head = payload_regressor(chain.head(link), q[:, :link], dq[:, :link], ddq[:, :link])
        np.testing.assert_allclose(columns[:, :link], head, rtol=0, atol=1e-11)


def mass_matrix(chain: Chain, payload: InertialParameters, q: np.ndarray) -> np.ndarray:
    """M of the payload's kinetic energy 1/2 dq^T M dq, from numerical velocities of its mass distribution."""
    step = 1e-6
    inertia = np.zeros((chain.n, chain.n))
    moved = [(chain.forward(q + step * e)[-1] - chain.forward(q - step * e)[-1]) / (2 * step) for e in np.eye(chain.n)]
    for i in range(chain.n):
        for j in range(chain.n):
            inertia[i, j] = np.trace(moved[i][:3] @ payload.pseudo_inertia @ moved[j][:3].T)
    return inertia


def potential_j(chain: Chain, payload: InertialParameters, q: np.ndarray) -> float:
    center = chain.forward(q)[-1] @ np.r_[payload.center_of_mass_m, 1.0]
    return -payload.mass_kg * float(chain.gravity_m_s2 @ center[:3])


@pytest.mark.parametrize("seed", range(6))
def test_the_torque_is_lagranges(seed):
    rng = np.random.default_rng(200 + seed)
    chain, payload = random_chain(rng, 4), random_body(rng)
    q, dq, ddq = random_states(rng, 1, 4)[:, 0]
    step = 1e-4
    slope = [
        (mass_matrix(chain, payload, q + step * e) - mass_matrix(chain, payload, q - step * e)) / (2 * step)
        for e in np.eye(4)
    ]
    weight = [
        (potential_j(chain, payload, q + step * e) - potential_j(chain, payload, q - step * e)) / (2 * step)
        for e in np.eye(4)
    ]
    rate = sum(slope[i] * dq[i] for i in range(4))
    expected = mass_matrix(chain, payload, q) @ ddq + rate @ dq
    expected += np.array(weight) - np.array([0.5 * dq @ s @ dq for s in slope])
    got = payload_torque(chain, payload.theta, q, dq, ddq)
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-4 * max(1.0, np.abs(expected).max()))


@pytest.mark.parametrize("seed", range(6))
def test_the_torques_power_is_the_growth_of_the_payloads_energy(seed):
    rng = np.random.default_rng(300 + seed)
    chain, payload = random_chain(rng, 6), random_body(rng)
    q, dq, ddq = random_states(rng, 1, 6)[:, 0]

    def energy_j(t_s: float) -> float:
        position, velocity = q + dq * t_s + 0.5 * ddq * t_s**2, dq + ddq * t_s
        kinetic = 0.5 * velocity @ mass_matrix(chain, payload, position) @ velocity
        return float(kinetic) + potential_j(chain, payload, position)

    growth_w = (energy_j(1e-4) - energy_j(-1e-4)) / 2e-4
    power_w = float(payload_torque(chain, payload.theta, q, dq, ddq) @ dq)
    assert power_w == pytest.approx(growth_w, rel=1e-4, abs=1e-4 * np.abs(dq).sum())


@pytest.mark.parametrize("direction", [[0, 0, -9.81], [0, 9.81, 0], [4.0, -5.0, 7.0]])
def test_gravity_in_any_direction_is_the_gradient_of_the_potential(direction):
    rng = np.random.default_rng(9)
    chain, payload = random_chain(rng, 6), random_body(rng)
    chain = Chain(chain.placement, chain.axis, chain.flange, np.array(direction, dtype=float))
    q = rng.normal(size=6)
    expected = [
        (potential_j(chain, payload, q + 1e-6 * e) - potential_j(chain, payload, q - 1e-6 * e)) / 2e-6
        for e in np.eye(6)
    ]
    got = payload_torque(chain, payload.theta, q, np.zeros(6), np.zeros(6))
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-6)


def test_a_single_sample_is_one_row_of_the_batch():
    rng = np.random.default_rng(11)
    chain, payload = random_chain(rng, 6), random_body(rng)
    q, dq, ddq = random_states(rng, 8, 6)
    np.testing.assert_array_equal(
        payload_torque(chain, payload.theta, q[3], dq[3], ddq[3]),
        payload_torque(chain, payload.theta, q, dq, ddq)[3],
    )
    for regressor in (payload_regressor, body_regressor):
        np.testing.assert_array_equal(regressor(chain, q[3], dq[3], ddq[3]), regressor(chain, q, dq, ddq)[3])


def test_the_feed_forward_kernel_fills_the_array_it_was_given():
    rng = np.random.default_rng(12)
    chain, payload = random_chain(rng, 6), random_body(rng)
    states = random_states(rng, 1, 6)[:, 0]
    before = states.copy()
    torque = np.full(6, np.nan)
    assert kernels.PayloadTorque(feedforward_model(chain, payload.theta), torque).torque_nm(*states) is torque
    np.testing.assert_array_equal(states, before)
    np.testing.assert_array_equal(torque, payload_torque(chain, payload.theta, *states))


@pytest.mark.parametrize("short", [0, 1, 2])
def test_the_feed_forward_kernel_refuses_states_of_another_arm(short):
    rng = np.random.default_rng(14)
    states = list(random_states(rng, 1, 6)[:, 0])
    states[short] = states[short][:5].copy()
    model = feedforward_model(random_chain(rng, 6), random_body(rng).theta)
    with pytest.raises(ValueError, match="one number per joint"):
        kernels.PayloadTorque(model, np.zeros(6)).torque_nm(*states)


def test_arrays_of_any_layout_are_taken():
    rng = np.random.default_rng(13)
    chain = random_chain(rng, 6)
    q, dq, ddq = random_states(rng, 8, 6)
    expected = payload_regressor(chain, q, dq, ddq)
    interleaved = np.stack([q, dq, ddq], axis=-1)
    got = payload_regressor(chain, interleaved[..., 0], np.asfortranarray(dq), ddq.tolist())
    np.testing.assert_array_equal(got, expected)


def test_shapes_that_do_not_fit_are_refused():
    chain = random_chain(np.random.default_rng(0), 6)
    good = np.zeros((4, 6))
    with pytest.raises(ModelError, match=r"dq has shape \(3, 6\)"):
        payload_regressor(chain, good, good[:3], good)
    with pytest.raises(ModelError, match=r"q has shape \(4, 5\).*\(N, 6\)"):
        payload_regressor(chain, good[:, :5], good[:, :5], good[:, :5])
    with pytest.raises(ModelError, match=r"theta has shape \(9,\); expected \(10,\)"):
        payload_torque(chain, np.zeros(9), good, good, good)


def test_the_kernels_load_nothing_heavy():
    code = (
        "import sys\nfrom armload_identification.model import chain, payload, regressor\n"
        "heavy = {'scipy', 'matplotlib', 'mcap', 'can', 'ruckig'};"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
