"""Injection of the payload's torque into the drives: a plug-in of the cycle around `PayloadFeedforward`.

The torque must match the arm's state while it acts, and an arm lags its setpoints (by 40 ms on the simulated arms;
ignoring the lag reduces the following error by 60 to 70 % instead of 85 to 90 %). So the torque is computed from the
setpoints of one lag ago, which are free of noise. The lag is measured during motion, as following error over speed.

If the arm's body is known, the gear friction that the payload causes, or all of the arm's own torque, is added: see
`body_torque`.

Safety is not ensured here but by the gate (`torque_gate`), which clamps, limits the rate, and ramps in and out.
"""

from __future__ import annotations

from collections import deque
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from armload_controller.control_errors import ControlError
from armload_controller.cycle.control_cycle import Hold
from armload_controller.cycle.plugins import CycleStep
from armload_controller.feedforward.body_torque import ArmTerm
from armload_controller.feedforward.offset_check import OffsetCheck, OffsetVerdict
from armload_controller.feedforward.payload_feedforward import NOTHING, PayloadFeedforward
from armload_controller.feedforward.payload_use import why_not_usable
from armload_identification.float_array import FloatArray
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters, PayloadResult

LONGEST_LAG_S = 0.2
"""Upper bound of the lag; no servo follows later than this."""
FADE_IN_S = 0.5
"""Time in which the torque is faded in once it is allowed."""
LAG_MEMORY_S = 5.0
"""Forgetting time constant: the lag is that of about the last seconds of motion."""
_MOVED_RAD2_S = 1e-4
"""Integral of squared speed over time, in rad2/s, above which a joint's lag counts."""


class PayloadRefused(ControlError):
    """A payload must not be fed forward."""


class FollowingLag:
    """Time by which an arm lags its setpoints: the median over the joints that move.

        lag = sum e dq / sum dq^2        e the following error, dq the commanded speed

    Attributes:
        lag_s: The lag; 0 until a joint has moved.
    """

    def __init__(self, n: int, cycle_s: float) -> None:
        self._error_times_speed = np.zeros(n)
        self._speed_squared = np.zeros(n)
        self._remembered_share = np.exp(-cycle_s / LAG_MEMORY_S)
        self._cycle_s = cycle_s
        self.lag_s = 0.0

    def add(self, error_rad: FloatArray, velocity_rad_s: FloatArray) -> None:
        """Process one cycle; standstill has no effect."""
        moving = velocity_rad_s * velocity_rad_s * self._cycle_s
        if not moving.any():
            return
        self._error_times_speed = (
            self._remembered_share * self._error_times_speed + error_rad * velocity_rad_s * self._cycle_s
        )
        self._speed_squared = self._remembered_share * self._speed_squared + moving
        moved = self._speed_squared > _MOVED_RAD2_S
        if moved.any():
            lag_s = float(np.median(self._error_times_speed[moved] / self._speed_squared[moved]))
            self.lag_s = min(max(lag_s, 0.0), LONGEST_LAG_S)


