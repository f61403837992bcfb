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
from dataclasses import dataclass, replace

from armload_drivers.bring_up.drive_dialogue import DriveDialogue
from armload_drivers.bring_up.drive_objects import DriveObjects
from armload_drivers.bring_up.drive_securing import require_safety, secure
from armload_drivers.bring_up.sdo_channel import SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY, ArmSettings, DriveSettings, Identity
from armload_drivers.cia402.drive_safety import SafetyFinding, SafetyValues
from armload_drivers.cia402.object_dictionary import Entry
from armload_drivers.cia402.process_data.drive_scale import ReportedScale, resolve
from armload_drivers.cia402.process_data.drive_units import ArmUnits, AxisUnits
from armload_drivers.cia402.process_data.process_image import feedback_entries, setpoint_entries
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import CommandError, ServoTimeout, WrongDevice


@dataclass(frozen=True, slots=True)
class DriveReport:
    """Findings on one drive.

    Attributes:
        joint: Name of its joint.
        node_id: Node id.
        name: Device name (1008); empty if not reported.
        identity: 1018, as reported.
        polarity: 607E; 0 if not reported.
        missing: Objects that the drive lacks, or that do not hold the required value, as text.
        safety: Findings on every safety property; empty before they were checked.
        device_type: 1000; its upper half contains more than the mark of a CiA 402 drive.
    """

    joint: str
    node_id: int
    name: str
    identity: Identity
    polarity: int
    missing: tuple[str, ...]
    safety: tuple[SafetyFinding, ...]
    device_type: int


