"""Checking and configuring one drive by SDO, up to the point where it could be enabled.

The order for an arm: `check_identity`, `configure`, and `secure` once the units of all drives are known. What differs
between buses is in `canopen.canopen_setup` and `ethercat.ethercat_setup`: how a drive is found and started, its PDOs,
and the objects of its cycle. Nothing here energises a drive. Missing objects are reported, not guessed.

References:
    CiA 301, 7.5.2; CiA 402-2, 6 to 8.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

from armload_drivers.bring_up.drive_objects import DriveObjects
from armload_drivers.bring_up.drive_securing import require_safety, secure
from armload_drivers.bring_up.sdo_channel import OUT_OF_RANGE, SdoChannel
from armload_drivers.bring_up.sdo_requests import SdoRequests
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import (
    SIMULATION_IDENTITY,
    ArmSettings,
    DriveSettings,
    Identity,
    OperationMode,
)
from armload_drivers.cia402.drive_safety import SafetyFinding, SafetyValues
from armload_drivers.cia402.object_dictionary import Entry, PdoDirection
from armload_drivers.cia402.process_data.drive_scale import ReportedScale, resolve
from armload_drivers.cia402.process_data.drive_units import ArmUnits, AxisUnits
from armload_drivers.cia402.process_data.process_image import (
    effort_entry,
    feedback_entries,
    setpoint_entries,
    target_entry,
)
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import CommandError, SdoRefused, ServoError, ServoTimeout, WrongDevice

Step = tuple[str, Callable[[], str | None]]
"""A step of the configuration, by name; may return what it has found, as text."""

_MODE_KEYS = {OperationMode.CYCLIC_SYNCHRONOUS_POSITION: "csp", OperationMode.INTERPOLATED_POSITION: "ip"}
"""Values of the key `mode`."""
_COUNT_BITS = 8
"""Size of sub-index 0 of a record or array."""
_WIDE_BITS = 32
_EFFORTS = (od.TORQUE_ACTUAL, od.CURRENT_ACTUAL, od.TORQUE_ACTUAL_32, od.CURRENT_ACTUAL_32)

_NO_CYCLIC_MODE = (
    "An arm's joints move in step only in mode 8 (cyclic synchronous position, 607A) or 7 (interpolated position, "
    "60C1); a profile mode plans a motion of its own. Use firmware or a licence of the manufacturer that has one of "
    "these, or another drive"
)
_NO_EFFORT = (
    "A drive must report current (6078) or torque (6077) in a PDO. If it has an object of its manufacturer for one of "
    "these, name it with its scale in effort_object, or in a profile of the product; otherwise use other firmware or "
    "another drive"
)


class DriveSetup(SdoRequests, ABC):
    """Bring-up of one drive on either bus; its arguments are those of `SdoRequests`.

    Attributes:
        settings: The drive's settings; complete once its scale has been read.
        objects: Its objects, and the values that must not change before the drive is configured again.
        identity: 1018, as reported when the drive was identified; empty before.
        device_type: 1000, as reported when the drive was identified; 0 before.
        polarity: 607E, as read with the scale; 0 if not reported.
        safety: Findings on every safety property; empty before they were checked.
    """

    def __init__(self, drive: DriveSettings, arm: ArmSettings, sdo: SdoChannel, timeouts: Timeouts) -> None:
        super().__init__(drive, arm, sdo, timeouts)
        self.objects = DriveObjects(sdo)
        self.identity = Identity(None, None)
        self.device_type = self.polarity = 0
        self._rated_current_a: float | None = None
        self.safety: tuple[SafetyFinding, ...] = ()

    def check_identity(self) -> Identity:
        """Check device type and identity against the configuration or, if it states none, the device description.

        Returns:
            The reported identity (1018).

        Raises:
            WrongDevice: the node is not a CiA 402 drive, or not the configured one.
            ServoError: an SDO failed.
        """
        self._sdo.step = "identifying"
        self.device_type = device_type = self._sdo.read(od.DEVICE_TYPE)
        if not od.is_drive(device_type):
            raise self._wrong(
                od.no_drive(device_type),
                "If another kind of device has this node id, correct node_id: `armload drives scan` lists all. If it "
                "is the drive, its firmware does not declare CiA 402: ask its manufacturer for one that does",
            )
        self.identity = found = Identity(
            self._sdo.read(od.VENDOR_ID),
            self._sdo.read_if_there(od.PRODUCT_CODE),
            self._sdo.read_if_there(od.REVISION),
            None if self.settings.wanted_identity.serial is None else self._sdo.read_if_there(od.SERIAL_NUMBER),
        )
        wanted = self.settings.wanted_identity
        for what, is_, should in (
            ("vendor id", found.vendor_id, wanted.vendor_id),
            ("product code", found.product_code, wanted.product_code),
            ("revision", found.revision, wanted.revision),
            ("serial number", found.serial, wanted.serial),
        ):
            if should is not None and is_ != should:
                text = "nothing" if is_ is None else f"0x{is_:08X}"
                raise self._wrong(
                    f"{what} (1018) is {text} instead of 0x{should:08X}",
                    f"If this is the arm that the configuration describes, correct the identity there: {stated(found)}",
                )
        if self.settings.is_named and wanted.product_code is None and found.product_code is not None:
            raise self._wrong(
                "the drive reports a product code (1018:2), and the configuration states none",
                f"If it belongs to this arm, state it: {stated(found)}",
            )
        return found

    # Configuration -------------------------------------------------------------------------------------------

    def reading_steps(self) -> tuple[Step, ...]:
        """The first steps of `configure`, which only read."""
        return (
            ("axes", self._check_axes),
            ("modes", self._check_mode),
            ("scaling", self._read_scale),
            ("objects", self._find_mapped_objects),
            ("reference", self._check_reference),
        )

    def writing_steps(self) -> tuple[Step, ...]:
        """The other steps of `configure`."""
        return (
            ("cycle", self._write_cycle),
            ("setpoints", lambda: self._map(PdoDirection.RECEIVE)),
            ("feedback", lambda: self._map(PdoDirection.TRANSMIT)),
            ("mode", self._select_mode),
        )

    def configure(self) -> None:
        """Check and write everything that concerns only this drive, in PRE-OPERATIONAL.

        Raises:
            WrongDevice: a mode or scale contradicts the configuration.
            SdoRefused: a necessary object was refused.
            ServoError: the drive does not keep a written value.
        """
        for _, step in (*self.reading_steps(), *self.writing_steps()):
            step()

    def secure(self, units: ArmUnits) -> None:
        """Provide the safety properties; requires the units of all drives, because motors may be coupled.

        Raises:
            MissingSafety: the drive lacks a property, and the configuration does not accept that.
            ServoError: the drive does not answer.
        """
        values = SafetyValues(self.settings, self._arm, units, self._rated_current_a)
        self.safety = secure(self.objects, values)
        require_safety(self.objects, values, self.safety)
        # Only verified here; the watch itself starts with the cycle.
        self.watch_master(on=False)

    @abstractmethod
    def require_alive(self) -> None:
        """Require an answer from a drive that was started and did not report this.

        Raises:
            ServoTimeout: the drive does not answer.
        """

    def watch_master(self, *, on: bool) -> None:
        """Switch the drive's watch on its master on or off, if it is a setting of the drive."""

    @abstractmethod
    def _write_cycle(self) -> None:
        """Write the objects of the cycle."""

    @abstractmethod
    def _map(self, direction: PdoDirection) -> None:
        """Map what the drive receives, or what it sends, in each cycle."""

    def require_as_configured(self) -> None:
        """Require a drive without torque or fault, with the settings that were read back when it was configured.

        Raises:
            ServoFault: it is in FAULT.
            ServoError: it carries torque, or a setting has changed.
        """
        self.require_disabled()
        self.objects.require_held()

    def read_units(self) -> AxisUnits:
        """The drive's scale, from the configuration and the drive. Only reads.

        Raises:
            WrongDevice: the two contradict each other.
            ServoError: an SDO failed.
        """
        self._read_scale()
        return AxisUnits.of(self.settings, self.polarity)

    def _wrong(self, what: str, remedy: str) -> ServoError:
        """Error of a drive that contradicts the configuration, at the present step."""
        return self._sdo.failure(what, remedy, WrongDevice)

    def _check_axes(self) -> None:
        """Require a drive of one axis: nothing here watches or stops a second one."""
        self._sdo.step = "looking for a second axis"
        if not self.settings.second_axis_unused and self._sdo.bits_if_there(od.SECOND_CONTROLWORD):
            raise self._wrong(
                f"the drive serves several axes with one node id: it has {od.SECOND_CONTROLWORD}, and only the first "
                "axis is watched and stopped",
                "Use a drive for each axis, or let the manufacturer's tool give each axis a node id of its own. If "
                "nothing is connected to the others: second_axis_unused = true",
            )
        # Some drives answer for any sub-index; the number of sub-indices has a size of its own.
        if self._sdo.bits_if_there(od.POSITION_ACTUAL) == _COUNT_BITS and self._sdo.has(od.SECOND_POSITION):
            raise self._wrong(
                f"the drive serves several axes with one node id: it has {od.SECOND_POSITION}",
                "A drive whose axes are sub-indices of one object cannot be used: use a drive for each axis",
            )

    def _check_reference(self) -> str:
        """Require an axis whose position has its reference, if the drive reports this; what it says about homing."""
        self._sdo.step = "checking the reference"
        bit = self.settings.homed_bit
        if bit is not None and not self._sdo.read(od.STATUSWORD) >> bit & 1:
            raise self._sdo.failure(
                f"the axis is not homed: bit {bit} of the statusword (6041) is 0",
                "Its position means nothing. Home it with the manufacturer's tool, or see the manual for how an "
                "absolute encoder is set; then repeat this command",
            )
        offset, method = (self._sdo.read_if_there(entry) for entry in (od.HOME_OFFSET, od.HOMING_METHOD))
        found = [
            f"{name} is {value}"
            for name, value in (("home offset (607C)", offset), ("homing method (6098)", method))
            if value is not None
        ]
        return ", ".join(found) or "no 607C, no 6098"

    def _check_mode(self) -> None:
        """Require the configured mode to be among 6502, with the object for its setpoint."""
        self._sdo.step = "checking the mode"
        modes = self.objects.read(od.SUPPORTED_MODES)
        mode = self.settings.mode
        # 0 is the value of firmware that does not maintain 6502; 6061 then decides.
        if modes and not modes >> (mode - 1) & 1:
            what = f"mode {_named(mode)} is not offered, only {od.named_modes(modes)} (6502)"
        elif not self._sdo.has(target_entry(mode)):
            what = f"the drive has no {target_entry(mode)}, which mode {_named(mode)} requires"
        else:
            return
        raise self._wrong(what, self._other_mode(lambda other: not modes or bool(modes >> (other - 1) & 1)))

    def _other_mode(self, offered: Callable[[OperationMode], bool]) -> str:
        """What to do about a drive that cannot be used in the configured mode."""
        without = ""
        for other, name in _MODE_KEYS.items():
            if other is self.settings.mode or not offered(other):
                continue
            if self._sdo.has(target_entry(other)):
                return f'Set mode = "{name}"'
            without = f"Of mode {_named(other)} the drive lacks {target_entry(other)}. "
        return without + _NO_CYCLIC_MODE

    def _takes_mode(self, mode: OperationMode) -> bool:
        """Whether 6060 takes a mode; the drive is disabled."""
        with suppress(SdoRefused):
            self._sdo.write(od.MODE, int(mode))
            return True
        return False

    def _read_scale(self) -> None:
        """Read polarity and scale, and check them against the configuration."""
        self._sdo.step = "reading the scaling"
        read, optional = self.objects.read, self._sdo.read_if_there
        polarity = read(od.POLARITY)
        self.polarity = polarity or 0
        if polarity is not None:
            self.objects.held[od.POLARITY] = polarity
        torque, current_ma = read(od.RATED_TORQUE_MNM), optional(od.RATED_CURRENT_MA)
        self._rated_current_a = None if current_ma is None else current_ma * 1e-3
        reported = ReportedScale(
            increments_per_motor_turn=_ratio(read(od.ENCODER_INCREMENTS), read(od.ENCODER_REVOLUTIONS)),
            gear_ratio=_ratio(read(od.GEAR_MOTOR_REVOLUTIONS), read(od.GEAR_SHAFT_REVOLUTIONS)),
            feed_per_shaft_turn=_ratio(optional(od.FEED), optional(od.FEED_SHAFT_REVOLUTIONS)),
            rated_torque_nm=None if torque is None else torque * self.settings.rated_torque_unit_nm,
            rated_current_a=self._rated_current_a,
        )
        try:
            self.settings = resolve(self.settings, reported)
        except CommandError as error:
            raise self._wrong(str(error), "Correct the configuration, or the drive's parameters") from error

    def _find_mapped_objects(self) -> None:
        """Require the objects of the cycle, with the size that the configuration expects; all errors in one."""
        self._sdo.step = "looking for the objects of its PDOs"
        wrong = []
        for entry in (*setpoint_entries(self.settings), *feedback_entries(self.settings)):
            bits = self._sdo.bits_if_there(entry)
            if bits is None and entry is target_entry(self.settings.mode):
                continue  # `_check_mode` reports it
            if bits is None:
                wrong.append((f"the drive has no {entry}", self.instead_of(entry, self._sdo.has)))
            elif bits != entry.type.bits:
                wrong.append((f"{entry} has {bits} bits instead of {entry.type.bits}", self._resized(entry, bits)))
        if wrong:
            raise self._wrong("; ".join(what for what, _ in wrong), ". ".join(remedy for _, remedy in wrong))

    def instead_of(self, entry: Entry, can_be_used: Callable[[Entry], bool]) -> str:
        """How the configuration can avoid an object that is missing or cannot be mapped to a PDO.

        Args:
            entry: The object.
            can_be_used: Whether the same is not true of another object.
        """
        if entry.key == od.TORQUE_OFFSET.key:
            return "Set torque_offset = false; feed-forward is then refused on this drive"
        ours = self.settings.vendor_effort
        named = ours is not None and entry.key == effort_entry(self.settings).key
        if entry not in _EFFORTS and not named:
            return f"A joint requires {entry.index:04X}: use other firmware, or another drive"
        for other, name in ((od.TORQUE_ACTUAL, "torque"), (od.CURRENT_ACTUAL, "current")):
            if entry.key != other.key and can_be_used(other):
                instead = f'It has {other}: set feedback = "{name}"'
                return f"Correct effort_object. Or leave it out. {instead}" if named else instead
        return f"Correct effort_object. {_NO_EFFORT}" if named else _NO_EFFORT

    def _resized(self, entry: Entry, bits: int) -> str:
        """How the configuration can use an object of another size."""
        if self.settings.vendor_effort is not None and entry.key == effort_entry(self.settings).key:
            return f'Correct the type in effort_object: "i{bits}" has {bits} bits'
        key = {od.TORQUE_OFFSET.key: "torque_offset_bits"} | {effort.key: "effort_bits" for effort in _EFFORTS}
        room = self._room_for_32_bits(entry) if bits == _WIDE_BITS else ""
        if entry.key in key and (room or bits not in {16, _WIDE_BITS}):
            return room + self.instead_of(entry, lambda other: self._sdo.bits_if_there(other) == other.type.bits)
        if entry.key not in key:
            return f"A drive of CiA 402 has {entry.type.bits}: ask its manufacturer for firmware that conforms"
        name = key[entry.key]
        return f"Set {name} = {bits}{self._rate_for(**{name: bits})}"

    def _room_for_32_bits(self, entry: Entry) -> str:
        """Why an object of this size has no room beside the others, as text; empty if it has."""
        return ""

    def _rate_for(self, **of_drives: Any) -> str:
        """What advice about every drive must add so that it fits the bus, as text; see `bus_budget.with_rate_for`."""
        return ""

    def _select_mode(self) -> None:
        """Write 6060 and wait for 6061, which some drives lack."""
        self._write_mode()
        self.objects.held[self._require_mode()] = int(self.settings.mode)

    def _write_mode(self) -> None:
        """Write 6060; a drive without it must be in the mode."""
        self._sdo.step = "selecting the mode"
        if not self._sdo.has(od.MODE):
            found = self._sdo.read_if_there(od.MODE_DISPLAY)
            if found == self.settings.mode:
                return
            raise self._wrong(
                f"the drive has no {od.MODE}, and 6061 does not report mode {_named(self.settings.mode)}, but {found}",
                "Set this mode with the manufacturer's tool, use firmware that has 6060, or another drive",
            )
        try:
            self._sdo.write(od.MODE, int(self.settings.mode))
        except SdoRefused as refusal:
            if refusal.abort_code not in OUT_OF_RANGE:
                raise
            what = f"6060 refuses mode {_named(self.settings.mode)} with 0x{refusal.abort_code:08X}"
            raise self._wrong(what, self._other_mode(self._takes_mode)) from refusal

    def _require_mode(self) -> Entry:
        """Wait for 6061, or 6060 on drives without it; the object."""
        mode = int(self.settings.mode)
        shown = od.MODE_DISPLAY if self.objects.read(od.MODE_DISPLAY) is not None else od.MODE
        found = self._sdo.read_until(shown, mode, self._timeouts.mode_s)
        if found != mode:
            raise self._sdo.failure(
                f"{shown.index:04X} reports mode {found} after {self._timeouts.mode_s} s, {mode} was requested",
                "Is the mode licensed and allowed in the drive's present state?",
                ServoTimeout,
            )
        return shown


def _named(mode: OperationMode) -> str:
    """A mode by number and name."""
    return f"{int(mode)} ({mode.name})"


def configured_units(arm: ArmSettings, setups: Sequence[DriveSetup]) -> ArmUnits:
    """The arm's units with the scales and polarities that its drives reported."""
    scaled = replace(arm, drives=tuple(setup.settings for setup in setups))
    return ArmUnits(scaled, [setup.polarity for setup in setups])


def stated(found: Identity) -> str:
    """An identity as the robot's file states it."""
    numbers = ", ".join(
        f"{key} = 0x{value:08X}"
        for key, value in (("vendor_id", found.vendor_id), ("product_code", found.product_code))
        if value is not None
    )
    return f"identity = {{ {numbers} }}"


def is_simulation(identity: Identity) -> bool:
    """Whether an identity is the simulation's."""
    known = SIMULATION_IDENTITY
    return identity.vendor_id == known.vendor_id and identity.product_code == known.product_code


def _ratio(numerator: int | None, denominator: int | None) -> float | None:
    """A ratio reported by a drive; None if it is incomplete or zero."""
    return numerator / denominator if numerator and denominator else None
