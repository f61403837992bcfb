"""The cycles of an arm from `sensor_msgs/JointState` messages. Times are the messages' header stamps.

Rules of this file:
- Joints are found by name in every message, whatever their order; a message without one of them, such as a gripper's,
  is none of this arm's and is counted.
- A message that is not later than the last one is dropped and counted. One that is earlier by more than `RESTART_S`, or
  later by `FAR_S`, comes from a publisher that was started again with another clock: its time goes on after the last
  one. `RESTARTS` of them among `REGULAR` messages are two publishers, and an error.
- The middleware reports no loss of a publisher that offers best effort only. A gap between two stamps that is half as
  long again as any of the last `REGULAR` ones is such a loss, unless it is so long that the publisher has paused, or
  its clock was set. A program that is too slow loses seconds at once: its wait for messages was then never in vain.
  After `REGULAR` such gaps in a row, the publisher has a lower rate.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from typing import Final

import numpy as np

from armload_drivers.driver_errors import BusError
from armload_drivers.feeds.ros2_messages import JointState
from armload_drivers.feeds.ros2_participant import Subscription
from armload_drivers.listening.overheard_arm import OverheardCycle
from armload_drivers.servos import JointFeedback

LOOK_S: Final = 0.1
"""Longest wait for a message."""
PATIENCE_S: Final = 20.0
"""Time without any usable message after the start that counts as an error; two nodes may take ten seconds to discover
each other."""
RESTART_S: Final = 1.0
"""Stamps that go back by more than this come from another clock."""
FAR_S: Final = 3600.0
"""So do stamps that are later by this."""
RESTARTS: Final = 5
"""Number of changes of the clock that are one too many."""

REGULAR: Final = 50
"""Number of intervals between stamps that show a publisher's usual ones."""


class JointStateCycles:
    """Makes cycles of messages.

    Args:
        joint_names: The arm's joints.
        current: Whether effort is motor current in A instead of joint torque in N m.

    Attributes:
        of_others: Number of messages without all of the arm's joints.
        incomplete: Number of messages with the arm's joints, but not a position and an effort for each.
        not_later: Number of messages with a stamp that is not later than the last one.
        other_names: Names in the last message of others.
    """

    def __init__(self, joint_names: Sequence[str], *, current: bool) -> None:
        self.of_others = self.incomplete = self.not_later = 0
        self.other_names: tuple[str, ...] = ()
        self._names, self._with_current = tuple(joint_names), current
        self._order: dict[tuple[str, ...], list[int] | None] = {}
        self._nothing = np.zeros(len(self._names), dtype=np.uint16), np.zeros(len(self._names), dtype=np.bool_)
        self._offset_ns: int | None = None
        self._last_ns = 0
        self._restarted: deque[int] = deque(maxlen=RESTARTS)
        self._intervals_ns: deque[int] = deque(maxlen=REGULAR)
        self._gaps_ns: list[int] = []
        self._reported_lost = self._left_out = self._lost = 0
        self._heard_s = 0.0
        self._silent = False
        self._count = 0

    def take(self, message: JointState, now_s: float, lost: int = 0) -> OverheardCycle | None:
        """Process one message.

        Args:
            now_s: Monotonic time.
            lost: Number of samples that the middleware reported as lost before it.

        Returns:
            The cycle; None for a message of no use.

        Raises:
            BusError: the stamps are those of several clocks.
        """
        place = self._place(tuple(message.name))
        if place is None:
            self.of_others += 1
            return None
        position, effort = np.asarray(message.position, dtype=float), np.asarray(message.effort, dtype=float)
        complete = position.size == effort.size == len(message.name)
        if not (complete and np.isfinite(position[place]).all() and np.isfinite(effort[place]).all()):
            self.incomplete += 1
            return None
        last_ns, waited_s = self._last_ns, 0.0 if self._silent else now_s - self._heard_s
        elapsed_ns = self._elapsed_ns(10**9 * message.header.stamp.sec + message.header.stamp.nanosec, now_s)
        if elapsed_ns is None:
            return None
        if self._count:
            self._left_out += self._missing(elapsed_ns - last_ns, 1e9 * (waited_s + RESTART_S))
        self._silent = False
        self._reported_lost += lost
        lost_before, self._lost = self._lost, max(self._reported_lost, self._left_out)
        lost = self._lost - lost_before
        self._count += 1
        current, torque = (effort[place], None) if self._with_current else (None, effort[place])
        feedback = JointFeedback(self._count, 1e-9 * elapsed_ns, position[place], None, current, torque, *self._nothing)
        return OverheardCycle(feedback, None, enabled=True, lost=lost)

    def stamp_ns(self, time_s: float) -> int:
        """The header stamp, in ns, that belongs to a cycle's time."""
        return (self._offset_ns or 0) + round(1e9 * time_s)

    def hear_nothing(self) -> None:
        """A wait for messages was in vain: the publisher has paused."""
        self._silent = True

    def _missing(self, interval_ns: int, longest_ns: float) -> int:
        """Number of messages that are missing between two stamps, unless they are further apart than a loss can be."""
        usual = self._intervals_ns
        if len(usual) == REGULAR and interval_ns > 1.5 * max(usual):
            missing = round(interval_ns / float(np.median(usual))) - 1 if interval_ns < longest_ns else 0
            self._gaps_ns.append(interval_ns)
            if len(self._gaps_ns) == REGULAR:
                usual.extend(self._gaps_ns)
                self._gaps_ns.clear()
            return missing
        self._gaps_ns.clear()
        usual.append(interval_ns)
        return 0

    def _place(self, names: tuple[str, ...]) -> list[int] | None:
        """Indices of the arm's joints in a message; None if it lacks one."""
        if names not in self._order:
            complete = set(self._names) <= set(names)
            self._order[names] = [names.index(name) for name in self._names] if complete else None
            self.other_names = self.other_names if complete else names
        return self._order[names]

    def _elapsed_ns(self, stamp_ns: int, now_s: float) -> int | None:
        """Time since the first message; None if it is not later than the last one."""
        waited_ns, self._heard_s = round(1e9 * (now_s - self._heard_s)), now_s
        if self._offset_ns is None:
            self._offset_ns = stamp_ns
        elif not -1e9 * RESTART_S <= stamp_ns - self._offset_ns - self._last_ns <= 1e9 * FAR_S + waited_ns:
            self._offset_ns = stamp_ns - self._last_ns - max(waited_ns, 1)
            self._restarted.append(self._count)
            if len(self._restarted) == RESTARTS and self._count - self._restarted[0] < REGULAR:
                raise BusError(
                    f"joint states: their stamps changed to another clock {RESTARTS} times within "
                    f"{self._count - self._restarted[0]} messages. Do two programs publish on this topic?"
                )
        elapsed_ns = stamp_ns - self._offset_ns
        if self._count and elapsed_ns <= self._last_ns:
            self.not_later += 1
            return None
        self._last_ns = elapsed_ns
        return elapsed_ns


