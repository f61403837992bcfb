"""The torque that a motion requires: against Pinocchio, at any speed and load, and between samples."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from armload_identification.excitation.fourier import FourierTrajectory
from armload_identification.excitation.torque_limits import TorqueLimits
from armload_identification.identification_errors import ModelError
from armload_identification.model.dynamics import ArmBody
from armload_identification.model.payload import InertialParameters

pytestmark = pytest.mark.pure

N = 4
MAX_NM = np.array([400.0, 300.0, 200.0, 90.0])
VISCOUS = np.array([8.0, 6.0, 4.0, 2.0])
COULOMB = np.array([20.0, 15.0, 9.0, 4.0])
ROTOR = np.array([3.0, 2.0, 1.0, 0.5])
COUPLING = np.eye(N) + np.diag([0.0, 0.3, -0.4], -1)
TO_AXIS = np.linalg.inv(COUPLING)


class Case:
    """An arm with its limits, and the same arm in Pinocchio."""

    def __init__(self, any_arm, any_body, in_pinocchio, seed=6):
        rng = np.random.default_rng(seed)
        self.chain, self.links = any_arm(rng, N)
        self.payload = any_body(rng)
        body = ArmBody(np.array([link.theta for link in self.links]), ROTOR, VISCOUS, COULOMB, COUPLING)
        self.limits = TorqueLimits(self.chain, body, self.payload, MAX_NM - body.coulomb_nm)
        self.path = FourierTrajectory(
            0.2, rng.uniform(-1, 1, N), rng.normal(size=(N, 3)) * 0.3, rng.normal(size=(N, 3)) * 0.3
        )
        self.in_pinocchio = in_pinocchio

    def motor_torque(self, rate, share, times_s):
        """(N, n) magnitude of the torque at a share of the speed and of the payload, friction included."""
        state = self.path.evaluate(times_s)
        q, dq, ddq = state.position_rad, rate * state.velocity_rad_s, rate**2 * state.acceleration_rad_s2
        payload = InertialParameters(share * self.payload.theta) if share else None
        model = self.in_pinocchio(self.chain, self.links, payload)
        data = model.createData()
        links = np.array([pin.rnea(model, data, *row) for row in zip(q, dq, ddq, strict=True)])
        return np.abs(links + ROTOR * (ddq @ TO_AXIS.T) @ TO_AXIS + VISCOUS * dq + COULOMB * np.sign(dq))


@pytest.fixture(scope="module")
def case(any_arm, any_body, in_pinocchio):
    return Case(any_arm, any_body, in_pinocchio)


def test_the_four_cases_are_pinocchios_torque(case):
    state = case.path.evaluate(np.linspace(0.0, 5.0, 50))
    motion = (state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
    demand = np.split(case.limits.demand(*motion), case.limits.cases, axis=1)
    friction = VISCOUS * np.abs(motion[1])
    for found, payload, moving in zip(demand, (case.payload, case.payload, None, None), (1, 0, 1, 0), strict=True):
        model = case.in_pinocchio(case.chain, case.links, payload)
        data = model.createData()
        rows = zip(motion[0], moving * motion[1], moving * motion[2], strict=True)
        links = np.array([pin.rnea(model, data, *row) for row in rows])
        rotors = moving * ROTOR * (motion[2] @ TO_AXIS.T) @ TO_AXIS
        np.testing.assert_allclose(found, np.abs(links + rotors) + friction, atol=1e-9)


def test_no_speed_and_no_load_in_between_asks_for_more(case):
    greatest = case.limits.greatest(case.path).reshape(case.limits.cases, N).max(axis=0) + COULOMB
    times_s = np.linspace(0.0, 5.0, 2000)
    for rate in (0.0, 0.1, 0.5, 0.9, 1.0):
        for share in (0.0, 0.3, 1.0):
            assert np.all(case.motor_torque(rate, share, times_s) <= greatest)


def test_the_bound_holds_between_the_samples_and_gives_little_away(case):
    bound = case.limits.greatest(case.path)
    state = case.path.evaluate(np.linspace(0.0, 5.0, 50_001))
    dense = case.limits.demand(state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2).max(axis=0)
    assert np.all(bound >= dense)
    assert np.all(bound <= dense + 0.003 * np.tile(case.limits.available_nm, case.limits.cases))


@pytest.mark.parametrize("of", ["joints", "axes"])
def test_the_slope_is_the_finite_difference_of_the_demand(case, axes, of):
    limits = case.limits if of == "joints" else axes
    rng = np.random.default_rng(2)
    motion = rng.normal(size=(3, 30, N))
    weight = rng.uniform(size=(30, N * limits.cases))
    slope = limits.slope(weight, *motion)
    for order in range(3):
        direction = np.zeros_like(motion)
        direction[order] = rng.normal(size=motion[0].shape)
        ahead, behind = (np.sum(weight * limits.demand(*(motion + s * 1e-6 * direction))) for s in (1, -1))
        assert np.sum(slope * direction) == pytest.approx((ahead - behind) / 2e-6, rel=1e-6)
    assert not limits.slope(0.0 * weight, *motion).any()


def test_a_stated_share_leaves_the_rest_to_the_payload(case):
    share = np.array([0.5, 0.4, 0.3, 0.0])
    limits = TorqueLimits.from_share(case.chain, share, case.payload, MAX_NM)
    np.testing.assert_allclose(limits.available_nm, [200.0, 180.0, 140.0, 90.0])
    state = case.path.evaluate(np.linspace(0.0, 5.0, 20))
    motion = (state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
    loaded, empty = (case.in_pinocchio(case.chain, case.links, p) for p in (case.payload, None))
    expected = np.array(
        [
            np.abs(pin.rnea(loaded, loaded.createData(), *row) - pin.rnea(empty, empty.createData(), *row))
            for row in zip(*motion, strict=True)
        ]
    )
    assert limits.cases == 2  # the empty arm's torque is not known
    np.testing.assert_allclose(limits.demand(*motion)[:, :N], expected, atol=1e-9)


@pytest.fixture(scope="module")
def axes(case):
    return replace(case.limits, coupling=COUPLING, available_nm=np.array([900.0, 700.0, 500.0, 200.0]))


def test_the_motors_behind_coupled_joints_give_what_does_the_joints_work(case, axes):
    """Power is the same on both sides: tau_axis dq_axis = tau_joint dq_joint for any velocity."""
    state = case.path.evaluate(np.linspace(0.0, 5.0, 40))
    motion = (state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2)
    model = case.in_pinocchio(case.chain, case.links, case.payload)
    data = model.createData()
    joints = np.array([pin.rnea(model, data, *row) for row in zip(*motion, strict=True)])
    joints += ROTOR * (motion[2] @ TO_AXIS.T) @ TO_AXIS
    turning = np.eye(N)
    at_axes = np.array([[torque @ (COUPLING @ axis) for axis in turning] for torque in joints])
    friction = (VISCOUS * np.abs(motion[1])) @ np.abs(COUPLING)
    np.testing.assert_allclose(axes.demand(*motion)[:, :N], np.abs(at_axes) + friction, atol=1e-9)


def test_the_bound_on_the_motors_holds_between_the_samples(case, axes):
    bound = axes.greatest(case.path)
    state = case.path.evaluate(np.linspace(0.0, 5.0, 20_001))
    dense = axes.demand(state.position_rad, state.velocity_rad_s, state.acceleration_rad_s2).max(axis=0)
    assert np.all(bound >= dense)
    assert np.all(bound <= dense + 0.003 * np.tile(axes.available_nm, axes.cases))


def test_limits_that_leave_nothing_are_refused(case):
    body = ArmBody(np.zeros((N, 10)), np.zeros(N), np.zeros(N), MAX_NM, np.eye(N))
    with pytest.raises(ModelError, match="torque for arm and payload"):
        TorqueLimits(case.chain, body, case.payload, MAX_NM - body.coulomb_nm)
    with pytest.raises(ModelError, match="share of the torque"):
        TorqueLimits.from_share(case.chain, np.ones(N), case.payload, MAX_NM)
    with pytest.raises(ModelError, match=r"share of the torque is .*; expected numbers of at least 0"):
        TorqueLimits.from_share(case.chain, np.full(N, -0.1), case.payload, MAX_NM)
    with pytest.raises(ModelError, match="share of the torque"):
        TorqueLimits.from_share(case.chain, np.zeros(2), case.payload, MAX_NM)
