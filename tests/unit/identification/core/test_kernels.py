"""The compiled kernels: every instruction set against Pinocchio and plain sums, and the arguments they reject."""

from __future__ import annotations

import math
import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest

from armload_core import kernels
from armload_identification.identification_errors import ModelError
from armload_identification.model.chain import Chain
from armload_identification.model.dynamics import ArmBody, ArmDynamics
from armload_identification.model.regressor import (
    body_regressor,
    feedforward_model,
    payload_regressor,
    payload_torque,
)

pytestmark = pytest.mark.pure

PINOCCHIO_ORDER = [0, 1, 2, 3, 4, 6, 9, 5, 7, 8]
"""Pinocchio's dynamic parameters are m, m c, Ixx, Ixy, Iyy, Ixz, Iyz, Izz."""
JOINTS = [1, 2, 6, 7, 15, 16]


@pytest.fixture(params=kernels.variants(), autouse=True)
def variant(request):
    """Each instruction set in turn."""
    kernels.use_variant(request.param)
    yield request.param
    kernels.use_variant(kernels.variants()[0])


def states(seed: int, samples: int, n: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.stack([rng.uniform(-np.pi, np.pi, (samples, n)), *2.0 * rng.normal(size=(2, samples, n))])


def close(found, expected):
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13 * max(1.0, np.abs(expected).max()))


def sine_cosine(angle):
    angle = np.atleast_2d(angle).reshape(-1, 1)
    sine, cosine = np.full(angle.shape, np.nan), np.full(angle.shape, np.nan)
    kernels.sine_cosine_into(angle, sine, cosine)
    return sine.ravel(), cosine.ravel()


class TestSineAndCosine:
    @pytest.mark.parametrize("greatest", [1e-8, 1.0, 7.0, 1e3, 1.6e6])
    def test_within_an_ulp_of_one_of_libm(self, greatest):
        angle = np.random.default_rng(1).uniform(-greatest, greatest, 20_000)
        sine, cosine = sine_cosine(angle)
        assert np.abs(sine - [math.sin(a) for a in angle]).max() <= 4e-16
        assert np.abs(cosine - [math.cos(a) for a in angle]).max() <= 4e-16

    def test_at_and_around_multiples_of_a_quarter_of_a_turn(self):
        quarters = np.arange(-5000, 5001) * (np.pi / 4)
        angle = np.concatenate([quarters, np.nextafter(quarters, np.inf), np.nextafter(quarters, -np.inf)])
        sine, cosine = sine_cosine(angle)
        assert np.abs(sine - [math.sin(a) for a in angle]).max() <= 4e-16
        assert np.abs(cosine - [math.cos(a) for a in angle]).max() <= 4e-16

    def test_small_angles_keep_their_relative_accuracy(self):
        angle = 10.0 ** -np.arange(1.0, 300.0)
        np.testing.assert_allclose(sine_cosine(angle)[0], [math.sin(a) for a in angle], rtol=3e-16)

    def test_what_is_far_beyond_any_joint_is_libms(self):
        angle = np.array([1.7e6, -1e9, 1e22, 0.5, 1e300, -1.0, 2.0])
        sine, cosine = sine_cosine(angle)
        np.testing.assert_allclose(sine, [math.sin(a) for a in angle], rtol=0, atol=4e-16)
        np.testing.assert_allclose(cosine, [math.cos(a) for a in angle], rtol=0, atol=4e-16)

    def test_what_is_no_number_spoils_its_own_sample_only(self):
        sine, cosine = sine_cosine(np.array([0.0, np.nan, np.inf, -np.inf, 1.0]))
        np.testing.assert_array_equal(np.isnan(sine), [False, True, True, True, False])
        np.testing.assert_array_equal(np.isnan(cosine), [False, True, True, True, False])


