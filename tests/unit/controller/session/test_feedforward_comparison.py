"""The trial of the torque offset in a session: what is added, what the operator is asked, and what is refused."""

from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import CommissioningError, MotionError, OffsetRefused
from armload_controller.feedforward.payload_feedforward import PayloadFeedforward
from armload_controller.motion.checked_path import check_path
from armload_controller.motion.motion_control import MotionControl
from armload_controller.session.feedforward_comparison import ComparisonRuns
from armload_controller.session.run_session import Consent, NoDisplay, Operator, SessionLoad, no_operator, run_session
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.model.payload import PayloadResult, Provenance
from tests.fake_servos import FakeServos

ROBOT = load_robot("prbt").with_bus(cycle_hz=50.0)
START_RAD = np.array([0.2, 0.7, 1.1, 0.3, 0.9, 0.4])
BODY = ROBOT.simulation.payload("gripper")
PAYLOAD = PayloadResult(
    "flange", BODY, np.ones(10, bool), np.stack([BODY.values] * 2, axis=1), *np.ones((2, 6)), Provenance("0", "0", {})
)
SWING = FourierTrajectory(0.25, START_RAD, np.full((6, 1), 0.05), np.full((6, 1), 0.02))


class Sent:
    """Plug-in that collects the torque offsets sent."""

    name = "sent"

    def __init__(self):
        self.torque_nm = []

    def on_cycle(self, step):
        if step.sent is not None:
            self.torque_nm.append(step.sent.torque_offset_nm)


class ReversedOffset:
    """A plant with one drive that reverses the sign of its torque offset."""

    def __init__(self, plant):
        self._plant = plant

    def __getattr__(self, name):
        return getattr(self._plant, name)

    def set_torque_offset(self, axis, torque_nm):
        self._plant.set_torque_offset(axis, -torque_nm if axis == 2 else torque_nm)


@pytest.fixture
def tried():
    """Try the offset on the loaded arm; returns the result and the (N, n) torque offsets sent."""
    path = check_path(Excitation(SWING, 1), ROBOT.motion_constraints, 0.02, file=ROBOT.file, key="swing")

    def tried(operator=None, *, simulated=True, drives=lambda plant: plant):
        plant = ArmPlant(replace(ROBOT.simulation.plant_spec("gripper"), start_position_rad=START_RAD))
        servos, sent = FakeServos(ROBOT.drives.settings, drives(plant)), Sent()
        servos.simulated = simulated

        @contextmanager
        def open_servos(load):
            yield servos

        operator = replace(operator or no_operator(), watching=(sent,))
        with run_session(ROBOT, SessionLoad.LOADED, open_servos, operator) as session:
            verdict = ComparisonRuns(ROBOT, path).try_offset(session, PAYLOAD)
        return verdict, np.array(sent.torque_nm)

    return tried


def test_the_trial_adds_what_it_tries_and_never_the_payloads_torque(tried):
    verdict, sent_nm = tried()
    still = np.zeros(6)
    payload_nm = np.abs(PayloadFeedforward(ROBOT.chain, BODY).torque_nm(START_RAD, still, still))
    assert verdict.usable[2]
    assert payload_nm[2] > 4.0 * verdict.tried_nm[2]
    greatest_nm = np.abs(sent_nm).max(axis=0)
    np.testing.assert_allclose(greatest_nm, verdict.tried_nm, rtol=0.02, atol=0.05)
    assert not sent_nm[-1].any()


def test_the_operator_is_asked_with_the_torque_of_the_trial(tried):
    asked = []
    operator = Operator(NoDisplay(), MotionControl(), Consent(asked.append, given=True))
    with pytest.raises(CommissioningError, match="not confirmed"):
        tried(operator, simulated=False)
    (question,) = asked
    assert "Up to 1.6 N m will be added on prbt_joint_3, less on the others, and removed again." in question


def test_a_drive_that_responds_wrongly_stops_the_trial(tried):
    with pytest.raises(MotionError, match=r"prbt_joint_3 was commanded .* the sign is wrong") as caught:
        tried(drives=ReversedOffset)
    assert isinstance(caught.value.__cause__, OffsetRefused)
