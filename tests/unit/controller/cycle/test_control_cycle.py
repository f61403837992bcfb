"""The cycle: the commands sent, and how every cause brings the arm to rest."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from armload_controller.control_errors import MotionError
from armload_controller.cycle.control_cycle import Cycle
from armload_controller.cycle.following_monitor import FollowingMonitor
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.cycle.stop_decisions import Cause, StopStep, cause_of
from armload_controller.cycle.torque_gate import TorqueGate
from armload_controller.cycle.torque_monitor import TorqueWindow, measured_torque
from armload_controller.motion.checked_path import CheckedLeg, check_path
from armload_controller.motion.joint_limits import MotionLimits
from armload_controller.motion.motion_constraints import MotionConstraints
from armload_controller.motion.motion_control import MotionControl, OperatorStop, SpeedOutOfRange, TerminationStop
from armload_controller.motion.obstacles import Obstacles
from armload_controller.motion.phase import Segment
from armload_controller.session.run_session import run_leg
from armload_drivers.driver_errors import BusError, CommandError, LoopLost, ServoFault, ServoTimeout
from armload_drivers.servos import JointFeedback
from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.excitation.geometry.cartesian_speed import ArmPoints
from armload_identification.excitation.geometry.workspace import HalfSpace, Sphere, Workspace
from armload_identification.model.chain import Chain
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.run_format import EXCITATION_ATTACHMENT
from armload_identification.signals.joint_torque import Transmission
from tests.planned_leg import plan_leg

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
TRAJECTORY = EXCITATION.trajectory
START = np.full(N, 0.1)
TORQUE_MAX_NM = np.full(N, 50.0)
TRANSMISSION = Transmission(np.ones(N), np.eye(N))
CHAIN = Chain.from_origins(
    np.array([[0.0, 0.0, 0.2], [0.5, 0.0, 0.0]]),
    np.zeros((N, 3)),
    np.array([[0.0, 0.0, 1.0]] * N),
    np.eye(4),
    np.array([0.0, 0.0, -9.81]),
)


def constraints(workspace):
    """The limits above in a workspace, without limits of torque or of the servos' lag."""
    points = ArmPoints(CHAIN, np.zeros(3))
    return MotionConstraints("none", LIMITS, np.full(N, np.inf), None, None, Obstacles(workspace), points, None)


PATH = check_path(EXCITATION, constraints(Workspace(CHAIN)), CYCLE_S, file="test", key="excitation")


def as_if_checked(leg):
    """A leg that was never checked, made by bypassing the constructor, as a defect after the checks would."""
    checked = object.__new__(CheckedLeg)
    object.__setattr__(checked, "leg", leg)
    return checked


class Bumped:
    """The excitation with a step, as from a defect."""

    def __init__(self, at_s, step_rad=0.01):
        self.at_s, self.step_rad = at_s, step_rad

    def evaluate(self, t_s):
        state, late = TRAJECTORY.evaluate(t_s), (np.asarray(t_s) > self.at_s)[..., None]
        return state._replace(position_rad=state.position_rad + self.step_rad * late)


class Stranger:
    """A user's plug-in that calls a function in one cycle."""

    name = "stranger"

    def __init__(self, at, act):
        self.at, self.act, self.calls = at, act, 0

    def on_cycle(self, step):
        self.calls += 1
        return self.act(step) if step.feedback.cycle == self.at else None


@pytest.fixture
def run(tmp_path):
    """Approach and run the measured leg with some servos; the recording is always closed."""

    def run(servos, control=None, plugins=(), leg=None, stopwatch=lambda: 0.0, path=PATH):
        control = control or MotionControl()
        monitor = FollowingMonitor(LIMITS, max_skipped_cycles=3)
        gate = TorqueGate(TORQUE_MAX_NM, CYCLE_S)
        attachments = {EXCITATION_ATTACHMENT: format_excitation(EXCITATION)}
        with Recorder(tmp_path / f"run{len(list(tmp_path.iterdir()))}.mcap", attachments) as recorder:
            window = TorqueWindow(LIMITS.joint_names, TRANSMISSION, TORQUE_MAX_NM, CYCLE_S, None)
            cycle = Cycle(servos, LIMITS, gate, control, [recorder, monitor, window, *plugins], stopwatch)
            run_leg(cycle, path, leg or path.measured, lambda done: None)
        return monitor.summary, cycle

    return run


