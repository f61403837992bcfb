"""The master's record of one CANopen drive while cycles run: its frames, its NMT state and heartbeat."""

from __future__ import annotations

import can

from armload_drivers.bus.bus_link import BusLink, data_frame
from armload_drivers.bus.sync_sources import SyncSource
from armload_drivers.cia402 import emergency
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings, DriveSettings
from armload_drivers.cia402.axis_course import AxisCourse
from armload_drivers.cia402.drive_safety import HEARTBEAT_TOLERANCE
from armload_drivers.cia402.object_dictionary import NmtCommand, NmtState, PdoDirection
from armload_drivers.cia402.process_data.process_image import drive_image
from armload_drivers.cia402.state_machine import State
from armload_drivers.cyclic.cyclic_drive import CyclicDrive
from armload_drivers.driver_errors import ServoError

_ENABLED = State.OPERATION_ENABLED
"""Cached, because Python 3.11 takes 0.3 us to look up a member of an enumeration."""
_TWIN_CYCLES = 2
"""One frame too many may be a drive's first, sent when it enters OPERATIONAL."""
_OPERATIONAL = NmtState.OPERATIONAL.value
_IN_ORDER = (None, _OPERATIONAL)
_STATE_NAMES = {state.value: state.name.replace("_", "-") for state in NmtState}


