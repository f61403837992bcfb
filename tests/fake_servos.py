"""`JointServos` without a bus: the simulated arm is commanded directly, in virtual time.

Modelled: the sequence of states, the timing (a command is latched at the SYNC whose feedback is returned, and reached
one cycle later), the drives' units (every number passes through counts and per mille), statuswords, following errors,
and scripted failures. Not modelled: boot, SDO, NMT, heartbeat, bus load. A cycle takes only its computing time.

Rules:

- Time passes only in calls: `enable`, `exchange`, `stop` and `disable` let SYNCs pass.
- A drive in FAULT has no torque and its brake engaged; the others hold. The fault cannot be reset.
- Axes that leave their predicted course lose their torque as in `cyclic.torque_removal`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from armload_drivers.cia402.arm_settings import ArmSettings, DriveSettings, EffortFeedback
from armload_drivers.cia402.axis_brakes import HELD_RAD, HOLDING_WATCH_S, axis_moves
from armload_drivers.cia402.axis_course import axis_courses, loop_lost
from armload_drivers.cia402.process_data.drive_units import ArmUnits, RawAxes
from armload_drivers.cia402.process_data.offset_fade import OffsetFade
from armload_drivers.cia402.state_machine import POWERED, State
from armload_drivers.driver_errors import ServoFault, ServoTimeout, SimulationError, StateError
from armload_drivers.servos import JointCommand, JointFeedback
from armload_drivers.simulation.mujoco_plant import ArmPlant, PlantSample
from armload_identification.float_array import FloatArray

QUICK_STOP_S = 0.2
"""Duration of a drive's quick stop ramp."""
STANDSTILL_RAD_S = 1e-3
"""The arm is at standstill if every axis is slower than this."""
STANDSTILL_TIMEOUT_S = 2.0

_VOLTAGE_AND_REMOTE = 0x0210
"""Bits 4 (voltage enabled) and 9 (remote) of the statusword."""


class FailureKind(Enum):
    """Kind of a scripted failure."""

    FAULT = auto()
    """The drive goes to FAULT and stays there."""
    MISSING_FEEDBACK = auto()
    """The drive works, but its feedback does not arrive."""


@dataclass(frozen=True, slots=True)
class ScriptedFailure:
    """One scripted failure.

    Attributes:
        kind: Its kind.
        joint: Index of the joint whose drive fails.
        cycle: Number of the SYNC since `connect` at which it begins.
        cycles: Number of cycles without feedback; a fault is permanent.
    """

    kind: FailureKind
    joint: int
    cycle: int
    cycles: int = 1


class _Life(Enum):
    """Phase of the arm between `connect` and `close`."""

    CLOSED = auto()
    CONNECTED = auto()
    ENABLED = auto()
    STOPPED = auto()