@pytest.mark.parametrize("n", JOINTS)
def test_regressors_and_torques_are_pinocchios(n, any_arm, any_body, in_pinocchio):
    rng = np.random.default_rng(n)
    chain, links = any_arm(rng, n)
    payload, motion = any_body(rng), states(n, 11, n)
    empty, loaded = in_pinocchio(chain, links), in_pinocchio(chain, links, payload)
    data = empty.createData()
    bodies = np.array([pin.computeJointTorqueRegressor(empty, data, *state) for state in zip(*motion, strict=True)])
    bodies = bodies.reshape(11, n, n, 10)[..., PINOCCHIO_ORDER].reshape(11, n, 10 * n)
    torque, carrying = (
        np.array([pin.rnea(model, model.createData(), *state) for state in zip(*motion, strict=True)])
        for model in (empty, loaded)
    )
    close(body_regressor(chain, *motion), bodies)
    close(payload_regressor(chain, *motion) @ payload.theta, carrying - torque)
    close(payload_torque(chain, payload.theta, *motion), carrying - torque)
    still = np.zeros(n)
    arm = ArmDynamics(chain, ArmBody(np.array([link.theta for link in links]), still, still, still, np.eye(len(links))))
    close(arm.torque(*motion), torque)


@pytest.mark.parametrize("samples", range(11))
def test_every_number_of_samples_gives_what_one_at_a_time_does(samples, any_arm, any_body):
    rng = np.random.default_rng(5)
    chain, links = any_arm(rng, 6)
    theta, motion = any_body(rng).theta, states(6, samples, 6)
    still = np.zeros(6)
    arm = ArmDynamics(chain, ArmBody(np.array([link.theta for link in links]), still, still, still, np.eye(len(links))))
    weight = rng.normal(size=(samples, 6)) * rng.integers(0, 2, (samples, 1))
    for found, one in (
        (payload_regressor(chain, *motion), lambda *s: payload_regressor(chain, *s)),
        (body_regressor(chain, *motion), lambda *s: body_regressor(chain, *s)),
        (payload_torque(chain, theta, *motion), lambda *s: payload_torque(chain, theta, *s)),
        (arm.torque(*motion), arm.torque),
    ):
        assert len(found) == samples
        for t in range(samples):
            np.testing.assert_array_equal(found[t], one(*motion[:, t : t + 1])[0])
    slope = arm.slope(weight, *motion)
    for t in range(samples):
        np.testing.assert_array_equal(slope[:, t], arm.slope(weight[t : t + 1], *motion[:, t : t + 1])[:, 0])


@pytest.mark.parametrize("n", [1, 6, 16])
@pytest.mark.parametrize("samples", [1, 2, 3, 4, 5, 9])
def test_the_slope_of_the_regressor_is_the_difference(n, samples, any_arm):
    rng = np.random.default_rng(n)
    chain, _ = any_arm(rng, n)
    bodies, motion = rng.normal(size=(samples, n, 10)), states(n, samples, n)
    slope = np.full_like(motion, np.nan)
    kernels.regressor_slope_into(chain.packed, bodies, *motion, slope)
    step = 1e-5
    for order in range(3):
        direction = np.zeros_like(motion)
        direction[order] = rng.normal(size=(samples, n))
        ahead, behind = (np.sum(bodies * payload_regressor(chain, *(motion + s * direction))) for s in (step, -step))
        scale = np.abs(bodies * payload_regressor(chain, *motion)).sum()
        assert np.sum(slope * direction) == pytest.approx((ahead - behind) / (2 * step), rel=1e-6, abs=1e-8 * scale)


@pytest.mark.parametrize("n", [1, 5, 16])
def test_the_slope_of_the_torque_is_the_difference(n, any_arm):
    rng = np.random.default_rng(n)
    chain, links = any_arm(rng, n)
    motion, weight, still = states(n, 7, n), rng.normal(size=(7, n)), np.zeros(n)
    weight[2] = 0.0
    arm = ArmDynamics(chain, ArmBody(np.array([link.theta for link in links]), still, still, still, np.eye(len(links))))
    slope = arm.slope(weight, *motion)
    assert not slope[:, 2].any()
    for order in range(3):
        direction = np.zeros_like(motion)
        direction[order] = rng.normal(size=(7, n))
        ahead, behind = (np.sum(weight * arm.torque(*(motion + s * direction))) for s in (1e-6, -1e-6))
        assert np.sum(slope * direction) == pytest.approx((ahead - behind) / 2e-6, rel=1e-5)