def first_of(segment):
    """Setpoints sent before a segment of the measured leg begins."""
    (leg,) = PATH.approach_from(START)
    approach = plan_leg(leg.leg, CYCLE_S)
    return len(approach) - 1 + plan_leg(PATH.measured.leg, CYCLE_S).segment.index(segment) - 1


def distance_to_path(positions):
    grid = TRAJECTORY.evaluate(np.linspace(0.0, 1.0, 20001)).position_rad
    return max(np.abs(grid - position).max(axis=1).min() for position in positions)


def test_a_way_that_is_not_free_is_not_gone(connected_servos, run):
    elbow = CHAIN.forward(START)[1][:3, 3]
    wall = HalfSpace("wall", np.array([0.0, 1.0, 0.0]), elbow[1] + 0.002, (2,))
    workspace = Workspace(CHAIN, (Sphere(2, np.zeros(3), 0.01),), (wall,))
    path = check_path(EXCITATION, constraints(workspace), CYCLE_S, file="test", key="excitation")
    servos = connected_servos(N, CYCLE_S)
    expected = r"Nothing was switched on: the path to the start is blocked.*link 2 within -0\.01. m of 'wall'"
    with pytest.raises(MotionError, match=expected) as raised:
        run(servos, path=path)
    assert cause_of(raised.value.__cause__) is Cause.BLOCKED
    assert servos.log == []


def test_an_arm_that_sinks_a_little_while_it_gets_torque_goes_back_first(connected_servos, run):
    servos = connected_servos(N, CYCLE_S)
    stood = START + np.array([0.0, 2e-3])
    servos.standing_rad = lambda: stood
    run(servos)
    sent = np.array([command.position_rad for command in servos.sent])
    back = int(np.abs(sent - stood).max(axis=1).argmin())
    assert np.abs(sent[back] - stood).max() < 1e-9
    np.testing.assert_allclose(sent[: back + 1, 0], START[0], atol=1e-9)


def test_an_arm_that_moves_far_while_it_gets_torque_goes_nowhere(connected_servos, run):
    servos = connected_servos(N, CYCLE_S)
    servos.standing_rad = lambda: START + np.array([0.0, 0.02])
    with pytest.raises(MotionError, match=r"elbow moved by 0\.0200 rad while the arm was being enabled") as raised:
        run(servos)
    assert cause_of(raised.value.__cause__) is Cause.BLOCKED
    assert all((command.position_rad == START).all() for command in servos.sent)
    assert servos.log[-2:] == ["stop", "disable"]


def test_a_leg_that_was_not_checked_is_not_followed(connected_servos):
    servos = connected_servos(N, CYCLE_S)
    cycle = Cycle(servos, LIMITS, TorqueGate(TORQUE_MAX_NM, CYCLE_S), MotionControl(), [])
    with pytest.raises(MotionError), cycle.powered() as arm:
        arm.follow(PATH.measured.leg, lambda done: None)
    assert servos.sent == []
    assert servos.log[1:] == ["stop", "disable"]


def test_a_whole_leg_is_sent_and_recorded(connected_servos, run, tmp_path):
    servos = connected_servos(N, CYCLE_S)
    summary, _ = run(servos)
    sent = np.array([command.position_rad for command in servos.sent])
    plan = plan_leg(PATH.measured.leg, CYCLE_S)
    begin = first_of(Segment.RAMP_UP)
    np.testing.assert_allclose(sent[begin + 1 : begin + len(plan)], plan.position_rad[1:], atol=1e-8)
    assert summary.cycles == len(sent)
    assert summary.duration_s == pytest.approx(len(sent) * CYCLE_S)
    recording = read_recording_file(tmp_path / "run0.mcap")
    # A command is reached one cycle after the SYNC that latches it, to half a count.
    np.testing.assert_allclose(recording.position_rad[1:], sent[:-1], atol=1e-8, rtol=0.0)
    periods = ~np.isnan(recording.phase_s)
    phase = recording.phase_s[periods]
    np.testing.assert_allclose(phase, np.arange(1, 201) * CYCLE_S, atol=1e-12)
    # The position measured one cycle later belongs to the recorded phase.
    reached = recording.position_rad[np.flatnonzero(periods) + 1]
    np.testing.assert_allclose(reached, TRAJECTORY.evaluate(phase).position_rad, atol=2e-8, rtol=0.0)
    assert servos.log == ["enable", "stop", "disable"]


