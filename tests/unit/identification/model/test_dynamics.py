"""The arm's torque against Pinocchio's, and its derivative."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from armload_identification.identification_errors import ModelError
from armload_identification.model.dynamics import ArmBody, ArmDynamics

pytestmark = pytest.mark.pure


def states(rng: np.random.Generator, n: int, samples: int = 20) -> np.ndarray:
    return np.stack([rng.uniform(-np.pi, np.pi, (samples, n)), *3.0 * rng.normal(size=(2, samples, n))])


def body(links, rotors=0.0, coupling=None) -> ArmBody:
    n = len(links)
    theta, still = np.array([link.theta for link in links]), np.zeros(n)
    return ArmBody(theta, np.full(n, rotors), still, still, np.eye(n) if coupling is None else coupling)


def wound(rng: np.random.Generator, n: int) -> np.ndarray:
    """A matrix that couples every motor with every joint."""
    return np.eye(n) + 0.2 * rng.normal(size=(n, n))


@pytest.mark.parametrize("seed", range(10))
def test_equal_to_pinocchio_with_and_without_a_payload(seed, any_arm, any_body, in_pinocchio):
    rng = np.random.default_rng(seed)
    chain, links = any_arm(rng, 1 + seed % 7)
    payload, motion = any_body(rng), states(rng, chain.n)
    for carried in (None, payload):
        model = in_pinocchio(chain, links, carried)
        data = model.createData()
        expected = np.array([pin.rnea(model, data, *state) for state in zip(*motion, strict=True)])
        arm = body(links) if carried is None else body(links).carrying(chain, carried)
        found = ArmDynamics(chain, arm).torque(*motion)
        np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-9 * np.abs(expected).max())


def test_rotors_resist_their_own_acceleration(any_arm):
    rng = np.random.default_rng(3)
    chain, links = any_arm(rng, 4)
    q, dq, ddq = states(rng, 4)
    added = ArmDynamics(chain, body(links, 2.5)).torque(q, dq, ddq) - ArmDynamics(chain, body(links)).torque(q, dq, ddq)
    np.testing.assert_allclose(added, 2.5 * ddq, atol=1e-9)


def test_a_massless_arm_needs_no_torque(any_arm):
    rng = np.random.default_rng(4)
    chain, _ = any_arm(rng, 6)
    assert not ArmDynamics(chain, ArmBody.massless(6)).torque(*states(rng, 6)).any()


def test_the_slope_is_the_finite_difference_of_the_torque(any_arm):
    rng = np.random.default_rng(5)
    chain, links = any_arm(rng, 5)
    arm = ArmDynamics(chain, body(links, 0.7, wound(rng, 5)))
    motion = states(rng, 5)
    weight = rng.normal(size=motion[0].shape)
    weight[::3] = 0.0  # samples of zero weight are left out
    slope = arm.slope(weight, *motion)
    assert not slope[:, ::3].any()
    for order in range(3):
        direction = np.zeros_like(motion)
        direction[order] = rng.normal(size=motion[0].shape)
        ahead, behind = (np.sum(weight * arm.torque(*(motion + s * 1e-6 * direction))) for s in (1, -1))
        assert np.sum(slope * direction) == pytest.approx((ahead - behind) / 2e-6, rel=1e-6)


def test_what_no_arm_has_is_refused(any_arm):
    chain, _ = any_arm(np.random.default_rng(0), 3)
    three = np.zeros(3)
    with pytest.raises(ModelError, match="a body of 2 links for a chain of 3 joints"):
        ArmDynamics(chain, ArmBody.massless(2))
    with pytest.raises(ModelError, match=r"links of the body has shape \(3, 9\); expected \(n, 10\)"):
        ArmBody(np.zeros((3, 9)), three, three, three, np.eye(3))
    with pytest.raises(ModelError, match="links of the body contains a number that is not finite"):
        ArmBody(np.full((3, 10), np.nan), three, three, three, np.eye(3))
    with pytest.raises(ModelError, match=r"coulomb_nm of the body is .*expected numbers of at least 0"):
        ArmBody(np.zeros((3, 10)), three, three, np.array([1.0, -1.0, 0.0]), np.eye(3))
    with pytest.raises(ModelError, match="rotor_inertia_kg_m2"):
        ArmBody(np.zeros((3, 10)), np.zeros(2), three, three, np.eye(3))
    with pytest.raises(ModelError, match=r"coupling \[\[.*has no inverse; expected q_joint = C q_axis"):
        ArmBody(np.zeros((3, 10)), three, three, three, np.ones((3, 3)))
