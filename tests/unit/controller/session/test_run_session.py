"""A session: every run of a path includes the slow round, the consent, the monitors and the checks."""

import json
import re
import time
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import CommissioningError, MotionError
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.cycle.stop_decisions import Cause, cause_of
from armload_controller.motion.checked_path import check_path
from armload_controller.motion.motion_control import MotionControl, OperatorStop
from armload_controller.motion.obstacles import Obstacles
from armload_controller.motion.phase import Segment
from armload_controller.session.run_session import AddedTorque, Consent, NoDisplay, Operator, no_operator, run_session
from armload_controller.session.session_load import SessionLoad
from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.excitation.geometry.workspace import HalfSpace, Sphere, Workspace
from armload_identification.model.dynamics import ArmDynamics
from armload_identification.model.payload import InertialParameters
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.run_format import RUN_ATTACHMENT, WAY_ROUND_ATTACHMENT
from armload_identification.report.page import rendered

CYCLE_S = 0.02
ROBOT = load_robot("prbt").with_bus(cycle_hz=1.0 / CYCLE_S)
SWING = FourierTrajectory(1.0, np.array([0.0, 0.6, 1.2, 0.0, 0.5, 0.0]), np.full((6, 1), 0.05), np.full((6, 1), 0.02))
CONSTRAINTS = ROBOT.motion_constraints


def checked():
    return check_path(Excitation(SWING, 1), CONSTRAINTS, CYCLE_S, file=ROBOT.file, key="swing")


@pytest.mark.parametrize(
    ("changes", "cycle_s", "text"),
    [
        ({"robot_sha256": "0" * 64}, CYCLE_S, r"was not checked for prbt as configured in prbt\.toml"),
        ({}, 0.005, r"was checked for cycles of 5 ms, the drives run at 20 ms"),
    ],
)
def test_a_path_that_was_checked_for_another_arm_or_cycle_is_not_run(opened, changes, cycle_s, text):
    other = replace(CONSTRAINTS, **changes)
    path = check_path(Excitation(SWING, 1), other, cycle_s, file=ROBOT.file, key="swing")
    with opened() as (session, servos), pytest.raises(CommissioningError, match=text):
        session.run(path, "run")
    assert servos.log == ["connect"]


class Segments:
    """Plug-in that records the commanded parts of a run."""

    name = "segments"

    def __init__(self):
        self.seen = []

    def on_cycle(self, step):
        segment = step.reference.segment
        if not self.seen or self.seen[-1] is not segment:
            self.seen.append(segment)


class Adding:
    """Plug-in that adds more torque than a gate passes."""

    name = "adding"

    def on_cycle(self, step):
        return np.full(6, 1e4)


@pytest.fixture
def opened(ideal_servos):
    """A session with a perfect arm, and the arm."""

    @contextmanager
    def opened(load=SessionLoad.UNLOADED, operator=None, *, simulated=True, events=None, position_rad=None):
        servos = ideal_servos(6, CYCLE_S, events, position_rad)
        servos.simulated = simulated

        @contextmanager
        def open_servos(which):
            assert which is load
            yield servos

        with run_session(ROBOT, load, open_servos, operator or no_operator()) as session:
            yield session, servos

    return opened


def test_a_path_is_rounded_slowly_once_and_run_as_often_as_wanted(opened):
    path, seen = checked(), Segments()
    with opened() as (session, servos):
        session.run(path, "first", plugins=[seen])
        assert seen.seen[:2] == [Segment.APPROACH, Segment.SLOW]
        again = Segments()
        session.run(path, "again", plugins=[again])
    assert servos.log == ["connect", *["enable", "stop", "disable"] * 3]
    assert again.seen[0] is Segment.APPROACH
    assert Segment.SLOW not in again.seen


def test_every_path_has_a_slow_round_of_its_own(opened):
    with opened() as (session, servos):
        session.run(checked(), "first")
        seen = Segments()
        session.run(checked(), "second", plugins=[seen])
    assert Segment.SLOW in seen.seen
    assert servos.log.count("enable") == 4


def test_a_slow_round_that_was_stopped_is_made_again(opened):
    path, seen = checked(), Segments()
    with opened(events={300: RuntimeError("a defect")}) as (session, servos):
        with pytest.raises(MotionError, match="a defect"):
            session.run(path, "first")
        servos.events.clear()
        session.run(path, "again", plugins=[seen])
    assert Segment.SLOW in seen.seen


class Told(NoDisplay):
    """Records the operator's messages."""

    def __init__(self):
        self.texts = []

    def step(self, text):
        self.texts.append(text)


def test_a_session_says_which_envelopes_at_reduced_speed_are_assumed(opened):
    display = Told()
    with opened(operator=Operator(display, MotionControl(), Consent(lambda question: False, given=False))):
        assert set(ROBOT.payloads.assumed_envelopes) <= set(display.texts)
    assert len(ROBOT.payloads.assumed_envelopes) == 2