def test_a_jump_in_the_plan_stops_before_it_is_sent(connected_servos, run):
    servos = connected_servos(N, CYCLE_S)
    with pytest.raises(MotionError, match="off the checked path"):
        run(servos, leg=as_if_checked(replace(PATH.measured.leg, path=Bumped(0.105))))
    assert len(servos.sent) == first_of(Segment.PERIODS) + 10
    assert servos.log[1:] == ["stop", "disable"]


@pytest.mark.parametrize(("step_rad", "stops"), [(1e-5, False), (3e-5, True), (1e-4, True)])
@pytest.mark.parametrize("joint", range(N))
def test_nothing_leaves_that_is_a_tenth_of_a_milliradian_off_the_path(connected_servos, step_rad, stops, joint):
    """One joint's jump is so small that the jerk limit nearly allows it; otherwise Ruckig deviates from the path."""
    servos = connected_servos(N, CYCLE_S)
    cycle = Cycle(servos, LIMITS, TorqueGate(TORQUE_MAX_NM, CYCLE_S), MotionControl(), [])
    leg = replace(PATH.measured.leg, path=Bumped(0.105, step_rad * (np.arange(N) == joint)))
    legs = *PATH.approach_from(START), as_if_checked(leg)
    if stops:
        with pytest.raises(MotionError, match="off the checked path"):
            follow_all(cycle, legs)
    else:
        follow_all(cycle, legs)
    begin = first_of(Segment.RAMP_UP) + 1
    plan = plan_leg(leg, CYCLE_S).position_rad[1 : 1 + len(servos.sent) - begin]
    sent = np.array([command.position_rad for command in servos.sent[begin : begin + len(plan)]])
    assert len(sent) >= first_of(Segment.PERIODS) - begin
    assert np.abs(sent - plan).max() <= 1e-4


def test_nothing_is_switched_on_after_a_stop_was_asked_for(connected_servos):
    control = MotionControl()
    control.stop(OperatorStop("Ctrl-C"))
    servos = connected_servos(N, CYCLE_S)
    with pytest.raises(MotionError, match=r"Nothing was switched on.*Ctrl-C"):
        follow_all(Cycle(servos, LIMITS, TorqueGate(TORQUE_MAX_NM, CYCLE_S), control, []), [])
    assert servos.log == []


def test_an_arm_that_stands_still_can_be_stopped(connected_servos):
    control = MotionControl()
    servos = connected_servos(N, CYCLE_S)
    stranger = Stranger(10, lambda step: control.stop(OperatorStop("Ctrl-C")))
    cycle = Cycle(servos, LIMITS, TorqueGate(TORQUE_MAX_NM, CYCLE_S), control, [stranger])
    with pytest.raises(MotionError, match="Ctrl-C"), cycle.powered() as arm:
        arm.hold(lambda: len(servos.sent) > 100)
    assert len(servos.sent) < 20
    assert servos.log[1:] == ["stop", "disable"]


@pytest.mark.parametrize("stubborn", ["exchange", "stop"])
def test_a_step_of_a_stop_that_fails_does_not_keep_the_next_one_back(connected_servos, run, stubborn):
    servos = connected_servos(N, CYCLE_S)
    if stubborn == "exchange":
        servos.events = dict.fromkeys(range(130, 1000), BusError("no frame leaves"))
    else:
        stop = servos.stop

        def stop_and_complain(suspect):
            stop(suspect)
            raise ServoTimeout(3, "elbow", "quick stop", "still turning", "Look.")

        servos.stop = stop_and_complain
    with pytest.raises(MotionError, match="a plug-in failed") as caught:
        run(servos, plugins=[Stranger(129, lambda step: 1 / 0)])
    assert servos.log[1:] == ["stop", "disable"]
    text = str(caught.value)
    assert "While stopping" in text
    assert ("no frame leaves" if stubborn == "exchange" else "still turning") in text