class FeedforwardPlugin:
    """Adds a payload's torque once allowed.

    Args:
        robot: Its name, for messages.
        payload: The payload at its flange; None for an empty flange.
        cycle_s: Duration of a cycle.
        beside: The arm's own torque; None adds only the payload's.
        commanded: (n, n) matrix that the row of torques is multiplied with to compensate for gain errors of the
            drives; identity if not given.

    Attributes:
        chain: The arm.
        robot: Its name.

    Raises:
        PayloadRefused: the payload's mass or centre of mass is not determined, or it belongs to another arm.
    """

    name = "feed-forward"

    def __init__(
        self,
        chain: Chain,
        robot: str,
        payload: PayloadResult | None,
        cycle_s: float,
        beside: ArmTerm | None = None,
        commanded: FloatArray | None = None,
    ) -> None:
        self._commanded = np.eye(chain.n) if commanded is None else commanded
        self.chain, self.robot, self._cycle_s, self._arm_term = chain, robot, cycle_s, beside
        self._arm_term_share = 0.0
        if payload is not None:
            self._require(payload)
        self._payload = NOTHING if payload is None else payload.model
        self._feedforward = PayloadFeedforward(chain, NOTHING)
        self._joints = np.zeros(chain.n)
        self._lag = FollowingLag(chain.n, cycle_s)
        length = int(np.ceil(LONGEST_LAG_S / cycle_s)) + 2
        self._states: deque[FloatArray] = deque(maxlen=length)

    @property
    def fade_in_cycles(self) -> int:
        """Number of cycles from `allow` until the full torque is added."""
        return round(FADE_IN_S / self._cycle_s) + 1

    @property
    def lag_s(self) -> float:
        """The lag of the arm measured so far."""
        return self._lag.lag_s

    def allow(self, joints: NDArray[np.bool_]) -> None:
        """Start adding torque, faded in.

        Args:
            joints: (n,) joints on which torque may be added, from `OffsetCheck`.
        """
        self._joints = joints.astype(np.float64)
        self._feedforward.set_payload(self._payload, FADE_IN_S, self._cycle_s)

    def set_payload(self, payload: PayloadResult, transition_s: float) -> None:
        """Change the payload while running, without a step; may be called from any thread.

        Args:
            payload: The new payload.
            transition_s: Duration of the change.

        Raises:
            PayloadRefused: it must not be fed forward; the present payload is kept.
        """
        self._require(payload)
        self._replace_payload(payload.model, transition_s)

    def drop_payload(self, transition_s: float) -> None:
        """Fade the payload's torque out: the flange is empty; may be called from any thread."""
        self._replace_payload(NOTHING, transition_s)

    def on_cycle(self, step: CycleStep) -> FloatArray:
        """The payload's torque at the state that the arm will be in while it acts."""
        if step.sent is not None and step.sent_reference is not None:
            error = step.sent.position_rad - step.feedback.position_rad
            self._lag.add(error, step.sent_reference.velocity_rad_s)
        reference = step.reference
        motion = (reference.position_rad, reference.velocity_rad_s, reference.acceleration_rad_s2)
        self._states.appendleft(np.array(motion))
        # The error is sampled at SYNC; torque acts from then until the next one, on average half a cycle later.
        delay = max(self._lag.lag_s / self._cycle_s - 0.5, 0.0)
        last = len(self._states) - 1
        before = min(int(delay), last)
        share = delay - int(delay)
        q, dq, ddq = (1.0 - share) * self._states[before] + share * self._states[min(before + 1, last)]
        torque = self._feedforward.torque_nm(q, dq, ddq)
        if self._arm_term is not None and self._joints.any():
            self._arm_term_share = min(1.0, self._arm_term_share + self._cycle_s / FADE_IN_S)
            torque = torque + self._arm_term_share * self._arm_term.torque_nm(q, dq, ddq, torque)
        return self._joints * (torque @ self._commanded)

    def _replace_payload(self, payload: InertialParameters, transition_s: float) -> None:
        """Set the payload; its torque changes now if torque is allowed, otherwise when `allow` is called."""
        self._payload = payload
        if self._joints.any():
            self._feedforward.set_payload(payload, transition_s, self._cycle_s)

    def _require(self, payload: PayloadResult) -> None:
        problem = why_not_usable(payload, self.chain, self.robot, "fed forward")
        if problem is not None:
            raise PayloadRefused(f"payload: {problem}")


class Feeding(Protocol):
    """A plug-in that adds torque once allowed: `FeedforwardPlugin`, or a wrapper of it."""

    @property
    def fade_in_cycles(self) -> int:
        """Number of cycles from `allow` until the full torque is added."""

    def allow(self, joints: NDArray[np.bool_]) -> None:
        """Start adding torque on some joints, faded in."""

    def on_cycle(self, step: CycleStep) -> FloatArray:
        """(n,) torque to add."""


class CheckedFeedforward:
    """The feed-forward and the preceding check of the torque offset, as one plug-in.

    Args:
        feedforward: Adds nothing until `fade_in` allows it.
        check: Tries the torque offset during `try_offset`.

    Attributes:
        check: The check.
    """

    name = "feed-forward"

    def __init__(self, feedforward: Feeding, check: OffsetCheck) -> None:
        self._feedforward, self.check = feedforward, check
        self._checking = False

    def on_cycle(self, step: CycleStep) -> FloatArray | None:
        """The check's torque while it runs, otherwise the payload's."""
        torque = self._feedforward.on_cycle(step)
        return self.check.on_cycle(step) if self._checking else torque

    def try_offset(self, hold: Hold) -> OffsetVerdict:
        """Try the torque offset at standstill; none of the payload's torque is added.

        Raises:
            OffsetRefused: a drive responds wrongly to its offset.
        """
        self._checking = True
        hold(self.check.done)
        self._checking = False
        verdict = self.check.verdict()
        verdict.require()
        return verdict

    def fade_in(self, hold: Hold, verdict: OffsetVerdict) -> None:
        """Fade the payload's torque in at standstill, after a trial of the offset.

        Raises:
            OffsetRefused: the trial failed; no torque is added.
        """
        self._feedforward.allow(verdict.require())
        cycles = iter(range(self._feedforward.fade_in_cycles))
        hold(lambda: next(cycles, None) is None)
