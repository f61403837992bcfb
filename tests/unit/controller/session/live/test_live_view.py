"""The live view: a client sees the arm move, and neither clients nor the server affect the cycle."""

import re
import socket
import sys
from contextlib import contextmanager, suppress
from threading import Thread

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from websockets.exceptions import ConnectionClosed

from armload_controller.config.robot import load_robot
from armload_controller.control_errors import CommissioningError, ConfigurationError
from armload_controller.cycle.arm_frames import BASE_FRAME, FLANGE_FRAME
from armload_controller.cycle.plugins import CycleStep
from armload_controller.motion.checked_path import check_path
from armload_controller.motion.leg_interpolator import Reference
from armload_controller.motion.motion_control import MotionControl
from armload_controller.motion.phase import PhaseState, Segment
from armload_controller.session.live.live_view import LiveAddress, LiveView, live_at, shown_live
from armload_controller.session.run_session import Consent, NoDisplay, Operator, run_session
from armload_controller.session.session_load import SessionLoad
from armload_drivers.servos import JointCommand, JointFeedback
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from tests.foxglove_clients import Client, silent_client

EVERY_S = 0.05

ROBOT = load_robot("prbt")
SWING = FourierTrajectory(1.0, np.array([0.0, 0.6, 1.2, 0.0, 0.5, 0.0]), np.full((6, 1), 0.05), np.full((6, 1), 0.02))
LOOPBACK = LiveAddress(port=0)


class Steps(NoDisplay):
    """Records the operator's messages."""

    def __init__(self):
        self.texts = []

    def step(self, text):
        self.texts.append(text)

    @property
    def port(self):
        return int(re.search(r"ws://127\.0\.0\.1:(\d+)", "\n".join(self.texts)).group(1))


def operator(display=None):
    return Operator(display or NoDisplay(), MotionControl(), Consent(lambda question: False, given=False))


class Watcher(Client):
    """A client that stores all messages, in its own thread."""

    def __init__(self, port):
        super().__init__(port)
        self.seen = {}
        self.thread = Thread(target=self._listen)
        self.thread.start()

    def _listen(self):
        with suppress(ConnectionClosed):
            for topic, message in self:
                self.seen.setdefault(topic, []).append(message)


@pytest.fixture(scope="module")
def path():
    return check_path(Excitation(SWING, 1), ROBOT.motion_constraints, 0.01, file=ROBOT.file, key="swing")


def test_a_client_sees_the_arm_move_and_one_that_never_reads_keeps_nobody_waiting(ideal_servos, path):
    display = Steps()
    servos = ideal_servos(6, 0.01)

    @contextmanager
    def open_servos(load):
        yield servos

    with shown_live(operator(display), ROBOT, LOOPBACK) as watched:
        silent = silent_client(display.port)
        watcher = Watcher(display.port)
        with run_session(ROBOT, SessionLoad.UNLOADED, open_servos, watched) as session:
            session.run(path, "swing")
        view = watched.watching[-1]
        assert not view.ended
    watcher.thread.join(10.0)
    assert not watcher.thread.is_alive()
    silent.close()

    assert watcher.server["capabilities"] == []
    assert set(watcher.channels) == {"/joints", "/frames", "/limits", "/progress"}
    assert watcher.channels["/frames"]["schemaName"] == "foxglove.FrameTransforms"
    rows, frames, limits, progress = (watcher.seen[t] for t in ("/joints", "/frames", "/limits", "/progress"))
    commanded = np.array([command.position_rad for command in servos.sent])
    seen = np.array([row["position_rad"] for row in rows])
    share = np.ptp(seen, axis=0) / np.ptp(commanded, axis=0)
    # The busier the machine, the fewer rows are shown, and the less likely the extremes are among them.
    assert (share > 0.9).all()
    assert (share < 1.001).all()
    assert {row["segment"] for row in rows} >= {"approach", "slow", "periods"}
    np.testing.assert_allclose(rows[3]["current_a"], 0.5, atol=0.06)
    pose = flange_pose(frames[-1])
    np.testing.assert_allclose(pose, ROBOT.chain.forward(np.array(rows[-1]["position_rad"]))[-1], atol=1e-9)
    assert limits[0]["joint_names"] == list(ROBOT.joint_names)
    np.testing.assert_allclose(limits[0]["torque_max_nm"], ROBOT.limits.torque_max_nm)
    share = np.array([entry["position_share"] for entry in limits])
    high = ROBOT.limits.motion.position_max_rad
    np.testing.assert_allclose(share[-1], np.abs(seen[-1]) / high, atol=1e-9)
    assert progress[-1] == {"text": "swing, run", "share": 1.0}
    assert {entry["text"] for entry in progress} >= {"swing, slow round", "swing, run"}


