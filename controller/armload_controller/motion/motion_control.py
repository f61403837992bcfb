"""What operators and programs may request of a motion while it runs: pause, resume, another speed, stop.

The cycle looks at the goal once per cycle. A stop is final; to move again, make a new control.
"""

from __future__ import annotations

import signal
from dataclasses import dataclass

from armload_controller.control_errors import ControlError

SLOWEST_SHARE = 0.01
"""The slowest override."""


class StopRequested(ControlError):
    """A stop was requested; the base of the reasons."""


class OperatorStop(StopRequested):
    """The operator asked for a stop: Ctrl-C, a key, a button."""


class TerminationStop(StopRequested):
    """The operating system asked the program to end: SIGTERM, SIGQUIT, or SIGHUP when the terminal is gone.

    Attributes:
        signal_number: Of the signal.
    """

    def __init__(self, text: str, signal_number: int = signal.SIGTERM) -> None:
        super().__init__(text)
        self.signal_number = signal_number


class PluginStop(StopRequested):
    """A plug-in asked for a stop.

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
    """What is requested.

    Attributes:
        share: Speed override, 0.01 to 1.
        paused: Stand on the path until resumed.
        stop: Reason of a final stop; None while there is none.
    """

    share: float = 1.0
    paused: bool = False
    stop: StopRequested | None = None


class MotionControl:
    """The operator's hand on a motion.

    Every request is one assignment, so that threads and signal handlers may make it without a lock.

    Args:
        share: Speed override to begin with.
    """

    def __init__(self, share: float = 1.0) -> None:
        self._paused = False
        self._stop: StopRequested | None = None
        self.set_speed(share)

    @property
    def goal(self) -> Goal:
        """What is requested now."""
        return Goal(self._share, self._paused, self._stop)

    def pause(self) -> None:
        """Come to rest on the path and wait there."""
        self._paused = True

    def resume(self) -> None:
        """Go on where the arm stands."""
        self._paused = False

    def set_speed(self, share: float) -> None:
        """Override the speed.

        Args:
            share: 0.01 to 1 of the planned speed.

        Raises:
            SpeedOutOfRange: another value.
        """
        if not SLOWEST_SHARE <= share <= 1.0:
            raise SpeedOutOfRange(f"speed {share * 100:g} %: choose 1 to 100 %; a checked path is never run faster")
        self._share = share

    def require_no_stop(self) -> None:
        """Go on only if no stop was requested.

        Raises:
            StopRequested: the reason that was given.
        """
        if self._stop is not None:
            raise self._stop

    def stop(self, reason: StopRequested) -> None:
        """Come to rest on the path and end; the first reason counts."""
        if self._stop is None:
            self._stop = reason