class Surroundings:
    """Spheres on every link of an arm, two planes, two boxes, and pairs of spheres that must stay apart."""

    def __init__(self, chain: Chain, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.chain = chain
        self.links = np.repeat(np.arange(chain.n + 1), 2)
        count = len(self.links)
        self.spheres = np.column_stack([rng.uniform(-0.3, 0.3, (count, 3)), rng.uniform(0.01, 0.1, count)])
        normals = rng.normal(size=(2, 3))
        self.planes = np.column_stack([normals / np.linalg.norm(normals, axis=1)[:, None], rng.normal(size=2)])
        turns = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2)]
        self.boxes = np.array(
            [[*turn.ravel(), *rng.uniform(-0.5, 0.5, 3), *rng.uniform(0.05, 0.4, 3)] for turn in turns]
        )
        self.on_plane = np.array([(s, p) for s in range(count) for p in range(2)])
        self.on_box = self.on_plane.copy()
        self.pairs = np.array([(a, b) for a in range(count) for b in range(a) if (a + b) % 3 == 0], dtype=np.int64)
        self.pairs = self.pairs.reshape(-1, 2)

    def arrays(self):
        yield from (self.chain.packed, self.links, self.spheres, self.planes)
        yield from (self.on_plane, self.boxes, self.on_box, self.pairs)

    @property
    def count(self) -> int:
        return len(self.on_plane) + len(self.on_box) + len(self.pairs)

    def clearances(self, q):
        out = np.full((len(q), self.count), np.nan)
        kernels.clearances_into(*self.arrays(), q, out)
        return out

    def slope(self, weight, q):
        slope = np.zeros_like(q)
        kernels.clearance_slope_into(*self.arrays(), q, slope, weight)
        return slope

    def expected(self, q):
        """The clearances of one configuration from the chain's poses."""
        poses = np.concatenate([np.eye(4)[None], self.chain.forward(q)])
        turned = [np.eye(3), *(self.chain.turned_back(i).T for i in range(self.chain.n))]
        centre = np.array(
            [
                poses[link][:3, :3] @ turned[link] @ sphere[:3] + poses[link][:3, 3]
                for link, sphere in zip(self.links, self.spheres, strict=True)
            ]
        )
        radius = self.spheres[:, 3]
        for s, p in self.on_plane:
            yield self.planes[p, :3] @ centre[s] - self.planes[p, 3] - radius[s]
        for s, b in self.on_box:
            local = self.boxes[b, :9].reshape(3, 3).T @ (centre[s] - self.boxes[b, 9:12])
            beyond = np.abs(local) - self.boxes[b, 12:]
            outside = np.linalg.norm(np.maximum(beyond, 0.0))
            yield (outside if outside > 0.0 else beyond.max()) - radius[s]
        for a, b in self.pairs:
            yield np.linalg.norm(centre[a] - centre[b]) - radius[a] - radius[b]


@pytest.mark.parametrize("n", [1, 6, 16])
@pytest.mark.parametrize("samples", [0, 1, 4, 7])
def test_clearances_are_distances_and_their_slope_the_difference(n, samples, any_arm):
    rng = np.random.default_rng(n)
    around = Surroundings(any_arm(rng, n)[0], n)
    q = rng.uniform(-np.pi, np.pi, (samples, n))
    found = around.clearances(q)
    np.testing.assert_allclose(
        found, np.array([list(around.expected(one)) for one in q]).reshape(found.shape), atol=1e-12
    )
    weight = rng.normal(size=found.shape) * rng.integers(0, 2, found.shape)
    weight[1:2] = 0.0
    slope, direction = around.slope(weight, q), rng.normal(size=q.shape)
    assert not slope[1:2].any()
    ahead, behind = (np.sum(weight * around.clearances(q + s * direction)) for s in (1e-7, -1e-7))
    assert np.sum(slope * direction) == pytest.approx((ahead - behind) / 2e-7, rel=1e-5, abs=1e-5)


