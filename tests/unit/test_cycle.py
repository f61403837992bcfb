"""The cycle: what is sent, and how every cause brings the arm to rest."""

from dataclasses import replace

import numpy as np
import pytest

from armload_controller.cycle import Cycle
from armload_controller.errors import MotionError
from armload_controller.limits import LimitViolation, MotionLimits
from armload_controller.recorder import Recorder
from armload_controller.safety import DECISIONS, Cause, cause_of
from armload_controller.setpoints import Segment, plan_path, plan_run
from armload_drivers.errors import BusError, ServoFault, ServoTimeout
from armload_identification.fourier import Excitation, FourierTrajectory
from armload_identification.recording import read_recording

N = 2
CYCLE_S = 0.01
LIMITS = MotionLimits(
    joint_names=("base", "elbow"),
    position_min_rad=np.full(N, -2.0),
    position_max_rad=np.full(N, 2.0),
    velocity_max_rad_s=np.full(N, 2.0),
    acceleration_max_rad_s2=np.full(N, 6.0),
    jerk_max_rad_s3=np.full(N, 600.0),
    following_error_rad=np.full(N, 0.05),
)
EXCITATION = Excitation(
    FourierTrajectory(1.0, np.array([0.2, -0.2]), np.array([[0.05], [0.03]]), np.array([[0.02], [0.04]])), 2
)
PATH = EXCITATION.trajectory
START = np.full(N, 0.1)


@pytest.fixture
def plan():
    return plan_run(START, plan_path(EXCITATION, LIMITS, CYCLE_S), LIMITS, CYCLE_S)


@pytest.fixture
def run(tmp_path, plan):
    """Run the plan on some servos; the recording is closed whatever happens."""

    def run(servos, stop_requested=lambda: False, plan=plan):
        servos.enable()
        with Recorder(tmp_path / "run.mcap", {}) as recorder:
            return Cycle(servos, LIMITS, stop_requested).run(plan, PATH, START, recorder, lambda done: None)

    return run


def test_a_whole_plan_is_sent_and_recorded(ideal_servos, run, plan, tmp_path):
    servos = ideal_servos(N, CYCLE_S)
    summary = run(servos)
    sent = np.array([command.position_rad for command in servos.sent])
    np.testing.assert_allclose(sent, plan.position_rad, atol=1e-8)
    assert summary.cycles == len(plan)
    assert summary.duration_s == pytest.approx((len(plan) - 1) * CYCLE_S)
    recording = read_recording(tmp_path / "run.mcap")
    assert len(recording.time_s) == len(plan)
    np.testing.assert_allclose(recording.position_rad, sent, atol=1e-12)


def test_a_plan_beyond_a_limit_moves_nothing(ideal_servos, run, plan):
    position = plan.position_rad.copy()
    position[-1, 0] = 2.5
    servos = ideal_servos(N, CYCLE_S)
    with pytest.raises(LimitViolation, match="base"):
        run(servos, plan=replace(plan, position_rad=position))
    assert not servos.sent


def test_a_jump_in_the_plan_stops_before_it_is_sent(ideal_servos, run, plan):
    position = plan.position_rad.copy()
    row = plan.segment.index(Segment.PERIODS) + 10
    position[row] += 0.01
    servos = ideal_servos(N, CYCLE_S)
    with pytest.raises(MotionError, match="off the checked path"):
        run(servos, plan=replace(plan, position_rad=position))
    assert len(servos.sent) == row
    assert servos.log[-2:] == ["stop", "disable"]


@pytest.mark.parametrize(
    ("event", "text", "steps"),
    [
        (ServoFault(3, "elbow", "streaming", "overcurrent", "Look."), "elbow", ["stop", "disable"]),
        (ServoTimeout(3, "elbow", "streaming", "no feedback", "Look."), "does not answer", ["stop", "disable"]),
        (BusError("bus-off"), "bus-off", ["disable"]),
        (RuntimeError("broken plug-in"), "broken plug-in", ["stop", "disable"]),
        (KeyboardInterrupt(), "operator", ["stop", "disable"]),
    ],
)
def test_every_failure_brings_the_arm_to_rest_first(ideal_servos, run, event, text, steps):
    servos = ideal_servos(N, CYCLE_S, {120: event})
    with pytest.raises(MotionError, match=text) as caught:
        run(servos)
    assert servos.log[1:] == steps
    assert len(caught.value.last_feedback) == 50
    assert caught.value.last_feedback[-1].cycle == 120
    assert caught.value.__cause__ is event


def test_a_joint_that_lags_is_stopped(ideal_servos, run):
    def stuck(feedback):
        return replace(feedback, position_rad=feedback.position_rad + np.array([0.0, 0.06]))

    servos = ideal_servos(N, CYCLE_S, {130: stuck})
    with pytest.raises(MotionError, match=r"elbow: 0\.0600 rad behind its target"):
        run(servos)
    assert len(servos.sent) == 131
    assert servos.log[1:] == ["stop", "disable"]


def test_nan_feedback_stops(ideal_servos, run):
    servos = ideal_servos(N, CYCLE_S, {130: lambda f: replace(f, position_rad=np.full(N, np.nan))})
    with pytest.raises(MotionError):
        run(servos)
    assert len(servos.sent) == 131


def test_the_operator_stops_along_the_path(ideal_servos, run, plan):
    row = plan.segment.index(Segment.PERIODS) + 50
    servos = ideal_servos(N, CYCLE_S)
    with pytest.raises(MotionError, match="operator"):
        run(servos, stop_requested=lambda: len(servos.sent) >= row)
    sent = np.array([command.position_rad for command in servos.sent])
    assert row < len(sent) < len(plan)
    grid = PATH.evaluate(np.linspace(0.0, 1.0, 20001)).position_rad
    for position in sent[row:]:
        assert np.abs(grid - position).max(axis=1).min() < 1e-4
    assert np.abs(servos.sent[-1].velocity_rad_s).max() < 1e-9
    assert servos.log[1:] == ["stop", "disable"]


def test_every_cause_has_a_decision_and_an_advice():
    assert set(DECISIONS) == set(Cause)
    assert all(decision.advice for decision in DECISIONS.values())
    assert cause_of(ZeroDivisionError()) is Cause.PROGRAM
