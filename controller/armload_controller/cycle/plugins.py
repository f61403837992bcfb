"""Plug-ins of the cycle: the recorder, the monitors, the feed-forward, and those that users attach.

A plug-in is called once per cycle, in the cycle's thread and in the order of attachment, with the feedback just
received and the setpoint about to be sent. It may return torque to be added, raise, or request a stop.

Rules. Each call is timed. A plug-in that takes more than `BUDGET_SHARE` of the cycle `OVERRUNS_IN_A_ROW` times in a row
is reported and not called again, and the arm stops; one that blocks makes the cycle late, and the lost time is not made
up: see `Cause.LATE`. Torque of plug-ins goes through one `TorqueGate`, never directly to a drive.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from armload_controller.control_errors import ControlError
from armload_controller.motion.leg_interpolator import Reference
from armload_drivers.servos import JointCommand, JointFeedback
from armload_identification.float_array import FloatArray

BUDGET_SHARE = 0.5
"""Share of the cycle that one call of a plug-in may take."""
OVERRUNS_IN_A_ROW = 5
"""After this many consecutive calls over the budget, the plug-in is taken to be the cause, not the computer."""

AskToStop = Callable[[str], None]
"""Called with the reason, as text for the operator."""


@dataclass(frozen=True, slots=True)
class CycleStep:
    """One cycle as passed to a plug-in.

    Attributes:
        feedback: Last feedback of the drives.
        sent: The command that this feedback belongs to; None in the first cycle after enabling.
        sent_reference: Reference of that command; None likewise.
        command: The command about to be sent, before this cycle's torque is added.
        reference: Its reference; contains the acceleration that belongs to the command's velocity.
        ask_to_stop: Brings the arm to rest on its path.
    """

    feedback: JointFeedback
    sent: JointCommand | None
    sent_reference: Reference | None
    command: JointCommand
    reference: Reference
    ask_to_stop: AskToStop


class CyclePlugin(Protocol):
    """A plug-in of the cycle.

    Attributes:
        name: Its name, for messages.
    """

    @property
    def name(self) -> str:
        """Its name, for messages."""

    def on_cycle(self, step: CycleStep) -> FloatArray | None:
        """Process one cycle.

        Args:
            step: The cycle; its arrays are read-only.

        Returns:
            (n,) joint torque to add, in N m, or None. The array may be reused in the next call.
        """


class PluginError(ControlError):
    """A plug-in failed.

    Attributes:
        plugin: Its name.
    """

    def __init__(self, plugin: str, what: str) -> None:
        super().__init__(f"plug-in {plugin!r} {what}")
        self.plugin = plugin


class PluginFailed(PluginError):
    """A plug-in raised, or returned something other than torques."""


class PluginTooSlow(PluginError):
    """A plug-in takes more time than its budget."""


@dataclass(slots=True)
class PluginTiming:
    """Time that a plug-in has taken.

    Attributes:
        name: The plug-in.
        last_s: Time of the last call.
        overruns: Number of consecutive calls over the budget.
    """

    name: str
    last_s: float = 0.0
    overruns: int = 0

    def add(self, seconds: float, budget_s: float) -> None:
        """Count one call."""
        self.last_s = seconds
        self.overruns = self.overruns + 1 if seconds > budget_s else 0


class PluginHost:
    """Calls plug-ins, times them, and adds up their torque.

    Args:
        plugins: The plug-ins, in the order of their calls.
        cycle_s: Duration of the cycle.
        stopwatch: Monotonic clock that calls are timed with, in s.

    Attributes:
        calling: Name of the plug-in called last.
        failed: Name of the plug-in whose call ended in an error; empty if none.
    """

    def __init__(self, plugins: Sequence[CyclePlugin], n: int, cycle_s: float, stopwatch: Callable[[], float]) -> None:
        self._entries = [(plugin, PluginTiming(plugin.name)) for plugin in plugins]
        self._timings = tuple(timing for _, timing in self._entries)
        self._torque = np.zeros(n)
        self._cycle_s = cycle_s
        self._budget_s = BUDGET_SHARE * cycle_s
        self._stopwatch = stopwatch
        self.calling = ""
        self.failed = ""

    def detach(self, name: str) -> None:
        """Stop calling a plug-in."""
        self._entries = [entry for entry in self._entries if entry[0].name != name]

    def slowest(self) -> PluginTiming | None:
        """The plug-in with the longest last call, if longer than a cycle; otherwise None."""
        late = [timing for timing in self._timings if timing.last_s > self._cycle_s]
        return max(late, key=lambda timing: timing.last_s) if late else None

    def call(self, step: CycleStep) -> FloatArray:
        """Call all plug-ins for one cycle.

        Returns:
            (n,) sum of their torques in N m; the array is reused by the next call.

        Raises:
            PluginTooSlow: naming the plug-in.
            PluginFailed: naming the plug-in; the original exception is the cause.
            ControlError: raised by a monitor, and passed on unchanged.
        """
        self._torque[:] = 0.0
        begun_s = self._stopwatch()
        for plugin, timing in self._entries:
            self.calling = self.failed = timing.name
            try:
                torque = plugin.on_cycle(step)
            except ControlError:
                raise
            except Exception as error:
                raise PluginFailed(timing.name, f"raised {type(error).__name__}: {error}") from error
            ended_s = self._stopwatch()
            timing.add(ended_s - begun_s, self._budget_s)
            begun_s = ended_s
            if timing.overruns >= OVERRUNS_IN_A_ROW:
                raise PluginTooSlow(
                    timing.name,
                    f"took {timing.last_s * 1e3:.2f} ms, its budget is {self._budget_s * 1e3:.2f} ms a cycle",
                )
            if torque is not None:
                if np.shape(torque) != self._torque.shape or not np.isfinite(torque).all():
                    expected = f"expected {len(self._torque)} finite joint torques in N m"
                    raise PluginFailed(timing.name, f"returned {torque!r}, {expected}")
                self._torque += torque
        self.failed = ""
        return self._torque
