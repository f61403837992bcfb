"""Monitors: plug-ins that judge every feedback before the next setpoint leaves, and count."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from armload_controller.errors import ControlError
from armload_controller.limits import MotionLimits
from armload_controller.plugins import CycleStep
from armload_drivers.servos import FloatArray, JointFeedback
from armload_identification.signals import Transmission

TORQUE_FILTER_S = 0.02
"""Time constant that noise is taken out of the measured torque with, before it is compared."""


class FollowingError(ControlError):
    """A joint is farther from its target than its window.

    Attributes:
        joint: Name of the joint.
        error_rad: Distance between target and measured position.
        window_rad: Greatest distance allowed.
    """

    def __init__(self, joint: str, error_rad: float, window_rad: float) -> None:
        super().__init__(f"{joint}: {error_rad:.4f} rad behind its target, {window_rad:.4f} rad allowed")
        self.joint = joint
        self.error_rad = error_rad
        self.window_rad = window_rad


class TorqueError(ControlError):
    """A joint's torque is not what it should be.

    Attributes:
        joint: Name of the joint.
        measured_nm: Torque measured, noise filtered out.
        expected_nm: What the model says, 0 without one.
        window_nm: Greatest difference allowed.
    """

    def __init__(self, joint: str, measured_nm: float, expected_nm: float, window_nm: float) -> None:
        super().__init__(
            f"{joint}: {measured_nm:.1f} N m measured, {expected_nm:.1f} N m expected, {window_nm:.1f} apart allowed"
        )
        self.joint = joint
        self.measured_nm = measured_nm
        self.expected_nm = expected_nm
        self.window_nm = window_nm


class StaleFeedback(ControlError):
    """The feedback is one that was there before."""


class LateCycle(ControlError):
    """The program missed more cycles than are allowed.

    Attributes:
        skipped: Cycles missed in a row.
    """

    def __init__(self, skipped: int, allowed: int) -> None:
        super().__init__(f"{skipped} cycles skipped in a row, {allowed} allowed")
        self.skipped = skipped


@dataclass(frozen=True, slots=True)
class CycleSummary:
    """What a run counted.

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
    """Judges following error, stale feedback and late cycles.

    Args:
        limits: With the windows.
        max_skipped_cycles: So many cycles may be skipped in a row.
    """

    name = "monitor"

    def __init__(self, limits: MotionLimits, max_skipped_cycles: int) -> None:
        n = len(limits.joint_names)
        self._limits = limits
        self._max_skipped = max_skipped_cycles
        self._cycles = 0
        self._missing = np.zeros(n)
        self._worst_rad = np.zeros(n)
        self._skipped = 0
        self._duration_s = 0.0
        self._last_s = float("nan")

    def on_cycle(self, step: CycleStep) -> None:
        """Judge and count one feedback.

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
        worst = int(np.argmax(error_rad - limits.following_error_rad))
        if not error_rad[worst] <= limits.following_error_rad[worst]:
            raise FollowingError(
                limits.joint_names[worst], float(error_rad[worst]), float(limits.following_error_rad[worst])
            )
        if feedback.skipped_cycles > self._max_skipped:
            raise LateCycle(feedback.skipped_cycles, self._max_skipped)

    def summary(self) -> CycleSummary:
        """What was counted so far."""
        return CycleSummary(self._cycles, self._duration_s, self._missing.copy(), self._skipped, self._worst_rad.copy())

    def _count(self, feedback: JointFeedback, error_rad: FloatArray) -> None:
        if feedback.time_s <= self._last_s:
            raise StaleFeedback(f"feedback of cycle {feedback.cycle} came again")
        self._cycles += 1
        self._duration_s += feedback.time_s - self._last_s
        self._missing += feedback.missing
        self._skipped += feedback.skipped_cycles
        np.maximum(self._worst_rad, error_rad, out=self._worst_rad)
        self._last_s = feedback.time_s


class TorqueModel(Protocol):
    """Something that knows what torque a motion takes."""

    def torque_nm(
        self, position_rad: FloatArray, velocity_rad_s: FloatArray, acceleration_rad_s2: FloatArray
    ) -> FloatArray:
        """(n,) joint torques in N m."""


class TorqueWindow:
    """Judges measured torque against a model, or where there is none against the joint's greatest torque.

    Args:
        joint_names: Names, for messages.
        transmission: From motor current to joint torque.
        window_nm: (n,) greatest difference between measured and expected torque.
        cycle_s: Duration of a cycle.
        model: What the motion should take; None expects nothing and leaves the window to be the torque limit.
    """

    name = "torque window"

    def __init__(
        self,
        joint_names: tuple[str, ...],
        transmission: Transmission,
        window_nm: FloatArray,
        cycle_s: float,
        model: TorqueModel | None,
    ) -> None:
        self._joint_names = joint_names
        self._measured = JointTorque(transmission)
        self._window = window_nm
        self._share = cycle_s / (TORQUE_FILTER_S + cycle_s)
        self._model = model
        self._difference = np.zeros_like(window_nm)

    def on_cycle(self, step: CycleStep) -> None:
        """Judge one feedback.

        Raises:
            TorqueError: naming the joint.
        """
        reference = step.sent_reference
        if reference is None:
            return
        expected = np.zeros_like(self._window)
        if self._model is not None:
            expected = self._model.torque_nm(
                reference.position_rad, reference.velocity_rad_s, reference.acceleration_rad_s2
            )
        difference = self._measured(step.feedback) - expected
        self._difference += self._share * (difference - self._difference)
        excess = np.abs(self._difference) - self._window
        worst = int(np.argmax(excess))
        if not excess[worst] <= 0.0:
            raise TorqueError(
                self._joint_names[worst],
                float(self._difference[worst] + expected[worst]),
                float(expected[worst]),
                float(self._window[worst]),
            )


class JointTorque:
    """Measured joint torque of a feedback, whichever way the drives tell it.

    Args:
        transmission: From motor current to joint torque.
    """

    def __init__(self, transmission: Transmission) -> None:
        self._from_current = np.linalg.inv(transmission.coupling).T * transmission.gain_nm_a

    def __call__(self, feedback: JointFeedback) -> FloatArray:
        """(n,) joint torque in N m; NaN where the drives tell neither torque nor current."""
        if feedback.torque_nm is not None:
            return feedback.torque_nm
        if feedback.current_a is None:
            return np.full(len(feedback.position_rad), np.nan)
        return np.asarray(self._from_current @ feedback.current_a)
