"""One simulated CiA 402 drive: a slave's reaction to frames, SYNC and time. No bus, no thread, no clock.

Rules of this file:
- The effects of frames and of time are decided here and in `power_stage`; `drives_on_bus` only transports frames.
- At SYNC the drive first stores the actual values, then latches the last RPDO, obeys it, and sends its TPDOs, so that
  the statusword already reflects the controlword latched by this SYNC.
- The reaction to a lost master (1016), an overdue RPDO (1400:5) and leaving OPERATIONAL with torque on is that of 6007.

Simplification: an NMT reset of communication resets the entire node.

References:
    CiA 301, 7.2 (services), 7.3 (NMT).
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from itertools import pairwise

from armload_drivers.cia402 import emergency
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import DriveSettings
from armload_drivers.cia402.object_dictionary import Entry, NmtCommand, NmtState, PdoDirection
from armload_drivers.cia402.state_machine import State
from armload_drivers.simulation.drives.drive_dictionary import SILENCE, DriveTraits, build_dictionary
from armload_drivers.simulation.drives.drive_pdos import Pdo
from armload_drivers.simulation.drives.eds_objects import adopt_description, pdo_count
from armload_drivers.simulation.drives.power_stage import PowerStage
from armload_drivers.simulation.drives.sdo_server import SdoServer
from armload_drivers.simulation.plant_interface import PlantAxis

HEARTBEAT_LOST = 0x8130
PDO_TOO_SHORT = 0x8210
SYNC_LENGTH = 0x8240
RPDO_OVERDUE = 0x8250

_COMMUNICATION_ERROR, _PROFILE_ERROR = 0x11, 0x21
"""Error register (1001): generic, and communication or device profile."""
_REMOTE = 0x0200
"""Bit 9 of the statusword: PDOs are processed."""

_OPERATIONAL = NmtState.OPERATIONAL
"""Cached, because Python 3.11 takes 0.3 us to look up a member of an enumeration."""

Send = Callable[[int, bytes], None]
"""Sends a frame: COB-ID and data."""


class SimulatedDrive:
    """One slave.

    Args:
        settings: The configured drive.
        moved: The axis that it drives.
        cycle_s: Configured cycle.
        traits: Deviations from the configured drive.
        send: Sends a frame.
        rerouted: Called when COB-IDs of RPDOs may have changed.

    Attributes:
        node_id: Node id.
        state: NMT state; None while it has no supply.
        power: Its power stage.
        rpdos: Receive PDOs.
        dropped_feedback: Number of next SYNCs after which TPDOs are not sent; an injected fault.
    """

    def __init__(
        self,
        settings: DriveSettings,
        moved: PlantAxis,
        *,
        cycle_s: float,
        traits: DriveTraits,
        send: Send,
        rerouted: Callable[[], None],
    ) -> None:
        self.node_id = settings.node_id
        self.dropped_feedback = 0
        self.state: NmtState | None = None
        self._settings, self._traits = settings, traits
        self._moved = moved
        self._cycle_s = cycle_s
        self._send, self._rerouted = send, rerouted
        self._initialise()

    def _initialise(self) -> None:
        """Set everything to the state after power-on."""
        node_id = self.node_id
        self.dictionary = dictionary = build_dictionary(self._settings, self._traits, self._cycle_s)
        described = self._traits.description
        if described is not None:
            adopt_description(dictionary, described, node_id)
        self._values = dictionary.values
        self.server = SdoServer(dictionary)
        self.power = PowerStage(
            self._settings,
            self._traits,
            self._moved,
            dictionary=dictionary,
            report=self._report_fault,
        )
        first = {PdoDirection.RECEIVE: (od.CONTROLWORD,), PdoDirection.TRANSMIT: (od.STATUSWORD,)}
        self.rpdos, self.tpdos = (
            [
                Pdo(direction, number, node_id, dictionary, first[direction] if number == 0 else ())
                for number in range(od.PDO_COUNT if described is None else pdo_count(described, direction))
            ]
            for direction in PdoDirection
        )
        dictionary.remove(self._traits.absent)
        dictionary.forgets = self._traits.forgets
        self._heartbeat_due_s: float | None = None
        self._master_overdue_s: float | None = None
        self._now_s = 0.0
        self._reported: State | None = None
        dictionary.reactions[od.CONTROLWORD.key] = self._obey_and_report
        dictionary.reactions[od.HEARTBEAT_PRODUCER_MS.key] = self._restart_heartbeat
        dictionary.reactions[od.HEARTBEAT_CONSUMER.key] = self._restart_consumer
        for direction, pdos in zip(PdoDirection, (self.rpdos, self.tpdos), strict=True):
            for number, pdo in enumerate(pdos):
                dictionary.reactions[direction.cob_id_entry(number).key] = self._refresh_of(pdo)
        self._list_enabled()

    def _refresh_of(self, pdo: Pdo) -> Callable[[], None]:
        """Reaction to a write of a PDO's COB-ID."""

        def refresh() -> None:
            pdo.refresh()
            self._list_enabled()
            self._rerouted()

        return refresh

    def _list_enabled(self) -> None:
        """Update the lists of PDOs in use."""
        self._enabled_rpdos, self._enabled_tpdos = (
            tuple(pdo for pdo in pdos if pdo.cob_id is not None) for pdos in (self.rpdos, self.tpdos)
        )

    # NMT -----------------------------------------------------------------------------------------------------

    def switch_on(self, now_s: float) -> None:
        """Supply on: boot."""
        self._pass_time(now_s)
        self._boot()

    def switch_off(self) -> None:
        """Supply off: the drive no longer answers, and its brake engages."""
        self.power.remove_torque()
        self.state = None

    def _boot(self) -> None:
        """Reset, send the boot-up message, and enter PRE-OPERATIONAL."""
        self.power.remove_torque()
        now_s = self._now_s
        self._initialise()
        self._moved.plant.keep_braked(self._moved.axis, False)
        self._pass_time(now_s)
        self._restart_heartbeat()
        self.power.machine.initialised()
        self._report_state()
        self._rerouted()
        if self._traits.boot_message:
            self._send(od.HEARTBEAT_BASE + self.node_id, bytes([NmtState.BOOT_UP.value]))
        self.state = NmtState.PRE_OPERATIONAL

    def command(self, command: NmtCommand, now_s: float) -> None:
        """Obey an NMT command."""
        self._pass_time(now_s)
        if self.state is None:
            return
        if command in {NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION}:
            self._boot()
            return
        target = {
            NmtCommand.START: _OPERATIONAL,
            NmtCommand.STOP: NmtState.STOPPED,
            NmtCommand.PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
        }[command]
        if self.state is _OPERATIONAL and target is not _OPERATIONAL:
            self.power.lose_master(HEARTBEAT_LOST)
        if target is not self.state:
            self.state = target
            for pdo in (*self.rpdos, *self.tpdos):
                pdo.refresh()
            self._report_state()

    def fail(self, code: int, now_s: float, *, persistent: bool = False) -> None:
        """Detect a fault; see `PowerStage.fail`. Has no effect without supply."""
        self._pass_time(now_s)
        if self.state is not None:
            self.power.fail(code, persistent=persistent)

    def set_object(self, entry: Entry, value: int) -> None:
        """Change an object from inside."""
        self._values[entry.key] = value
        self.dictionary.reactions.get(entry.key, _nothing)()

    def _pass_time(self, now_s: float) -> None:
        """Advance the time; every call from outside begins with this."""
        self._now_s = now_s
        self.power.advance(now_s)

    def _report_state(self) -> None:
        """Update the statusword."""
        remote = _REMOTE if self.state is _OPERATIONAL else 0
        bit = self._settings.homed_bit
        homed = 0 if bit is None or not self._traits.homed else 1 << bit
        self._reported = self.power.machine.state
        self._values[od.STATUSWORD.key] = self.power.statusword | remote | homed

    # Frames --------------------------------------------------------------------------------------------------

    def request(self, data: bytes | bytearray, now_s: float) -> None:
        """Process an SDO request."""
        self._pass_time(now_s)
        if self.state in {NmtState.PRE_OPERATIONAL, _OPERATIONAL}:
            self.power.measure_at_rest()
            self._report_state()
            answer = self._serve(bytes(data))
            if answer is not None:
                self._send(od.SDO_TX_BASE + self.node_id, answer)

    def _serve(self, request: bytes) -> bytes | None:
        """Answer of the SDO server, or the one that the traits define."""
        decide = self._traits.on_request
        verdict = None if decide is None else decide(request)
        if verdict is None:
            return self.server.receive(request)
        return None if verdict == SILENCE else struct.pack("<B3sI", 0x80, request[1:4], verdict)

    def setpoints(self, pdo: Pdo, data: bytes | bytearray, now_s: float) -> None:
        """Process an RPDO; SYNC latches it, or it acts immediately if it is event-driven."""
        self._pass_time(now_s)
        if self.state is not _OPERATIONAL:
            return
        if len(data) < pdo.length:
            self._announce(PDO_TOO_SHORT, _COMMUNICATION_ERROR)
            return
        if pdo.timer_s:
            pdo.deadline_s = now_s + pdo.timer_s
        if pdo.synchronous:
            pdo.pending = bytes(data)
        else:
            pdo.store(bytes(data))
            self._obey_and_report()

    def heard(self, node_id: int, now_s: float) -> None:
        """Process another node's heartbeat."""
        watched = self._values[od.HEARTBEAT_CONSUMER.key]
        if watched >> 16 & 0x7F == node_id and watched & 0xFFFF:
            self._master_overdue_s = now_s + (watched & 0xFFFF) * 1e-3

    # The cycle -----------------------------------------------------------------------------------------------

    def sync(self, now_s: float, length: int = 0) -> None:
        """Latch, obey and answer; call `power.measure` first.

        Args:
            now_s: Time.
            length: Number of data bytes of the SYNC; one that contradicts 1019 is reported and ignored.
        """
        self._pass_time(now_s)
        if self.state is not _OPERATIONAL:
            return
        if length != bool(self._values[od.SYNC_COUNTER_OVERFLOW.key]):
            self._announce(SYNC_LENGTH, _COMMUNICATION_ERROR)
            return
        for pdo in self._enabled_rpdos:
            if pdo.pending is not None:
                pdo.store(pdo.pending)
                pdo.pending = None
        self.power.obey()
        self.power.supervise_lag()
        self._report_state()
        if self.dropped_feedback:
            self.dropped_feedback -= 1
            return
        for pdo in self._enabled_tpdos:
            if pdo.synchronous:
                pdo.syncs += 1
                if pdo.syncs >= pdo.type:
                    pdo.syncs = 0
                    self._transmit(pdo)

    def tick(self, now_s: float) -> None:
        """Process the drive's own timers."""
        self._pass_time(now_s)
        if self.state is None:
            return
        if self._heartbeat_due_s is not None and now_s >= self._heartbeat_due_s:
            self._send(od.HEARTBEAT_BASE + self.node_id, bytes([self.state.value]))
            self._heartbeat_due_s += self._values[od.HEARTBEAT_PRODUCER_MS.key] * 1e-3
            self._heartbeat_due_s = max(self._heartbeat_due_s, now_s)
        if self._master_overdue_s is not None and now_s > self._master_overdue_s:
            self._master_overdue_s = None
            self._lose_master()
        if self.state is _OPERATIONAL:
            for pdo in self._enabled_rpdos:
                if pdo.deadline_s is not None and now_s > pdo.deadline_s:
                    pdo.deadline_s = None
                    self._lose_connection(RPDO_OVERDUE)
            if self.power.machine.state is not self._reported:
                self._report_state()
            self._send_events()

    def _transmit(self, pdo: Pdo) -> None:
        """Send a TPDO."""
        if pdo.cob_id is not None:
            self._send(pdo.cob_id, pdo.pack())

    def _send_events(self) -> None:
        """Send event-driven TPDOs: on a new statusword, and when their timer expires."""
        for pdo in self._enabled_tpdos:
            if pdo.synchronous or self.state is not _OPERATIONAL:
                continue
            event = self._values[od.STATUSWORD.key] if pdo.carries(od.STATUSWORD) else 0
            due = pdo.deadline_s is not None and self._now_s >= pdo.deadline_s
            if event != pdo.last_event or due:
                pdo.last_event = event
                pdo.deadline_s = self._now_s + pdo.timer_s if pdo.timer_s else None
                self._transmit(pdo)

    def _obey_and_report(self) -> None:
        """Obey a controlword received without SYNC."""
        self.power.obey()
        self._report_state()
        self._send_events()

    # Errors --------------------------------------------------------------------------------------------------

    def _report_fault(self, code: int) -> None:
        """Announce a fault of the power stage, or that there is none any more (0)."""
        if code:
            self._announce(code, _PROFILE_ERROR)
        else:
            self._values[od.ERROR_CODE.key] = 0
            self._values[od.ERROR_REGISTER.key] = 0
            self._send(od.EMERGENCY_BASE + self.node_id, emergency.pack(0, 0))

    def _announce(self, code: int, register: int) -> None:
        """Send an emergency message and store its code."""
        values = self._values
        values[od.ERROR_CODE.key] = code
        values[od.ERROR_REGISTER.key] = register
        history = [entry.key for entry in od.ERROR_HISTORY]
        for newer, older in reversed(list(pairwise(history))):
            values[older] = values[newer]
        values[history[0]] = code
        values[od.ERROR_COUNT.key] = min(values[od.ERROR_COUNT.key] + 1, len(history))
        if self.state in {NmtState.PRE_OPERATIONAL, _OPERATIONAL}:
            self._send(od.EMERGENCY_BASE + self.node_id, emergency.pack(code, register))

    def _lose_connection(self, code: int) -> None:
        """React to the loss of the master: send an emergency message and follow 6007."""
        if not self.power.lose_master(code):
            self._announce(code, _COMMUNICATION_ERROR)

    def _lose_master(self) -> None:
        """React to the overdue heartbeat of the master: 6007, then 1029."""
        self._lose_connection(HEARTBEAT_LOST)
        behaviour = self._values[od.COMMUNICATION_ERROR_BEHAVIOUR.key]
        if behaviour == 0 and self.state is _OPERATIONAL:
            self.state = NmtState.PRE_OPERATIONAL
        elif behaviour == 2:
            self.state = NmtState.STOPPED

    def _restart_heartbeat(self) -> None:
        """1017 was written."""
        period_ms = self._values[od.HEARTBEAT_PRODUCER_MS.key]
        self._heartbeat_due_s = self._now_s + period_ms * 1e-3 if period_ms else None

    def _restart_consumer(self) -> None:
        """1016 was written: monitoring starts with the next heartbeat."""
        self._master_overdue_s = None


def _nothing() -> None:
    """Reaction of an object that has none."""
