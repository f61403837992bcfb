"""Cycles over all drives of one arm, on either bus: added torque that fades, and the errors of drives."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from armload_drivers.cia402.arm_settings import ArmSettings, EffortFeedback
from armload_drivers.cia402.axis_course import axis_courses
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.cia402.process_data.offset_fade import OffsetFade
from armload_drivers.cia402.state_machine import State
from armload_drivers.cyclic.cyclic_drive import CyclicDrive
from armload_drivers.driver_errors import DriverError, ForeignMaster, LoopLost, ServoFault
from armload_drivers.servos import JointFeedback

Drive = TypeVar("Drive", bound=CyclicDrive)


class ArmCycle(ABC, Generic[Drive]):
    """Cycles over all drives of one arm.

    Args:
        nodes: Its drives.
        units: Conversion of setpoints and feedback.

    Attributes:
        nodes: Its drives.
        units: Conversion of setpoints and feedback.
        number: Number of cycles so far.
    """

    def __init__(self, arm: ArmSettings, nodes: Sequence[Drive], units: ArmUnits) -> None:
        self.nodes = nodes
        self.number = 0
        self.units = units
        self._arm, self._cycle_s = arm, arm.cycle_s
        self._with_current = units.feedback is EffortFeedback.CURRENT
        self._fade: OffsetFade | None = None
        self._none_missing = np.zeros(len(nodes), dtype=np.bool_)
        self._none_missing.setflags(write=False)
        self._words: list[int | None] = []
        self._word_array: NDArray[np.uint16]

    @abstractmethod
    def begin(self) -> None:
        """Start the drives and the periods."""

    @abstractmethod
    def end(self) -> None:
        """End the exchange of process data."""

    @abstractmethod
    def now_s(self) -> float:
        """Time of the clock of the cycles."""

    @abstractmethod
    def run(self) -> JointFeedback:
        """One cycle, without fault checks.

        Raises:
            BusError: the bus failed.
        """

    @abstractmethod
    def await_restart(self, nodes: Sequence[CyclicDrive], limit_s: float) -> None:
        """Wait until drives have restarted, or the time is over.

        Raises:
            BusError: the bus failed.
        """

    @property
    @abstractmethod
    def rivals(self) -> tuple[str, str]:
        """What another master was heard to command and to ask, as text; empty if nothing."""

    def _line_problems(self) -> list[DriverError]:
        """What is wrong with the bus itself in this cycle."""
        return []

    def _explain(self, suspects: Sequence[Drive]) -> None:
        """Find out more about drives that are not in order, without delaying the cycle by much."""

    def meanwhile(self, action: Callable[[], None]) -> None:
        """Do something that waits for a drive. Raises what it raises."""
        action()

    def _begin_drives(self) -> None:
        """Reset all drives for a new start of cycles."""
        self._fade = None
        courses = axis_courses(self._arm, self.units)
        for node, axis, course in zip(self.nodes, self.units.axes, courses, strict=True):
            node.begin(axis.counts_per_rad, course)

    def _fade_offsets(self) -> None:
        """Offsets of the next cycle, if they are being faded."""
        if self._fade is not None:
            for node, permille in zip(self.nodes, self._fade.next(), strict=True):
                node.offset_permille = permille

    def _feedback(self, time_s: float, missing: list[bool], skipped: int) -> JointFeedback:
        """Feedback of the drives in SI units."""
        nodes, units = self.nodes, self.units
        position_rad = units.joint_position_rad([node.position_counts for node in nodes])
        effort = [node.effort for node in nodes]
        current_a = units.motor_current_a(effort) if self._with_current else None
        torque_nm = None if self._with_current else units.joint_torque_nm(effort)
        words = [node.machine.statusword for node in nodes]
        if words != self._words:  # the read-only array of the last cycle serves if none has changed
            self._words, self._word_array = words, np.array([word or 0 for word in words], dtype=np.uint16)
            self._word_array.setflags(write=False)
        lacking = np.array(missing) if True in missing else self._none_missing
        # by position: keywords take three times as long
        return JointFeedback(
            self.number, time_s, position_rad, None, current_a, torque_nm, self._word_array, lacking, skipped
        )

    def fade_offsets(self) -> None:
        """From the next cycle on, fade all torque offsets to zero, in every drive state. Idempotent."""
        if self._fade is None:
            self._fade = OffsetFade([node.offset_permille for node in self.nodes], self._cycle_s)

    @property
    def fading(self) -> bool:
        """Whether torque offsets are being faded to zero."""
        return self._fade is not None and not self._fade.done

    def count(self, limit_s: float) -> int:
        """A time limit in cycles."""
        return max(1, math.ceil(limit_s / self._cycle_s))

    def run_checked(self, step: str, *, must_follow: bool) -> JointFeedback:
        """One cycle with fault checks; the likely cause is raised, and other drives' problems are added as notes.

        Args:
            step: The step in progress, for the error.
            must_follow: Whether every drive was enabled and must stay so.

        Raises:
            DriverError: of the drive or bus that is the likely cause.
            ForeignMaster: another node sends what only the master may send.
            BusError: the bus failed.
        """
        feedback = self.run()
        time_s, problems = feedback.time_s, self._line_problems()
        suspects = [node for node in self.nodes if not node.in_order(time_s)]
        if suspects:
            self._explain(suspects)
            found = (node.problem(step, time_s, must_follow=must_follow) for node in suspects)
            problems += [problem for problem in found if problem is not None]
        if problems:
            # The first of these is the cause; simultaneous problems of other drives are usually its consequence.
            problems.sort(key=lambda problem: (not isinstance(problem, LoopLost), not isinstance(problem, ServoFault)))
            for other in problems[1:]:
                problems[0].add_note(f"At the same time: {other}")
            for text in self.rivals:
                if text:
                    problems[0].add_note(text)
            raise problems[0]
        commands, _ = self.rivals
        if commands:
            raise ForeignMaster(commands)
        return feedback

    def ask(self, goal: State, step: str, of: Callable[[Drive], bool]) -> None:
        """Request a state from the drives that meet a condition and are not in a fault.

        Raises:
            ServoError: a drive's state does not allow it.
        """
        for node in self.nodes:
            if of(node) and not node.faulty:
                node.ask(goal, step)
