"""The operator's keys while an arm moves: space pauses and resumes, - and + change the speed in steps of 10 %.

Keys are polled once per cycle by the thread that reports progress, without a separate thread. The terminal delivers
single keys only during motion; questions are answered line by line as usual. Ctrl-C remains a signal.
"""

from __future__ import annotations

import os
import re
import select
import sys
import termios
import tty
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from enum import Enum

from armload_controller.motion.motion_control import Goal, MotionControl

HINT = "keys: space pauses and resumes, - and + change the speed, Ctrl-C stops"
STEP = 0.1
"""Step per key as a share of the planned speed; also the lowest speed that keys can set."""
_MOST_BYTES_PER_POLL = 64
_ESCAPE_SEQUENCES = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*[@-~]?|O.?|.)?", re.DOTALL)
"""Sequences of arrow and function keys, in which + and - have no meaning."""


class Key(Enum):
    """Request of a key."""

    PAUSE = "pause or resume"
    SLOWER = "slower"
    FASTER = "faster"


_KEYS = {" ": Key.PAUSE, "-": Key.SLOWER, "+": Key.FASTER, "=": Key.FASTER}
""""=" is the key of + without shift."""


def requests_in(typed: bytes) -> list[Key]:
    """The requests of typed bytes, in order; other keys are ignored."""
    return [_KEYS[letter] for letter in _ESCAPE_SEQUENCES.sub(b"", typed).decode("latin-1") if letter in _KEYS]


def press(control: MotionControl, key: Key) -> None:
    """Pass a key's request to a motion."""
    goal = control.goal
    match key:
        case Key.PAUSE if goal.paused:
            control.resume()
        case Key.PAUSE:
            control.pause()
        case _:
            share = round(goal.share / STEP) * STEP + (STEP if key is Key.FASTER else -STEP)
            control.set_speed(round(min(max(share, STEP), 1.0), 6))


def described(goal: Goal) -> str:
    """The present request as text for a progress line; empty at full speed."""
    if goal.stop is not None:
        return "stopping"
    if goal.paused:
        return "paused"
    return "" if goal.share == 1.0 else f"speed {100 * goal.share:.0f} %"


class Keyboard:
    """A terminal's keys as requests to a motion.

    Args:
        control: Receives the requests.
        terminal: File descriptor of the terminal.
    """

    def __init__(self, control: MotionControl, terminal: int) -> None:
        self._control, self._terminal = control, terminal

    @classmethod
    def of_this_process(cls, control: MotionControl) -> Keyboard | None:
        """The keyboard of this process; None if its input is not a terminal."""
        if sys.stdin is None or sys.stdin.closed or not sys.stdin.isatty():
            return None
        return cls(control, sys.stdin.fileno())

    @contextmanager
    def awake(self) -> Iterator[None]:
        """Deliver keys one by one, without echo, within a `with` block."""
        if not self._in_foreground():
            yield
            return
        before = termios.tcgetattr(self._terminal)
        tty.setcbreak(self._terminal, termios.TCSANOW)
        try:
            yield
        finally:
            # A closed terminal cannot be restored.
            with suppress(termios.error):
                termios.tcsetattr(self._terminal, termios.TCSANOW, before)

    def forget(self) -> None:
        """Discard unread input, so that a question is not answered before it is asked."""
        if self._in_foreground():
            termios.tcflush(self._terminal, termios.TCIFLUSH)

    def poll(self) -> str:
        """Process the keys typed since the last call; never waits.

        Returns:
            The present request, as text for a progress line.
        """
        ready, _, _ = select.select([self._terminal], [], [], 0.0)
        # A background process that reads its terminal is suspended, with the arm moving.
        if ready and self._in_foreground():
            typed = b""
            with suppress(OSError):
                typed = os.read(self._terminal, _MOST_BYTES_PER_POLL)
            for key in requests_in(typed):
                press(self._control, key)
        return described(self._control.goal)

    def _in_foreground(self) -> bool:
        """Whether this process is in the terminal's foreground group."""
        try:
            return os.tcgetpgrp(self._terminal) == os.getpgrp()
        except OSError:
            return False