class DriveSetup(DriveDialogue, ABC):
    """Bring-up of one drive on either bus; its arguments are those of `DriveDialogue`.

    Attributes:
        settings: The drive's settings; complete once its scale has been read.
    """

    def __init__(self, drive: DriveSettings, arm: ArmSettings, sdo: SdoChannel, timeouts: Timeouts) -> None:
        super().__init__(drive, arm, sdo, timeouts)
        self._objects = DriveObjects(sdo)
        self._identity = Identity(None, None)
        self._polarity = self._device_type = 0
        self._rated_current_a: float | None = None
        self._safety: tuple[SafetyFinding, ...] = ()

    def check_identity(self) -> Identity:
        """Check device type and identity against the configuration or, if it states none, the device description.

        Returns:
            The reported identity (1018).

        Raises:
            WrongDevice: the node is not a CiA 402 drive, or not the configured one.
            ServoError: an SDO failed.
        """
        self._sdo.step = "identifying"
        self._device_type = device_type = self._sdo.read(od.DEVICE_TYPE)
        if not od.is_drive(device_type):
            raise self._wrong(
                od.no_drive(device_type),
                "If another kind of device has this node id, correct node_id: `armload drives scan` lists all. If it "
                "is the drive, its firmware does not declare CiA 402: ask its manufacturer for one that does",
            )
        self._identity = found = Identity(
            self._sdo.read(od.VENDOR_ID),
            self._sdo.read_if_there(od.PRODUCT_CODE),
            self._sdo.read_if_there(od.REVISION),
        )
        wanted = self.settings.wanted_identity
        for what, is_, should in (
            ("vendor id", found.vendor_id, wanted.vendor_id),
            ("product code", found.product_code, wanted.product_code),
            ("revision", found.revision, wanted.revision),
        ):
            if should is not None and is_ != should:
                text = "nothing" if is_ is None else f"0x{is_:08X}"
                raise self._wrong(
                    f"{what} (1018) is {text} instead of 0x{should:08X}",
                    "If this is the arm that the configuration describes, correct the identity there",
                )
        return found

    @property
    def identity(self) -> Identity:
        """1018, as reported when the drive was identified; empty before."""
        return self._identity

    @property
    def device_type(self) -> int:
        """1000, as reported when the drive was identified; 0 before."""
        return self._device_type

    # Configuration -------------------------------------------------------------------------------------------

    def steps(self) -> tuple[tuple[str, Callable[[], None]], ...]:
        """The steps of `configure`, by name and in order."""
        return (
            ("modes", self._check_mode),
            ("scaling", self._read_scale),
            ("cycle", self._write_cycle),
            ("PDOs", self._map_pdos),
            ("mode", self._select_mode),
        )

    def configure(self) -> int:
        """Check and write everything that concerns only this drive, in PRE-OPERATIONAL.

        Returns:
            Polarity (607E); 0 if the drive does not report it.

        Raises:
            WrongDevice: a mode or scale contradicts the configuration.
            SdoRefused: a necessary object was refused.
            ServoError: the drive does not keep a written value.
        """
        for _, step in self.steps():
            step()
        return self._polarity

    def secure(self, units: ArmUnits) -> None:
        """Provide the safety properties; requires the units of all drives, because motors may be coupled.

        Raises:
            MissingSafety: the drive lacks a property, and the configuration does not accept that.
            ServoError: the drive does not answer.
        """
        values = SafetyValues.of(self.settings, self._arm, units, self._rated_current_a)
        self._safety = secure(self._objects, values)
        # Only verified here; the watch itself starts with the cycle.
        self.watch_master(on=False)
        require_safety(self._objects, values, self._safety)

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
    def _map_pdos(self) -> None:
        """Map the objects of the cycle."""

    @property
    def objects(self) -> DriveObjects:
        """Its objects, and the values that must not change before the drive is configured again."""
        return self._objects

    def require_as_configured(self) -> None:
        """Require a drive without torque or fault, with the settings that were read back when it was configured.

        Raises:
            ServoFault: it is in FAULT.
            ServoError: it carries torque, or a setting has changed.
        """
        self.require_disabled()
        self._objects.require_held()

    def report(self) -> DriveReport:
        """The findings."""
        return DriveReport(
            joint=self.settings.joint,
            node_id=self.settings.node_id,
            name=self._read_name(),
            identity=self._identity,
            polarity=self._polarity,
            missing=tuple(str(entry) for entry in self._objects.missing),
            safety=self._safety,
            device_type=self._device_type,
        )

    def read_units(self) -> AxisUnits:
        """The drive's scale, from the configuration and the drive. Only reads.

        Raises:
            WrongDevice: the two contradict each other.
            ServoError: an SDO failed.
        """
        self._read_scale()
        return AxisUnits.of(self.settings, self._polarity)

    def _wrong(self, what: str, remedy: str) -> WrongDevice:
        """Error of this drive at the present step."""
        return WrongDevice(self.settings.node_id, self.settings.joint, self._sdo.step, what, remedy)

    def _read_name(self) -> str:
        """Device name."""
        self._sdo.step = "reading the name"
        return self._sdo.read_text_if_there(od.DEVICE_NAME)

    def _check_mode(self) -> None:
        """Require the configured mode to be among 6502."""
        self._sdo.step = "checking the mode"
        modes = self._objects.read(od.SUPPORTED_MODES)
        mode = self.settings.mode
        if modes is not None and not modes >> (mode - 1) & 1:
            offered = [str(number + 1) for number in range(32) if modes >> number & 1]
            raise self._wrong(
                f"mode {int(mode)} ({mode.name}) is not offered, only {', '.join(offered) or 'none'} (6502)",
                "Set this drive's mode in the configuration to one it offers: 7 or 8",
            )

    def _read_scale(self) -> None:
        """Read polarity and scale, and check them against the configuration."""
        self._sdo.step = "reading the scaling"
        read, optional = self._objects.read, self._sdo.read_if_there
        polarity = read(od.POLARITY)
        self._polarity = polarity or 0
        if polarity is not None:
            self._objects.held[od.POLARITY] = polarity
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

    def _require_mapped_objects(self) -> None:
        """Require the objects of the PDOs, with the size that the configuration expects."""
        self._sdo.step = "looking for the objects of its PDOs"
        for entry in (*setpoint_entries(self.settings), *feedback_entries(self.settings)):
            bits = self._sdo.bits_if_there(entry)
            if bits is None:
                raise self._wrong(f"the drive has no {entry}", self._instead_of(entry))
            if bits != entry.type.bits:
                remedy = "The configuration expects another data type: see the manufacturer's manual"
                if entry.key == od.TORQUE_OFFSET.key:
                    remedy = f"Set torque_offset_bits = {bits}"
                raise self._wrong(f"{entry} has {bits} bits instead of {entry.type.bits}", remedy)

    def _instead_of(self, entry: Entry) -> str:
        """How the configuration can avoid a missing object."""
        if entry.key == od.TORQUE_OFFSET.key:
            return "Set torque_offset = false; feed-forward is then refused on this drive"
        for other, name in ((od.TORQUE_ACTUAL, "torque"), (od.CURRENT_ACTUAL, "current")):
            if entry in {od.TORQUE_ACTUAL, od.CURRENT_ACTUAL} and self._sdo.has(other):
                return f'It has {other}: set feedback = "{name}"'
        if entry in {od.TORQUE_ACTUAL, od.CURRENT_ACTUAL}:
            return "Name the manufacturer's object for current or torque: effort_object"
        return "A joint requires it: use another mode or another drive"

    def _select_mode(self) -> None:
        """Write 6060 and wait for 6061."""
        self._sdo.step = "selecting the mode"
        mode = int(self.settings.mode)
        self._sdo.write(od.MODE, mode)
        found = self._sdo.read_until(od.MODE_DISPLAY, mode, self._timeouts.mode_s)
        if found != mode:
            raise ServoTimeout(
                self.settings.node_id,
                self.settings.joint,
                self._sdo.step,
                f"6061 reports mode {found} after {self._timeouts.mode_s} s, {mode} was requested",
                "Is the mode licensed and allowed in the drive's present state?",
            )
        self._objects.held[od.MODE_DISPLAY] = mode


def arm_with(arm: ArmSettings, setups: Sequence[DriveSetup]) -> ArmSettings:
    """The arm's settings with the scales that its drives reported."""
    return replace(arm, drives=tuple(setup.settings for setup in setups))


def is_simulation(identity: Identity) -> bool:
    """Whether an identity is the simulation's."""
    known = SIMULATION_IDENTITY
    return identity.vendor_id == known.vendor_id and identity.product_code == known.product_code


def _ratio(numerator: int | None, denominator: int | None) -> float | None:
    """A ratio reported by a drive; None if it is incomplete or zero."""
    return numerator / denominator if numerator and denominator else None
