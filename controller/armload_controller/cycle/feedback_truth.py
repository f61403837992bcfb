"""Implausible feedback: a plug-in that checks what drives report, with one error class per kind of contradiction.

Every cycle

    statusword                          voltage (bit 4) and remote (bit 9), if set at first, stay set; following error
                                        (bit 13) stays clear, an internal limit (bit 11) does not last
    current or torque                   it is not exactly zero while the motor turns

and every `WINDOW_S`

    velocity against position           they agree, if drives report a velocity

Positions are compared with the setpoints by the servos themselves, because a stop depends on it:
`armload_drivers.cia402.axis_course`. The sign of a torque is checked after the slow round: `slow_round_torque`. The
following error has its own monitor. A joint whose feedback is missing repeats its last values.
"""

from __future__ import annotations

import numpy as np

from armload_controller.control_errors import ControlError
from armload_controller.cycle.plugins import CycleStep
from armload_controller.motion.joint_limits import MotionLimits
from armload_drivers.servos import JointFeedback
from armload_identification.float_array import FloatArray

WINDOW_S = 0.4
"""Time over which velocities are compared."""
NO_EFFORT = 1e-9
"""A current in A or torque in N m up to this is zero: drives report whole counts, which are far coarser."""
VELOCITY_FACTOR, VELOCITY_SHARE = 0.3, 0.05
"""A reported velocity may differ from the position's by this share of it, plus this share of the limit."""
IDLE_RAD = 0.1
"""A motor that turns by this angle must draw current in at least one sample."""
LIMITED_S = 0.1
"""A drive may report an internal limit for at most this time."""

_VOLTAGE, _REMOTE, _LIMITED, _FOLLOWING = 0x0010, 0x0200, 0x0800, 0x2000


class FeedbackError(ControlError):
    """A drive reports something implausible or forbidden.

    Attributes:
        joint: Name of the joint.
    """

    def __init__(self, joint: str, what: str) -> None:
        super().__init__(f"{joint}: {what}")
        self.joint = joint


class VelocityContradicts(FeedbackError):
    """A velocity contradicts the change of position."""


class TorqueMissing(FeedbackError):
    """A current or torque is zero in motion, or never changes."""


class TorqueReversed(FeedbackError):
    """A current or torque has the wrong sign."""


class VoltageLost(FeedbackError):
    """A drive's power stage has lost its voltage (statusword bit 4)."""


class RemoteLost(FeedbackError):
    """A drive no longer accepts commands from the bus (statusword bit 9)."""


class InternalLimit(FeedbackError):
    """A drive limits the motion on its own (statusword bit 11)."""


class DriveLag(FeedbackError):
    """A drive reports a following error (statusword bit 13)."""


class FeedbackTruth:
    """Checks feedback for plausibility.

    Args:
        limits: Limits of the joints.
        coupling: (n, n) C with q_joint = C q_axis.
        reports_lag: (n,) whether bit 13 of a drive's statusword is a following error, as it is in CSP.
        cycle_s: Duration of a cycle.
    """

    name = "feedback"

    def __init__(self, limits: MotionLimits, coupling: FloatArray, reports_lag: FloatArray, cycle_s: float) -> None:
        n = len(limits.joint_names)
        self._names = limits.joint_names
        self._to_axes = np.linalg.inv(coupling)
        self._coupling = coupling
        self._velocity_max = limits.velocity_max_rad_s
        self._forbidden = np.where(reports_lag, _FOLLOWING, 0).astype(np.uint16)
        self._rows = max(2, round(WINDOW_S / cycle_s))
        self._required = np.zeros(n, dtype=np.uint16)
        self._n = n

    def on_cycle(self, step: CycleStep) -> None:
        """Check one feedback.

        Raises:
            FeedbackError: naming the joint; its class states the contradiction.
        """
        feedback = step.feedback
        if step.sent is None:
            self._begin(feedback)
            return
        self._judge_words(feedback)
        self._judge_idling(feedback)
        if feedback.velocity_rad_s is not None:
            self._judge_velocity(feedback, feedback.velocity_rad_s)

    def _begin(self, feedback: JointFeedback) -> None:
        """Start afresh after the arm is enabled; an earlier motion does not count."""
        self._required = feedback.statusword & np.uint16(_VOLTAGE | _REMOTE)
        self._accepted = b""
        self._limited_since_s: float | None = None
        self._idle_from = self._to_axes @ feedback.position_rad
        self._velocity_sum, self._velocities = np.zeros(self._n), 0
        self._velocity_from = feedback

    def _judge_words(self, feedback: JointFeedback) -> None:
        """Check the bits of the statuswords.

        Raises:
            FeedbackError: a bit is wrong.
        """
        word = feedback.statusword
        seen = word.tobytes()
        if seen == self._accepted:
            return
        if ((word & self._required) != self._required).any():
            for bit, kind, what in (
                (_VOLTAGE, VoltageLost, "the power stage has lost its supply voltage (statusword bit 4)"),
                (_REMOTE, RemoteLost, "the drive no longer accepts commands from the bus (statusword bit 9)"),
            ):
                lost = (self._required & ~word & bit) != 0
                if lost.any():
                    raise kind(self._names[int(lost.argmax())], what)
        if (word & self._forbidden).any():
            joint = int(((word & self._forbidden) != 0).argmax())
            raise DriveLag(self._names[joint], "the drive reports a following error (statusword bit 13)")
        if not (word & _LIMITED).any():
            self._accepted, self._limited_since_s = seen, None
            return
        self._accepted = b""
        if self._limited_since_s is None:
            self._limited_since_s = feedback.time_s
        if feedback.time_s - self._limited_since_s > LIMITED_S:
            joint = int(((word & _LIMITED) != 0).argmax())
            raise InternalLimit(self._names[joint], "the drive limits the motion on its own (statusword bit 11)")

    def _judge_idling(self, feedback: JointFeedback) -> None:
        """Check that a motor draws current or torque when it turns."""
        effort = feedback.current_a
        if effort is None and feedback.torque_nm is not None:
            effort = self._coupling.T @ feedback.torque_nm
        if effort is None:
            return
        idle = np.abs(effort) <= NO_EFFORT
        axes = self._to_axes @ feedback.position_rad
        self._idle_from = np.where(idle, self._idle_from, axes)
        if idle.any():
            turned = np.abs(axes - self._idle_from)
            joint = int(turned.argmax())
            if turned[joint] > IDLE_RAD:
                raise TorqueMissing(
                    self._names[joint], f"current or torque is exactly zero while it moves by {turned[joint]:.2f} rad"
                )

    def _judge_velocity(self, feedback: JointFeedback, velocity_rad_s: FloatArray) -> None:
        """Check that reported velocities match the positions."""
        self._velocity_sum += velocity_rad_s
        self._velocities += 1
        if self._velocities < self._rows:
            return
        begun, self._velocity_from = self._velocity_from, feedback
        moved_rad_s = (feedback.position_rad - begun.position_rad) / (feedback.time_s - begun.time_s)
        reported_rad_s = self._velocity_sum / self._velocities
        self._velocity_sum, self._velocities = np.zeros(self._n), 0
        allowed = VELOCITY_FACTOR * np.abs(moved_rad_s) + VELOCITY_SHARE * self._velocity_max
        excess = np.abs(reported_rad_s - moved_rad_s) - allowed
        if (excess > 0.0).any():
            joint = int(np.argmax(excess))
            raise VelocityContradicts(
                self._names[joint],
                f"a velocity of {reported_rad_s[joint]:.3f} rad/s is reported, the position moves at "
                f"{moved_rad_s[joint]:.3f} rad/s",
            )
