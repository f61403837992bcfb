"""The power side of one simulated drive: state machine, setpoints, ramps, following error, faults.

Rules of this file:
- The reaction to the loss of the master is that of 6007. A quick stop caused by it does not end by itself when frames
  return: the controlword must first withdraw "enable operation".
- At the end of a ramp a drive engages its brake, and removes the torque when the brake holds. In motion (transition 9,
  or 12 during a ramp) torque is removed at once, and the brake engages meanwhile.
- Time comes from `advance`, which the drive calls before anything else.
- Setpoints are interpolated over the actual SYNC period, as in drives that lock onto it. With a period slightly longer
  than 60C2, the axis would otherwise stop at the end of every cycle, just when torque is measured.

Simplifications: halt (bit 8) is not implemented, 605D has no effect, and max torque (6072) is not enforced.

References:
    CiA 402-2, 8 (device control), 10.4 (quick stop), 11 (interpolated position mode), 14 (cyclic
    synchronous position mode).
"""

from __future__ import annotations

from collections.abc import Callable

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import DriveSettings, OperationMode
from armload_drivers.cia402.object_dictionary import DataType
from armload_drivers.cia402.process_data.drive_units import AxisUnits, saturate
from armload_drivers.cia402.process_data.process_image import effort_entry
from armload_drivers.cia402.state_machine import FAULT_RESET_BIT, POWERED, Command, DriveMachine, State
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.sdo_server import Abort, Dictionary, SdoAbort
from armload_drivers.simulation.plant_interface import PlantAxis

FOLLOWING_ERROR = 0x8611

_VOLTAGE_ENABLED = 0x0010
_LIMIT_ACTIVE, _FOLLOWING, _FOLLOWING_ERROR = 0x0800, 0x1000, 0x2000
_ENABLE_OPERATION_BIT, _INTERPOLATE = 0x0008, 0x0010
_WINDOW_OFF = 0xFFFF_FFFF
_SHORTEST_STOP_S = 1e-3
_STAYS_IN_QUICK_STOP = frozenset({5, 6, 7, 8})
_SLOW_DOWN_OPTIONS = {5: od.DISABLE_OPTION, 8: od.SHUTDOWN_OPTION}
"""Option code for leaving operation, by the number of the transition."""
_IP, _CSP = int(OperationMode.INTERPOLATED_POSITION), int(OperationMode.CYCLIC_SYNCHRONOUS_POSITION)

_LOCK_RANGE, _LOCK_GAIN = 0.5, 0.1
"""SYNC periods within this share of 60C2 are followed, by this share of the difference per cycle."""

_ENABLED = State.OPERATION_ENABLED
_I16, _I32 = DataType.I16, DataType.I32
"""Cached, because Python 3.11 takes 0.3 us to look up a member of an enumeration."""

Report = Callable[[int], None]
"""Reports an error code; 0 if there is no error any more."""


