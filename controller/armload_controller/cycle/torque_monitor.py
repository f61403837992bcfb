"""A plug-in that checks every feedback's torque before the next setpoint is sent."""

from __future__ import annotations

import numpy as np

from armload_controller.control_errors import ControlError
from armload_controller.cycle.plugins import CycleStep
from armload_controller.motion.expected_torque import ExpectedTorque
from armload_drivers.servos import JointFeedback
from armload_identification.float_array import FloatArray
from armload_identification.signals.joint_torque import Transmission

TORQUE_FILTER_S = 0.02
"""Time constant of the low-pass filter on the measured torque."""
MODEL_EVERY_S = 0.01
"""Interval at which the model is evaluated; motions within the joints' limits change little in this time."""
REACH_BACK_S = 0.1
"""The arm may lag its setpoints by up to this time: twice the lag of the simulated servos."""


class TorqueError(ControlError):
    """A joint's torque is outside the expected range.

    Attributes:
        joint: Name of the joint.
    """

    def __init__(self, joint: str, measured_nm: float, least_nm: float, greatest_nm: float) -> None:
        super().__init__(f"{joint}: {measured_nm:.1f} N m measured, {least_nm:.1f} to {greatest_nm:.1f} N m expected")
        self.joint = joint


class TorqueWindow:
    """Checks measured torque against a model, or without one against the joint's greatest torque.

    The arm lags its setpoints, so the torque may be that of any setpoint of the last `REACH_BACK_S`.

    Args:
        joint_names: Names, for messages.
        transmission: Converts motor current to joint torque.
        torque_max_nm: (n,) greatest torque of each joint.
        cycle_s: Duration of a cycle.
        model: Predicts the motion's torque; None allows up to each joint's greatest torque.
    """

    name = "torque window"

    def __init__(
        self,
        joint_names: tuple[str, ...],
        transmission: Transmission,
        torque_max_nm: FloatArray,
        cycle_s: float,
        model: ExpectedTorque | None,
    ) -> None:
        self._joint_names = joint_names
        self._transmission = transmission
        self._share = cycle_s / (TORQUE_FILTER_S + cycle_s)
        self._model = model
        self._filtered: FloatArray | None = None
        self._every = max(1, round(MODEL_EVERY_S / cycle_s))
        self._least = np.empty((max(2, round(REACH_BACK_S / (self._every * cycle_s))), len(torque_max_nm)))
        self._greatest = np.empty_like(self._least)
        self._window = -torque_max_nm, torque_max_nm
        self._calls = 0

    def on_cycle(self, step: CycleStep) -> None:
        """Check one feedback.

        Raises:
            TorqueError: naming the joint.
        """
        reference = step.sent_reference
        if reference is None:
            self._filtered = None
            return
        if self._model is not None and (self._filtered is None or self._calls % self._every == 0):
            state = reference.position_rad, reference.velocity_rad_s, reference.acceleration_rad_s2
            rows = slice(None) if self._filtered is None else self._calls // self._every % len(self._least)
            self._least[rows], self._greatest[rows] = self._model.bounds_nm(*state)
            self._window = self._least.min(axis=0), self._greatest.max(axis=0)
        self._calls += 1
        least, greatest = self._window
        before = 0.5 * (least + greatest) if self._filtered is None else self._filtered
        self._filtered = before + self._share * (measured_torque(step.feedback, self._transmission) - before)
        excess = np.maximum(self._filtered - greatest, least - self._filtered)
        worst = int(excess.argmax())
        if not excess[worst] <= 0.0:
            raise TorqueError(
                self._joint_names[worst], float(self._filtered[worst]), float(least[worst]), float(greatest[worst])
            )


def measured_torque(feedback: JointFeedback, transmission: Transmission) -> FloatArray:
    """Measured joint torque of a feedback.

    Args:
        feedback: Feedback of one cycle.
        transmission: Converts motor current to joint torque.

    Returns:
        (n,) in N m; NaN if the drives report neither torque nor current.
    """
    torque = transmission.measured(feedback.torque_nm, feedback.current_a)
    return np.full(len(feedback.position_rad), np.nan) if torque is None else torque
