"""Implausible feedback: a plug-in that checks what drives report, with one error class per kind of contradiction.

Every cycle

    position against the last one       it moves no faster than the recent setpoints, plus a share of the limit
    statusword                          voltage (bit 4) and remote (bit 9), if set at first, stay set; following error
                                        (bit 13) stays clear, an internal limit (bit 11) does not last

and every `EVERY_S`, in the motors' axes, where each position is that of one encoder,

    position against the setpoints      it changes while they move, and in their direction
    velocity against position           over `WINDOW_S` they agree, if drives report a velocity
    current or torque                   it is not exactly zero while the motor turns

The sign of a torque is checked after the slow round: `torque_signs`. The following error has its own monitor. A joint
whose feedback is missing repeats its last values; only its elapsed time grows.
"""

from __future__ import annotations

import numpy as np

from armload_controller.control_errors import ControlError
from armload_controller.cycle.plugins import CycleStep
from armload_controller.motion.joint_limits import MotionLimits
from armload_core.arrays import FloatArray
from armload_drivers.servos import JointFeedback

EVERY_S = 0.02
"""Interval at which position, velocity and torque are compared with the motion."""
WINDOW_S = 0.4
"""Time over which directions and velocities are compared."""
RECENT_S = 0.1
"""Time constant with which the setpoints' greatest speed decays; twice the lag of the simulated servos."""
JUMP_FACTOR, JUMP_SHARE, JUMP_RAD = 2.0, 0.2, 1e-3
"""A position may move by this factor times the setpoints' recent speed, plus this share of the limit, plus this
distance."""
FROZEN_SHARE = 0.4
"""A position is frozen if it stays while the setpoints move by this share of the following error window."""
SAME_RAD = 1e-9
"""Positions this close are the same count of an encoder."""
NO_EFFORT = 1e-9
"""A current in A or torque in N m up to this is zero: drives report whole counts, which are far coarser."""
STRAIGHT_SHARE, LEAST_WAY_RAD, BACKWARDS_SHARE = 0.95, 0.01, 0.5
"""Setpoints count as one-way at this share of net to total travel and this distance; a position is reversed if it moves
against them by the last share."""
APART_SHARE = 0.2
"""The position must also be this share of the following error window away: friction held a joint of the simulated PRBT
back until its setpoints had already reversed, 16 mrad away or 0.08 of the window."""
VELOCITY_FACTOR, VELOCITY_SHARE = 0.3, 0.05
"""A reported velocity may differ from the position's by this share of it, plus this share of the limit."""
IDLE_RAD = 0.1
"""A motor that turns by this angle must draw current."""
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


class PositionJumps(FeedbackError):
    """A position moved faster than the joint can."""


class PositionFrozen(FeedbackError):
    """A position does not change while its setpoints move."""