class PowerStage:
    """The power stage of one axis.

    Args:
        settings: The configured drive.
        traits: Deviations of the drive.
        moved: The axis that it moves, initially without torque.
        dictionary: The drive's objects; those of CiA 402 are updated here.
        report: Called with the code of an error.

    Attributes:
        machine: Power state.
    """

    def __init__(
        self,
        settings: DriveSettings,
        traits: DriveTraits,
        moved: PlantAxis,
        *,
        dictionary: Dictionary,
        report: Report,
    ) -> None:
        self.machine = DriveMachine()
        self._settings, self._traits = settings, traits
        self._plant, self._axis = moved
        self._values = dictionary.values
        self._report = report
        self._now_s = 0.0
        self._obeyed: tuple[int, State] | None = None
        self._interlocked = False
        self._persistent_fault = False
        self._limited = False
        self._lag_since_s: float | None = None
        self._ramp_end_s: float | None = None
        self._sync_s: float | None = None
        self._offset_permille = 0
        self._velocity_rad_s = 0.0
        self._vendor_effort = None if settings.vendor_effort is None else effort_entry(settings)
        for entry in (od.POLARITY, od.INTERPOLATION_TIME, od.INTERPOLATION_EXPONENT, od.MODE):
            dictionary.reactions[entry.key] = self._take_settings
        for entry in (od.PHYSICAL_OUTPUTS, od.OUTPUT_MASK):
            dictionary.reactions[entry.key] = self._set_brake
        dictionary.vetoes[od.POLARITY.key] = self._only_without_power
        self._take_settings()

    def _only_without_power(self, _: int) -> None:
        """Veto for objects that may not change while the motor carries torque."""
        if self.machine.state in POWERED:
            raise SdoAbort(Abort.DEVICE_STATE)

    def _set_brake(self) -> None:
        """Keep the brake closed, or not."""
        values = self._values
        closed = values.get(od.PHYSICAL_OUTPUTS.key, 0) & values.get(od.OUTPUT_MASK.key, 0) & od.SET_BRAKE
        self._plant.keep_braked(self._axis, bool(closed))

    def _take_settings(self) -> None:
        """Convert objects that the cycle needs in another form."""
        values = self._values
        self._units = AxisUnits.of(self._settings, values[od.POLARITY.key])
        self._configured_period_s = values[od.INTERPOLATION_TIME.key] * 10.0 ** values[od.INTERPOLATION_EXPONENT.key]
        self._period_s = self._configured_period_s
        if self._traits.takes_mode:
            values[od.MODE_DISPLAY.key] = values[od.MODE.key]

    def advance(self, now_s: float) -> None:
        """Advance the time: a ramp may end."""
        self._now_s = now_s
        if self._ramp_end_s is not None and now_s >= self._ramp_end_s:
            self._finish_ramp()

    def lock_onto_sync(self, time_s: float) -> None:
        """Adapt to the period of SYNC, given the time of the last one."""
        before_s, self._sync_s = self._sync_s, time_s
        if before_s is not None:
            late_s = time_s - before_s - self._configured_period_s
            if abs(late_s) < _LOCK_RANGE * self._configured_period_s:
                self._period_s += _LOCK_GAIN * (self._configured_period_s + late_s - self._period_s)

    def measure_at_rest(self) -> None:
        """Store the position between SYNCs, for SDO; without noise."""
        position = self._plant.hold_position(self._axis)
        self._values[od.POSITION_ACTUAL.key] = saturate(position * self._units.counts_per_rad, _I32)

    def measure(self, position_rad: float, velocity_rad_s: float, demand_rad: float, torque_nm: float) -> None:
        """Store actual values."""
        units, values = self._units, self._values
        self._velocity_rad_s = velocity_rad_s
        counts = position_rad * units.counts_per_rad
        values[od.POSITION_ACTUAL.key] = saturate(counts, _I32)
        values[od.VELOCITY_ACTUAL.key] = saturate(velocity_rad_s * units.counts_per_rad, _I32)
        lag = demand_rad * units.counts_per_rad - counts
        values[od.FOLLOWING_ERROR_ACTUAL.key] = saturate(lag, _I32)
        permille = saturate(torque_nm / units.torque_nm_per_permille, _I16)
        values[od.TORQUE_ACTUAL.key] = permille
        values[od.CURRENT_ACTUAL.key] = permille
        if self._vendor_effort is not None:
            values[self._vendor_effort.key] = saturate(torque_nm * units.effort_units_per_nm, self._vendor_effort.type)

    def obey(self) -> None:
        """Act on the controlword, and follow the setpoints while operation is enabled."""
        machine = self.machine
        word = self._values[od.CONTROLWORD.key]
        if self._interlocked and not word & _ENABLE_OPERATION_BIT:
            self._interlocked = False
        if (word, machine.state) != self._obeyed and not self._interlocked:
            self._make_transitions(word & ~FAULT_RESET_BIT if self._persistent_fault else word)
            self._obeyed = (word, machine.state)
        if machine.state is _ENABLED:
            self._follow(word)
        if machine.state in POWERED:
            self._add_torque()

    def _make_transitions(self, word: int) -> None:
        """Let the state machine act on a controlword, and the plant on its transitions."""
        before = self.machine.state
        if before is self._traits.stuck_in:
            return
        made = self.machine.receive(word)
        after = self.machine.state
        if 15 in made:
            self._report(0)
        elif after is State.QUICK_STOP_ACTIVE and before is not after:
            self._begin_stop(self._values[od.QUICK_STOP_OPTION.key])
        elif after is _ENABLED and before is not after:
            self._ramp_end_s = None
            if before not in POWERED:
                self._lag_since_s = None
                self._plant.set_powered(self._axis, True)
        elif before in POWERED and after not in POWERED:
            option = _SLOW_DOWN_OPTIONS.get(made[-1])
            if option is not None:
                self._begin_stop(self._values[option.key])
            elif before is State.QUICK_STOP_ACTIVE and self._ramp_end_s is None:
                self._leave_to_brake()
            else:
                self.remove_torque()

    def _follow(self, word: int) -> None:
        """Pass setpoints to the plant."""
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

    def _add_torque(self) -> None:
        """Pass the torque offset to the plant; it also acts during ramps."""
        offset = self._values[od.TORQUE_OFFSET.key]
        if offset != self._offset_permille:
            self._offset_permille = offset
            self._plant.set_torque_offset(self._axis, offset * self._units.torque_nm_per_permille)

    def supervise_lag(self) -> None:
        """Fault if the following error stays outside 6065 for the time in 6066."""
        window = self._values[od.FOLLOWING_ERROR_WINDOW.key]
        if (
            self.machine.state is not _ENABLED
            or window == _WINDOW_OFF
            or abs(self._values[od.FOLLOWING_ERROR_ACTUAL.key]) <= window
        ):
            self._lag_since_s = None
        elif self._lag_since_s is None:
            self._lag_since_s = self._now_s
        if self._lag_since_s is not None:
            allowed_s = self._values[od.FOLLOWING_ERROR_TIMEOUT_MS.key] * 1e-3
            if self._now_s - self._lag_since_s >= allowed_s:
                self.fail(FOLLOWING_ERROR)

    def _begin_stop(self, option: int) -> None:
        """Slow down on the quick stop ramp, or remove torque at once, depending on the option code."""
        if option == 0:
            self.remove_torque()
            self._finish_ramp()
            return
        deceleration = self._values[od.QUICK_STOP_DECELERATION.key] / abs(self._units.counts_per_rad)
        over_s = max(_SHORTEST_STOP_S, abs(self._velocity_rad_s) / deceleration if deceleration else 0.0)
        self._plant.slow_down(self._axis, over_s)
        self._ramp_end_s = self._now_s + over_s

    def _finish_ramp(self) -> None:
        """End a quick stop or fault reaction at standstill."""
        self._ramp_end_s = None
        if self.machine.state is State.FAULT_REACTION_ACTIVE:
            self.machine.fault_reaction_done()
            self._leave_to_brake()
        elif (
            self.machine.state is State.QUICK_STOP_ACTIVE
            and self._values[od.QUICK_STOP_OPTION.key] not in _STAYS_IN_QUICK_STOP
        ):
            self.machine.quick_stop_done()
            self._leave_to_brake()
        elif self.machine.state not in POWERED:
            self._leave_to_brake()

    def _leave_to_brake(self) -> None:
        """Engage the brake at the end of a ramp, and remove the torque when it holds."""
        self._plant.hold_by_brake(self._axis)
        self._forget_motion()

    def remove_torque(self) -> None:
        """Remove torque at once; the brake engages."""
        self._plant.set_powered(self._axis, False)
        self._forget_motion()

    def _forget_motion(self) -> None:
        """Reset all motion state."""
        self._ramp_end_s = None
        self._lag_since_s = None
        self._limited = False
        if self._offset_permille:
            self._offset_permille = 0
            self._plant.set_torque_offset(self._axis, 0.0)

    @property
    def statusword(self) -> int:
        """Statusword of the present state, without bit 9 (remote)."""
        state = self.machine.state
        word = self.machine.status_bits | _VOLTAGE_ENABLED
        if state is _ENABLED:
            mode = self._values[od.MODE_DISPLAY.key]
            interpolating = bool(self._values[od.CONTROLWORD.key] & _INTERPOLATE)
            if mode == _CSP or (mode == _IP and interpolating):
                word |= _FOLLOWING
            if self._lag_since_s is not None:
                word |= _FOLLOWING_ERROR
            if self._limited:
                word |= _LIMIT_ACTIVE
        return word

    def fail(self, code: int, *, persistent: bool = False) -> None:
        """Detect a fault: report it, react according to 605E, then enter FAULT.

        Args:
            code: Error code.
            persistent: Whether the cause persists, so that a fault reset has no effect.
        """
        if self.machine.state in {State.FAULT, State.FAULT_REACTION_ACTIVE}:
            return
        powered = self.machine.state in POWERED
        self._persistent_fault = persistent
        self._report(code)
        self.machine.fault()
        if powered:
            self._begin_stop(self._values[od.FAULT_REACTION_OPTION.key])
        else:
            self._finish_ramp()

    def lose_master(self, code: int) -> bool:
        """React to the loss of the master according to 6007.

        Args:
            code: Error code of the loss, used if the reaction is a fault.

        Returns:
            Whether the reaction is a fault, which has then been reported.
        """
        if self.machine.state is not _ENABLED:
            return False
        option = self._values[od.ABORT_CONNECTION_OPTION.key]
        if option == 1:
            self.fail(code)
        elif option:
            self._interlocked = True
            reaction = Command.DISABLE_VOLTAGE if option == 2 else Command.QUICK_STOP
            self._make_transitions(reaction.value[1])
        return option == 1
