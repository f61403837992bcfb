"""The feed-forward: equal to Pinocchio, and light enough for somebody else's control process."""

import subprocess
import sys

import numpy as np
import pinocchio as pin
import pytest

from armload_controller.feedforward import PayloadFeedforward
from armload_identification.chain import Chain
from armload_identification.payload import InertialParameters

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


def test_importing_it_loads_no_bus_no_motion_no_plotting():
    """Numba itself loads scipy and scipy.linalg; nothing else of scipy may come."""
    heavy = ["can", "canopen", "ruckig", "scipy.optimize", "scipy.signal", "matplotlib", "mcap", "pydantic", "typer"]
    heavy += ["rich", "mujoco", "armload_drivers"]
    program = f"import sys, armload_controller.feedforward\nprint([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