def test_a_sphere_inside_a_box_is_pushed_out_of_the_nearest_side(any_arm):
    around = Surroundings(any_arm(np.random.default_rng(0), 1)[0], 0)
    around.links, around.spheres = np.array([1]), np.array([[0.3, 0.0, 0.0, 0.01]])
    around.on_plane, around.on_box, around.pairs = (np.zeros((k, 2), dtype=np.int64) for k in (0, 1, 0))
    around.boxes = np.array([[*np.eye(3).ravel(), 0.0, 0.0, 0.0, 5.0, 6.0, 7.0]])
    q = np.linspace(-3.0, 3.0, 9)[:, None]
    assert (around.clearances(q) < -4.0).all()
    ahead, behind = (around.clearances(q + s)[:, 0] for s in (1e-7, -1e-7))
    np.testing.assert_allclose(around.slope(np.ones((9, 1)), q)[:, 0], (ahead - behind) / 2e-7, atol=1e-6)


class TestRefusals:
    def test_a_chain_of_seventeen_joints(self, any_arm):
        with pytest.raises(ModelError, match="a chain of 17 joints; expected at most 16"):
            any_arm(np.random.default_rng(0), 17)
        seventeen = np.zeros((2, 17))
        with pytest.raises(ValueError, match="17 joints; the kernels take 1 to 16"):
            kernels.body_regressor_into(np.zeros(372), *[seventeen] * 3, np.zeros((2, 17, 170)))

    @pytest.mark.parametrize(
        ("change", "error", "message"),
        [
            ({"q": np.zeros((4, 6), dtype=np.int64)}, TypeError, "q: expected a C-contiguous array of float64 with 2"),
            ({"q": np.zeros((4, 6), dtype=np.float32)}, TypeError, "q: expected"),
            ({"q": np.zeros((4, 6), dtype=">f8")}, TypeError, "q: expected"),
            ({"dq": np.zeros((6, 4)).T}, TypeError, "dq: expected"),
            ({"dq": np.zeros((4, 12))[:, ::2]}, TypeError, "dq: expected"),
            ({"ddq": np.zeros(6)}, TypeError, "ddq: expected"),
            ({"ddq": [[0.0] * 6] * 4}, TypeError, "ddq: expected"),
            ({"ddq": np.zeros((5, 6))}, ValueError, "ddq: axis 0 has the length 5, expected 4"),
            ({"q": np.zeros((4, 5))}, ValueError, "packed: axis 0 has the length 141, expected 120"),
            ({"packed": np.zeros(140)}, ValueError, "packed: axis 0 has the length 140, expected 141"),
            ({"out": np.zeros((4, 6, 9))}, ValueError, "out: axis 2 has the length 9, expected 10"),
            ({"out": np.zeros((4, 6))}, TypeError, "out: expected a C-contiguous writable array"),
            ({"out": np.broadcast_to(0.0, (4, 6, 10))}, TypeError, "out: expected a C-contiguous writable array"),
            ({"out": bytes(1920)}, TypeError, "out: expected"),
        ],
    )
    def test_arrays_that_do_not_fit(self, change, error, message, any_arm):
        given = {
            "packed": any_arm(np.random.default_rng(0), 6)[0].packed,
            **{name: np.zeros((4, 6)) for name in ("q", "dq", "ddq")},
            "out": np.zeros((4, 6, 10)),
        }
        kernels.payload_regressor_into(*given.values())
        with pytest.raises(error, match=message):
            kernels.payload_regressor_into(*(given | change).values())

    def test_another_number_of_arrays(self):
        for function in (kernels.payload_regressor_into, kernels.regressor_slope_into, kernels.clearances_into):
            with pytest.raises(TypeError, match="expected"):
                function()

    @pytest.mark.parametrize(
        ("name", "value"), [("links", 7), ("links", -1), ("on_plane", 2), ("on_box", -1), ("on_box", 14), ("pairs", 14)]
    )
    def test_spheres_and_obstacles_that_are_not_there(self, name, value, any_arm):
        around = Surroundings(any_arm(np.random.default_rng(0), 6)[0], 0)
        q, count = np.zeros((3, 6)), around.count
        getattr(around, name).flat[-1] = value
        with pytest.raises(ValueError, match=f"{name}: {value} in column"):
            around.clearances(q)
        with pytest.raises(ValueError, match=f"{name}: {value} in column"):
            around.slope(np.zeros((3, count)), q)

    def test_clearances_of_another_number(self, any_arm):
        around = Surroundings(any_arm(np.random.default_rng(0), 6)[0], 0)
        with pytest.raises(ValueError, match=f"out: 3 columns, expected {around.count}"):
            kernels.clearances_into(*around.arrays(), np.zeros((2, 6)), np.zeros((2, 3)))
        with pytest.raises(ValueError, match=f"weight: 3 columns, expected {around.count}"):
            around.slope(np.zeros((2, 3)), np.zeros((2, 6)))
        around.spheres = around.spheres[1:].copy()
        with pytest.raises(ValueError, match="spheres: 13 rows for 14 links"):
            around.clearances(np.zeros((2, 6)))

    def test_an_instruction_set_that_is_not_there(self):
        with pytest.raises(ValueError, match="'mmx' is none of"):
            kernels.use_variant("mmx")
        with pytest.raises(TypeError):
            kernels.use_variant(3)


