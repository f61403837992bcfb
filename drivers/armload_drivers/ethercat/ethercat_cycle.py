"""The cycle of the EtherCAT master: one frame that carries setpoints out and feedback in, and what is wrong with it.

Rules of this file:
- Feedback counts only if the frame returned and its working counter is right. Otherwise the cycle's inputs are
  discarded: they are those of the frame before.
- The working counter says that somebody did not take part, not who: then the drives' states are read at once. They are
  also read every `STATE_S`, because a right counter does not prove that a drive is in OP.
- Of drives that have left OP no fixed share of the counter is expected: some ESCs close the outputs, some do not.
- Nothing here waits for a mailbox: requests are made by a thread beside the cycle (`meanwhile`, `CoeSdo.ask`).
- Inputs were sampled when the drives received the frame before: their time is that of the frame before.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future, wait
from contextlib import suppress

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.cyclic.arm_cycle import ArmCycle
from armload_drivers.cyclic.cyclic_drive import CyclicDrive
from armload_drivers.deadline_clock import DeadlineClock
from armload_drivers.driver_errors import BusError, DriverError, FramesLost, LinkDown, ServoTimeout, WorkingCounterWrong
from armload_drivers.ethercat.ethercat_drive import EthercatDrive
from armload_drivers.ethercat.ethercat_line import EthercatLine, LineState, MailboxAbort, MailboxSilence, line_state_of
from armload_drivers.ethercat.network_interface import FrameMonitor, is_running
from armload_drivers.servos import JointFeedback

FRAME_SHARE = 0.6
"""Share of the cycle in which the frame must return; the rest is left to the caller."""
STATE_S = 0.02
"""Time between two reads of the drives' states."""
STATE_TRIES = 4
"""A drive is missing if so many readings of its state find none: a reading that is not scheduled in time finds none."""
RIVAL_S = 0.01
"""Time between two looks for another master's frames: to find none costs 10 us of CPU."""
POLL_S = 0.05
"""Time between two looks into a mailbox, drive by drive, for emergency messages."""
EXPLAIN_S = 5e-3
"""Longest wait for the cause of a fault (603F) per drive in a fault, before it is reported without. A busy computer may
take as long to begin with the first drive, so the time of all of them counts together."""
LOSS_WINDOW = 500
"""Frames over which the share of lost ones is measured."""
LOSS_LIMIT = 0.05
"""Greatest share of frames that may be lost over the window. A sound cable loses none in hours; twice as much would let
three in a row be lost every few minutes at 500 Hz."""
_OUTPUTS_AND_INPUTS = 3
"""Share of a drive of the working counter: 1 for inputs read, 2 for outputs written."""