def test_a_way_round_is_announced_before_the_arm_gets_torque_and_stands_in_recording_and_report(opened, tmp_path):
    """A wall between the arm's position and the beginning of the path."""
    reaching = Excitation(replace(SWING, offset_rad=np.array([0.0, 1.0, 0.0, 0.0, 0.0, 0.0])), 1)
    path = check_path(reaching, CONSTRAINTS, CYCLE_S, file=ROBOT.file, key="swing")
    turned = np.array([np.pi - 0.6, 0.0, 0.0, 0.0, 0.0, 0.0])
    tool = [ROBOT.chain.forward(path.start_rad + share * turned)[-1][:3, 3] for share in (0.0, 0.5, 1.0)]
    away = tool[1] - 0.5 * (tool[0] + tool[2])
    normal = -away / np.linalg.norm(away)
    wall = HalfSpace("wall", normal, normal @ tool[1] + 0.05, (7,))
    obstacles = Obstacles(Workspace(ROBOT.chain, (Sphere(7, np.zeros(3), 0.02),), (wall,)))
    constraints = replace(CONSTRAINTS, obstacles=obstacles)
    walled = check_path(reaching, constraints, CYCLE_S, file=ROBOT.file, key="swing")
    display = Told()
    operator = Operator(display, MotionControl(), Consent(lambda question: False, given=False))
    file = tmp_path / "run.mcap"
    standing = {"operator": operator, "position_rad": path.start_rad + turned}
    with opened(events={200: RuntimeError("enough")}, **standing) as (session, servos):
        recorder = Recorder(file, {"excitation.toml": format_excitation(path.excitation)})
        with pytest.raises(MotionError, match="enough"), recorder:
            session.run(walled, "swing", recorder=recorder)
        assert servos.log[:2] == ["connect", "enable"]
    (said,) = [text for text in display.texts if "is blocked" in text]
    count = int(re.fullmatch(r"swing: the straight path to its start is blocked: .* via (\d) points?", said)[1])
    run = read_recording_file(tmp_path / "run.partial.mcap", with_effort=False)
    via_points = np.array(json.loads(run.source.attachments[WAY_ROUND_ATTACHMENT])["via_points_rad"])
    assert via_points.shape == (count, 6)
    signal = SimpleNamespace(time_s=run.time_s, interval_s=CYCLE_S)
    said = rendered("motion.html.j2", source=run.source, signal=signal, excitation=path.excitation)
    assert f"blocked: the arm went round the obstacle, via {count}\N{NO-BREAK SPACE}point" in said


@pytest.mark.parametrize(
    ("distort", "cause"),
    [
        (lambda f: f._replace(position_rad=f.position_rad + 1.0), Cause.FOLLOWING_ERROR),
        (lambda f: f._replace(torque_nm=np.full(6, 1e5)), Cause.TORQUE),
        (lambda f: f._replace(skipped_cycles=1000), Cause.LATE),
        (lambda f: f._replace(statusword=f.statusword & ~np.uint16(0x0010)), Cause.VOLTAGE),
    ],
)
@pytest.mark.parametrize(
    "move",
    [
        lambda session: session.run(checked(), "run"),
        lambda session: session.hold([], lambda hold: hold(lambda: len(session._servos.sent) > 100)),
    ],
    ids=["run", "hold"],
)
def test_every_motion_is_monitored(opened, distort, cause, move):
    with opened(events={20: distort}) as (session, servos):
        with pytest.raises(MotionError) as caught:
            move(session)
        assert cause_of(caught.value.__cause__) is cause
        assert "until then" not in str(caught.value), "20 cycles of a slow round have shown nothing"
        assert len(servos.sent) == 21


def test_an_empty_arm_must_not_need_the_torque_of_a_loaded_one(opened):
    """Stretched out horizontally, with the heaviest payload's weight on the shoulder."""
    stretched, nothing = np.array([0.0, np.pi / 2, 0.0, 0.0, 0.0, 0.0]), np.zeros((1, 6))
    arm, payload = ROBOT.strength.arm_body, ROBOT.payloads.heaviest
    carrying = ArmDynamics(ROBOT.chain, arm.carrying(ROBOT.chain, InertialParameters(1.5 * payload.theta)))
    torque_nm = carrying.torque(stretched[None], nothing, nothing)[0]
    events = dict.fromkeys(range(100), lambda feedback: feedback._replace(torque_nm=torque_nm))
    for load, stopped in ((SessionLoad.LOADED, False), (SessionLoad.UNLOADED, True)):
        with opened(load, events=events, position_rad=stretched) as (session, servos):
            with pytest.raises(MotionError) if stopped else nullcontext() as caught:
                session.hold([], lambda hold, servos=servos: hold(lambda: len(servos.sent) > 30))
            if stopped:
                assert cause_of(caught.value.__cause__) is Cause.TORQUE


