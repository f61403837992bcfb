"""The master's record of one EtherCAT drive while cycles run: its bytes in the frame, and its EtherCAT state."""

from __future__ import annotations

from armload_drivers.cia402 import emergency
from armload_drivers.cia402.arm_settings import ArmSettings, DriveSettings
from armload_drivers.cia402.axis_course import AxisCourse
from armload_drivers.cia402.process_data.frame_part import FramePart
from armload_drivers.cia402.process_data.process_image import feedback_entries, setpoint_entries
from armload_drivers.cia402.state_machine import State
from armload_drivers.cyclic.cyclic_drive import CyclicDrive
from armload_drivers.deadline_clock import DeadlineClock
from armload_drivers.driver_errors import DriveHung, DriveLeftOp, LoopLost, ServoError, ServoTimeout
from armload_drivers.ethercat.coe_sdo import CoeSdo
from armload_drivers.ethercat.ethercat_line import STATE_ERROR, EthercatLine, LineState, line_state_of

_ENABLED = State.OPERATION_ENABLED
_OP = LineState.OP.value
HUNG_CYCLES = 2
"""Inputs without a single changed bit for so many cycles, on a moving target, point to a hung firmware."""
HUNG_REQUESTS = 2
"""So many consecutive SDO requests without an answer mean that the firmware hangs if its inputs do not change."""
HUNG_S = 0.5
"""For how long they have not changed then. A mailbox alone may fail after a lost frame, while the firmware works."""
RESTART_S = 2.0
"""Limit of the way to INIT, and of that to PREOP."""