class TestPayloadTorque:
    @pytest.fixture
    def made(self, any_arm, any_body):
        rng = np.random.default_rng(8)
        chain, theta = any_arm(rng, 6)[0], any_body(rng).theta
        q, dq, ddq = states(8, 1, 6)[:, 0]
        return kernels.PayloadTorque(feedforward_model(chain, theta), np.zeros(6)), q, dq, ddq, chain, theta

    def test_any_kind_of_array_gives_the_same_torque(self, made):
        torque, q, dq, ddq, chain, theta = made
        expected = payload_torque(chain, theta, q, dq, ddq)
        unaligned = np.frombuffer(b"\0" + q.tobytes(), dtype=np.uint8)[1:].view(np.float64)
        for other in (q[::-1].copy()[::-1], q.astype(">f8"), q.tolist(), tuple(q), memoryview(q), unaligned):
            np.testing.assert_array_equal(torque.torque_nm(other, dq, ddq), expected)
        for other in (q.astype(np.float32), np.round(q).astype(np.int64), np.round(q).astype(int).tolist()):
            same = np.array(other, dtype=np.float64)
            np.testing.assert_array_equal(torque.torque_nm(other, dq, ddq), payload_torque(chain, theta, same, dq, ddq))

    def test_the_array_it_fills_may_be_an_argument(self, made):
        _, q, dq, ddq, chain, theta = made
        model, here = feedforward_model(chain, theta), q.copy()
        np.testing.assert_array_equal(
            kernels.PayloadTorque(model, here).torque_nm(here, dq, ddq), payload_torque(chain, theta, q, dq, ddq)
        )

    def test_the_model_is_a_copy(self, made):
        _, q, dq, ddq, chain, theta = made
        model = feedforward_model(chain, theta)
        torque = kernels.PayloadTorque(model, np.zeros(6))
        model[:] = np.nan
        np.testing.assert_array_equal(torque.torque_nm(q, dq, ddq), payload_torque(chain, theta, q, dq, ddq))

    @pytest.mark.parametrize("wrong", [np.zeros(5), np.zeros((1, 6)), np.float64(1.0), np.zeros(0), [0.0] * 7])
    def test_a_state_of_another_arm(self, wrong, made):
        torque, q, dq, ddq = made[:4]
        for k in range(3):
            state = [q, dq, ddq]
            state[k] = wrong
            with pytest.raises(ValueError, match="one number per joint"):
                torque.torque_nm(*state)

    def test_what_is_no_array_at_all(self, made):
        torque, q, dq, ddq = made[:4]
        with pytest.raises(ValueError, match="could not convert"):
            torque.torque_nm("six", dq, ddq)
        with pytest.raises(TypeError):
            torque.torque_nm(q, object(), ddq)
        with pytest.raises(TypeError, match="expected position, velocity and acceleration"):
            torque.torque_nm(q, dq)

    def test_what_cannot_be_made(self, made):
        model = feedforward_model(*made[4:])
        with pytest.raises(ValueError, match="model: axis 0 has the length 151, expected 130"):
            kernels.PayloadTorque(model, np.zeros(5))
        with pytest.raises(ValueError, match="17 joints; the kernels take 1 to 16"):
            kernels.PayloadTorque(np.zeros(382), np.zeros(17))
        with pytest.raises(ValueError, match="0 joints"):
            kernels.PayloadTorque(np.zeros(25), np.zeros(0))
        with pytest.raises(TypeError, match="torque: expected a C-contiguous writable array"):
            kernels.PayloadTorque(model, np.broadcast_to(0.0, 6))
        with pytest.raises(TypeError):
            kernels.PayloadTorque(model, torque=np.zeros(6))
        with pytest.raises(RuntimeError, match="called before"):
            made[0].__init__(model, np.zeros(6))
        unmade = kernels.PayloadTorque.__new__(kernels.PayloadTorque)
        with pytest.raises(TypeError, match="__init__ was not called"):
            unmade.torque_nm(np.zeros(6), np.zeros(6), np.zeros(6))
        with pytest.raises(ValueError, match="__init__"):
            unmade.change_parameters(np.zeros(10), 1)

    @pytest.mark.parametrize(("theta", "calls"), [(np.zeros(9), 1), (np.zeros(10), 0), (np.zeros(10, dtype=int), 1)])
    def test_a_change_that_cannot_be(self, theta, calls, made):
        torque, q, dq, ddq = made[:4]
        before = torque.torque_nm(q, dq, ddq).copy()
        with pytest.raises(ValueError, match="expected 10 parameters of float64 and at least one call"):
            torque.change_parameters(theta, calls)
        np.testing.assert_array_equal(torque.torque_nm(q, dq, ddq), before)

    def test_nothing_is_kept_of_the_arguments(self, made):
        torque, q, dq, ddq = made[:4]
        before = [sys.getrefcount(a) for a in (q, dq, ddq)]
        for _ in range(100):
            torque.torque_nm(q, dq, ddq)
            torque.torque_nm(q.tolist(), dq, ddq)
        assert [sys.getrefcount(a) for a in (q, dq, ddq)] == before