class PositionReversed(FeedbackError):
    """A position moves against its setpoints."""


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
        self._spare_rad_s = JUMP_SHARE * limits.velocity_max_rad_s
        self._velocity_max = limits.velocity_max_rad_s
        # For a joint without a following error window: its greatest speed times the window of time.
        window_rad = np.minimum(limits.following_error_rad, limits.velocity_max_rad_s * WINDOW_S)
        self._frozen_rad, self._apart_rad = FROZEN_SHARE * window_rad, APART_SHARE * window_rad
        self._forbidden = np.where(reports_lag, _FOLLOWING, 0).astype(np.uint16)
        self._decay = float(np.exp(-cycle_s / RECENT_S))
        self._every = max(1, round(EVERY_S / cycle_s))
        self._rows = max(2, round(WINDOW_S / (self._every * cycle_s)))
        self._required = np.zeros(n, dtype=np.uint16)
        self._position = np.zeros(n)
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
        self._judge_step(feedback, np.abs(step.sent.velocity_rad_s))
        if feedback.velocity_rad_s is not None:
            self._velocity_sum += feedback.velocity_rad_s
            self._velocities += 1
        self._calls += 1
        if self._calls % self._every == 0:
            self._judge_motion(feedback, step.sent.position_rad)

    def _begin(self, feedback: JointFeedback) -> None:
        """Start afresh after the arm is enabled; an earlier motion does not count."""
        self._required = feedback.statusword & np.uint16(_VOLTAGE | _REMOTE)
        self._accepted = b""
        self._limited_since_s: float | None = None
        self._position = feedback.position_rad
        self._time_s = feedback.time_s
        self._since_s = np.zeros(self._n)
        self._recent_rad_s = np.zeros(self._n)
        self._calls = 0
        self._velocity_sum, self._velocities, self._velocity_since_s = np.zeros(self._n), 0, feedback.time_s
        self._kept = 0
        self._axes = self._to_axes @ feedback.position_rad
        self._wanted = self._axes
        self._changed = self._axes
        self._unchanged_way, self._idle_way, self._way = np.zeros((3, self._n))
        self._ring = np.zeros((3, self._rows, self._n))

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
            self._limited_since_s = self._time_s
        if feedback.time_s - self._limited_since_s > LIMITED_S:
            joint = int(((word & _LIMITED) != 0).argmax())
            raise InternalLimit(self._names[joint], "the drive limits the motion on its own (statusword bit 11)")

    def _judge_step(self, feedback: JointFeedback, speed_rad_s: FloatArray) -> None:
        """Check a position against the last one.

        Raises:
            PositionJumps: a joint moved farther than possible.
        """
        self._since_s += feedback.time_s - self._time_s
        self._time_s = feedback.time_s
        self._recent_rad_s = np.maximum(self._recent_rad_s * self._decay, speed_rad_s)
        moved = np.abs(feedback.position_rad - self._position)
        allowed = self._since_s * (JUMP_FACTOR * self._recent_rad_s + self._spare_rad_s) + JUMP_RAD
        self._position = feedback.position_rad
        if (moved > allowed).any():
            joint = int(np.argmax(moved - allowed))
            raise PositionJumps(
                self._names[joint],
                f"the position moved by {moved[joint]:.4f} rad in {self._since_s[joint] * 1e3:.0f} ms, "
                f"at most {allowed[joint]:.4f} rad is possible",
            )
        self._since_s *= feedback.missing

    def _judge_motion(self, feedback: JointFeedback, target_rad: FloatArray) -> None:
        """Check positions, velocities and torques against the motion.

        Raises:
            FeedbackError: one of them is implausible.
        """
        axes, wanted = self._to_axes @ feedback.position_rad, self._to_axes @ target_rad
        moved, way = np.abs(axes - self._axes), np.abs(wanted - self._wanted)
        self._axes, self._wanted = axes, wanted
        self._way = self._way + way
        self._judge_standing(axes, way)
        self._judge_idling(feedback, moved)
        row = self._kept % self._rows
        if self._kept >= self._rows:
            old_axes, old_wanted, old_way = self._ring[:, row]
            self._judge_direction(axes - old_axes, wanted - old_wanted, self._way - old_way)
            if self._velocities and row == 0:
                lasted_s = feedback.time_s - self._velocity_since_s
                self._judge_velocity(
                    self._coupling @ (axes - old_axes) / lasted_s, self._velocity_sum / self._velocities
                )
        if row == 0:
            self._velocity_since_s = feedback.time_s
            self._velocity_sum, self._velocities = np.zeros(self._n), 0
        self._ring[:, row] = axes, wanted, self._way
        self._kept += 1

    def _judge_standing(self, axes: FloatArray, way: FloatArray) -> None:
        """Check that a position changes while its setpoints move."""
        changed = np.abs(axes - self._changed) > SAME_RAD
        self._changed = np.where(changed, axes, self._changed)
        self._unchanged_way = np.where(changed, 0.0, self._unchanged_way + way)
        if (self._unchanged_way > self._frozen_rad).any():
            joint = int(np.argmax(self._unchanged_way / self._frozen_rad))
            raise PositionFrozen(
                self._names[joint],
                f"the position has not changed by a single count while its setpoints moved by "
                f"{self._unchanged_way[joint]:.3f} rad",
            )

    def _judge_idling(self, feedback: JointFeedback, moved: FloatArray) -> None:
        """Check that a motor draws current or torque when it turns."""
        effort = feedback.current_a
        if effort is None and feedback.torque_nm is not None:
            effort = self._coupling.T @ feedback.torque_nm
        if effort is None:
            return
        self._idle_way = np.where(np.abs(effort) > NO_EFFORT, 0.0, self._idle_way + moved)
        if (self._idle_way > IDLE_RAD).any():
            joint = int(np.argmax(self._idle_way))
            raise TorqueMissing(
                self._names[joint],
                f"current or torque is exactly zero while it moves by {self._idle_way[joint]:.2f} rad",
            )

    def _judge_direction(self, moved: FloatArray, wanted: FloatArray, way: FloatArray) -> None:
        """Check that a position moves in the direction of its setpoints."""
        straight = (np.abs(wanted) > STRAIGHT_SHARE * way) & (np.abs(wanted) > LEAST_WAY_RAD)
        backwards = moved * np.sign(wanted) < -BACKWARDS_SHARE * np.abs(wanted)
        wrong = straight & backwards & (np.abs(self._wanted - self._axes) > self._apart_rad)
        if wrong.any():
            joint = int(wrong.argmax())
            raise PositionReversed(
                self._names[joint],
                f"the position moved by {moved[joint]:.3f} rad while its setpoints moved by {wanted[joint]:.3f} rad",
            )

    def _judge_velocity(self, moved_rad_s: FloatArray, reported_rad_s: FloatArray) -> None:
        """Check that reported velocities match the positions."""
        allowed = VELOCITY_FACTOR * np.abs(moved_rad_s) + VELOCITY_SHARE * self._velocity_max
        excess = np.abs(reported_rad_s - moved_rad_s) - allowed
        if (excess > 0.0).any():
            joint = int(np.argmax(excess))
            raise VelocityContradicts(
                self._names[joint],
                f"a velocity of {reported_rad_s[joint]:.3f} rad/s is reported, the position moves at "
                f"{moved_rad_s[joint]:.3f} rad/s",
            )