def test_every_setpoint_is_within_the_robots_own_limits(opened):
    """The path was checked against wider limits, as from a defect; the cycle does not rely on that check."""
    joint, own = 5, ROBOT.limits.motion
    beyond = replace(SWING, offset_rad=np.where(np.arange(6) == joint, own.position_max_rad, SWING.offset_rad))
    wider = replace(own, position_max_rad=own.position_max_rad + 1.0)
    path = check_path(Excitation(beyond, 1), replace(CONSTRAINTS, limits=wider), CYCLE_S, file=ROBOT.file, key="swing")
    said = f"{own.joint_names[joint]}: position .* beyond the limit"
    standing = path.start_rad - 0.2 * (np.arange(6) == joint)
    with opened(position_rad=standing) as (session, servos), pytest.raises(MotionError, match=said) as caught:
        session.run(path, "run")
    assert cause_of(caught.value.__cause__) is Cause.LIMIT
    assert max(command.position_rad[joint] for command in servos.sent) <= own.position_max_rad[joint]


def test_added_torque_is_what_joint_and_drive_allow(opened):
    with opened() as (session, servos):
        session.hold([Adding()], lambda hold: hold(lambda: len(servos.sent) > 200))
    greatest = np.max([command.torque_offset_nm for command in servos.sent], axis=0)
    np.testing.assert_allclose(greatest, 0.8 * ROBOT.limits.added_torque_max_nm)


class Taking:
    """Plug-in that takes some time in every cycle."""

    name = "taking"

    def __init__(self, take):
        self.take = take

    def on_cycle(self, step):
        self.take(0.6 * CYCLE_S)


def computing(seconds):
    begun_s = time.thread_time()
    while time.thread_time() - begun_s < seconds:
        pass


def test_in_virtual_time_a_plugin_answers_for_what_it_computes_and_not_for_a_busy_computer(opened):
    with opened() as (session, servos):
        session.hold([Taking(time.sleep)], lambda hold: hold(lambda: len(servos.sent) > 8))
        with pytest.raises(MotionError, match="plug-in 'taking' took"):
            session.hold([Taking(computing)], lambda hold: hold(lambda: len(servos.sent) > 100))


def test_an_arm_in_the_way_of_something_is_not_moved(opened):
    """The straight way is checked from the arm's actual position, not from the beginning of the path."""
    start_rad = np.array([0.0, 2.25, 0.0, 0.0, 0.0, 0.0])
    with opened(position_rad=start_rad) as (session, servos), pytest.raises(MotionError) as caught:
        session.run(checked(), "run")
    assert cause_of(caught.value.__cause__) is Cause.BLOCKED
    assert all((command.position_rad == start_rad).all() for command in servos.sent)


def test_nothing_is_opened_after_a_stop_was_requested(ideal_servos):
    operator = no_operator()
    operator.control.stop(OperatorStop("Ctrl-C"))
    opened = []
    with (
        pytest.raises(MotionError, match="Nothing was switched on"),
        run_session(ROBOT, SessionLoad.UNLOADED, opened.append, operator),
    ):
        pass
    assert opened == []


def test_nothing_is_asked_or_moved_after_a_stop_while_connecting(ideal_servos):
    operator, servos = no_operator(), ideal_servos(6, CYCLE_S)
    connect = servos.connect

    def interrupted():
        operator.control.stop(OperatorStop("Ctrl-C"))
        connect()

    servos.connect = interrupted
    with (
        pytest.raises(MotionError, match="Nothing was switched on"),
        run_session(ROBOT, SessionLoad.UNLOADED, lambda load: nullcontext(servos), operator),
    ):
        raise AssertionError("the session went on")
    assert servos.log == ["connect"]


class Person:
    """Answers questions, and records them."""

    def __init__(self, *answers):
        self.answers, self.asked = list(answers), []

    def __call__(self, question):
        self.asked.append(question)
        return self.answers.pop(0)


@pytest.mark.parametrize(("load", "given", "asked"), [(SessionLoad.UNLOADED, True, 0), (SessionLoad.LOADED, True, 1)])
def test_holding_a_position_is_always_asked_for_and_motion_with_a_payload_too(opened, load, given, asked):
    person = Person(*[True] * 10)
    operator = Operator(NoDisplay(), MotionControl(), Consent(person, given))
    with opened(load, operator, simulated=False) as (session, _):
        session.run(checked(), "run")
        assert len(person.asked) == asked
        session.run(checked(), "another")
        assert len(person.asked) == asked
        session.hold([], lambda hold: None)
    assert "hold its position" in person.asked[-1]
    assert len(person.asked) == asked + 1