class FakeServos:
    """All joint servos of a simulated arm, without a bus.

    Attributes:
        n: Number of joints.
        cycle_s: Duration of one cycle.
        simulated: Always True.
    """

    def __init__(self, arm: ArmSettings, plant: ArmPlant, failures: Sequence[ScriptedFailure] = ()) -> None:
        """Create the drives of a simulated arm.

        Args:
            arm: Scaling and limits of the drives.
            plant: The arm; owned by this object from now on.
            failures: Scripted failures.

        Raises:
            SimulationError: Settings and plant have different numbers of joints.
        """
        if len(arm.drives) != plant.n:
            raise SimulationError(f"{len(arm.drives)} drives are configured for a plant of {plant.n} joints")
        self.n = plant.n
        self.cycle_s = arm.cycle_s
        self.simulated = True
        self._arm = arm
        self._plant = plant
        self._failures = tuple(failures)
        self._units = ArmUnits(arm)
        self._life = _Life.CLOSED
        self._states = [State.SWITCH_ON_DISABLED] * self.n
        self._missed = np.zeros(self.n, dtype=np.int64)
        self._begin_s = 0.0
        self._cycle = 0
        self._offset_permille = [0] * self.n
        self._fade: OffsetFade | None = None
        self._courses = axis_courses(arm, self._units)
        self._targets = [0] * self.n
        self._judged = [0] * self.n
        self._last = self._reported(plant.sample(arm.cycle_s))

    def connect(self) -> None:
        """Connect; nothing is energised.

        Raises:
            StateError: Already connected.
        """
        if self._life is not _Life.CLOSED:
            raise StateError("the servos are already connected; close them first")
        self._begin_s = self._plant.time_s
        self._cycle = 0
        self._missed[:] = 0
        self._life = _Life.CONNECTED

    def standing_rad(self) -> FloatArray:
        """(n,) positions of the joints.

        Raises:
            StateError: Not connected, or enabled.
        """
        if self._life is not _Life.CONNECTED:
            raise StateError("the servos must be connected and disabled to report their position")
        raw = self._reported(self._plant.sample(self.cycle_s))
        return self._units.joint_position_rad(raw.position_counts)

    def enable(self) -> JointFeedback:
        """Enable every axis at its present position.

        Returns:
            Feedback of the first enabled cycle.

        Raises:
            StateError: Not connected, or already enabled.
            ServoFault: A drive is in FAULT.
        """
        if self._life is not _Life.CONNECTED:
            raise StateError("the servos must be connected and disabled before they are enabled")
        self._raise_fault("enabling")
        self._fade = None
        self._add_torque([0] * self.n)
        self._targets = self._reported(self._plant.sample(self.cycle_s)).position_counts
        for axis, course in enumerate(self._courses):
            self._plant.set_powered(axis, True)
            self._states[axis] = State.OPERATION_ENABLED
            course.begin(self._targets[axis])
            self._judged[axis] = self._cycle
        self._life = _Life.ENABLED
        return self._sync("enabling")

    def exchange(self, command: JointCommand) -> JointFeedback:
        """Let one SYNC pass, which latches a command.

        Args:
            command: Setpoints of this cycle; the velocity is not used, as with drives without 60B1.

        Returns:
            Feedback sampled at that SYNC.

        Raises:
            StateError: Not enabled, or stopped.
            CommandError: A setpoint cannot be sent, or no axis could follow it in a cycle; nothing has moved.
            LoopLost: An axis has left its predicted course.
            ServoFault: A drive is in FAULT.
            ServoTimeout: A joint's feedback was missing in more consecutive cycles than the settings allow.
        """
        if self._life is not _Life.ENABLED:
            raise StateError("the servos must be enabled before setpoints are exchanged")
        raw = self._units.targets(command)
        for axis, course in enumerate(self._courses):
            way = raw.position_counts[axis] - self._targets[axis]
            if abs(way) > course.step:
                raise course.too_far(self._drive(axis).joint, way)
        self._targets = raw.position_counts
        feedback = self._sync("exchanging setpoints")
        for axis, units in enumerate(self._units.axes):
            self._plant.set_target(axis, raw.position_counts[axis] / units.counts_per_rad, self.cycle_s)
        self._add_torque(raw.effort)
        return feedback

    def stop(self, suspect: int | None = None) -> None:
        """Quick stop: bring every setpoint to rest within `QUICK_STOP_S`, wait for standstill and hold.

        Torque offsets are faded to zero linearly within `OFFSET_FADE_S`.

        Args:
            suspect: See `JointServos.stop`.

        Raises:
            StateError: Not connected.
            LoopLost: An axis left its predicted course during the stop; all others have come to rest.
            ServoTimeout: The arm does not come to rest; its torque was removed.
        """
        if self._life is _Life.CLOSED:
            raise StateError("the servos must be connected before they are stopped")
        if self._life is not _Life.ENABLED:
            return
        self._life = _Life.STOPPED
        if suspect is not None:
            self._courses[suspect].suspect()
        known = self._drop_astray()
        self._fade_offsets()
        self._pass_sync()
        for axis, state in enumerate(self._states):
            if state is State.OPERATION_ENABLED:
                self._plant.slow_down(axis, QUICK_STOP_S)
                self._states[axis] = State.QUICK_STOP_ACTIVE
        self._wait_for_standstill("quick stop", QUICK_STOP_S)
        for axis in self._drop_astray():
            if axis not in known:
                raise loop_lost(self._drive(axis), "quick stop", self._courses[axis].lost)

    def disable(self) -> None:
        """Engage brakes and remove torque once the arm is at standstill.

        Axes without a brake keep their torque until it is removed from the others. Then all are watched for
        `HOLDING_WATCH_S`.

        Raises:
            StateError: Not connected.
            ServoTimeout: The arm does not come to rest; its torque was removed.
            AxisMoves: An axis moves without torque.
        """
        if self._life is _Life.CLOSED:
            raise StateError("the servos must be connected before they are disabled")
        if self._life is _Life.CONNECTED:
            return
        self._fade_offsets()
        try:
            self._wait_for_standstill("disabling", 0.0)
        finally:
            self._remove_torque()
        self._require_rest()

    def take_remarks(self) -> tuple[str, ...]:
        """Nothing: there is no bus."""
        return ()

    def close(self) -> None:
        """Stop and disable if necessary, and disconnect. Idempotent.

        Raises:
            ServoTimeout: The arm does not come to rest; its torque is removed anyway.
            AxisMoves: An axis moves without torque.
        """
        if self._life is _Life.CLOSED:
            return
        try:
            self.stop()
            self.disable()
        finally:
            self._remove_torque()
            self._life = _Life.CLOSED

    def _remove_torque(self) -> None:
        """Switch every axis off, those without a brake last."""
        for axis in sorted(range(self.n), key=lambda axis: not self._drive(axis).has_brake):
            self._plant.hold_by_brake(axis)
            if self._states[axis] is not State.FAULT:
                self._states[axis] = State.SWITCH_ON_DISABLED
        self._add_torque([0] * self.n)
        self._life = _Life.CONNECTED

    def _require_rest(self) -> None:
        """Check that the axes do not move without torque."""
        begun_rad = self._plant.sample(self.cycle_s).axis_position_rad
        for _ in range(math.ceil(HOLDING_WATCH_S / self.cycle_s)):
            sample = self._pass_sync()
        moved_rad = np.abs(sample.axis_position_rad - begun_rad)
        if moved_rad.max() > HELD_RAD:
            axis = int(moved_rad.argmax())
            raise axis_moves(self._drive(axis), float(moved_rad[axis]))

    def _add_torque(self, permille: list[int]) -> None:
        """Apply torque offsets (n,)."""
        self._offset_permille = permille
        for axis, units in enumerate(self._units.axes):
            self._plant.set_torque_offset(axis, permille[axis] * units.torque_nm_per_permille)

    def _fade_offsets(self) -> None:
        """Fade torque offsets to zero from the next SYNC on. Idempotent."""
        if self._fade is None:
            self._fade = OffsetFade(self._offset_permille, self.cycle_s)

    def _wait_for_standstill(self, step: str, least_s: float) -> None:
        """Let SYNCs pass until nothing moves and no torque offset is left, but at least for `least_s`."""
        first = self._cycle
        while True:
            sample = self._pass_sync()
            astray = self._drop_astray()
            elapsed_s = (self._cycle - first) * self.cycle_s
            speed = np.abs(sample.axis_velocity_rad_s)
            speed[astray] = 0.0
            faded = self._fade is None or self._fade.done
            if elapsed_s >= least_s and faded and speed.max() < STANDSTILL_RAD_S:
                return
            if elapsed_s > least_s + STANDSTILL_TIMEOUT_S:
                self._remove_torque()
                drive = self._drive(int(speed.argmax()))
                raise ServoTimeout(
                    drive.node_id,
                    drive.joint,
                    step,
                    f"still turning at {speed.max():.3g} rad/s after {elapsed_s:.1f} s",
                    "An axis without torque and without a brake falls: secure it",
                )

    def _sync(self, step: str) -> JointFeedback:
        """Let one SYNC pass and report it.

        Raises:
            ServoFault: A drive is in FAULT.
            ServoTimeout: Too much feedback is missing.
        """
        sample = self._pass_sync()
        missing = self._missing()
        reported = self._reported(sample)
        for axis in np.flatnonzero(missing):
            reported.position_counts[axis] = self._last.position_counts[axis]
            reported.effort[axis] = self._last.effort[axis]
        self._last = reported
        self._missed = np.where(missing, self._missed + 1, 0)
        for lost in self._astray():
            raise loop_lost(self._drive(lost), step, self._courses[lost].lost)
        self._raise_fault(step)
        missed, allowed = int(self._missed.max()), self._arm.max_missing_cycles
        if missed > allowed:
            drive = self._drive(int(self._missed.argmax()))
            remedy = f"Check the drive's supply and cable. Allowed are {allowed} (max_missing_cycles)"
            raise ServoTimeout(drive.node_id, drive.joint, step, f"no feedback for {missed} cycles", remedy)
        with_current = self._units.feedback is EffortFeedback.CURRENT
        return JointFeedback(
            cycle=self._cycle,
            time_s=self._begin_s + self._cycle * self.cycle_s,
            position_rad=self._units.joint_position_rad(reported.position_counts),
            velocity_rad_s=None,
            current_a=self._units.motor_current_a(reported.effort) if with_current else None,
            torque_nm=None if with_current else self._units.joint_torque_nm(reported.effort),
            statusword=self._statusword(),
            missing=missing,
        )

    def _pass_sync(self) -> PlantSample:
        """Advance the arm by a cycle, with its faults."""
        self._cycle += 1
        self._plant.advance(self._begin_s + self._cycle * self.cycle_s)
        sample = self._plant.sample(self.cycle_s)
        if self._fade is not None and not self._fade.done:
            self._add_torque(self._fade.next())
        lag = np.abs(sample.axis_demand_rad - sample.axis_position_rad)
        for axis, drive in enumerate(self._arm.drives):
            powered = self._states[axis] in {State.OPERATION_ENABLED, State.QUICK_STOP_ACTIVE}
            if powered and (lag[axis] > drive.following_error_rad or self._fails(FailureKind.FAULT, axis)):
                self._plant.set_powered(axis, False)
                self._states[axis] = State.FAULT
        self._follow_courses(sample)
        return sample

    def _follow_courses(self, sample: PlantSample) -> None:
        """Judge the motion of all powered axes whose feedback arrives."""
        raw, missing = self._reported(sample), self._missing()
        for axis, course in enumerate(self._courses):
            state = self._states[axis]
            if state in POWERED and not missing[axis]:
                if state is not State.OPERATION_ENABLED:
                    course.slow_down()
                elapsed_s = (self._cycle - self._judged[axis]) * self.cycle_s
                course.follow(self._targets[axis], raw.position_counts[axis], raw.effort[axis], elapsed_s)
                self._judged[axis] = self._cycle

    def _astray(self) -> list[int]:
        """Axes that have left their course since they were enabled."""
        return [axis for axis, course in enumerate(self._courses) if course.lost]

    def _drop_astray(self) -> list[int]:
        """Remove the torque of axes that have left their course at once, of all if there is more than one."""
        astray = self._astray()
        for axis in range(self.n) if len(astray) > 1 else astray:
            if self._states[axis] in POWERED:
                self._plant.set_powered(axis, False)
                self._states[axis] = State.SWITCH_ON_DISABLED
        return astray

    def _fails(self, kind: FailureKind, axis: int) -> bool:
        """Whether a failure is scripted for the present cycle."""
        return bool(self._failures) and any(
            failure.kind is kind
            and failure.joint == axis
            and failure.cycle <= self._cycle < failure.cycle + failure.cycles
            for failure in self._failures
        )

    def _missing(self) -> NDArray[np.bool_]:
        """Joints (n,) whose feedback does not arrive in the present cycle."""
        return np.array([self._fails(FailureKind.MISSING_FEEDBACK, axis) for axis in range(self.n)])

    def _raise_fault(self, step: str) -> None:
        """Raise for the first drive in FAULT."""
        for axis, state in enumerate(self._states):
            if state is State.FAULT:
                drive = self._drive(axis)
                raise ServoFault(
                    drive.node_id,
                    drive.joint,
                    step,
                    "the drive is in FAULT, without torque",
                    f"It faults when it lags by more than {drive.following_error_rad} rad, or by script",
                )

    def _statusword(self) -> NDArray[np.uint16]:
        """Statuswords (n,) of the present states."""
        return np.array([state.bits | _VOLTAGE_AND_REMOTE for state in self._states], dtype=np.uint16)

    def _reported(self, sample: PlantSample) -> RawAxes:
        """A sample in the drives' units."""
        return self._units.measured(sample.axis_position_rad, sample.axis_torque_nm)

    def _drive(self, axis: int) -> DriveSettings:
        """Settings of one drive."""
        return self._arm.drives[axis]