class EthercatDrive(CyclicDrive):
    """One drive in the cycle of EtherCAT.

    Args:
        sdo: SDO access to it.
        clock: Provides the time.
        arm: Settings of its arm: cycle, and cycles in which feedback may be missing.

    Attributes:
        place: Its place in the line, from 0.
        status: Its AL status when it was last read.
    """

    def __init__(
        self, drive: DriveSettings, line: EthercatLine, sdo: CoeSdo, clock: DeadlineClock, arm: ArmSettings
    ) -> None:
        super().__init__(drive, clock.now_s, arm)
        self.place = drive.node_id - 1
        self.status = _OP
        self._line, self._sdo = line, sdo
        self._with_offset = drive.torque_offset
        self._input = b""
        self._same_cycles = 0
        self._changed_s = 0.0
        self._sent_counts = 0

    def map(self, outputs: FramePart, inputs: FramePart, constants: bytes) -> None:
        """Set where its objects are in the frame.

        Args:
            constants: Its outputs with the values of those that are not sent, and zeros elsewhere.
        """
        self._pack = outputs.packer(setpoint_entries(self.settings), constants)
        self._unpack = inputs.unpacker(feedback_entries(self.settings))
        self._line.on_emergency(self.place, self._take_emergency)

    def _take_emergency(self, code: int, register: int, manufacturer: bytes) -> None:
        """Keep an emergency message."""
        self._emergency = emergency.Emergency(code, register, manufacturer) if code else None

    def explain(self, code: int) -> None:
        """Keep an error code (603F) as the cause of a fault, unless an emergency message gave one."""
        self._emergency = self._emergency or emergency.Emergency(code, None, b"")

    @property
    def unexplained(self) -> bool:
        """Whether it is in a fault of which the cause is not known."""
        return self.faulty and self._emergency is None

    @property
    def in_op(self) -> bool:
        """Whether it was in OP when its state was last read."""
        return self.status & ~STATE_ERROR == _OP

    def begin(self, counts_per_rad: float, course: AxisCourse) -> None:
        """As `CyclicDrive.begin`."""
        super().begin(counts_per_rad, course)
        self.status = _OP
        self._input, self._same_cycles = b"", 0
        self._sent_counts = self.target_counts
        self._sdo.unanswered = 0

    def require_configured(self) -> None:
        """Refuse a drive that is not in PREOP, as `connect` has left it."""
        state = line_state_of(self.status)
        if state is not LineState.PREOP:
            raise self._error(
                "enabling",
                f"the drive has restarted since it was configured: it is in {state.name}",
                "Has its supply dipped, or has another program reset it? Repeat the command: it configures the drive",
            )

    @property
    def restarted(self) -> bool:
        """Whether it does not answer under its address."""
        return line_state_of(self.status) in {LineState.NONE, LineState.INIT}

    def leave_cycle(self) -> None:
        """SAFEOP, in which a drive answers SDO, and outputs are no longer valid."""
        if line_state_of(self.status) is LineState.OP:
            self._line.request(LineState.SAFEOP, self.place)

    def restart(self) -> None:
        """INIT, and PREOP again if it answers."""
        self._line.request(LineState.INIT, self.place)
        if self._line.reaches(LineState.INIT, self.place, RESTART_S):
            self._line.request(LineState.PREOP, self.place)
            self._line.reaches(LineState.PREOP, self.place, RESTART_S)

    # The cycle -----------------------------------------------------------------------------------------------

    def prepare(self, now_s: float) -> None:
        """Put the outputs of this cycle in the frame."""
        word, target = self.controlword(now_s), self.target_counts
        data = self._pack(word, target, self.offset_permille) if self._with_offset else self._pack(word, target)
        self._line.put(self.place, data)

    def evaluate(self, now_s: float) -> None:
        """Process the inputs of a frame that is complete.

        They were sampled when the frame before was received, and belong to its target.
        """
        data = self._line.get(self.place)
        moved = self._sent_counts != self.target_counts
        if data != self._input:
            self._input, self._changed_s, self._same_cycles = data, now_s, 0
        else:
            self._same_cycles = self._same_cycles + 1 if moved else 0
        word, counts, effort = self._unpack(data)
        elapsed_s, self._evaluated_s = now_s - self._evaluated_s, now_s
        self._receive(word, counts, effort, self._sent_counts, now_s, elapsed_s)
        self._sent_counts = self.target_counts

    def miss(self) -> None:
        """Its inputs did not arrive, or are not to be trusted; it may not have received its setpoints either."""
        self._missing += 1

    # Problems ------------------------------------------------------------------------------------------------

    def in_order(self, now_s: float) -> bool:
        """Whether this drive is enabled and `problem` is None; takes a fifth of its time."""
        return not (
            self.machine.state is not _ENABLED
            or self.course.lost
            or self._emergency
            or self._undefined
            or self._missing
            or self.status != _OP
            or self._sdo.unanswered
        )

    def _missed(self, step: str, now_s: float) -> ServoError | None:
        """Error for a drive that does not answer, has left OP, or hangs; it is marked as lost."""
        state = line_state_of(self.status)
        if state is LineState.NONE:
            self.lost = True
            return self._timeout(
                step,
                "the drive has left the line: it does not answer under its address",
                "Check its supply, and the cable before it; all drives behind a broken cable are lost with it",
            )
        if state is not LineState.OP:
            self.lost = True
            return self._error(
                step,
                f"the drive has left OP, it is in {state.name}: {self._line.reason(self.place)}",
                "If its watchdog has acted, the program was not scheduled for a while; else see the drive's manual",
                DriveLeftOp,
            )
        if self._sdo.unanswered >= HUNG_REQUESTS and now_s - self._changed_s >= HUNG_S:
            return self._error(
                step,
                f"the drive answers no SDO ({self._sdo.unanswered} requests), and no bit of its feedback has changed "
                f"for {now_s - self._changed_s:.1f} s, although its frames are complete: its firmware hangs",
                "Its torque cannot be removed by this program: press the emergency stop, then switch the drive off",
                DriveHung,
            )
        return None

    def gone(self, step: str) -> ServoTimeout:
        """Error for a drive whose feedback has stopped; marks the drive as lost."""
        problem = self._missed(step, 0.0)
        return problem if isinstance(problem, ServoTimeout) else super().gone(step)

    def astray(self, step: str) -> LoopLost:
        """Error for an axis that has left its course."""
        error = super().astray(step)
        if self._same_cycles >= HUNG_CYCLES:
            error.add_note(
                f"{self.settings.joint}: not a bit of its feedback has changed for {self._same_cycles} cycles; its "
                "firmware may hang"
            )
        return error