class DriveNode(CyclicDrive):
    """One drive in the cycle of CANopen.

    Args:
        sync: Provides the clock for heartbeats.
        arm: Settings of its arm: cycle, heartbeat, and cycles in which feedback may be missing.

    Attributes:
        message: The RPDO.
        offset_message: A second RPDO for the torque offset; None if `message` contains it, or there is no offset.
        arrived: Number of feedback frames received since this SYNC.
        expected: Number of feedback frames per SYNC.
        booted: Whether a boot-up message was received since the drive was configured.
        heartbeat_limit_s: Longest permitted time without a heartbeat.
        wrong_frames: Number of feedback frames with a wrong length; they count as missing.
    """

    # Of more than 30 attributes in a dictionary Python 3.11 looks each up anew: a cycle takes 8 us longer.
    __slots__ = (
        "_effort_frame", "_effort_length", "_frame", "_heard_s", "_late", "_length", "_link", "_most_late",
        "_nmt_state", "_pack", "_pack_offset", "_surplus_cycles", "_unpack", "_unpack_effort", "_with_offset",
        "arrived", "booted", "expected", "heartbeat_limit_s", "message", "offset_message", "wrong_frames",
    )  # fmt: skip

    def __init__(self, drive: DriveSettings, link: BusLink, sync: SyncSource, arm: ArmSettings) -> None:
        super().__init__(drive, sync.now_s, arm)
        self._link, image = link, drive_image(drive)
        self.message = data_frame(image.rpdo.cob_id, bytes(image.rpdo.length))
        self.offset_message: can.Message | None = None
        if image.offset is not None:
            self.offset_message = data_frame(image.offset.cob_id, bytes(image.offset.length))
            self._pack_offset = image.offset.pack
        self.arrived = 0
        self.expected = sum(layout.direction is PdoDirection.TRANSMIT for layout in image.layouts)
        self.booted = False
        self.wrong_frames = 0
        self.heartbeat_limit_s = HEARTBEAT_TOLERANCE * arm.heartbeat_s
        self._pack = image.rpdo.pack
        self._unpack = image.tpdo.unpack
        self._length = image.tpdo.length
        self._with_offset = drive.torque_offset and image.offset is None
        self._frame = self._effort_frame = bytearray()
        self._heard_s = 0.0
        self._nmt_state: int | None = None
        self._late = self._surplus_cycles = 0
        self._most_late = arm.max_missing_cycles * self.expected
        node_id = drive.node_id
        link.subscribe(image.tpdo.cob_id, self._take_feedback)
        if image.effort is not None:
            self._effort_length = image.effort.length
            self._unpack_effort = image.effort.unpack
            link.subscribe(image.effort.cob_id, self._take_effort)
        link.subscribe(od.HEARTBEAT_BASE + node_id, self._take_heartbeat)
        link.subscribe(od.EMERGENCY_BASE + node_id, self._take_emergency)

    # Frames --------------------------------------------------------------------------------------------------

    def _take_feedback(self, data: bytearray) -> None:
        """Keep a TPDO."""
        if len(data) == self._length:
            self._frame = data
            self.arrived += 1
            self._nmt_state = _OPERATIONAL
        else:
            self.wrong_frames += 1

    def _take_effort(self, data: bytearray) -> None:
        """Keep the second TPDO, with the effort."""
        if len(data) == self._effort_length:
            self._effort_frame = data
            self.arrived += 1
        else:
            self.wrong_frames += 1

    def _take_heartbeat(self, data: bytearray) -> None:
        """Record the NMT state from a heartbeat or boot-up message."""
        if not data:
            return
        self._heard_s = self._now_s()
        state = data[0] & 0x7F
        if state == NmtState.BOOT_UP.value:
            self.booted = True
        # A heartbeat sent before the start command took effect does not show the resulting state.
        if self._nmt_state is not None:
            self._nmt_state = state

    def _take_emergency(self, data: bytearray) -> None:
        """Keep an emergency message."""
        message = emergency.parse_emergency(bytes(data))
        if message is not None:
            self._emergency = message if message.code else None

    @property
    def restarted(self) -> bool:
        """Whether a boot-up message was received."""
        return self.booted

    def leave_cycle(self) -> None:
        """PRE-OPERATIONAL, in which a drive answers SDO and ignores late setpoints."""
        self._link.command(NmtCommand.PRE_OPERATIONAL, self.settings.node_id)

    def restart(self) -> None:
        """NMT reset."""
        self.booted = False
        self._link.command(NmtCommand.RESET_NODE, self.settings.node_id)

    # The cycle -----------------------------------------------------------------------------------------------

    def begin(self, counts_per_rad: float, course: AxisCourse) -> None:
        """As `CyclicDrive.begin`."""
        super().begin(counts_per_rad, course)
        self.arrived = 0
        self._late = self._surplus_cycles = 0
        self._heard_s = self._now_s()
        self._nmt_state = None

    def require_configured(self) -> None:
        """Refuse a drive whose boot-up message was received since it was configured."""
        if self.booted:
            raise self._error(
                "enabling",
                "the drive has rebooted since it was configured",
                "Has another program reset it, or has its supply dipped? Repeat the command: it configures the drive",
            )

    def excuse_silence(self, away_s: float) -> None:
        """Extend the wait for the next heartbeat by a time in which nothing was read."""
        self._heard_s += away_s

    def excuse_surplus(self) -> None:
        """A SYNC was not used by a cycle: what arrived in answer to it is no twin's."""
        self._surplus_cycles = 0

    def prepare(self, now_s: float) -> can.Message:
        """RPDO of this cycle."""
        word = self.controlword(now_s)
        if self._with_offset:
            self.message.data[:] = self._pack(word, self.target_counts, self.offset_permille)
        else:
            self.message.data[:] = self._pack(word, self.target_counts)
        return self.message

    def prepare_offset(self, message: can.Message) -> can.Message:
        """The second RPDO of this cycle, with the torque offset."""
        message.data[:] = self._pack_offset(self.offset_permille)
        return message

    def expect(self) -> None:
        """SYNC: feedback from now on belongs to it. More than one frame for the last one means a twin, unless late.

        On a busy computer, simulated drives or this program answer several SYNCs late, and catch up over several: so
        many frames too many as were missing before are no twin's.
        """
        surplus = self.arrived - self.expected
        if surplus > self._late:
            self._surplus_cycles += 1
        else:
            self._surplus_cycles = 0
            if surplus:
                self._late = min(self._late - surplus, self._most_late)
        self.arrived = 0

    def evaluate(self, now_s: float) -> bool:
        """Process this cycle's feedback, or count it as missing; whether it is missing."""
        if self.arrived < self.expected:
            self._missing += 1
            return True
        if self.expected == 1:
            statusword, counts, effort = self._unpack(self._frame)
        else:
            statusword, counts = self._unpack(self._frame)
            (effort,) = self._unpack_effort(self._effort_frame)
        elapsed_s, self._evaluated_s = now_s - self._evaluated_s, now_s
        if self.arrived > self.expected:  # this process was late: the last frame belongs to a later SYNC than this one
            elapsed_s *= self.arrived // self.expected
        self._receive(statusword, counts, effort, self.target_counts, now_s, elapsed_s)
        return False

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

    def _missed(self, step: str, now_s: float) -> ServoError | None:
        """Error for a drive that has rebooted, is silent, or has left OPERATIONAL; it is marked as lost."""
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
        return None

    def _contradiction(self, step: str) -> ServoError | None:
        """Error for feedback that cannot be from one drive that follows the standard."""
        if self._surplus_cycles >= _TWIN_CYCLES:
            return self._error(
                step,
                f"more feedback arrives than one drive sends: two drives have node id {self.settings.node_id}",
                "Both obey the setpoints: give each drive a node id of its own, or unplug one",
            )
        return super()._contradiction(step)
