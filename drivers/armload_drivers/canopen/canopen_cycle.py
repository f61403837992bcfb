"""The cycle of the CANopen master: setpoints out, heartbeat, SYNC, feedback in, and the errors of drives.

It waits only for the next SYNC and its feedback, allocates no messages, and uses no SDO. Measured with six joints in
lockstep: 60 us of the calling thread's time (`benchmarks/timing/cycle_time.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable

import can
import numpy as np

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.rival_master import ForeignTraffic
from armload_drivers.bus.sync_sources import SyncSource
from armload_drivers.canopen.drive_node import DriveNode
from armload_drivers.canopen.rhythm import Rhythm
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings, EffortFeedback
from armload_drivers.cia402.axis_course import axis_courses
from armload_drivers.cia402.object_dictionary import NmtCommand, NmtState
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.cia402.process_data.offset_fade import OffsetFade
from armload_drivers.cia402.state_machine import State
from armload_drivers.driver_errors import ForeignMaster, LoopLost, ServoFault
from armload_drivers.servos import JointFeedback

LOAD_WINDOW_S = 1.0
"""Time over which the bus load is measured."""


_STALLED_CYCLES = 3


class CanopenCycle:
    """Cycles over all drives of one arm.

    Args:
        arm: The arm.
        nodes: Its drives.
        link: The bus.
        sync: Source of SYNC.
        units: Conversion of setpoints and feedback.
        rhythms: Those of SYNC and of the feedback.

    Attributes:
        nodes: Its drives.
        units: Conversion of setpoints and feedback.
        number: Number of SYNCs so far.
        foreign: Detects frames from other nodes that only the master may send.
        bus_load: Measured share of the bus over the last second, every frame counted at its worst-case length.
    """

    def __init__(
        self,
        arm: ArmSettings,
        nodes: list[DriveNode],
        link: BusLink,
        sync: SyncSource,
        units: ArmUnits,
        rhythms: tuple[Rhythm, Rhythm],
    ) -> None:
        self.nodes = nodes
        self.number = 0
        self.units = units
        self.bus_load = 0.0
        self._arm = arm
        self.foreign = ForeignTraffic(arm, link, sync_is_ours=sync.heard)
        self._sync_counter = arm.sync_counter
        self._bitrate = arm.bitrate
        self._load_since_s, self._load_bits = 0.0, 0
        self._cycle_s, self._heartbeat_s = arm.cycle_s, arm.heartbeat_s
        self._with_current = units.feedback is EffortFeedback.CURRENT
        self._link, self._sync = link, sync
        self._sync_rhythm, self._feedback_rhythm = rhythms
        self._heartbeat = can.Message(
            arbitration_id=od.HEARTBEAT_BASE + arm.master_node_id,
            data=[NmtState.OPERATIONAL.value],
            is_extended_id=False,
        )
        self._heartbeat_due_s = self._looked_s = 0.0
        self._fade: OffsetFade | None = None
        self._none_missing = np.zeros(len(nodes), dtype=np.bool_)
        self._none_missing.setflags(write=False)
        self._offset_frames = [(node, node.offset_message) for node in nodes if node.offset_message is not None]

    def begin(self) -> None:
        """Start the nodes and the periods; frames received before are discarded."""
        self._link.drain()
        self._fade = None
        courses = axis_courses(self._arm, self.units)
        for node, axis, course in zip(self.nodes, self.units.axes, courses, strict=True):
            node.begin(axis.counts_per_rad, course)
            self._link.command(NmtCommand.START, node.settings.node_id)
        self.foreign.forget()
        self._sync_rhythm.begin()
        self._feedback_rhythm.begin()
        self._sync.begin(self._link, self._cycle_s, self._sync_counter)
        self._heartbeat_due_s = self._looked_s = self._sync.now_s()

    def end(self) -> None:
        """End PDO communication."""
        self._sync.end(self._link)
        for node in self.nodes:
            self._link.command(NmtCommand.PRE_OPERATIONAL, node.settings.node_id)

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

    def now_s(self) -> float:
        """Time of the clock of SYNC."""
        return self._sync.now_s()

    def run(self) -> JointFeedback:
        """One cycle, without fault checks.

        Raises:
            BusError: the bus failed.
        """
        link, sync, nodes = self._link, self._sync, self.nodes
        now_s = sync.now_s()
        if self._fade is not None:
            for node, permille in zip(nodes, self._fade.next(), strict=True):
                node.offset_permille = permille
        for node in nodes:
            link.send(node.prepare(now_s))
        for node, message in self._offset_frames:
            link.send(node.prepare_offset(message))
        if now_s >= self._heartbeat_due_s:
            link.send(self._heartbeat)
            self._heartbeat_due_s = now_s + self._heartbeat_s
        tick = sync.next(link, self._expect_feedback)
        self._sync_rhythm.note(tick.time_s)
        sync.await_feedback(link, self._complete)
        if link.stamp_s:
            self._feedback_rhythm.note(link.stamp_s)
        away_s = sync.now_s() - self._looked_s
        if away_s > _STALLED_CYCLES * self._cycle_s:
            # This process was not running, and perhaps no other on this computer was. Frames that the drives sent in
            # this time are read before the drives are checked, and their silence during it is excused.
            link.drain()
            for node in nodes:
                node.excuse_silence(away_s)
        self._looked_s = sync.now_s()
        self.number += 1
        missing = [node.evaluate(tick.time_s) for node in nodes]
        if tick.time_s - self._load_since_s >= LOAD_WINDOW_S:
            self._measure_load(tick.time_s)
        effort = [node.effort for node in nodes]
        with_current = self._with_current
        return JointFeedback(
            cycle=self.number,
            time_s=tick.time_s,
            position_rad=self.units.joint_position_rad([node.position_counts for node in nodes]),
            velocity_rad_s=None,
            current_a=self.units.motor_current_a(effort) if with_current else None,
            torque_nm=None if with_current else self.units.joint_torque_nm(effort),
            statusword=np.array([node.machine.statusword or 0 for node in nodes], dtype=np.uint16),
            missing=np.array(missing) if True in missing else self._none_missing,
            skipped_cycles=tick.skipped,
        )

    def run_checked(self, step: str, *, must_follow: bool) -> JointFeedback:
        """One cycle with fault checks; the likely cause is raised, and other drives' problems are added as notes.

        Args:
            step: The step in progress, for the error.
            must_follow: Whether every drive was enabled and must stay so.

        Raises:
            ServoError: of the drive that is the likely cause.
            ForeignMaster: another node sends what only the master may send.
            BusError: the bus failed.
        """
        feedback = self.run()
        problems = [
            problem
            for node in self.nodes
            if not node.in_order(feedback.time_s)
            and (problem := node.problem(step, feedback.time_s, must_follow=must_follow)) is not None
        ]
        if problems:
            # The first of these is the cause; simultaneous problems of other drives are usually its consequence.
            problems.sort(key=lambda problem: (not isinstance(problem, LoopLost), not isinstance(problem, ServoFault)))
            for other in problems[1:]:
                problems[0].add_note(f"At the same time: {other}")
            for text in (self.foreign.commands, self.foreign.requests):
                if text:
                    problems[0].add_note(text)
            raise problems[0]
        if self.foreign.commands:
            raise ForeignMaster(self.foreign.commands)
        return feedback

    def ask(self, goal: State, step: str, of: Callable[[DriveNode], bool]) -> None:
        """Request a state from the drives that meet a condition and are not in a fault.

        Raises:
            ServoError: a drive's state does not allow it.
        """
        for node in self.nodes:
            if of(node) and not node.faulty:
                node.ask(goal, step)

    def _expect_feedback(self) -> None:
        """Feedback from now on belongs to this SYNC, earlier feedback does not."""
        for node in self.nodes:
            node.expect()

    def _measure_load(self, now_s: float) -> None:
        """Complete one measurement of the bus load."""
        bits = self._link.bits - self._load_bits
        self._load_bits = self._link.bits
        if self._load_since_s:
            self.bus_load = bits / (self._bitrate * (now_s - self._load_since_s))
        self._load_since_s = now_s

    def _complete(self) -> bool:
        """Whether the feedback of all drives that are not lost is complete."""
        return all([node.arrived >= node.expected or node.lost for node in self.nodes])  # noqa: C419 - faster than a generator