class TestServoLoops:
    @staticmethod
    def arrays(joints: int = 2, hinges: int = 1) -> dict[str, np.ndarray]:
        wide = joints * hinges
        return {
            "parameter": np.ones((kernels.SERVO_PARAMETERS, joints)),
            "state": np.zeros((kernels.SERVO_STATES, joints)),
            "to_axis": np.eye(joints),
            **{name: np.zeros(wide) for name in ("position", "velocity", "link_torque", "applied", "friction")},
        }

    def test_it_fills_the_arrays_that_it_shares(self):
        given = self.arrays(hinges=2)
        given["state"][[kernels.SERVO_POWER_ENDS, kernels.SERVO_BRAKE_BEGINS]] = np.inf
        given["state"][kernels.SERVO_OFFSET] = [0.25, -0.5]
        loops = kernels.ServoLoops(*given.values(), 100.0)
        assert loops.step(0) is True
        np.testing.assert_array_equal(given["applied"], [0.5, 0.0, -1.0, 0.0])  # a gain error of one doubles the torque
        np.testing.assert_array_equal(given["friction"], [2.0, 0.0, 2.0, 0.0])  # Coulomb and Stribeck friction at rest

    @pytest.mark.parametrize("speed", [100.0, -100.0, np.nan, np.inf])
    def test_an_absurd_speed_is_a_divergence(self, speed):
        given = self.arrays()
        loops = kernels.ServoLoops(*given.values(), 100.0)
        given["velocity"][1] = speed
        assert loops.step(0) is False

    @pytest.mark.parametrize(
        ("change", "error", "message"),
        [
            ({"parameter": np.ones((3, 2))}, ValueError, "parameter: axis 0 has the length 3"),
            ({"state": np.zeros((kernels.SERVO_STATES, 3))}, ValueError, "state: axis 1 has the length 3, expected 2"),
            ({"to_axis": np.eye(3)}, ValueError, "to_axis: axis 0 has the length 3, expected 2"),
            ({"friction": np.zeros(4)}, ValueError, "friction: axis 0 has the length 4, expected 2"),
            ({"applied": np.broadcast_to(0.0, 2)}, TypeError, "applied: expected a C-contiguous writable array"),
            ({"velocity": np.zeros(2, dtype=np.float32)}, TypeError, "velocity: expected"),
        ],
    )
    def test_arrays_that_do_not_fit(self, change, error, message):
        with pytest.raises(error, match=message):
            kernels.ServoLoops(*(self.arrays() | change).values(), 100.0)

    def test_hinges_that_do_not_come_out_even(self):
        given = self.arrays() | {name: np.zeros(3) for name in self.arrays() if self.arrays()[name].ndim == 1}
        with pytest.raises(ValueError, match="3 hinges for 2 joints"):
            kernels.ServoLoops(*given.values(), 100.0)

    def test_an_axis_that_is_not_there(self):
        loops = kernels.ServoLoops(*self.arrays().values(), 100.0)
        for axis in (-1, 2):
            with pytest.raises(IndexError, match=f"axis {axis} of 2"):
                loops.setpoint(axis, 0.0)
            with pytest.raises(IndexError, match=f"axis {axis} of 2"):
                loops.ramp(axis, 0.0, 1.0, 1.0, False)

    def test_a_ramp_begins_where_the_setpoint_is(self):
        loops = kernels.ServoLoops(*self.arrays().values(), 100.0)
        loops.ramp(1, 0.0, 2.0, 4.0, False)
        loops.ramp(1, 1.0, -0.5, 2.0, False)
        assert [loops.setpoint(1, step) for step in (1.0, 2.0, 3.0, 9.0)] == [0.5, 0.0, -0.5, -0.5]
        loops.ramp(1, 3.0, 0.5, 4.0, True)
        assert [loops.setpoint(1, step) for step in (3.0, 5.0, 7.0)] == [-0.5, 0.25, 0.5]  # three quarters at half time
        assert loops.setpoint(0, 5.0) == 0.0

    def test_what_is_measured(self):
        given = self.arrays(hinges=2)
        given["to_axis"][1, 0] = -0.5
        for name, values in (("position", [1.0, 0.1, 2.0, 0.2]), ("velocity", [3.0, 0.3, 4.0, 0.4])):
            given[name][:] = values
        given["link_torque"][:] = [7.0, 0.0, 8.0, 0.0]
        given["state"][[kernels.SERVO_RAMP_TO, kernels.SERVO_TORQUE, kernels.SERVO_TRUE_TORQUE]] = [
            [0.5, 0.6],
            [5.0, 6.0],
            [5.5, 6.5],
        ]
        given["state"][kernels.SERVO_ENCODER_SCALE] = 1.0
        out = np.full((kernels.SERVO_MEASUREMENTS, 2), np.nan)
        kernels.ServoLoops(*given.values(), 100.0).measure(0.0, out)
        expected = {
            "AXIS_POSITION": [1.0, 1.5],
            "AXIS_VELOCITY": [3.0, 2.5],
            "AXIS_DEMAND": [0.5, 0.6],
            "AXIS_TORQUE": [5.0, 6.0],
            "JOINT_POSITION": [1.1, 2.2],
            "JOINT_VELOCITY": [3.3, 4.4],
            "JOINT_TORQUE": [5.5 - 3.25, 6.5],
            "LINK_TORQUE": [7.0, 8.0],
        }
        assert len(expected) == kernels.SERVO_MEASUREMENTS
        for name, values in expected.items():
            np.testing.assert_allclose(out[getattr(kernels, f"SERVO_{name}")], values, rtol=1e-15)

    def test_the_loops_see_what_the_encoder_has(self):
        given = self.arrays()
        given["position"][:], given["velocity"][:] = [2.0, 3.0], [4.0, 5.0]
        given["parameter"][kernels.SERVO_TIME_STEP] = 0.5
        given["state"][[kernels.SERVO_ENCODER_SCALE, kernels.SERVO_ENCODER_OFFSET, kernels.SERVO_ENCODER_DRIFT]] = [
            [-1.0, 0.0],
            [1.0, 7.0],
            [0.0, 0.25],
        ]
        loops, out = kernels.ServoLoops(*given.values(), 100.0), np.empty((kernels.SERVO_MEASUREMENTS, 2))
        loops.measure(8.0, out)
        np.testing.assert_allclose(out[kernels.SERVO_AXIS_POSITION], [-1.0, 8.0])
        np.testing.assert_allclose(out[kernels.SERVO_AXIS_VELOCITY], [-4.0, 0.25])
        np.testing.assert_allclose(out[kernels.SERVO_JOINT_POSITION], [2.0, 3.0])
        assert [loops.position(axis, 8.0) for axis in (0, 1)] == [-1.0, 8.0]
        given["state"][kernels.SERVO_POWER_ENDS] = np.inf
        loops.step(8.0)
        # gain 1 times the setpoint's distance 0 - p, less the velocity; a gain error of one doubles the torque
        np.testing.assert_allclose(given["state"][kernels.SERVO_TORQUE], [1.0, -1.0])

    def test_power_ends_and_the_brake_begins_at_their_steps(self):
        given = self.arrays()
        given["state"][kernels.SERVO_POWER_ENDS] = [3.0, np.inf]
        given["state"][kernels.SERVO_BRAKE_BEGINS] = [4.0, np.inf]
        given["state"][kernels.SERVO_OFFSET] = 0.5
        given["parameter"][[kernels.SERVO_RIPPLE, kernels.SERVO_GAIN_DRIFT]] = 0.0
        loops, applied, friction = kernels.ServoLoops(*given.values(), 100.0), [], []
        for step in (2, 3, 4):
            loops.step(step)
            applied.append(given["applied"][0])
            friction.append(given["friction"][0])
        assert applied == [1.0, 0.0, 0.0]
        assert friction == [2.0, 2.0, 3.0]
        assert given["applied"][1] == 1.0

    @pytest.mark.parametrize("shape", [(1, 2), (kernels.SERVO_MEASUREMENTS, 3)])
    def test_a_measurement_that_does_not_fit(self, shape):
        loops = kernels.ServoLoops(*self.arrays().values(), 100.0)
        with pytest.raises(ValueError, match="out: axis"):
            loops.measure(0.0, np.zeros(shape))

    def test_it_is_made_once(self):
        loops = kernels.ServoLoops(*self.arrays().values(), 100.0)
        with pytest.raises(TypeError, match="made once"):
            loops.__init__(*self.arrays().values(), 100.0)


def test_the_kernels_load_nothing_but_themselves():
    code = "import sys; before = set(sys.modules)\nfrom armload_core import kernels\nprint(*set(sys.modules) - before)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert set(done.stdout.split()) <= {"armload_core", "armload_core.kernels", "__future__"}