class EthercatCycle(ArmCycle[EthercatDrive]):
    """Cycles over all drives of one arm.

    Args:
        nodes: Its drives.
        units: Conversion of setpoints and feedback.
        clock: Decides when frames are sent.
        worker: One thread for requests beside the cycle.

    Attributes:
        lost: Number of frames that did not return in time.
        wrong: Number of frames with a wrong working counter.
        sent: Number of frames.
    """

    def __init__(
        self,
        arm: ArmSettings,
        nodes: Sequence[EthercatDrive],
        units: ArmUnits,
        *,
        line: EthercatLine,
        clock: DeadlineClock,
        worker: Executor,
    ) -> None:
        super().__init__(arm, nodes, units)
        self.lost = self.wrong = self.sent = 0
        self._line, self._clock, self._worker = line, clock, worker
        self._monitor: FrameMonitor | None = None
        self._max_missing = arm.max_missing_cycles
        self._limit_s = FRAME_SHARE * arm.cycle_s
        self._lost_row = self._wrong_row = self._counter = 0
        self._lately = [False] * LOSS_WINDOW
        self._states_due_s = self._poll_due_s = self._listen_due_s = self._last_s = 0.0
        self._polled: Future[None] | None = None
        self._next_polled = 0
        self._all_in = True
        self._rival = ""

    def begin(self) -> None:
        """SAFEOP, first frames with valid outputs, OP; the drives' watchdogs count from the first frame on.

        Raises:
            ServoTimeout: a drive does not reach OP.
            BusError: the bus failed.
        """
        self._begin_drives()
        self._lost_row = self._wrong_row = 0
        self._lately = [False] * LOSS_WINDOW
        self._all_in, self._rival = True, ""
        self._clock.begin(self._cycle_s)
        for state in (LineState.SAFEOP, LineState.OP):
            self._line.request(state)
            self._reach(state)
        self._last_s = self._clock.now_s()
        self.read_states()
        self._monitor = self._monitor or FrameMonitor(self._line.interface)
        self._monitor.commands_only()

    def _reach(self, state: LineState) -> None:
        """Run frames until all drives are in a state."""
        limit_s, statuses = 3.0, [0]
        for _ in range(self.count(limit_s)):
            self._clock.next()
            for node in self.nodes:
                node.prepare(self._clock.now_s())
            self._line.exchange(self._limit_s)
            statuses = self._line.statuses()
            if all(statuses[node.place] == state.value for node in self.nodes):
                return
        late = next(node for node in self.nodes if statuses[node.place] != state.value)
        raise ServoTimeout(
            late.settings.node_id,
            late.settings.joint,
            "starting the cycle",
            f"{state.name} not reached within {limit_s:g} s, the drive is in "
            f"{line_state_of(statuses[late.place]).name}: {self._line.reason(late.place)}",
            "Does it accept the mapping, the cycle and its synchronisation (1C32)? See its manual",
        )

    def end(self) -> None:
        """PREOP: no process data, and no watchdog."""
        self._line.request(LineState.PREOP)
        for node in self.nodes:
            self._line.reaches(LineState.PREOP, node.place, 1.0)
        self.read_states()

    def close(self) -> None:
        """Stop listening for other masters."""
        if self._monitor is not None:
            self._monitor.close()
            self._monitor = None

    def now_s(self) -> float:
        """Time of the frames' clock."""
        return self._clock.now_s()

    def read_states(self, *, all_answered: bool = False) -> None:
        """Read the EtherCAT states of all drives.

        Args:
            all_answered: Whether a frame has just proved that no drive is missing: then it is the reading that failed.
        """
        for _ in range(1 if all_answered else STATE_TRIES):
            statuses = self._line.statuses()
            if LineState.NONE not in statuses:
                break
        for node in self.nodes:
            status = statuses[node.place]
            if status or not all_answered:
                node.status = status
        self._all_in = all(node.in_op for node in self.nodes)

    def run(self) -> JointFeedback:
        """One cycle, without fault checks.

        Raises:
            LinkDown: the cable is unplugged.
            CommandError: outputs have a wrong length.
        """
        line, nodes = self._line, self.nodes
        time_s, skipped = self._clock.next()
        self._fade_offsets()
        for node in nodes:
            node.prepare(time_s)
        counter = self._counter = line.exchange(self._limit_s)
        self.number += 1
        self.sent += 1
        lost, complete = counter < 0, counter == line.expected_counter
        self.lost += lost
        self._lost_row = self._lost_row + 1 if lost else 0
        self._lately[self.number % LOSS_WINDOW] = lost
        if lost:
            self._require_link()
        elif not complete:
            self.read_states()
            self._states_due_s = time_s + STATE_S
            self.wrong += self._all_in
        elif time_s >= self._states_due_s:
            self.read_states(all_answered=True)
            self._states_due_s = time_s + STATE_S
        # With drives outside OP the counter is smaller by an unknown share: the others must make up at least theirs.
        others = sum(node.in_op for node in nodes) * _OUTPUTS_AND_INPUTS
        trusted = complete or (not lost and not self._all_in and counter >= others > 0)
        self._wrong_row = 0 if complete or lost or trusted else self._wrong_row + 1
        missing = [True] * len(nodes)
        for index, node in enumerate(nodes):
            if trusted and node.in_op:
                node.evaluate(time_s)
                missing[index] = False
            else:
                node.miss()
        self._listen(time_s)
        self._poll(time_s)
        sampled_s, self._last_s = self._last_s, time_s
        return self._feedback(sampled_s, missing, skipped)

    def _require_link(self) -> None:
        """Refuse to go on without a cable."""
        if not is_running(self._line.interface):
            raise LinkDown(
                f"interface {self._line.interface} has no link: the cable to the first drive is unplugged or broken, "
                "or this drive has no supply; the drives' watchdogs stop the arm"
            )

    def _line_problems(self) -> list[DriverError]:
        """What is wrong with the frames themselves, beyond what may be."""
        found: list[DriverError] = []
        if self._lost_row > self._max_missing:
            found.append(
                FramesLost(
                    f"{self._lost_row} frames in a row did not return within {1e3 * self._limit_s:.1f} ms; allowed are "
                    f"{self._max_missing} (max_missing_cycles). Check cables, plugs and the interface's driver"
                )
            )
        lately = sum(self._lately)
        if lately > LOSS_LIMIT * LOSS_WINDOW:
            found.append(
                FramesLost(
                    f"{lately} of the last {LOSS_WINDOW} frames did not return in time; allowed are "
                    f"{LOSS_LIMIT * LOSS_WINDOW:.0f}. Check cables, plugs and the interface's driver"
                )
            )
        if self._wrong_row > self._max_missing:
            found.append(
                WorkingCounterWrong(
                    f"the working counter is {self._counter} instead of {self._line.expected_counter}, "
                    f"{self._wrong_row} frames in a row, although all drives report OP: a drive does not take part in "
                    f"the frame. Check its mapping and its cable; allowed are {self._max_missing} (max_missing_cycles)"
                )
            )
        return found

    def _listen(self, time_s: float) -> None:
        """Take frames of another master that were received since the last look."""
        if self._monitor is None or self._rival or time_s < self._listen_due_s:
            return
        self._listen_due_s = time_s + RIVAL_S
        with suppress(BusError):
            frame = self._monitor.receive()
            if frame is not None:
                self._rival = (
                    f"another master sends EtherCAT frames on {self._line.interface} (command {frame[16]}). Two "
                    "masters cannot share an arm: stop the other program"
                )

    @property
    def rivals(self) -> tuple[str, str]:
        """What is known of another master that was heard since cycles run; empty if there is none."""
        return self._rival, ""

    def await_restart(self, nodes: Sequence[CyclicDrive], limit_s: float) -> None:
        """`EthercatDrive.restart` has waited."""

    # Beside the cycle ----------------------------------------------------------------------------------------

    def meanwhile(self, action: Callable[[], None]) -> None:
        """Do something that waits for a drive in the thread beside the cycle, while frames go on."""
        done = self._worker.submit(action)
        while not done.done():
            try:
                self.run()
            except BusError:
                time.sleep(self._cycle_s)
        done.result()

    def _poll(self, now_s: float) -> None:
        """Have the next mailbox looked into, if the last look is over."""
        if now_s < self._poll_due_s or not (self._polled is None or self._polled.done()):
            return
        self._poll_due_s = now_s + POLL_S
        node = self.nodes[self._next_polled]
        self._next_polled = (self._next_polled + 1) % len(self.nodes)
        if node.in_op:
            self._polled = self._worker.submit(self._line.poll_mailbox, node.place)

    def _explain(self, suspects: Sequence[EthercatDrive]) -> None:
        """Ask drives in a fault for its cause, and wait for a short time."""

        def ask(node: EthercatDrive) -> None:
            with suppress(MailboxAbort, MailboxSilence):
                code = self._line.upload(node.place, od.ERROR_CODE.index, 0, EXPLAIN_S)
                node.explain(int.from_bytes(code[:2], "little"))

        asked = [self._worker.submit(ask, node) for node in suspects if node.unexplained]
        for answered in wait(asked, EXPLAIN_S * len(asked)).done:
            answered.result()
