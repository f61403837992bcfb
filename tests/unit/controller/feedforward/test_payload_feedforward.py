"""The feed-forward: equal to Pinocchio, and light enough for the user's own control process."""

import subprocess
import sys
import threading
import time

import numpy as np
import pinocchio as pin
import pytest

from armload_controller.feedforward.payload_feedforward import NOTHING, PayloadFeedforward
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters

ORIGINS = np.array([[0.0, 0.0, 0.3], [0.1, 0.0, 0.2], [0.0, 0.5, 0.0]])
ANGLES = np.array([[0.1, 0.2, 0.3], [1.5, 0.0, -0.4], [0.0, -0.7, 0.2]])
AXES = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]])
PAYLOAD = InertialParameters.from_center_of_mass(
    3.0, [0.05, -0.1, 0.2], np.array([[0.05, 0.001, 0.002], [0.001, 0.04, -0.003], [0.002, -0.003, 0.03]])
)


@pytest.fixture
def pinocchio_model():
    """The same arm, without links, with the payload fixed to the last joint."""
    model = pin.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    parent = 0
    for origin, angles, axis in zip(ORIGINS, ANGLES, AXES, strict=True):
        joint = pin.JointModelRevoluteUnaligned(axis)
        parent = model.addJoint(parent, joint, pin.SE3(pin.rpy.rpyToMatrix(angles), origin), "joint")
    inertia = pin.Inertia(PAYLOAD.mass_kg, PAYLOAD.center_of_mass_m, PAYLOAD.inertia_about_com)
    model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    return model


def test_torque_is_pinocchios(pinocchio_model):
    chain = Chain.from_origins(ORIGINS, ANGLES, AXES, np.eye(4), np.array([0.0, 0.0, -9.81]))
    feedforward = PayloadFeedforward(chain, PAYLOAD)
    data = pinocchio_model.createData()
    rng = np.random.default_rng(3)
    for _ in range(50):
        q, dq, ddq = rng.normal(size=(3, 3))
        expected = pin.rnea(pinocchio_model, data, q, dq, ddq)
        np.testing.assert_allclose(feedforward.torque_nm(q, dq, ddq), expected, atol=1e-10)


def test_other_layouts_and_lists_are_taken_and_another_number_of_joints_is_not():
    chain = Chain.from_origins(ORIGINS, ANGLES, AXES, np.eye(4), np.array([0.0, 0.0, -9.81]))
    feedforward = PayloadFeedforward(chain, PAYLOAD)
    q, dq, ddq = np.random.default_rng(4).normal(size=(3, 3))
    expected = feedforward.torque_nm(q, dq, ddq).copy()
    spread = np.stack([q, dq, ddq], axis=-1)
    np.testing.assert_array_equal(feedforward.torque_nm(*spread.T), expected)
    np.testing.assert_array_equal(feedforward.torque_nm(q.tolist(), dq.tolist(), ddq.tolist()), expected)
    for wrong in (q[:2].copy(), [*q.tolist(), 0.0]):
        with pytest.raises(ValueError, match="one number per joint"):
            feedforward.torque_nm(wrong, dq, ddq)


def changing(requests, calls=400):
    """Torques (calls, 3) of a standing arm; `requests` are made before the call of their number."""
    chain = Chain.from_origins(ORIGINS, ANGLES, AXES, np.eye(4), np.array([0.0, 0.0, -9.81]))
    feedforward = PayloadFeedforward(chain, PAYLOAD)
    q, still = np.array([0.3, -0.5, 0.7]), np.zeros(3)
    torques = []
    for call in range(calls):
        for payload, transition_s in requests.get(call, ()):
            feedforward.set_payload(payload, transition_s, cycle_s=0.001)
        torques.append(feedforward.torque_nm(q, still, still).copy())
    return np.array(torques)


def test_a_payload_is_changed_without_a_step():
    torques = changing({100: [(NOTHING, 0.2)]})
    whole = np.abs(torques[0]).max()
    np.testing.assert_array_equal(torques[99], torques[0])
    np.testing.assert_array_equal(torques[299:], 0.0)
    assert np.abs(torques[298]).max() > 0
    assert np.abs(np.diff(torques, axis=0)).max() <= 1.5 * whole / 200 * 1.001
    assert np.abs(np.diff(torques, 2, axis=0)).max() <= 6.1 * whole / 200**2


def test_a_second_change_takes_up_where_the_first_is():
    torques = changing({100: [(NOTHING, 0.2)], 200: [(PAYLOAD, 0.1)]})
    np.testing.assert_allclose(torques[-1], torques[0])
    assert np.abs(np.diff(torques, axis=0)).max() <= 1.5 * np.abs(torques[0]).max() / 100
    assert np.abs(torques[200]).max() < 0.6 * np.abs(torques[0]).max()


def test_a_change_at_once_is_complete_with_the_next_call():
    torques = changing({100: [(NOTHING, 0.0)]})
    assert torques[99].any()
    assert not torques[100].any()


def test_changes_from_other_threads_all_arrive():
    chain = Chain.from_origins(ORIGINS, ANGLES, AXES, np.eye(4), np.array([0.0, 0.0, -9.81]))
    feedforward = PayloadFeedforward(chain, PAYLOAD)
    q, still = np.array([0.3, -0.5, 0.7]), np.zeros(3)
    whole = feedforward.torque_nm(q, still, still).copy()

    def juggle():
        for _ in range(2000):
            feedforward.set_payload(NOTHING, 0.01, 0.001)
            feedforward.set_payload(PAYLOAD, 0.01, 0.001)

    threads = [threading.Thread(target=juggle) for _ in range(3)]
    for thread in threads:
        thread.start()
    worst = np.zeros(3)
    end_s = time.monotonic() + 60.0
    while any(thread.is_alive() for thread in threads):
        assert time.monotonic() < end_s, "the other threads do not end"
        worst = np.maximum(worst, np.abs(feedforward.torque_nm(q, still, still)))
    for thread in threads:
        thread.join()
    for _ in range(10):
        last = feedforward.torque_nm(q, still, still)
    np.testing.assert_allclose(last, whole)
    assert (worst <= np.abs(whole) * (1 + 1e-12)).all()


@pytest.mark.parametrize(("transition_s", "cycle_s"), [(-0.1, 0.001), (0.1, 0.0), (float("nan"), 0.001)])
def test_a_change_in_impossible_time_is_refused(transition_s, cycle_s):
    chain = Chain.from_origins(ORIGINS, ANGLES, AXES, np.eye(4), np.array([0.0, 0.0, -9.81]))
    with pytest.raises(ValueError, match="transition_s"):
        PayloadFeedforward(chain, PAYLOAD).set_payload(NOTHING, transition_s, cycle_s)


def test_importing_it_loads_no_bus_no_motion_no_plotting():
    heavy = ["can", "canopen", "ruckig", "scipy", "matplotlib", "mcap", "msgspec", "typer"]
    heavy += ["rich", "mujoco", "armload_drivers"]
    loads = "import sys, armload_controller.feedforward.payload_feedforward"
    program = f"{loads}\nprint([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
