"""The master's record of one drive while cycles run: its state, the course of its axis, and its problems."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

from armload_drivers.cia402 import emergency
from armload_drivers.cia402.arm_settings import ArmSettings, DriveSettings, OperationMode
from armload_drivers.cia402.axis_brakes import STANDSTILL_RAD_S
from armload_drivers.cia402.axis_course import AxisCourse, loop_lost
from armload_drivers.cia402.state_machine import POWERED, MasterMachine, State
from armload_drivers.driver_errors import (
    LoopLost,
    ServoError,
    ServoFault,
    ServoTimeout,
    StatuswordError,
    TransitionError,
)

_ENABLE_INTERPOLATION = 0x0010
_INTERPOLATION_ACTIVE = 0x1000
_ENABLED = State.OPERATION_ENABLED
"""Cached, because Python 3.11 takes 0.3 us to look up a member of an enumeration."""
_FAULTY = frozenset({State.FAULT, State.FAULT_REACTION_ACTIVE})


class CyclicDrive(ABC):
    """One drive in the cycle, on either bus.

    Args:
        now_s: Clock of the cycles.
        arm: Settings of its arm: cycle, and cycles in which feedback may be missing.

    Attributes:
        settings: Its settings.
        machine: Its power state.
        course: The predicted course of its axis; set by `begin`.
        target_counts: Target position of the next cycle.
        offset_permille: Torque offset of the next cycle.
        position_counts: Last actual position.
        effort: Last actual current or torque, in the units of its object.
        lost: Whether it was reported to the caller as not answering.
    """

    course: AxisCourse

    def __init__(self, drive: DriveSettings, now_s: Callable[[], float], arm: ArmSettings) -> None:
        self.settings = drive
        self.machine = MasterMachine()
        self.target_counts = 0
        self.offset_permille = 0
        self.position_counts = 0
        self.effort = 0
        self.lost = False
        self._now_s = now_s
        self._max_missing = arm.max_missing_cycles
        self._cycle_s, self._still_counts = arm.cycle_s, 0.0
        self._interpolates = drive.mode is OperationMode.INTERPOLATED_POSITION
        self._missing = 0
        self._still_cycles = 0
        self._emergency: emergency.Emergency | None = None
        self._undefined: StatuswordError | None = None

    def begin(self, counts_per_rad: float, course: AxisCourse) -> None:
        """Reset everything for a new start of cycles.

        Args:
            counts_per_rad: Position units per radian of the axis.
        """
        self.machine = MasterMachine()
        self.course = course
        self._carried = False
        self._evaluated_s = self._now_s()
        self.lost = False
        self._still_counts = STANDSTILL_RAD_S * self._cycle_s * abs(counts_per_rad)
        self._missing = self._still_cycles = 0
        self._emergency = self._undefined = None

    @abstractmethod
    def require_configured(self) -> None:
        """Refuse a drive that has restarted since it was configured: it may have lost what was written to it.

        Raises:
            ServoError: it has restarted.
        """

    @property
    @abstractmethod
    def restarted(self) -> bool:
        """Whether it has restarted since it was configured."""

    @abstractmethod
    def leave_cycle(self) -> None:
        """Let the drive answer SDO and ignore further setpoints."""

    @abstractmethod
    def restart(self) -> None:
        """Restart the drive, which removes its torque."""

    def ask(self, goal: State, step: str) -> None:
        """Request a state.

        Raises:
            ServoError: the present state does not allow it.
        """
        try:
            self.machine.request(goal)
        except TransitionError as error:
            raise self._error(step, str(error), "Disable the arm, and enable it again") from error

    def controlword(self, now_s: float) -> int:
        """Controlword of this cycle."""
        machine = self.machine
        word = machine.controlword(now_s)
        if self._interpolates and machine.state is _ENABLED is machine.goal:
            word |= _ENABLE_INTERPOLATION
        return word

    def _receive(self, statusword: int, counts: int, effort: int, target: int, now_s: float, elapsed_s: float) -> None:
        """Process the feedback of a cycle.

        Args:
            statusword: 6041.
            counts: Actual position.
            effort: Actual effort.
            target: The target that was in force when they were sampled, in counts.
            now_s: Time of the cycle.
            elapsed_s: Time since the feedback before.
        """
        self._missing = 0
        self.lost = False
        self.effort = effort
        still = abs(counts - self.position_counts) <= self._still_counts
        self._still_cycles = self._still_cycles + 1 if still else 0
        self.position_counts = counts
        machine = self.machine
        if statusword != machine.statusword or machine.state is not machine.goal:
            try:
                machine.receive(statusword, now_s)
            except StatuswordError as error:
                self._undefined = error
            else:
                self._undefined = None
        state = machine.state
        if state is _ENABLED or state in POWERED:
            course = self.course
            if not self._carried:
                self._carried = True
                course.begin(counts)
            if state is not _ENABLED:
                course.slow_down()
            course.follow(target, counts, effort, elapsed_s)
        else:
            self._carried = False

    def take_position(self, counts: int, asked_s: float, now_s: float) -> None:
        """Process a position that was read by SDO while feedback is missing: the drive should slow down.

        Args:
            counts: The position.
            asked_s: Time of the request; the position was sampled after it.
            now_s: Time of the answer.
        """
        elapsed_s, longest_s, self._evaluated_s = asked_s - self._evaluated_s, now_s - self._evaluated_s, asked_s
        still = abs(counts - self.position_counts) <= self._still_counts * max(1.0, longest_s / self._cycle_s)
        self._still_cycles = self._still_cycles + 1 if still else 0
        self.position_counts = counts
        if self._carried:
            self.course.slow_down()
            self.course.follow(self.target_counts, counts, self.effort, elapsed_s, longest_s)

    @property
    def statusword(self) -> int:
        """Last statusword, 0 before the first."""
        return self.machine.statusword or 0

    @property
    def state(self) -> State | None:
        """Last power state."""
        return self.machine.state

    @property
    def faulty(self) -> bool:
        """Whether the drive is in FAULT or FAULT REACTION ACTIVE."""
        return self.machine.state in _FAULTY

    @property
    def follows(self) -> bool:
        """Whether the drive is enabled and follows setpoints."""
        active = not self._interpolates or bool(self.statusword & _INTERPOLATION_ACTIVE)
        return self.machine.state is _ENABLED and active

    # Problems ------------------------------------------------------------------------------------------------

    @abstractmethod
    def in_order(self, now_s: float) -> bool:
        """Whether this drive is enabled and `problem` is None; takes a fifth of its time.

        Args:
            now_s: Time of the cycle.
        """

    def problem(self, step: str, now_s: float, *, must_follow: bool) -> ServoError | None:
        """The most serious problem of this drive in this cycle; None if there is none.

        Args:
            step: The step in progress, for the error.
            now_s: Time of the cycle.
            must_follow: Whether the drive was enabled and must stay so.
        """
        found = self.astray(step) if self.course.lost else self._fault(step) or self._contradiction(step)
        found = found or self._missed(step, now_s)
        if found is None and must_follow and self.machine.state is not _ENABLED:
            return self._error(
                step,
                f"the drive has left OPERATION ENABLED, it is in {self._state_text}",
                "If its enable input or the emergency stop was used, disable and enable again",
            )
        return found

    def _contradiction(self, step: str) -> ServoError | None:
        """Error for feedback that cannot be from one drive that follows the standard."""
        if self._undefined is not None:
            return self._error(step, str(self._undefined), "Does this drive send 6041 as mapped? See its manual")
        return None

    @abstractmethod
    def _missed(self, step: str, now_s: float) -> ServoError | None:
        """Error for a drive that does not take part in the cycles as it should; it is marked as lost."""

    def astray(self, step: str) -> LoopLost:
        """Error for an axis that has left its course."""
        return loop_lost(self.settings, step, self.course.lost)

    def not_in_time(self, step: str, limit_s: float, now_s: float) -> ServoTimeout:
        """Error for a state that was not reached."""
        goal = "the requested state" if self.machine.goal is None else self.machine.goal.title
        return self._timeout(
            step,
            f"{goal} and standstill not reached within {limit_s} s, the drive has been in {self._state_text} "
            f"for {now_s - self.machine.since_s:.2f} s",
            "Is its power stage powered, safe torque off inactive, and its brake able to release?",
        )

    def gone(self, step: str) -> ServoTimeout:
        """Error for a drive whose feedback has stopped; marks the drive as lost."""
        self.lost = True
        remedy = f"Check the drive's supply and cable. Allowed are {self._max_missing} (max_missing_cycles)"
        return self._timeout(step, f"no feedback for {self._missing} cycles", remedy)

    def _fault(self, step: str) -> ServoError | None:
        """Error for a fault that the drive itself reports."""
        if not self.faulty and self._emergency is None:
            return None
        cause = "no emergency message gave a cause" if self._emergency is None else self._emergency.text
        return self._error(
            step,
            f"the drive reports a fault: {cause}; it is in {self._state_text}",
            "Remove the cause, then reset the fault (`armload drives reset`) and enable again",
            ServoFault,
        )

    def forget_rest(self) -> None:
        """From now on the axis may move."""
        self._still_cycles = 0

    def still_for(self, cycles: int) -> bool:
        """Whether the axis has been at standstill for this many cycles."""
        return self._still_cycles >= cycles

    @property
    def is_silent(self) -> bool:
        """Whether the last SYNC's feedback is missing."""
        return self._missing > 0

    @property
    def is_gone(self) -> bool:
        """Whether feedback has stopped for longer than allowed."""
        return self._missing > self._max_missing

    @property
    def _state_text(self) -> str:
        """State and statusword, for errors."""
        if self.machine.state is None:
            return "an unknown state"
        return f"{self.machine.state.title} (statusword 0x{self.statusword:04X})"

    def _error(self, step: str, what: str, remedy: str, kind: type[ServoError] = ServoError) -> ServoError:
        """Error of this drive."""
        return kind(self.settings.node_id, self.settings.joint, step, what, remedy)

    def _timeout(self, step: str, what: str, remedy: str) -> ServoTimeout:
        """Timeout error of this drive."""
        return ServoTimeout(self.settings.node_id, self.settings.joint, step, what, remedy)