def joint_state_cycles(
    subscription: Subscription,
    topic: str,
    states: JointStateCycles,
    patience_s: float = PATIENCE_S,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[OverheardCycle | None]:
    """The cycles of an arm from its topic, without end.

    Args:
        subscription: Of the topic.
        topic: Its name, for messages.
        states: Makes the cycles.
        patience_s: Longest time until the first cycle, and with messages of the arm that are of no use.
        clock: Monotonic time in s.

    Yields:
        Cycles; None after `LOOK_S` without one.

    Raises:
        BusError: the middleware failed, there was no cycle at first, or none of the arm's messages has been of use for
            long; states what is missing.
    """
    useful_s, heard = clock(), False
    while True:
        found = subscription.take(LOOK_S)
        now_s, lost, useful = clock(), subscription.newly_lost(), False
        for message in found:
            cycle = states.take(message, now_s, lost)
            if cycle is not None:
                useful, lost = True, 0
                yield cycle
        if useful:
            useful_s, heard, states.incomplete, states.not_later = now_s, True, 0, 0
        if not found:
            states.hear_nothing()
        if now_s - useful_s > patience_s and (not heard or states.incomplete + states.not_later > REGULAR):
            raise BusError(_what_is_missing(topic, states, patience_s))
        if not useful:
            yield None


def _what_is_missing(topic: str, states: JointStateCycles, patience_s: float) -> str:
    """Why there is no cycle, and what to check."""
    begin = f"{topic}: no usable message within {patience_s:g} s: "
    if states.not_later:
        return begin + (
            f"{states.not_later} messages have a header stamp that is not later than the last one's. armload needs the "
            "time of each message: its publisher must set header.stamp"
        )
    if states.incomplete:
        return begin + (
            f"{states.incomplete} messages have the arm's joints but not a position and an effort for each. armload "
            "needs the effort: enable it in the arm's driver or joint_state_broadcaster"
        )
    if states.of_others:
        return begin + (
            f"{states.of_others} messages name other joints, the last one {', '.join(states.other_names)}. Give the "
            "topic of this arm, or its joint names in the robot file"
        )
    return begin + (
        "nothing is published. Is the topic's name that of `ros2 topic list`, and are ROS_DOMAIN_ID and "
        "ROS_LOCALHOST_ONLY those of the publisher?"
    )