def test_enabling_that_is_interrupted_after_torque_is_on_is_undone(connected_servos):
    servos = connected_servos(N, CYCLE_S)
    enable = servos.enable

    def interrupted():
        enable()
        raise KeyboardInterrupt

    servos.enable = interrupted
    with pytest.raises(KeyboardInterrupt):
        follow_all(Cycle(servos, LIMITS, TorqueGate(TORQUE_MAX_NM, CYCLE_S), MotionControl(), []), [])
    assert servos.log == ["enable", "disable"]


def test_enabling_that_fails_is_left_to_the_servos(connected_servos):
    servos = connected_servos(N, CYCLE_S)

    def fails():
        raise ServoTimeout(3, "elbow", "enabling", "not in time", "Look.")

    servos.enable = fails
    with pytest.raises(ServoTimeout):
        follow_all(Cycle(servos, LIMITS, TorqueGate(TORQUE_MAX_NM, CYCLE_S), MotionControl(), []), [])
    assert servos.log == []


def test_an_axis_that_is_lost_in_the_last_stop_is_an_emergency_too(connected_servos):
    servos, control = connected_servos(N, CYCLE_S), MotionControl()
    stop = servos.stop

    def lost(suspect=None):
        stop(suspect)
        servos.stop = stop
        raise LoopLost(3, "elbow", "quick stop", "it turned", "Look.")

    servos.stop = lost
    with pytest.raises(MotionError, match=r"emergency stop.*keep clear"):
        follow_all(Cycle(servos, LIMITS, TorqueGate(TORQUE_MAX_NM, CYCLE_S), control, []), [])
    assert servos.log[-1] == "disable"
    assert control.ended


@pytest.mark.parametrize(("step", "ended"), [("ramp", False), ("stop", True), ("disable", True)])
def test_only_the_ramp_of_a_stop_may_be_interrupted(connected_servos, run, step, ended):
    servos, control, seen = connected_servos(N, CYCLE_S), MotionControl(), {}

    def noted(name, call, *args):
        seen[name] = control.ended
        return call(*args)

    for name, attribute in (("ramp", "exchange"), ("stop", "stop"), ("disable", "disable")):
        setattr(servos, attribute, partial(noted, name, getattr(servos, attribute)))
    stranger = Stranger(10, lambda step: control.stop(OperatorStop("Ctrl-C")))
    cycle = Cycle(servos, LIMITS, TorqueGate(TORQUE_MAX_NM, CYCLE_S), control, [stranger])
    with pytest.raises(MotionError), cycle.powered() as arm:
        arm.hold(lambda: False)
    assert seen[step] is ended


def test_an_error_about_another_motion_stops_this_one(connected_servos, run):
    """An error that a plug-in met elsewhere says nothing about this arm."""

    def fail(step):
        raise MotionError("another arm was stopped", ())

    servos = connected_servos(N, CYCLE_S)
    with pytest.raises(MotionError, match="another arm was stopped"):
        run(servos, plugins=[Stranger(129, fail)])
    assert servos.log[1:] == ["stop", "disable"]


def follow_all(cycle, legs):
    with cycle.powered() as arm:
        for leg in legs:
            arm.follow(leg, lambda done: None)


def test_a_setpoint_beyond_a_limit_stops_before_it_is_sent(connected_servos):
    """The plan has been checked, but every setpoint is checked again before it is sent."""
    highest = TRAJECTORY.evaluate(np.linspace(0.0, 1.0, 1001)).position_rad[:, 0].max()
    narrow = replace(LIMITS, position_max_rad=np.array([highest - 0.01, 2.0]))
    servos = connected_servos(N, CYCLE_S)
    cycle = Cycle(servos, narrow, TorqueGate(TORQUE_MAX_NM, CYCLE_S), MotionControl(), [])
    legs = *PATH.approach_from(START), PATH.measured
    with pytest.raises(MotionError, match=r"base: position .* is beyond the limit of") as caught:
        follow_all(cycle, legs)
    assert cause_of(caught.value.__cause__) is Cause.LIMIT
    sent = np.array([command.position_rad[0] for command in servos.sent])
    assert highest - 0.02 < sent.max() <= highest - 0.01
    assert servos.log[1:] == ["stop", "disable"]


