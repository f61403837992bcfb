"""The operator's keys while an arm moves: space pauses and resumes, - and + change the speed in steps of 10 %.

Keys are looked for once a cycle by the thread that reports the progress; there is none of its own. The terminal is
set not to wait for a whole line only while something moves: questions are answered as ever. Ctrl-C stays a signal.
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
"""Of the planned speed, per key; also the slowest that keys can set."""
_AT_ONCE = 64
_ESCAPE_SEQUENCES = re.compile(rb"\x1b(?:\[[0-?]*[ -/]*[@-~]?|O.?|.)?", re.DOTALL)
"""What arrow and function keys send, in which a + or - means nothing."""


class Key(Enum):
    """What a key asks for."""

    PAUSE = "pause or resume"
    SLOWER = "slower"
    FASTER = "faster"


_KEYS = {" ": Key.PAUSE, "-": Key.SLOWER, "+": Key.FASTER, "=": Key.FASTER}
"""The key of + without shift is as good."""


def decode(typed: bytes) -> list[Key]:
    """What was asked for, in order; what means nothing is left out."""
    return [_KEYS[letter] for letter in _ESCAPE_SEQUENCES.sub(b"", typed).decode("latin-1") if letter in _KEYS]


def press(control: MotionControl, key: Key) -> None:
    """Ask a motion for what a key means."""
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
    """What is asked for, in the words of a progress line; nothing at full speed."""
    if goal.stop is not None:
        return "stopping"
    if goal.paused:
        return "paused"
    return "" if goal.share == 1.0 else f"speed {100 * goal.share:.0f} %"


class Keyboard:
    """A terminal's keys as requests to a motion.

    Args:
        control: Gets the requests.
        terminal: File descriptor of the terminal.
    """

    def __init__(self, control: MotionControl, terminal: int) -> None:
        self._control, self._terminal = control, terminal

    @classmethod
    def of_this_process(cls, control: MotionControl) -> Keyboard | None:
        """The keyboard of this process, None where its input is no terminal."""
        if sys.stdin is None or sys.stdin.closed or not sys.stdin.isatty():
            return None
        return cls(control, sys.stdin.fileno())

    @contextmanager
    def awake(self) -> Iterator[None]:
        """Keys arrive one by one and are not shown, until the block is left."""
        if not self._in_foreground():
            yield
            return
        before = termios.tcgetattr(self._terminal)
        tty.setcbreak(self._terminal, termios.TCSANOW)
        try:
            yield
        finally:
            # Of a terminal that is gone there is nothing to restore.
            with suppress(termios.error):
                termios.tcsetattr(self._terminal, termios.TCSANOW, before)

    def forget(self) -> None:
        """Drop what was typed and not read: a question is not answered before it is asked."""
        if self._in_foreground():
            termios.tcflush(self._terminal, termios.TCIFLUSH)

    def poll(self) -> str:
        """Pass on what was typed since the last call; never waits.

        Returns:
            What is asked for now, in the words of a progress line.
        """
        ready, _, _ = select.select([self._terminal], [], [], 0.0)
        # A process in the background that reads its terminal is halted, with the arm moving.
        if ready and self._in_foreground():
            typed = b""
            with suppress(OSError):
                typed = os.read(self._terminal, _AT_ONCE)
            for key in decode(typed):
                press(self._control, key)
        return described(self._control.goal)

    def _in_foreground(self) -> bool:
        """Whether the terminal listens to this process."""
        try:
            return os.tcgetpgrp(self._terminal) == os.getpgrp()
        except OSError:
            return False
