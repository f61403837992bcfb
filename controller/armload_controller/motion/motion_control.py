"""Requests to a running motion by operators and programs: pause, resume, another speed, stop.

The goal is read once per cycle. A stop is final; to move again, create a new control.
"""

from __future__ import annotations

import signal
from dataclasses import dataclass

from armload_controller.control_errors import ControlError

SLOWEST_SHARE = 0.01
"""Smallest speed override."""


class StopRequested(ControlError):
    """A stop was requested; base class of the reasons."""


class OperatorStop(StopRequested):
    """The operator requested a stop: Ctrl-C, a key, a button."""


class TerminationStop(StopRequested):
    """The operating system requested the program to end: SIGTERM, SIGQUIT, or SIGHUP when the terminal is closed."""

    def __init__(self, text: str, signal_number: int = signal.SIGTERM) -> None:
        super().__init__(text)
        self.signal_number = signal_number


class PluginStop(StopRequested):
    """A plug-in requested a stop.

    Attributes:
        plugin: Its name.
    """

    def __init__(self, plugin: str, reason: str) -> None:
        super().__init__(f"{plugin}: {reason}")
        self.plugin = plugin


class SpeedOutOfRange(ControlError):
    """A speed override that is not between 1 and 100 %."""


@dataclass(frozen=True, slots=True)
class Goal:
    """The requested state of a motion.

    Attributes:
        share: Speed override, 0.01 to 1.
        paused: Whether to stand on the path until resumed.
        stop: Reason for a final stop; None if none was requested.
    """

    share: float
    paused: bool
    stop: StopRequested | None


class MotionControl:
    """Requests to a motion.

    Every request is one assignment, so threads and signal handlers can make it without a lock.

    Args:
        share: Initial speed override.

    Attributes:
        ended: Whether the motion has ended with an error: its torque is being removed, which nothing may interrupt.
    """

    def __init__(self, share: float = 1.0) -> None:
        self.ended = self._paused = False
        self._stop: StopRequested | None = None
        self.set_speed(share)

    @property
    def goal(self) -> Goal:
        """The present goal."""
        return Goal(self._share, self._paused, self._stop)

    def pause(self) -> None:
        """Come to rest on the path and wait there."""
        self._paused = True

    def resume(self) -> None:
        """Continue from the present position."""
        self._paused = False

    def set_speed(self, share: float) -> None:
        """Override the speed.

        Args:
            share: 0.01 to 1 of the planned speed.

        Raises:
            SpeedOutOfRange: the value is outside this range.
        """
        if not SLOWEST_SHARE <= share <= 1.0:
            raise SpeedOutOfRange(f"speed {share * 100:g} %: choose 1 to 100 %; a checked path is never run faster")
        self._share = share

    def require_no_stop(self) -> None:
        """Raise if a stop was requested.

        Raises:
            StopRequested: the reason of the request.
        """
        if self._stop is not None:
            raise self._stop

    def stop(self, reason: StopRequested) -> None:
        """Come to rest on the path and end; the first reason counts."""
        if self._stop is None:
            self._stop = reason