def test_torque_windows_and_checks_see_coupled_motors_as_joints():
    """Power is the same on both sides of the gears: tau_joint . dq_joint = tau_motor . dq_motor."""
    coupling = np.array([[1.0, 0.0], [0.2, 1.0]])
    gain = np.array([30.0, 20.0])
    current, motor_speed = np.array([1.5, -0.7]), np.array([0.3, 1.1])
    feedback = JointFeedback(1, 0.01, np.zeros(N), None, current, None, np.zeros(N, np.uint16), np.zeros(N, bool))
    torque = measured_torque(feedback, Transmission(gain, coupling))
    assert torque @ (coupling @ motor_speed) == pytest.approx((gain * current) @ motor_speed)


@pytest.mark.parametrize(
    ("event", "text", "steps"),
    [
        (ServoFault(3, "elbow", "streaming", "overcurrent", "Look."), "elbow", ["stop", "disable"]),
        (ServoTimeout(3, "elbow", "streaming", "no feedback", "Look."), "does not answer", ["stop", "disable"]),
        (BusError("bus-off"), "bus-off", ["disable"]),
        (CommandError("no 60B2"), "no 60B2", ["stop", "disable"]),
        (RuntimeError("broken program"), "broken program", ["stop", "disable"]),
        (KeyboardInterrupt(), "operator", ["stop", "disable"]),
    ],
)
def test_every_failure_brings_the_arm_to_rest_first(connected_servos, run, event, text, steps):
    servos = connected_servos(N, CYCLE_S, {120: event})
    with pytest.raises(MotionError, match=text) as caught:
        run(servos)
    assert servos.log[1:] == steps
    assert len(servos.sent) == 120
    assert len(caught.value.last_feedback) == 50
    assert caught.value.last_feedback[-1].cycle == 121
    assert caught.value.__cause__ is event


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (
            # The elbow lags by one cycle, 0.0009 rad here.
            lambda f: f._replace(position_rad=f.position_rad + np.array([0.0, 0.06])),
            r"elbow: 0\.0591 rad behind its target",
        ),
        (lambda f: f._replace(position_rad=np.full(N, np.nan)), "does not follow"),
        (
            lambda f: f._replace(current_a=np.array([0.5, 900.0])),
            r"elbow: .* N m measured, -50\.0 to 50\.0 N m expected",
        ),
        (lambda f: f._replace(time_s=f.time_s - CYCLE_S), "was repeated"),
        (lambda f: f._replace(skipped_cycles=4), "4 cycles skipped in a row, 3 allowed"),
    ],
)
def test_feedback_that_must_not_be_stops_before_anything_more_is_sent(connected_servos, run, change, text):
    servos = connected_servos(N, CYCLE_S, {130: change})
    with pytest.raises(MotionError, match=text):
        run(servos)
    assert len(servos.sent) == 131
    assert servos.log[1:] == ["stop", "disable"]


def test_skipped_cycles_within_what_is_allowed_are_counted(connected_servos, run):
    servos = connected_servos(N, CYCLE_S, {130: lambda f: f._replace(skipped_cycles=3)})
    summary, _ = run(servos)
    assert summary.skipped == 3


@pytest.mark.parametrize("segment", [Segment.APPROACH, Segment.RAMP_UP, Segment.PERIODS, Segment.RAMP_DOWN])
@pytest.mark.parametrize("reason", [OperatorStop("Ctrl-C"), TerminationStop("SIGTERM")])
def test_a_stop_is_along_the_path(connected_servos, run, segment, reason):
    row = 20 if segment is Segment.APPROACH else first_of(segment) + 12
    control = MotionControl()
    servos = connected_servos(N, CYCLE_S)
    stranger = Stranger(row, lambda step: control.stop(reason))
    with pytest.raises(MotionError, match=str(reason)) as caught:
        run(servos, control, [stranger])
    assert "along the path" in str(caught.value)
    sent = np.array([command.position_rad for command in servos.sent])
    assert row < len(sent) < row + 120
    if segment is Segment.APPROACH:
        line = PATH.start_rad - START
        share = (sent - START) @ line / (line @ line)
        np.testing.assert_allclose(sent, START + share[:, None] * line, atol=1e-9)
    else:
        assert distance_to_path(sent[row:]) < 1e-4
    assert np.abs(np.diff(sent, 2, axis=0)).max() <= 6.0 * CYCLE_S**2 * 1.01
    np.testing.assert_allclose(sent[-1], sent[-2], atol=1e-9)
    assert servos.log[1:] == ["stop", "disable"]


