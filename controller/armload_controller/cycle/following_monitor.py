"""A plug-in that checks every feedback's distance, age and cycle before the next setpoint is sent, and keeps counts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from armload_controller.control_errors import ControlError
from armload_controller.cycle.plugins import CycleStep
from armload_controller.motion.joint_limits import MotionLimits
from armload_drivers.servos import JointFeedback
from armload_identification.float_array import FloatArray


class FollowingError(ControlError):
    """A joint's distance to its target exceeds its window.

    Attributes:
        joint: Name of the joint.
    """

    def __init__(self, joint: str, error_rad: float, window_rad: float) -> None:
        super().__init__(f"{joint}: {error_rad:.4f} rad behind its target, {window_rad:.4f} rad allowed")
        self.joint = joint


class StaleFeedback(ControlError):
    """A feedback was repeated."""


class LateCycle(ControlError):
    """The program missed more cycles than are allowed."""

    def __init__(self, skipped: int, allowed: int) -> None:
        super().__init__(f"{skipped} cycles skipped in a row, {allowed} allowed")


@dataclass(eq=False, slots=True)
class CycleSummary:
    """Counts of a run so far.

    Attributes:
        cycles: Setpoints sent.
        duration_s: Time under power, on the servos' clock.
        missing: (n,) cycles in which a joint's feedback was missing.
        skipped: Cycles skipped because the program was late.
        following_error_rad: (n,) greatest distance between target and measured position.
    """

    cycles: int
    duration_s: float
    missing: FloatArray
    skipped: int
    following_error_rad: FloatArray


class FollowingMonitor:
    """Checks following error, stale feedback and late cycles.

    Args:
        limits: Limits with the following error windows.
        max_skipped_cycles: Greatest number of cycles that may be skipped in a row.

    Attributes:
        summary: The counts.
    """

    name = "monitor"

    def __init__(self, limits: MotionLimits, max_skipped_cycles: int) -> None:
        n = len(limits.joint_names)
        self._limits = limits
        self._max_skipped = max_skipped_cycles
        self.summary = CycleSummary(0, 0.0, np.zeros(n), 0, np.zeros(n))
        self._last_s = float("nan")

    def on_cycle(self, step: CycleStep) -> None:
        """Check and count one feedback.

        Raises:
            FollowingError: naming the joint.
            StaleFeedback: the feedback's cycle does not advance.
            LateCycle: more cycles skipped than allowed.
        """
        feedback, limits = step.feedback, self._limits
        if step.sent is None:
            self._last_s = feedback.time_s
            return
        error_rad = np.abs(step.sent.position_rad - feedback.position_rad)
        self._count(feedback, error_rad)
        worst = int((error_rad - limits.following_error_rad).argmax())
        if not error_rad[worst] <= limits.following_error_rad[worst]:
            raise FollowingError(
                limits.joint_names[worst], float(error_rad[worst]), float(limits.following_error_rad[worst])
            )
        if feedback.skipped_cycles > self._max_skipped:
            raise LateCycle(feedback.skipped_cycles, self._max_skipped)

    def _count(self, feedback: JointFeedback, error_rad: FloatArray) -> None:
        if feedback.time_s <= self._last_s:
            raise StaleFeedback(f"feedback of cycle {feedback.cycle} was repeated")
        counts = self.summary
        counts.cycles += 1
        counts.duration_s += feedback.time_s - self._last_s
        counts.missing += feedback.missing
        counts.skipped += feedback.skipped_cycles
        np.maximum(counts.following_error_rad, error_rad, out=counts.following_error_rad)
        self._last_s = feedback.time_s
