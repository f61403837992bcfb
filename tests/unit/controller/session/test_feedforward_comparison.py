"""Runs with and without feed-forward: the trial of the offset, what the operator is asked, and what is compared."""

from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import CommissioningError, MotionError, OffsetRefused
from armload_controller.feedforward.payload_feedforward import PayloadFeedforward
from armload_controller.motion.checked_path import check_path
from armload_controller.motion.motion_control import MotionControl
from armload_controller.motion.phase import Segment
from armload_controller.session.feedforward_comparison import (
    ComparisonRuns,
    FollowingComparison,
    FollowingRecorder,
    FollowingRun,
    Measure,
    beyond_lag,
)
from armload_controller.session.run_session import Consent, NoDisplay, Operator, no_operator, run_session
from armload_controller.session.session_load import SessionLoad
from armload_drivers.simulation.mujoco_plant import ArmPlant
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.model.payload import PayloadResult, Provenance
from armload_identification.model.regressor import payload_torque
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


# The comparison itself, by arithmetic ----------------------------------------------------------------------------


def compared(without, weight=(1.0, 1.0), **with_rad):
    without = np.asarray(without, dtype=float)
    phase_s = np.arange(len(without), dtype=float)
    names = ("base", "elbow")
    return FollowingComparison(Measure.ADDED, names, phase_s, without, with_rad, np.asarray(weight))


def test_the_effect_is_a_share_of_the_rms():
    swing = np.array([[3.0, 0.0], [-4.0, 0.0]])
    found = compared(swing, less=0.25 * swing, more=1.5 * swing, same=swing)
    np.testing.assert_allclose(found.without_rms_rad, [np.sqrt(12.5), 0.0])
    np.testing.assert_allclose(found.reduction("less"), [0.75, np.nan])
    assert found.less("less", 0, 1) == "75.0 % less"
    assert found.less("more", 0, 0) == "50 % more"
    assert found.less("same", 0, 0) == "0 % less"
    assert found.less("less", 1, 0) == "no error without it"


@pytest.mark.parametrize(
    ("weight", "loaded"), [((5.0, 1.0), (0, 1)), ((5.0, 0.99), (0,)), ((0.1, 5.0), (1,)), ((0.0, 0.0), (0, 1))]
)
def test_a_joint_is_loaded_from_a_fifth_of_the_greatest_weight(weight, loaded):
    assert compared(np.ones((3, 2)), weight).gravity_loaded == loaded


def test_what_is_linear_in_the_derivatives_of_the_motion_is_lag_and_no_more():
    phase_s = np.linspace(0.0, SWING.period_s, 200, endpoint=False)
    path = FourierTrajectory(0.25, START_RAD, np.full((6, 3), 0.05), np.linspace(-0.04, 0.04, 18).reshape(6, 3))
    state = path.evaluate(phase_s)
    step = 1e-3
    fourth = (path.evaluate(phase_s + step).jerk_rad_s3 - path.evaluate(phase_s - step).jerk_rad_s3) / (2.0 * step)
    lag = 0.04 * state.velocity_rad_s - 0.01 * state.acceleration_rad_s2 + 1e-3 * state.jerk_rad_s3 + 1e-4 * fourth
    np.testing.assert_allclose(beyond_lag(lag, path, phase_s), 0.0, atol=1e-9)
    steady = np.full_like(lag, 1e-3)
    np.testing.assert_allclose(beyond_lag(lag + steady, path, phase_s), steady, atol=1e-6)
    still = FourierTrajectory(0.25, START_RAD, np.zeros((6, 1)), np.zeros((6, 1)))
    np.testing.assert_array_equal(beyond_lag(steady, still, phase_s), steady)


def step(phase_s, *, segment=Segment.PERIODS, sent=True):
    """One cycle in which the arm is 0.1 rad behind."""
    reference = SimpleNamespace(segment=segment, state=SimpleNamespace(phase_s=phase_s))
    command = SimpleNamespace(position_rad=np.full(6, phase_s)) if sent else None
    feedback = SimpleNamespace(position_rad=np.full(6, phase_s - 0.1))
    return SimpleNamespace(sent=command, sent_reference=reference if sent else None, feedback=feedback)


def test_only_cycles_of_the_periods_are_compared():
    recorder = FollowingRecorder()
    others = [segment for segment in Segment if segment is not Segment.PERIODS]
    recorder.on_cycle(step(0.0, sent=False))
    recorder.on_cycle(step(0.0, segment=others[0]))
    with pytest.raises(CommissioningError, match="no cycle at full speed: nothing to compare"):
        recorder.run()
    for phase_s in (1.0, 2.0):
        recorder.on_cycle(step(phase_s))
    run = recorder.run()
    np.testing.assert_array_equal(run.phase_s, [1.0, 2.0])
    np.testing.assert_allclose(run.error_rad, 0.1)


@pytest.mark.parametrize("with_empty", [True, False])
def test_runs_are_compared_at_the_phases_that_all_of_them_have(with_empty):
    path = check_path(Excitation(SWING, 1), ROBOT.motion_constraints, 0.02, file=ROBOT.file, key="swing")
    runs = ComparisonRuns(ROBOT, path)

    def run(first, last, error_rad):
        phase_s = 0.02 * np.arange(first, last) + 1e-9
        return FollowingRun(phase_s, error_rad + np.zeros((phase_s.size, 6)))

    ramp = 1e-3 * np.arange(100.0)[:, None]
    without, fed = run(0, 100, ramp), run(10, 90, 1e-3)
    empty = run(5, 200, 2e-3) if with_empty else None
    found = runs.compare(without, {"fed": fed}, empty, PAYLOAD)
    np.testing.assert_allclose(found.phase_s, 0.02 * np.arange(10, 90))
    assert found.joint_names == ROBOT.joint_names
    assert list(found.with_rad) == ["fed"]
    assert found.measure is (Measure.ADDED if with_empty else Measure.TORQUES)
    if with_empty:
        np.testing.assert_allclose(found.without_rad, ramp[10:90] - 2e-3 + np.zeros(6))
        np.testing.assert_allclose(found.with_rad["fed"], -1e-3)
    positions = SWING.evaluate(np.linspace(0.0, SWING.period_s, 400)).position_rad
    still = np.zeros_like(positions)
    weight = np.abs(payload_torque(ROBOT.chain, BODY.theta, positions, still, still)).max(axis=0)
    np.testing.assert_allclose(found.weight_nm, weight, rtol=0.02, atol=1e-6)
