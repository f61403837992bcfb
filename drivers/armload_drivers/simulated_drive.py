"""One simulated CiA 402 drive: what a slave does with frames, SYNC and time. No bus, no thread, no clock.

Rules of this file:
- Whatever a frame or the passing of time causes is decided here; `simulated_drives` only carries frames.
- At SYNC the drive first stores the actual values, then latches the RPDO that came before, obeys it, and sends
  its TPDOs, so that the statusword already answers the controlword that this SYNC latched.
- Losing the master ends in what 6007 says. A quick stop or fault begun that way does not end by itself when
  frames come back: the controlword first has to withdraw "enable operation".
- A drive that loses its torque engages its brake; the plant does that.

What is simplified: 605B and 605C act as 0 (torque off at once on transitions 5 and 8, so a master brings the
arm to a standstill first), halt (bit 8) is not there, and max torque (6072) is kept but not enforced.

References:
    CiA 301, 7.2 (services), 7.3 (NMT); CiA 402-2, 8 (device control), 10.4 (quick stop), 11 (interpolated
    position mode), 14 (cyclic synchronous position mode).
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

from armload_drivers import emergency
from armload_drivers import objects as od
from armload_drivers.arm import DriveSettings, OperationMode
from armload_drivers.cia402 import FAULT_RESET_BIT, POWERED, DriveMachine, State
from armload_drivers.objects import NmtCommand, NmtState, PdoDirection
from armload_drivers.sdo_server import Abort, SdoAbort, SdoServer
from armload_drivers.simulated_dictionary import DriveTraits, build_dictionary
from armload_drivers.simulated_pdo import Pdo
from armload_drivers.simulated_plant import Plant
from armload_drivers.units import AxisUnits, saturate

HEARTBEAT_LOST = 0x8130
RPDO_OVERDUE = 0x8250
FOLLOWING_ERROR = 0x8611

_VOLTAGE_ENABLED, _REMOTE = 0x0010, 0x0200
_LIMIT_ACTIVE, _FOLLOWING, _FOLLOWING_ERROR = 0x0800, 0x1000, 0x2000
_ENABLE_OPERATION_BIT, _INTERPOLATE = 0x0008, 0x0010
_WINDOW_OFF = 0xFFFF_FFFF
_SHORTEST_STOP_S = 1e-3
_STAYS_IN_QUICK_STOP = frozenset({5, 6, 7, 8})
_IP, _CSP = int(OperationMode.INTERPOLATED_POSITION), int(OperationMode.CYCLIC_SYNCHRONOUS_POSITION)

Send = Callable[[int, bytes | bytearray], None]
"""Sends a frame: COB-ID and data."""


class SimulatedDrive:
    """One slave.

    Args:
        settings: The configured drive.
        axis: Its axis in the plant.
        plant: What it moves.
        cycle_s: Configured cycle.
        traits: In what it differs from the configured drive.
        send: Sends a frame.
        rerouted: Called when COB-IDs of RPDOs may have changed.

    Attributes:
        node_id: Node id.
        state: NMT state; None while it has no supply.
        machine: Power state.
        rpdos: Receive PDOs.
        dropped_feedback: TPDOs of so many SYNCs to come are not sent; a fault to be injected.
    """

    def __init__(
        self,
        settings: DriveSettings,
        axis: int,
        plant: Plant,
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
        self._axis, self._plant = axis, plant
        self._cycle_s = cycle_s
        self._send, self._rerouted = send, rerouted
        self._initialise()

    def _initialise(self) -> None:
        """Everything as after power-on."""
        node_id = self.node_id
        self.dictionary = dictionary = build_dictionary(self._settings, self._traits, self._cycle_s)
        self._values = dictionary.values
        self.server = SdoServer(dictionary)
        self.machine = DriveMachine()
        first = {PdoDirection.RECEIVE: (od.CONTROLWORD,), PdoDirection.TRANSMIT: (od.STATUSWORD,)}
        self.rpdos, self.tpdos = (
            [
                Pdo(direction, number, node_id, dictionary, first[direction] if number == 0 else ())
                for number in range(od.PDO_COUNT)
            ]
            for direction in PdoDirection
        )
        dictionary.remove(self._traits.absent)
        self._frames = [bytearray(8) for _ in self.tpdos]
        self._obeyed: tuple[int, State] | None = None
        self._interlocked = False
        self._persistent_fault = False
        self._limited = False
        self._lag_since_s: float | None = None
        self._ramp_end_s: float | None = None
        self._offset_permille = 0
        self._velocity_rad_s = 0.0
        self._heartbeat_due_s: float | None = None
        self._master_overdue_s: float | None = None
        self._now_s = 0.0
        for entry in (od.POLARITY, od.INTERPOLATION_TIME, od.INTERPOLATION_EXPONENT, od.MODE):
            dictionary.reactions[entry.key] = self._take_settings
        dictionary.reactions[od.CONTROLWORD.key] = self._obey_and_tell
        dictionary.reactions[od.HEARTBEAT_PRODUCER_MS.key] = self._restart_heartbeat
        dictionary.reactions[od.HEARTBEAT_CONSUMER.key] = self._restart_consumer
        for pdo in self.rpdos:
            key = PdoDirection.RECEIVE.cob_id_entry(self.rpdos.index(pdo)).key
            dictionary.reactions[key] = self._refresh_of(pdo)
        dictionary.vetoes[od.POLARITY.key] = self._only_without_power
        self._take_settings()

    def _refresh_of(self, pdo: Pdo) -> Callable[[], None]:
        """Reaction to a write of an RPDO's COB-ID."""

        def refresh() -> None:
            pdo.refresh()
            self._rerouted()

        return refresh

    def _only_without_power(self, _: int) -> None:
        """Veto for objects that may not change while the motor carries torque."""
        if self.machine.state in POWERED:
            raise SdoAbort(Abort.DEVICE_STATE)

    def _take_settings(self) -> None:
        """Take over objects that the cycle needs in another form."""
        values = self._values
        self._units = AxisUnits.of(self._settings, values[od.POLARITY.key])
        self._period_s = values[od.INTERPOLATION_TIME.key] * 10.0 ** values[od.INTERPOLATION_EXPONENT.key]
        if self._traits.takes_mode:
            values[od.MODE_DISPLAY.key] = values[od.MODE.key]

    # NMT -----------------------------------------------------------------------------------------------------

    def switch_on(self, now_s: float) -> None:
        """Supply on: boot."""
        self._now_s = now_s
        self._boot()

    def switch_off(self) -> None:
        """Supply off: nothing answers any more, the brake falls in."""
        self._remove_torque()
        self.state = None

    def _boot(self) -> None:
        """Reset and announce; then PRE-OPERATIONAL by itself."""
        self._remove_torque()
        self._initialise()
        self.machine.initialised()
        self._values[od.STATUSWORD.key] = self._statusword()
        self._rerouted()
        if self._traits.boot_message:
            self._send(od.HEARTBEAT_BASE + self.node_id, bytes([NmtState.BOOT_UP.value]))
        self.state = NmtState.PRE_OPERATIONAL

    def command(self, command: NmtCommand, now_s: float) -> None:
        """Obey an NMT command."""
        self._now_s = now_s
        if self.state is None:
            return
        if command in {NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION}:
            self._boot()
            return
        target = {
            NmtCommand.START: NmtState.OPERATIONAL,
            NmtCommand.STOP: NmtState.STOPPED,
            NmtCommand.PRE_OPERATIONAL: NmtState.PRE_OPERATIONAL,
        }[command]
        if self.state is NmtState.OPERATIONAL and target is not NmtState.OPERATIONAL:
            self._lose_connection(None)
        if target is not self.state:
            self.state = target
            for pdo in (*self.rpdos, *self.tpdos):
                pdo.refresh()

    # Frames --------------------------------------------------------------------------------------------------

    def request(self, data: bytes | bytearray, now_s: float) -> None:
        """Serve an SDO request."""
        self._now_s = now_s
        if self.state in {NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL}:
            position = self._plant.hold_position(self._axis)
            self._values[od.POSITION_ACTUAL.key] = saturate(position * self._units.counts_per_rad, od.DataType.I32)
            answer = self.server.receive(bytes(data))
            if answer is not None:
                self._send(od.SDO_TX_BASE + self.node_id, answer)

    def setpoints(self, pdo: Pdo, data: bytes | bytearray, now_s: float) -> None:
        """Take in an RPDO; SYNC latches it, or it acts at once where it is event-driven."""
        self._now_s = now_s
        if self.state is not NmtState.OPERATIONAL:
            return
        if len(data) < pdo.length:
            self._announce(0x8210, 0x10)
            return
        if pdo.timer_s:
            pdo.deadline_s = now_s + pdo.timer_s
        if pdo.synchronous:
            pdo.pending = bytes(data)
        else:
            pdo.store(bytes(data))
            self._obey_and_tell()

    def heard(self, node_id: int, now_s: float) -> None:
        """Take in another node's heartbeat."""
        watched = self._values[od.HEARTBEAT_CONSUMER.key]
        if watched >> 16 & 0x7F == node_id and watched & 0xFFFF:
            self._master_overdue_s = now_s + (watched & 0xFFFF) * 1e-3

    # The cycle -----------------------------------------------------------------------------------------------

    def measure(self, position_rad: float, velocity_rad_s: float, demand_rad: float, torque_nm: float) -> None:
        """Store actual values."""
        units, values = self._units, self._values
        self._velocity_rad_s = velocity_rad_s
        counts = position_rad * units.counts_per_rad
        values[od.POSITION_ACTUAL.key] = saturate(counts, od.DataType.I32)
        values[od.VELOCITY_ACTUAL.key] = saturate(velocity_rad_s * units.counts_per_rad, od.DataType.I32)
        lag = demand_rad * units.counts_per_rad - counts
        values[od.FOLLOWING_ERROR_ACTUAL.key] = saturate(lag, od.DataType.I32)
        permille = saturate(torque_nm / units.torque_nm_per_permille, od.DataType.I16)
        values[od.TORQUE_ACTUAL.key] = permille
        values[od.CURRENT_ACTUAL.key] = permille

    def sync(self, now_s: float) -> None:
        """Latch, obey and answer. `measure` comes first."""
        self._now_s = now_s
        if self.state is not NmtState.OPERATIONAL:
            return
        for pdo in self.rpdos:
            if pdo.pending is not None:
                pdo.store(pdo.pending)
                pdo.pending = None
        self._obey()
        self._supervise_lag()
        self._values[od.STATUSWORD.key] = self._statusword()
        if self.dropped_feedback:
            self.dropped_feedback -= 1
            return
        for number, pdo in enumerate(self.tpdos):
            if pdo.cob_id is not None and pdo.type < od.PDO_EVENT_DRIVEN:
                pdo.syncs += 1
                if pdo.syncs >= pdo.type:
                    pdo.syncs = 0
                    self._transmit(number)

    def tick(self, now_s: float) -> None:
        """Let the drive's own timers act."""
        self._now_s = now_s
        if self.state is None:
            return
        if self._heartbeat_due_s is not None and now_s >= self._heartbeat_due_s:
            self._send(od.HEARTBEAT_BASE + self.node_id, bytes([self.state.value]))
            self._heartbeat_due_s += self._values[od.HEARTBEAT_PRODUCER_MS.key] * 1e-3
            self._heartbeat_due_s = max(self._heartbeat_due_s, now_s)
        if self._ramp_end_s is not None and now_s >= self._ramp_end_s:
            self._finish_ramp()
        if self._master_overdue_s is not None and now_s > self._master_overdue_s:
            self._master_overdue_s = None
            self._lose_master()
        if self.state is NmtState.OPERATIONAL:
            for pdo in self.rpdos:
                if pdo.deadline_s is not None and now_s > pdo.deadline_s:
                    pdo.deadline_s = None
                    self._lose_connection(RPDO_OVERDUE)
            self._values[od.STATUSWORD.key] = self._statusword()
            self._send_events()

    def _transmit(self, number: int) -> None:
        """Send a TPDO."""
        pdo = self.tpdos[number]
        if pdo.cob_id is None:
            return
        frame = self._frames[number]
        if len(frame) != pdo.length:
            frame = self._frames[number] = bytearray(pdo.length)
        pdo.pack_into(frame)
        self._send(pdo.cob_id, frame)

    def _send_events(self) -> None:
        """Send event-driven TPDOs: on a new statusword, and when their timer is over."""
        for number, pdo in enumerate(self.tpdos):
            if pdo.cob_id is None or pdo.synchronous or self.state is not NmtState.OPERATIONAL:
                continue
            event = self._values[od.STATUSWORD.key] if pdo.carries(od.STATUSWORD) else 0
            due = pdo.deadline_s is not None and self._now_s >= pdo.deadline_s
            if event != pdo.last_event or due:
                pdo.last_event = event
                pdo.deadline_s = self._now_s + pdo.timer_s if pdo.timer_s else None
                self._transmit(number)

    # Power ---------------------------------------------------------------------------------------------------

    def _obey(self) -> None:
        """Act on the controlword, and follow the setpoints while operation is enabled."""
        machine = self.machine
        word = self._values[od.CONTROLWORD.key]
        if self._interlocked and not word & _ENABLE_OPERATION_BIT:
            self._interlocked = False
        if (word, machine.state) != self._obeyed and not self._interlocked:
            self._make_transitions(word & ~FAULT_RESET_BIT if self._persistent_fault else word)
            self._obeyed = (word, machine.state)
        if machine.state is State.OPERATION_ENABLED:
            self._follow(word)

    def _obey_and_tell(self) -> None:
        """Obey a controlword that came without SYNC."""
        self._obey()
        self._values[od.STATUSWORD.key] = self._statusword()
        self._send_events()

    def _make_transitions(self, word: int) -> None:
        """Let the state machine act on a controlword, and the plant on its transitions."""
        before = self.machine.state
        made = self.machine.receive(word)
        after = self.machine.state
        if 15 in made:
            self._clear_error()
        elif after is State.QUICK_STOP_ACTIVE and before is not after:
            self._begin_stop(self._values[od.QUICK_STOP_OPTION.key])
        elif after is State.OPERATION_ENABLED and before is not after:
            self._ramp_end_s = None
            if before not in POWERED:
                self._lag_since_s = None
                self._plant.set_powered(self._axis, True)
        elif before in POWERED and after not in POWERED:
            self._remove_torque()

    def _follow(self, word: int) -> None:
        """Hand setpoints to the plant."""
        values = self._values
        mode = values[od.MODE_DISPLAY.key]
        if mode == _CSP:
            counts = values[od.TARGET_POSITION.key]
        elif mode == _IP and word & _INTERPOLATE:
            counts = values[od.INTERPOLATION_SETPOINT.key]
        else:
            return
        lower, upper = values[od.POSITION_LIMIT_MIN.key], values[od.POSITION_LIMIT_MAX.key]
        limited = min(max(counts, lower), upper) if lower < upper else counts
        self._limited = limited != counts
        self._plant.set_target(self._axis, limited / self._units.counts_per_rad, self._period_s)
        offset = values[od.TORQUE_OFFSET.key]
        if offset != self._offset_permille:
            self._offset_permille = offset
            self._plant.set_torque_offset(self._axis, offset * self._units.torque_nm_per_permille)

    def _supervise_lag(self) -> None:
        """Fault where the following error stays outside 6065 for 6066."""
        window = self._values[od.FOLLOWING_ERROR_WINDOW.key]
        if (
            self.machine.state is not State.OPERATION_ENABLED
            or window == _WINDOW_OFF
            or abs(self._values[od.FOLLOWING_ERROR_ACTUAL.key]) <= window
        ):
            self._lag_since_s = None
        elif self._lag_since_s is None:
            self._lag_since_s = self._now_s
        if self._lag_since_s is not None:
            allowed_s = self._values[od.FOLLOWING_ERROR_TIMEOUT_MS.key] * 1e-3
            if self._now_s - self._lag_since_s >= allowed_s:
                self.fail(FOLLOWING_ERROR, self._now_s)

    def _begin_stop(self, option: int) -> None:
        """Slow down on the quick stop ramp, or let go at once where the option code says so."""
        if option == 0:
            self._finish_ramp()
            return
        deceleration = self._values[od.QUICK_STOP_DECELERATION.key] / abs(self._units.counts_per_rad)
        over_s = max(_SHORTEST_STOP_S, abs(self._velocity_rad_s) / deceleration if deceleration else 0.0)
        self._plant.slow_down(self._axis, over_s)
        self._ramp_end_s = self._now_s + over_s

    def _finish_ramp(self) -> None:
        """The axis stands: what a quick stop or a fault reaction ends in."""
        self._ramp_end_s = None
        if self.machine.state is State.FAULT_REACTION_ACTIVE:
            self.machine.fault_reaction_done()
            self._remove_torque()
        elif (
            self.machine.state is State.QUICK_STOP_ACTIVE
            and self._values[od.QUICK_STOP_OPTION.key] not in _STAYS_IN_QUICK_STOP
        ):
            self.machine.quick_stop_done()
            self._remove_torque()

    def _remove_torque(self) -> None:
        """Torque off; nothing of the old motion remains."""
        self._ramp_end_s = None
        self._lag_since_s = None
        self._limited = False
        self._plant.set_powered(self._axis, False)
        if self._offset_permille:
            self._offset_permille = 0
            self._plant.set_torque_offset(self._axis, 0.0)

    def _statusword(self) -> int:
        """Statusword of the present state."""
        state = self.machine.state
        word = self.machine.status_bits | _VOLTAGE_ENABLED
        if self.state is NmtState.OPERATIONAL:
            word |= _REMOTE
        if state is State.OPERATION_ENABLED:
            mode = self._values[od.MODE_DISPLAY.key]
            interpolating = bool(self._values[od.CONTROLWORD.key] & _INTERPOLATE)
            if mode == _CSP or (mode == _IP and interpolating):
                word |= _FOLLOWING
            if self._lag_since_s is not None:
                word |= _FOLLOWING_ERROR
            if self._limited:
                word |= _LIMIT_ACTIVE
        return word

    # Faults and lost masters -----------------------------------------------------------------------------------

    def fail(self, code: int, now_s: float, *, persistent: bool = False) -> None:
        """Detect a fault: emergency message, reaction as 605E says, then FAULT.

        Args:
            code: Error code.
            now_s: Present time.
            persistent: The cause stays, and with it FAULT, whatever the master resets.
        """
        self._now_s = now_s
        if self.state is None or self.machine.state in {State.FAULT, State.FAULT_REACTION_ACTIVE}:
            return
        self._persistent_fault = persistent
        powered = self.machine.state in POWERED
        self._announce(code, 0x21)
        self.machine.fault()
        if powered:
            self._begin_stop(self._values[od.FAULT_REACTION_OPTION.key])
        else:
            self._finish_ramp()

    def _announce(self, code: int, register: int) -> None:
        """Send an emergency message and keep its code."""
        values = self._values
        values[od.ERROR_CODE.key] = code
        values[od.ERROR_REGISTER.key] = register
        history = [entry.key for entry in od.ERROR_HISTORY]
        for newer, older in reversed(list(pairwise(history))):
            values[older] = values[newer]
        values[history[0]] = code
        values[od.ERROR_COUNT.key] = min(values[od.ERROR_COUNT.key] + 1, len(history))
        if self.state in {NmtState.PRE_OPERATIONAL, NmtState.OPERATIONAL}:
            self._send(od.EMERGENCY_BASE + self.node_id, emergency.pack(code, register))

    def _clear_error(self) -> None:
        """The fault was reset: tell that no error is left."""
        self._values[od.ERROR_CODE.key] = 0
        self._values[od.ERROR_REGISTER.key] = 0
        self._send(od.EMERGENCY_BASE + self.node_id, emergency.pack(0, 0))

    def _lose_master(self) -> None:
        """The heartbeat being watched is overdue: 6007, then 1029."""
        self._lose_connection(HEARTBEAT_LOST)
        behaviour = self._values[od.COMMUNICATION_ERROR_BEHAVIOUR.key]
        if behaviour == 0 and self.state is NmtState.OPERATIONAL:
            self.state = NmtState.PRE_OPERATIONAL
        elif behaviour == 2:
            self.state = NmtState.STOPPED

    def _lose_connection(self, code: int | None) -> None:
        """React as 6007 says; `code` is announced where there is one."""
        option = self._values[od.ABORT_CONNECTION_OPTION.key]
        enabled = self.machine.state is State.OPERATION_ENABLED
        if enabled and option == 1:
            self.fail(HEARTBEAT_LOST if code is None else code, self._now_s)
            return
        if code is not None:
            self._announce(code, 0x11)
        if not enabled:
            return
        self._interlocked = True
        if option == 2:
            self._make_transitions(0x00)
        elif option == 3:
            self._make_transitions(0x02)

    def _restart_heartbeat(self) -> None:
        """1017 was written."""
        period_ms = self._values[od.HEARTBEAT_PRODUCER_MS.key]
        self._heartbeat_due_s = self._now_s + period_ms * 1e-3 if period_ms else None

    def _restart_consumer(self) -> None:
        """1016 was written: watching begins with the next heartbeat."""
        self._master_overdue_s = None
