"""What the live view is told of limits, by hand: the used share of each."""

import socket
from types import SimpleNamespace

import numpy as np
import orjson
import pytest

from armload_controller.motion.joint_limits import MotionLimits
from armload_controller.session.live.live_server import LIMITS_TOPIC, PROGRESS_TOPIC, LiveArm, _listener, _messages
from armload_identification.signals.joint_torque import Transmission

LIMITS = MotionLimits(
    joint_names=("a", "b"),
    position_min_rad=np.array([-2.0, -1.0]),
    position_max_rad=np.array([4.0, 1.0]),
    velocity_max_rad_s=np.array([2.0, 4.0]),
    acceleration_max_rad_s2=np.ones(2),
    jerk_max_rad_s3=np.ones(2),
    following_error_rad=np.array([0.25, 0.5]),
)
ROW = {"position_rad": [2.5, -1.0], "command_position_rad": [2.625, -1.5], "torque_nm": [-30.0, 5.0]}


@pytest.fixture
def arm():
    frames = SimpleNamespace(message=lambda position_rad, now_ns: b"%d at %d" % (len(position_rad), now_ns))
    return LiveArm(frames, LIMITS, np.array([60.0, 50.0]), Transmission(np.ones(2), np.eye(2)))


def test_the_share_of_every_limit_is_that_of_its_range(arm):
    found = orjson.loads(arm.limits_message(ROW | {"velocity_rad_s": [-1.0, 4.0]}))
    assert found["position_share"] == [0.5, 1.0], "from the middle of the range, 1 and 0"
    assert found["velocity_share"] == [0.5, 1.0]
    assert found["torque_share"] == [0.5, 0.1]
    assert found["following_error_share"] == [0.5, 1.0]
    assert found["joint_names"] == ["a", "b"]
    assert (found["torque_max_nm"], found["following_error_max_rad"]) == ([60.0, 50.0], [0.25, 0.5])
    assert orjson.loads(arm.limits_message(ROW))["velocity_share"] is None, "not reported"


def test_messages_are_those_of_what_is_known(arm):
    assert _messages({}, arm, 7) == {}
    progress = _messages({"progress": {"text": "a", "done": 0.5}}, arm, 7)
    assert progress == {PROGRESS_TOPIC: b'{"text":"a","done":0.5}'}
    messages = _messages({"joints": ROW}, arm, 7)
    assert b"2 at 7" in messages.values()
    assert orjson.loads(messages[LIMITS_TOPIC])["position_share"] == [0.5, 1.0]
    assert len(messages) == 3


@pytest.mark.parametrize(("host", "family"), [("127.0.0.1", socket.AF_INET), ("localhost", None)])
def test_a_listener_is_at_the_first_address_of_its_host(host, family):
    with _listener(host, 0) as listener:
        assert family in {None, listener.family}
        assert listener.getsockname()[1] > 0
