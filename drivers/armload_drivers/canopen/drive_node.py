"""The master's record of one drive while cycles run: its frames, its state, and its problems."""

from __future__ import annotations

import can

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.sync_sources import SyncSource
from armload_drivers.cia402 import emergency
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import DriveSettings, OperationMode
from armload_drivers.cia402.axis_brakes import STANDSTILL_RAD_S
from armload_drivers.cia402.axis_course import AxisCourse, loop_lost
from armload_drivers.cia402.drive_safety import HEARTBEAT_TOLERANCE
from armload_drivers.cia402.object_dictionary import NmtState, PdoDirection
from armload_drivers.cia402.process_data.process_image import DriveImage
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
_TWIN_CYCLES = 2
"""One frame too many may be a drive's first, sent when it enters OPERATIONAL."""
_OPERATIONAL = NmtState.OPERATIONAL.value
_IN_ORDER = (None, _OPERATIONAL)
_STATE_NAMES = {state.value: state.name.replace("_", "-") for state in NmtState}


class DriveNode:
    """One drive in the cycle.

    Args:
        drive: Its settings.
        image: Its PDOs.
        link: The bus.
        sync: Provides the clock for heartbeats.
        cycle_s: Duration of a cycle.
        heartbeat_s: Heartbeat period.
        max_missing_cycles: Greatest number of consecutive cycles in which feedback may be missing.

    Attributes:
        settings: Its settings.
        machine: Its power state.
        course: The predicted course of its axis; set by `begin`.
        step: The greatest distance between two setpoints, in counts; set by `begin`.
        message: The RPDO.
        offset_message: A second RPDO for the torque offset; None if `message` contains it, or there is no offset.
        target_counts: Target position of the next RPDO.
        offset_permille: Torque offset of the next RPDO.
        position_counts: Last actual position.
        effort: Last actual current or torque, in the units of its object.
        arrived: Number of feedback frames received since this SYNC.
        expected: Number of feedback frames per SYNC.
        booted: Whether a boot-up message was received since the drive was configured.
        lost: Whether it was reported to the caller as not answering.
        heartbeat_limit_s: Longest permitted time without a heartbeat.
        wrong_frames: Number of feedback frames with a wrong length; they count as missing.
    """

    course: AxisCourse
    step: float

    def __init__(
        self,
        drive: DriveSettings,
        image: DriveImage,
        link: BusLink,
        sync: SyncSource,
        *,
        cycle_s: float,
        heartbeat_s: float,
        max_missing_cycles: int,
    ) -> None:
        self.settings = drive
        self.machine = MasterMachine()
        self.message = can.Message(
            arbitration_id=image.rpdo.cob_id, data=bytes(image.rpdo.length), is_extended_id=False
        )
        self.offset_message: can.Message | None = None
        if image.offset is not None:
            self.offset_message = can.Message(
                arbitration_id=image.offset.cob_id, data=bytes(image.offset.length), is_extended_id=False
            )
            self._pack_offset = image.offset.format.pack_into
        self.target_counts = 0
        self.offset_permille = 0
        self.position_counts = 0
        self.effort = 0
        self.arrived = 0
        self.expected = sum(layout.direction is PdoDirection.TRANSMIT for layout in image.layouts)
        self.booted = False
        self.lost = False
        self.wrong_frames = 0
        self._sync = sync
        self.heartbeat_limit_s = HEARTBEAT_TOLERANCE * heartbeat_s
        self._max_missing = max_missing_cycles
        self._cycle_s, self._still_rad = cycle_s, STANDSTILL_RAD_S * cycle_s
        self._still_counts = 0.0
        self._pack = image.rpdo.format.pack_into
        self._unpack = image.tpdo.format.unpack
        self._length = image.tpdo.length
        self._with_offset = drive.torque_offset and image.offset is None
        self._interpolates = drive.mode is OperationMode.INTERPOLATED_POSITION
        self._frame = b""
        self._effort_frame = b""
        self._missing = 0
        self._still_cycles = 0
        self._heard_s = 0.0
        self._nmt_state: int | None = None
        self._emergency: emergency.Emergency | None = None
        self._undefined: StatuswordError | None = None
        self._late = self._surplus_cycles = 0
        node_id = drive.node_id
        link.subscribe(image.tpdo.cob_id, self._take_feedback)
        if image.effort is not None:
            self._effort_length = image.effort.length
            self._unpack_effort = image.effort.format.unpack
            link.subscribe(image.effort.cob_id, self._take_effort)
        link.subscribe(od.HEARTBEAT_BASE + node_id, self._take_heartbeat)
        link.subscribe(od.EMERGENCY_BASE + node_id, self._take_emergency)

    # Frames --------------------------------------------------------------------------------------------------

    def _take_feedback(self, data: bytearray) -> None:
        """Keep a TPDO."""
        if len(data) == self._length:
            self._frame = bytes(data)
            self.arrived += 1
            self._nmt_state = _OPERATIONAL
        else:
            self.wrong_frames += 1

    def _take_effort(self, data: bytearray) -> None:
        """Keep the second TPDO, with the effort."""
        if len(data) == self._effort_length:
            self._effort_frame = bytes(data)
            self.arrived += 1
        else:
            self.wrong_frames += 1

    def _take_heartbeat(self, data: bytearray) -> None:
        """Record the NMT state from a heartbeat or boot-up message."""
        if not data:
            return
        self._heard_s = self._sync.now_s()
        state = data[0] & 0x7F
        if state == NmtState.BOOT_UP.value:
            self.booted = True
        # A heartbeat sent before the start command took effect does not show the resulting state.
        if self._nmt_state is not None:
            self._nmt_state = state

    def _take_emergency(self, data: bytearray) -> None:
        """Keep an emergency message."""
        message = emergency.parse(bytes(data))
        if message is not None:
            self._emergency = message if message.code else None

    # The cycle -----------------------------------------------------------------------------------------------

    def begin(self, counts_per_rad: float, course: AxisCourse) -> None:
        """Reset everything for a new start of cycles.

        Args:
            counts_per_rad: Position units per radian of the axis.
            course: The course of the axis.
        """
        self.machine = MasterMachine()
        self.course, self.step = course, course.step
        self._carried = False
        self._evaluated_s = self._sync.now_s()
        self.lost = False
        self.arrived = 0
        self._still_counts = self._still_rad * abs(counts_per_rad)
        self._missing = self._still_cycles = 0
        self._late = self._surplus_cycles = 0
        self._heard_s = self._sync.now_s()
        self._nmt_state = None
        self._emergency = self._undefined = None

    def require_configured(self) -> None:
        """Refuse a drive that has rebooted since it was configured: it may have lost what was written to it.

        Raises:
            ServoError: a boot-up message was received.
        """
        if self.booted:
            raise self._error(
                "enabling",
                "the drive has rebooted since it was configured",
                "Has another program reset it, or has its supply dipped? Repeat the command: it configures the drive",
            )

    def excuse_silence(self, away_s: float) -> None:
        """Extend the wait for the next heartbeat by a time in which nothing was read."""
        self._heard_s += away_s

    def ask(self, goal: State, step: str) -> None:
        """Request a state.

        Raises:
            ServoError: the present state does not allow it.
        """
        try:
            self.machine.request(goal)
        except TransitionError as error:
            raise self._error(step, str(error), "Disable the arm, and enable it again") from error

    def prepare(self, now_s: float) -> can.Message:
        """RPDO of this cycle."""
        machine = self.machine
        word = machine.controlword(now_s)
        if self._interpolates and machine.state is _ENABLED is machine.goal:
            word |= _ENABLE_INTERPOLATION
        if self._with_offset:
            self._pack(self.message.data, 0, word, self.target_counts, self.offset_permille)
        else:
            self._pack(self.message.data, 0, word, self.target_counts)
        return self.message

    def prepare_offset(self, message: can.Message) -> can.Message:
        """The second RPDO of this cycle, with the torque offset."""
        self._pack_offset(message.data, 0, self.offset_permille)
        return message

    def expect(self) -> None:
        """SYNC: feedback from now on belongs to it. More than one frame for the last one means a twin, unless late."""
        if self.arrived == self.expected:
            self._late = self._surplus_cycles = 0
        else:
            surplus = self.arrived - self.expected
            self._surplus_cycles = self._surplus_cycles + 1 if surplus > self._late else 0
            self._late = max(0, -surplus)
        self.arrived = 0

    def evaluate(self, now_s: float) -> bool:
        """Process this cycle's feedback, or count it as missing; whether it is missing."""
        if self.arrived < self.expected:
            self._missing += 1
            return True
        self._missing = 0
        self.lost = False
        if self.expected == 1:
            statusword, counts, self.effort = self._unpack(self._frame)
        else:
            statusword, counts = self._unpack(self._frame)
            (self.effort,) = self._unpack_effort(self._effort_frame)
        still = abs(counts - self.position_counts) <= self._still_counts
        self._still_cycles = self._still_cycles + 1 if still else 0
        self.position_counts = counts
        elapsed_s, self._evaluated_s = now_s - self._evaluated_s, now_s
        if self.arrived > self.expected:  # this process was late: the last frame belongs to a later SYNC than this one
            elapsed_s *= self.arrived // self.expected
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
            course.follow(self.target_counts, counts, self.effort, elapsed_s)
        else:
            self._carried = False
        return False

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

    def in_order(self, now_s: float) -> bool:
        """Whether this drive is enabled and `problem` is None; takes a fifth of its time.

        Args:
            now_s: Time of the SYNC.
        """
        return not (
            self.machine.state is not _ENABLED
            or self.course.lost
            or self._emergency
            or self._surplus_cycles
            or self._undefined
            or self.booted
            or self._missing
            or now_s - self._heard_s > self.heartbeat_limit_s
            or self._nmt_state not in _IN_ORDER
        )

    def problem(self, step: str, now_s: float, *, must_follow: bool) -> ServoError | None:
        """The most serious problem of this drive in this cycle; None if there is none.

        Args:
            step: The step in progress, for the error.
            now_s: Time of the SYNC.
            must_follow: Whether the drive was enabled and must stay so.
        """
        fault = self.astray(step) if self.course.lost else self._fault(step) or self._contradiction(step)
        if fault is not None:
            return fault
        if self.booted:
            self.lost = True
            return self._error(
                step, "the drive has rebooted by itself", "Check its supply; then reconnect and enable again"
            )
        if self.is_gone:
            return self.gone(step)
        if now_s - self._heard_s > self.heartbeat_limit_s:
            self.lost = True
            return self._timeout(
                step,
                f"no heartbeat for {now_s - self._heard_s:.3f} s",
                "Check the drive's supply and cable",
            )
        if self._nmt_state not in _IN_ORDER:
            self.lost = True
            name = _STATE_NAMES.get(self._nmt_state, f"NMT state {self._nmt_state}")
            return self._error(
                step,
                f"the drive has left OPERATIONAL, it is in {name}",
                "Is there another master on the bus? Has the drive missed the heartbeat?",
            )
        if must_follow and self.machine.state is not _ENABLED:
            return self._error(
                step,
                f"the drive has left OPERATION ENABLED, it is in {self._state_text}",
                "If its enable input or the emergency stop was used, disable and enable again",
            )
        return None

    def _contradiction(self, step: str) -> ServoError | None:
        """Error for feedback that cannot be from one drive that follows the standard."""
        if self._surplus_cycles >= _TWIN_CYCLES:
            return self._error(
                step,
                f"more feedback arrives than one drive sends: two drives have node id {self.settings.node_id}",
                "Both obey the setpoints: give each drive a node id of its own, or unplug one",
            )
        if self._undefined is not None:
            return self._error(step, str(self._undefined), "Does this drive send 6041 as mapped? See its manual")
        return None

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
        settings = self.settings
        return ServoTimeout.no_feedback(settings.node_id, settings.joint, step, self._missing, self._max_missing)

    def _fault(self, step: str) -> ServoFault | None:
        """Error for a fault that the drive itself reports."""
        if not self.faulty and self._emergency is None:
            return None
        cause = "no emergency message gave a cause" if self._emergency is None else self._emergency.text
        return ServoFault(
            self.settings.node_id,
            self.settings.joint,
            step,
            f"the drive reports a fault: {cause}; it is in {self._state_text}",
            "Remove the cause, then reset the fault (`armload drives reset`) and enable again",
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

    def _error(self, step: str, what: str, remedy: str) -> ServoError:
        """Error of this drive."""
        return ServoError(self.settings.node_id, self.settings.joint, step, what, remedy)

    def _timeout(self, step: str, what: str, remedy: str) -> ServoTimeout:
        """Timeout error of this drive."""
        return ServoTimeout(self.settings.node_id, self.settings.joint, step, what, remedy)
