"""The cycle: one setpoint out, one feedback in, until the path ends or the motion is stopped.

Rules. Every setpoint is checked against the limits after Ruckig and before it is sent. Ruckig's output may deviate
from the plan by at most `PATH_TOLERANCE_RAD`. Before an error leaves this module, the arm is brought to rest as the
row of `stop_decisions.Cause` for it prescribes.

Order within a cycle: the next setpoint is computed and checked, plug-ins receive it with the last feedback (monitors
check that feedback now, before anything else is sent), their torque passes the gate, and the command is sent.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np

from armload_controller.control_errors import ControlError, MotionError
from armload_controller.cycle.following_monitor import LateCycle
from armload_controller.cycle.plugins import CyclePlugin, CycleStep, PluginHost
from armload_controller.cycle.stop_decisions import PathDeviation, StopStep, cause_of
from armload_controller.cycle.torque_gate import TorqueGate
from armload_controller.motion.checked_path import CheckedLeg
from armload_controller.motion.joint_limits import MotionLimits, check_setpoints
from armload_controller.motion.leg_interpolator import LegInterpolator, Reference
from armload_controller.motion.motion_control import MotionControl, PluginStop
from armload_controller.motion.phase import PhaseState, Segment
from armload_controller.motion.setpoints import RuckigFollower
from armload_drivers.driver_errors import DriverError, LoopLost
from armload_drivers.servos import JointCommand, JointFeedback, JointServos
from armload_identification.float_array import FloatArray

PATH_TOLERANCE_RAD = 1e-4
"""Greatest distance between plan and command: the arm may only move where the path was checked."""
FLIGHT_RECORDER_CYCLES = 50
"""Number of last cycles that an error contains."""

Progress = Callable[[float], None]
"""Called with the fraction completed, 0 to 1."""
Hold = Callable[[Callable[[], bool]], None]
"""`PoweredArm.hold`: all that is handed out of an enabled arm, as whoever has only this cannot move it."""


class Cycle:
    """Moves one arm.

    Args:
        servos: A connected arm.
        limits: Limits of its joints.
        gate: Limits added torque.
        control: The operator's requests: pause, speed, stop.
        plugins: Called in every cycle, in this order; they include the recorder and the monitors.
        stopwatch: Clock in s that plug-ins are timed with.
    """

    def __init__(
        self,
        servos: JointServos,
        limits: MotionLimits,
        gate: TorqueGate,
        control: MotionControl,
        plugins: Sequence[CyclePlugin],
        stopwatch: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._servos = servos
        self._limits = limits
        self._gate = gate
        self._control = control
        self._host = PluginHost(plugins, servos.n, servos.cycle_s, stopwatch)

    def standing_rad(self) -> FloatArray:
        """(n,) position of the arm at standstill, without torque.

        Raises:
            DriverError: a drive does not report its position.
        """
        return self._servos.standing_rad()

    @contextmanager
    def powered(self) -> Iterator[PoweredArm]:
        """Enable the arm; leaving the block in any way brings the arm to rest and disables it.

        Raises:
            DriverError: the arm cannot be enabled; nothing has moved.
            MotionError: the motion was stopped, and the arm is at rest and disabled; or a stop had been requested
                before, and nothing was switched on.
        """
        require_going(self._control)
        self._gate.close()
        arm: PoweredArm | None = None
        try:
            feedback = self._servos.enable()
            arm = PoweredArm(self._servos, self._limits, self._gate, self._control, self._host, feedback)
            yield arm
            arm.release_torque()
            self._servos.stop()
            self._servos.disable()
        except BaseException as error:
            if arm is None:
                self._control.ended = True
                if not isinstance(error, DriverError):  # enabling was interrupted; the servos back out of their errors
                    self._servos.disable()
                raise
            arm.bring_to_rest(error)


def require_going(control: MotionControl) -> None:
    """Refuse to enable the drives after a stop was requested.

    Raises:
        MotionError: a stop was requested; the error's cause is the reason.
    """
    stop = control.goal.stop
    if stop is not None:
        raise not_switched_on(stop) from stop


def not_switched_on(error: ControlError) -> MotionError:
    """The error for a motion that was not started."""
    cause = cause_of(error)
    return MotionError(f"Nothing was switched on: {cause.words}: {error}. Next: {cause.advice}.", ())


def stop_message(error: BaseException, more: str = "", escalation: LoopLost | None = None) -> str:
    """The operator's message for a stopped motion.

    Args:
        error: The reason.
        more: Further detail, appended to the reason.
        escalation: The error of an axis that left its course during the stop, if any; it decides what to do next.
    """
    cause, decisive = cause_of(error), cause_of(escalation or error)
    detail = f": {error}" if str(error) else ""
    return f"Motion stopped ({decisive.category.title}): {cause.words}{detail}{more}. Next: {decisive.advice}."


class PoweredArm:
    """An arm with torque on, yielded by `Cycle.powered`.

    Attributes:
        position_rad: (n,) the last commanded position.
    """

    def __init__(
        self,
        servos: JointServos,
        limits: MotionLimits,
        gate: TorqueGate,
        control: MotionControl,
        host: PluginHost,
        feedback: JointFeedback,
    ) -> None:
        self._servos, self._limits = servos, limits
        self._gate, self._control, self._host = gate, control, host
        self._feedback = _sealed(feedback)
        self._last: deque[JointFeedback] = deque(maxlen=FLIGHT_RECORDER_CYCLES)
        self._follower = RuckigFollower(feedback.position_rad, limits, servos.cycle_s)
        self._sent: JointCommand | None = None
        self._sent_reference: Reference | None = None
        self._interpolator: LegInterpolator | None = None
        self._unsent: tuple[JointCommand, Reference] | None = None
        self.position_rad = feedback.position_rad

    def follow(self, leg: CheckedLeg, progress: Progress) -> None:
        """Run a leg from rest to rest; the operator may pause it and change its speed.

        Args:
            leg: The leg; it begins at the arm's present position.
            progress: Called with the fraction completed, 0 to 1.

        Raises:
            StopRequested: a stop was requested; the arm is at rest on the path, still powered.
            ControlError: something went wrong. `Cycle.powered` brings the arm to rest.
        """
        self._interpolator = interpolator = LegInterpolator(leg.leg, self._servos.cycle_s, self._control)
        while (reference := interpolator.next_reference()) is not None:
            self._exchange(reference)
            progress(interpolator.done)
        self._interpolator = None
        self._control.require_no_stop()

    def hold(self, done: Callable[[], bool]) -> None:
        """Stand still until `done` returns true; plug-ins continue to be called.

        Raises:
            StopRequested: a stop was requested.
        """
        while not done():
            self._exchange(self._standing())
            self._control.require_no_stop()

    def release_torque(self) -> None:
        """Ramp added torque to zero at standstill, and pass the last feedback to the plug-ins."""
        self._gate.release()
        self._exchange(self._standing())
        while not self._gate.empty:
            self._exchange(self._standing())
        self._call_plugins(self._command(self._standing()), self._standing())

    def bring_to_rest(self, error: BaseException) -> None:
        """Carry out the decision for the error's cause, then raise.

        Raises:
            MotionError: always.
        """
        if self._host.failed:
            self._host.detach(self._host.failed)
        joint, names = getattr(error, "joint", ""), self._limits.joint_names
        suspect = names.index(joint) if joint in names else None
        steps = {
            StopStep.RAMP_DOWN: self._ramp_down,
            StopStep.QUICK_STOP: lambda: self._servos.stop(suspect),
            StopStep.EMERGENCY_STOP: lambda: self._servos.stop(suspect),
            StopStep.DISABLE: self._servos.disable,
        }
        troubles, astray = [], None
        for step in cause_of(error).category.sequence:
            try:
                self._control.ended = step is not StopStep.RAMP_DOWN
                steps[step]()
            except BaseException as trouble:  # noqa: BLE001 - the next step must follow after any failure
                astray = trouble if isinstance(trouble, LoopLost) else astray
                said = [str(trouble) or type(trouble).__name__, *getattr(trouble, "__notes__", ())]
                troubles.append(f"{step.value}: {' '.join(said)}")
        late = self._host.slowest() if isinstance(error, LateCycle) else None
        message = stop_message(
            error, "" if late is None else f"; plug-in {late.name!r} took {late.last_s * 1e3:.1f} ms", astray
        )
        if troubles:
            message += " While stopping: " + "; ".join(troubles)
        raise MotionError(message, tuple(self._last)) from error

    # ---------------------------------------------------------------------------------------------------------

    def _ramp_down(self) -> None:
        """Bring the arm to rest along the path and added torque to zero."""
        self._control.stop(PluginStop("cycle", "coming to rest"))  # from now on every exchange releases the gate
        if self._unsent is not None:
            # A plug-in raised before this setpoint was sent; skipping it would cause a jump.
            self._send(*self._unsent)
        interpolator = self._interpolator
        while interpolator is not None and (reference := interpolator.next_reference()) is not None:
            self._exchange(reference)
        self.release_torque()

    def _standing(self) -> Reference:
        """A reference that stays at the last commanded position."""
        nothing = np.zeros_like(self.position_rad)
        return Reference(self.position_rad, nothing, nothing, Segment.HOLD, PhaseState(0.0, 0.0, 0.0))

    def _exchange(self, reference: Reference) -> None:
        """Send one setpoint and receive the feedback."""
        if self._control.goal.stop is not None:
            self._gate.release()
        command = self._command(reference)
        self._unsent = command, reference
        torque = self._gate.passed(self._call_plugins(command, reference))
        self._send(JointCommand(command.position_rad, command.velocity_rad_s, torque), reference)

    def _send(self, command: JointCommand, reference: Reference) -> None:
        """Send a checked command."""
        self._unsent = None
        self._feedback = _sealed(self._servos.exchange(command))
        self._last.append(self._feedback)
        self._sent, self._sent_reference = command, reference
        self.position_rad = command.position_rad

    def _command(self, reference: Reference) -> JointCommand:
        """The checked setpoint for a reference.

        Raises:
            PathDeviation: the setpoint deviates from the reference.
            LimitViolation: the setpoint exceeds a limit.
        """
        position, velocity, acceleration = self._follower.follow(
            reference.position_rad, reference.velocity_rad_s, reference.acceleration_rad_s2
        )
        distance = np.abs(position - reference.position_rad)
        deviation = distance[distance.argmax()]
        if not deviation <= PATH_TOLERANCE_RAD:
            raise PathDeviation(f"{deviation:.2e} rad off the checked path, {PATH_TOLERANCE_RAD:.0e} rad allowed")
        check_setpoints(position, velocity, acceleration, self._limits)
        return JointCommand(position, velocity, self._gate.torque_nm)

    def _call_plugins(self, command: JointCommand, reference: Reference) -> FloatArray:
        """Call the plug-ins with the last feedback and the next command."""
        return self._host.call(
            CycleStep(self._feedback, self._sent, self._sent_reference, command, reference, self._ask_to_stop)
        )

    def _ask_to_stop(self, reason: str) -> None:
        """A plug-in requests a stop."""
        self._control.stop(PluginStop(self._host.calling, reason))


def _sealed(feedback: JointFeedback) -> JointFeedback:
    """A feedback that no plug-in can change: the arm is held at this position, and errors keep these rows."""
    for values in (feedback.position_rad, feedback.velocity_rad_s, feedback.current_a, feedback.torque_nm):
        if values is not None:
            values.setflags(write=False)
    return feedback