def flange_pose(message):
    """Pose of the flange in the base frame, composed from the named transforms."""
    pose, frame = np.eye(4), FLANGE_FRAME
    by_child = {transform["child_frame_id"]: transform for transform in message["transforms"]}
    while frame != BASE_FRAME:
        transform = by_child[frame]
        step = np.eye(4)
        step[:3, :3] = Rotation.from_quat([transform["rotation"][k] for k in "xyzw"]).as_matrix()
        step[:3, 3] = [transform["translation"][k] for k in "xyz"]
        pose, frame = step @ pose, transform["parent_frame_id"]
    return pose


def steps(count):
    """The plug-ins' view of cycles that are far enough apart to be shown."""
    still = np.zeros(6)
    command = JointCommand(still, still, still)
    reference = Reference(still, still, still, Segment.HOLD, PhaseState(0.0, 0.0, 0.0))
    word, missing = np.zeros(6, np.uint16), np.zeros(6, bool)
    for cycle in range(count):
        feedback = JointFeedback(cycle, cycle * EVERY_S * 1.01, still, None, still, None, word, missing)
        yield CycleStep(feedback, command, reference, command, reference, lambda reason: None)


@pytest.fixture
def link():
    """Both ends of a view's connection."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        yield ours, theirs


def test_a_server_that_hangs_loses_messages_and_the_cycle_loses_no_time(link):
    """If the view waited, this test would never end, because nobody reads."""
    view = LiveView(link[0], NoDisplay())
    for step in steps(2000):
        assert view.on_cycle(step) is None
    assert 0 < view.left_out < 2000
    assert not view.ended


def test_a_server_that_is_gone_is_no_reason_to_stop(link):
    view = LiveView(link[0], NoDisplay())
    first, *more = steps(3)
    view.on_cycle(first)
    link[1].close()
    for step in more:
        view.on_cycle(step)
    assert view.ended


def test_cycles_are_shown_at_a_rate_to_look_at_also_after_a_session_s_clock_began_anew(link):
    view = LiveView(link[0], NoDisplay())
    shown = 0
    for step in (*steps(1), *steps(1), *steps(2), *steps(1)):
        view.on_cycle(step)
    link[1].setblocking(False)
    while True:
        try:
            shown += bool(link[1].recv(65536))
        except BlockingIOError:
            break
    assert shown == 3


def test_a_port_that_is_taken_is_named_with_the_way_out():
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with (
            pytest.raises(CommissioningError, match=rf"127\.0\.0\.1:{port}: .*in use.*--live-address HOST:PORT"),
            shown_live(operator(), ROBOT, LiveAddress(port=port)),
        ):
            pass


@pytest.mark.parametrize("text", ["8765", "127.0.0.1", "host:", ":1", "host:port", "host:70000"])
def test_an_address_that_is_none_is_refused(text):
    with pytest.raises(ConfigurationError, match="HOST:PORT, such as"):
        live_at(True, text)


def test_only_loopback_is_served_unless_said_otherwise():
    assert live_at(False, None) is None
    assert live_at(True, None).loopback
    assert LiveAddress.parse("[::1]:0") == LiveAddress("::1", 0)
    assert LiveAddress.parse("[::1]:0").loopback
    assert LiveAddress.parse("localhost:1").loopback
    assert not LiveAddress.parse("0.0.0.0:1").loopback
    assert not LiveAddress.parse("cell-7:1").loopback


def test_without_the_library_the_pip_command_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "foxglove", None)
    with pytest.raises(CommissioningError, match=r'pip install "armload\[live\]"'):
        live_at(True, None)