@pytest.mark.parametrize(
    ("act", "text"),
    [
        (lambda step: 1 / 0, "plug-in 'stranger' raised ZeroDivisionError"),
        (lambda step: np.full(N, np.nan), "plug-in 'stranger' returned"),
        (lambda step: np.zeros(N + 1), "plug-in 'stranger' returned"),
        (lambda step: step.ask_to_stop("enough"), "stranger: enough"),
    ],
)
def test_a_plugin_that_fails_or_asks_stops_along_the_path(connected_servos, run, act, text):
    row = first_of(Segment.PERIODS) + 30
    stranger = Stranger(row, act)
    servos = connected_servos(N, CYCLE_S)
    with pytest.raises(MotionError, match=text):
        run(servos, plugins=[stranger])
    sent = np.array([command.position_rad for command in servos.sent])
    assert distance_to_path(sent[row:]) < 1e-4
    assert np.abs(np.diff(sent, 2, axis=0)).max() <= 6.0 * CYCLE_S**2 * 1.01
    assert servos.log[1:] == ["stop", "disable"]


def test_a_failed_plugin_is_not_called_again_while_a_polite_one_is(connected_servos, run):
    for act, again in ((lambda step: 1 / 0, False), (lambda step: step.ask_to_stop("enough"), True)):
        stranger = Stranger(150, act)
        with pytest.raises(MotionError):
            run(connected_servos(N, CYCLE_S), plugins=[stranger])
        assert (stranger.calls > 151) == again


class Stopwatch:
    """A clock that advances only on request."""

    def __init__(self):
        self.now_s = 0.0

    def __call__(self):
        return self.now_s


def test_a_plugin_that_is_too_slow_is_named(connected_servos, run):
    watch = Stopwatch()

    class Slow:
        name = "slow"
        calls = 0

        def on_cycle(self, step):
            self.calls += 1
            watch.now_s += 0.006 if step.feedback.cycle > 100 else 0.001

    slow = Slow()
    servos = connected_servos(N, CYCLE_S)
    with pytest.raises(MotionError, match=r"plug-in 'slow' took 6\.00 ms, its budget is 5\.00 ms"):
        run(servos, plugins=[slow], stopwatch=watch)
    assert slow.calls == 105
    assert servos.log[1:] == ["stop", "disable"]


def test_a_plugin_that_is_slow_now_and_then_may_go_on(connected_servos, run):
    watch = Stopwatch()

    class Uneven:
        name = "uneven"

        def on_cycle(self, step):
            watch.now_s += 0.001 if step.feedback.cycle % 5 == 0 else 0.006

    summary, _ = run(connected_servos(N, CYCLE_S), plugins=[Uneven()], stopwatch=watch)
    assert summary.cycles > 200


def test_torques_of_several_plugins_add_up(connected_servos):
    class Adding:
        def __init__(self, name, torque_nm):
            self.name, self.torque_nm = name, np.array(torque_nm)

        def on_cycle(self, step):
            return self.torque_nm

    servos = connected_servos(N, CYCLE_S)
    plugins = [Adding("one", [3.0, -2.0]), Stranger(-1, None), Adding("other", [4.0, 1.0])]
    cycle = Cycle(servos, LIMITS, TorqueGate(TORQUE_MAX_NM, CYCLE_S), MotionControl(), plugins)
    with cycle.powered() as arm:
        arm.hold(lambda: len(servos.sent) >= 60)
    np.testing.assert_allclose(servos.sent[58].torque_offset_nm, [7.0, -1.0])


def test_a_late_cycle_names_the_plugin_that_blocked(connected_servos, run):
    watch = Stopwatch()

    class Blocking:
        name = "blocking"

        def on_cycle(self, step):
            watch.now_s += 0.5 if step.feedback.cycle == 101 else 0.0

    servos = connected_servos(N, CYCLE_S, {100: lambda f: f._replace(skipped_cycles=50)})
    with pytest.raises(MotionError, match=r"50 cycles skipped.*plug-in 'blocking' took 500\.0 ms"):
        run(servos, plugins=[Blocking()], stopwatch=watch)