def test_nobody_consents_to_the_motion_of_a_real_arm(opened):
    with opened(simulated=False) as (session, servos):
        for attempt in (lambda: session.run(checked(), "run"), lambda: session.hold([], lambda hold: None)):
            with pytest.raises(CommissioningError, match="not confirmed"):
                attempt()
    assert servos.log == ["connect"]


def test_what_is_handed_out_of_an_enabled_arm_can_only_hold_it(opened):
    """A plug-in's author cannot follow a leg without its slow round and consent, not even by mistake."""
    given = []
    with opened() as (session, _):
        session.hold([], given.append)
        session.run(checked(), "added", added=AddedTorque(given.append))
    assert [hold.__name__ for hold in given] == ["hold"] * 2
    assert not any(hasattr(hold, "follow") for hold in given)


def test_added_torque_is_named_in_the_question(opened):
    person = Person(True, True, True)
    operator = Operator(NoDisplay(), MotionControl(), Consent(person, given=False))
    path = checked()
    with opened(SessionLoad.LOADED, operator, simulated=False) as (session, _):
        session.run(path, "plain")
        session.run(path, "added", added=AddedTorque(lambda hold: None))
    assert "with added torque" not in person.asked[1]
    assert "with added torque?" in person.asked[2]


@pytest.mark.parametrize(("answer", "runs"), [(True, 2), (False, 1)])
def test_a_run_with_a_warning_is_asked_for_whatever_was_consented_to_beforehand(opened, answer, runs):
    person = Person(True, answer)
    operator = Operator(NoDisplay(), MotionControl(), Consent(person, given=True))
    with opened(SessionLoad.LOADED, operator, simulated=False) as (session, servos):
        try:
            session.run(checked(), "adapting", added=AddedTorque(lambda hold: None, "Torque will follow an estimate. "))
        except CommissioningError:
            assert not answer
    assert "Torque will follow an estimate. Run it at full speed with added torque?" in person.asked[1]
    assert servos.log.count("enable") == runs


def test_the_operator_reads_what_the_servos_remark_after_connecting_and_after_each_run(ideal_servos):
    servos, display = ideal_servos(6, CYCLE_S), Told()
    waiting = []
    servos.take_remarks = lambda: (waiting.pop(),) if waiting else ()
    operator = Operator(display, MotionControl(), Consent(lambda question: False, given=False))
    waiting.append("taken over")
    with run_session(ROBOT, SessionLoad.UNLOADED, lambda load: nullcontext(servos), operator) as session:
        assert display.texts[-1] == "taken over"
        waiting.append("3 error frames")
        session.run(checked(), "first")
        assert display.texts[-1] == "3 error frames"
        servos.events[len(servos.sent) + 10] = RuntimeError("a defect")
        waiting.append("4 error frames")
        with pytest.raises(MotionError, match="a defect"):
            session.run(checked(), "second")
    assert display.texts[-1] == "4 error frames", "a run that fails needs it most"


def test_an_arm_that_stands_elsewhere_than_the_last_recording_ended_is_asked_about(ideal_servos, tmp_path):
    """Even with consent given in advance; only on a real arm, and once in a session."""
    robot = load_robot("er50").with_bus(cycle_hz=1.0 / CYCLE_S)
    swing = FourierTrajectory(1.0, np.array([0.0, 0.3, 0.6, 0.0, 0.0, 0.0]), np.full((6, 1), 0.02), np.zeros((6, 1)))
    path = check_path(Excitation(swing, 1), robot.motion_constraints, CYCLE_S, file=robot.file, key="swing")
    run = json.dumps({"joints": list(robot.joint_names)})

    def session_from(position_rad, name, *, simulated):
        servos = ideal_servos(6, CYCLE_S, position_rad=position_rad)
        servos.simulated = simulated
        person = Person(*[True] * 4)
        operator = Operator(NoDisplay(), MotionControl(), Consent(person, given=True))
        with (
            Recorder(tmp_path / name, {RUN_ATTACHMENT: run}) as recorder,
            run_session(robot, SessionLoad.UNLOADED, lambda load: nullcontext(servos), operator) as session,
        ):
            session.run(path, "run", recorder=recorder)
            session.run(path, "again", recorder=recorder)
        return person.asked

    here = np.array([0.0, 0.3, 0.6, 0.0, 0.0, 0.0])
    assert session_from(here, "first.mcap", simulated=False) == []
    asked = session_from(here + 0.2 * np.eye(6)[0], "second.mcap", simulated=False)
    assert len(asked) == 1
    assert "where first.mcap ended: joint_1 by" in asked[0]
    assert session_from(here + 0.3, "third.mcap", simulated=True) == []
