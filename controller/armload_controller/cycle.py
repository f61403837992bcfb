"""The cycle: one setpoint out, one feedback in, until the plan ends or something stops it.

Rules. Every setpoint is checked against the limits after Ruckig and before it is sent. What Ruckig makes of
it may not be off the plan by more than `PATH_TOLERANCE_RAD`. Whatever happens, the arm is brought to rest by
the row of `safety.DECISIONS` that the cause belongs to before an error leaves this module.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from armload_controller.errors import MotionError
from armload_controller.limits import MotionLimits, check_setpoints
from armload_controller.recorder import Recorder
from armload_controller.safety import (
    DECISIONS,
    Cause,
    FollowingError,
    PathDeviation,
    StopCategory,
    cause_of,
)
from armload_controller.setpoints import MotionPlan, RuckigFollower, Segment, plan_stop
from armload_drivers.errors import DriverError
from armload_drivers.servos import FloatArray, JointCommand, JointFeedback, JointServos
from armload_identification.fourier import FourierTrajectory

PATH_TOLERANCE_RAD = 1e-4
"""Greatest distance between plan and command; the arm may only be where it was checked."""
FLIGHT_RECORDER_CYCLES = 50
"""Cycles that an error carries with it."""


@dataclass(frozen=True, slots=True)
class CycleSummary:
    """What a completed run counted.

    Attributes:
        cycles: Setpoints sent.
        duration_s: Time between the first and the last feedback, on the servos' clock.
        missing: (n,) cycles in which a joint's feedback was missing.
        skipped: Cycles skipped because the program was late.
        following_error_rad: (n,) greatest distance between target and measured position.
    """

    cycles: int
    duration_s: float
    missing: FloatArray
    skipped: int
    following_error_rad: FloatArray


class Cycle:
    """Streams plans to one arm.

    Args:
        servos: An enabled arm.
        limits: Limits of its joints.
        stop_requested: Asked once per cycle; True brings the arm to rest along the path.
    """

    def __init__(self, servos: JointServos, limits: MotionLimits, stop_requested: Callable[[], bool]) -> None:
        self._servos = servos
        self._limits = limits
        self._stop_requested = stop_requested
        self._last: deque[JointFeedback] = deque(maxlen=FLIGHT_RECORDER_CYCLES)
        self._no_torque = np.zeros(servos.n)

    def run(
        self,
        plan: MotionPlan,
        path: FourierTrajectory,
        start_rad: FloatArray,
        recorder: Recorder,
        progress: Callable[[int], None],
    ) -> CycleSummary:
        """Stream a plan from rest at `start_rad`.

        Args:
            plan: The setpoints.
            path: The path they lie on, for a stop along it.
            start_rad: (n,) position the drives hold now.
            recorder: Gets every cycle.
            progress: Called with the number of setpoints sent.

        Raises:
            LimitViolation: the plan breaks a limit; nothing has moved.
            MotionError: the motion was stopped; the arm is at rest and disabled.
        """
        check_setpoints(plan.position_rad, plan.velocity_rad_s, plan.acceleration_rad_s2, self._limits)
        follower = RuckigFollower(start_rad, self._limits, self._servos.cycle_s)
        tally = _Tally(self._servos.n)
        try:
            for row in range(len(plan)):
                if self._stop_requested():
                    self._stop_along_path(plan, row, path, follower, recorder)
                self._one(plan, row, follower, recorder, tally)
                progress(row + 1)
        except MotionError:
            raise
        except BaseException as error:  # noqa: BLE001 - whatever it is, the arm is brought to rest first
            self._bring_to_rest(cause_of(error), error)
        return tally.summary(len(plan))

    def _one(self, plan: MotionPlan, row: int, follower: RuckigFollower, recorder: Recorder, tally: _Tally) -> None:
        """Send one setpoint, judge and record the answer."""
        position, velocity, acceleration = follower.follow(
            plan.position_rad[row], plan.velocity_rad_s[row], plan.acceleration_rad_s2[row]
        )
        deviation = np.abs(position - plan.position_rad[row]).max()
        if not deviation <= PATH_TOLERANCE_RAD:
            raise PathDeviation(f"{deviation:.2e} rad off the checked path, {PATH_TOLERANCE_RAD:.0e} rad allowed")
        check_setpoints(position, velocity, acceleration, self._limits)
        command = JointCommand(position, velocity, self._no_torque)
        feedback = self._servos.exchange(command)
        self._last.append(feedback)
        segment = plan.segment[row]
        phase_s = float(plan.phase_s[row]) if segment is Segment.PERIODS else None
        recorder.write(feedback, command, segment, phase_s)
        error_rad = np.abs(position - feedback.position_rad)
        tally.add(feedback, error_rad)
        worst = int(np.argmax(error_rad - self._limits.following_error_rad))
        if not error_rad[worst] <= self._limits.following_error_rad[worst]:
            raise FollowingError(
                self._limits.joint_names[worst],
                float(error_rad[worst]),
                float(self._limits.following_error_rad[worst]),
            )

    def _stop_along_path(
        self,
        plan: MotionPlan,
        row: int,
        path: FourierTrajectory,
        follower: RuckigFollower,
        recorder: Recorder,
    ) -> None:
        """Come to rest on the path where the plan is on it; the quick stop does the rest."""
        if row > 0 and plan.segment[row - 1] is not Segment.APPROACH:
            ramp = plan_stop(plan, row - 1, path, self._limits, self._servos.cycle_s)
            tally = _Tally(self._servos.n)
            for step in range(len(ramp)):
                self._one(ramp, step, follower, recorder, tally)
        raise KeyboardInterrupt

    def _bring_to_rest(self, cause: Cause, error: BaseException) -> None:
        """Carry out the decision for a cause, then raise what happened.

        Raises:
            MotionError: always.
        """
        decision = DECISIONS[cause]
        troubles = []
        steps = [self._servos.disable]
        if decision.category is not StopCategory.TORQUE_OFF:
            steps.insert(0, self._servos.stop)
        for step in steps:
            try:
                step()
            except DriverError as trouble:
                troubles.append(str(trouble))
        detail = f": {error}" if str(error) else ""
        message = f"Motion stopped ({decision.category.value}): {cause.value}{detail}. Next: {decision.advice}."
        if troubles:
            message += " While stopping: " + "; ".join(troubles)
        raise MotionError(message, tuple(self._last)) from error


class _Tally:
    """Counts of a run."""

    def __init__(self, n: int) -> None:
        self._missing = np.zeros(n)
        self._worst_rad = np.zeros(n)
        self._skipped = 0
        self._first_s = self._last_s = float("nan")

    def add(self, feedback: JointFeedback, error_rad: FloatArray) -> None:
        self._missing += feedback.missing
        self._skipped += feedback.skipped_cycles
        np.maximum(self._worst_rad, error_rad, out=self._worst_rad)
        self._last_s = feedback.time_s
        if np.isnan(self._first_s):
            self._first_s = feedback.time_s

    def summary(self, cycles: int) -> CycleSummary:
        return CycleSummary(cycles, self._last_s - self._first_s, self._missing, self._skipped, self._worst_rad)