def test_added_torque_is_ramped_in_clamped_and_out(connected_servos, run):
    class Greedy:
        name = "greedy"

        def on_cycle(self, step):
            return np.array([1000.0, -7.0])

    servos = connected_servos(N, CYCLE_S)
    run(servos, plugins=[Greedy()])
    torque = np.array([command.torque_offset_nm for command in servos.sent])
    np.testing.assert_allclose(torque.max(axis=0), [40.0, 0.0])
    np.testing.assert_allclose(torque.min(axis=0), [0.0, -7.0])
    assert np.abs(torque[0]).max() <= 1.0
    assert np.abs(np.diff(torque, axis=0)).max() <= 2.1
    np.testing.assert_array_equal(torque[-1], 0.0)
    ramped_out = np.flatnonzero(torque[:, 0] == 40.0)[-1]
    assert np.abs(np.diff([c.position_rad for c in servos.sent[ramped_out:]], axis=0)).max() < 1e-9


def test_added_torque_goes_to_zero_on_a_stop_along_the_path(connected_servos, run):
    class Adding:
        name = "adding"

        def on_cycle(self, step):
            if step.feedback.cycle == 200:
                raise OSError("no space left")
            return np.full(N, 10.0)

    servos = connected_servos(N, CYCLE_S)
    with pytest.raises(MotionError, match="no space left"):
        run(servos, plugins=[Adding()])
    torque = np.array([command.torque_offset_nm for command in servos.sent])
    np.testing.assert_allclose(torque[199], 10.0)
    assert np.abs(np.diff(torque[199:], axis=0)).max() < 0.3
    np.testing.assert_array_equal(torque[-1], 0.0)


def test_added_torque_leaves_with_the_operators_stop_and_not_after_it(connected_servos, run):
    control = MotionControl()

    class Adding:
        name = "adding"

        def on_cycle(self, step):
            if step.feedback.cycle == 201:
                control.stop(OperatorStop("Ctrl-C"))
            return np.full(N, 10.0)

    servos = connected_servos(N, CYCLE_S)
    with pytest.raises(MotionError, match="Ctrl-C"):
        run(servos, control, plugins=[Adding()])
    torque = np.array([command.torque_offset_nm for command in servos.sent])
    # The plug-in requests the stop in the cycle of the 201st command; the gate closes within 40 cycles.
    np.testing.assert_allclose(torque[195:201], 10.0)
    np.testing.assert_allclose(torque[201:241], 10.0 * (1.0 - np.arange(1, 41)[:, None] / 40.0) * np.ones(N), atol=1e-9)
    np.testing.assert_array_equal(torque[241:], 0.0)


def test_an_arm_that_is_switched_on_again_takes_torque_again(connected_servos):
    class Adding:
        name = "adding"

        def on_cycle(self, step):
            return np.full(N, 10.0)

    servos = connected_servos(N, CYCLE_S)
    cycle = Cycle(servos, LIMITS, TorqueGate(TORQUE_MAX_NM, CYCLE_S), MotionControl(), [Adding()])
    for _ in range(2):
        begun = len(servos.sent)
        with cycle.powered() as arm:
            arm.hold(lambda begun=begun: len(servos.sent) >= begun + 60)
        torque = np.array([command.torque_offset_nm for command in servos.sent[begun:]])
        np.testing.assert_allclose(torque[0], 0.025)
        np.testing.assert_allclose(torque[58], 10.0)
        np.testing.assert_array_equal(torque[-1], 0.0)


@pytest.mark.parametrize("share", [0.0, 0.0099, 1.001, float("nan")])
def test_an_override_outside_1_to_100_per_cent_is_refused(share):
    with pytest.raises(SpeedOutOfRange, match="1 to 100 %"):
        MotionControl().set_speed(share)


def test_every_cause_has_a_decision_and_an_advice():
    assert all(cause.advice for cause in Cause)
    assert all(cause.category.sequence[-1] is StopStep.DISABLE for cause in Cause)
    assert cause_of(ZeroDivisionError()) is Cause.PROGRAM
