"""What several tests share: an arm that follows perfectly, and a watch over leaked threads."""

import threading
from pathlib import Path

import numpy as np
import pytest

from armload_drivers.errors import StateError
from armload_drivers.servos import JointFeedback

OPERATION_ENABLED = 0x0637


@pytest.fixture(autouse=True)
def no_leaked_threads():
    """A test that leaves a thread behind fails."""
    before = set(threading.enumerate())
    yield
    left = [t for t in threading.enumerate() if t not in before and t.is_alive()]
    for thread in left:
        thread.join(timeout=1.0)
    left = [t.name for t in left if t.is_alive()]
    assert not left, f"threads left running: {left}"


@pytest.fixture
def shared_data():
    """The measured data beside a checkout; a user's machine has none."""
    folder = Path(__file__).resolve().parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the measured recordings are not beside this checkout")
    return folder


class IdealServos:
    """A `JointServos` that is always exactly where it was told to be.

    Args:
        n: Number of joints.
        cycle_s: Duration of a cycle.
        events: Exception to raise, or distortion of the feedback (a function), by cycle number.
    """

    simulated = True

    def __init__(self, n, cycle_s, events=None):
        self.n, self.cycle_s = n, cycle_s
        self.events = events or {}
        self.log = []
        self.sent = []
        self._position = np.full(n, 0.1)
        self._enabled = False

    def connect(self):
        self.log.append("connect")

    def enable(self):
        self.log.append("enable")
        self._enabled = True
        return self._feedback()

    def exchange(self, command):
        if not self._enabled:
            raise StateError("not enabled")
        event = self.events.get(len(self.sent))
        if isinstance(event, BaseException):
            raise event
        self.sent.append(command)
        self._position = command.position_rad
        feedback = self._feedback()
        return event(feedback) if event else feedback

    def stop(self):
        self.log.append("stop")

    def disable(self):
        self.log.append("disable")
        self._enabled = False

    def close(self):
        self.log.append("close")

    def _feedback(self):
        cycle = len(self.sent)
        return JointFeedback(
            cycle=cycle,
            time_s=cycle * self.cycle_s,
            position_rad=self._position.copy(),
            velocity_rad_s=None,
            current_a=np.full(self.n, 0.5),
            torque_nm=None,
            statusword=np.full(self.n, OPERATION_ENABLED, np.uint16),
            missing=np.zeros(self.n, bool),
        )


@pytest.fixture
def ideal_servos():
    return IdealServos
