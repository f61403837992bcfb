"""Booting, checking and configuring one drive by SDO, up to the point where it could be enabled.

The order for an arm: `check_identity` of every node that is already up, so that another arm is refused before anything
is sent that changes it; NMT reset, unless a drive carries torque (`safe_reset`); `check_identity` again; `configure`. A
node that does not answer yet may still be reset, because that is how drives boot, unless only a simulation is allowed:
then every node must identify itself first.
Nothing here energises a drive. Missing objects are reported, not guessed.

References:
    CiA 301, 7.5.2; CiA 402-2, 6 to 8.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from armload_drivers.bring_up.drive_dialogue import DriveDialogue
from armload_drivers.bring_up.drive_objects import DriveObjects, write_cycle
from armload_drivers.bring_up.drive_securing import require_safety, secure
from armload_drivers.bring_up.pdo_setup import map_pdo, switch_others_off
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.sdo_channel import SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY, ArmSettings, DriveSettings, Identity
from armload_drivers.cia402.drive_safety import SafetyFinding, SafetyValues
from armload_drivers.cia402.object_dictionary import Entry
from armload_drivers.cia402.process_data.drive_scale import ReportedScale, resolve
from armload_drivers.cia402.process_data.drive_units import ArmUnits, AxisUnits
from armload_drivers.cia402.process_data.process_image import DriveImage, drive_image
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import (
    CommandError,
    ServoTimeout,
    WrongDevice,
)

HIGHEST_NODE_ID = 127


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


class DriveSetup(DriveDialogue):
    """Bring-up of one drive; its arguments are those of `DriveDialogue`.

    Attributes:
        settings: The drive's settings; complete once its scale has been read.
    """

    def __init__(
        self,
        drive: DriveSettings,
        arm: ArmSettings,
        *,
        image: DriveImage,
        sdo: SdoChannel,
        timeouts: Timeouts,
        master_node_id: int,
    ) -> None:
        super().__init__(drive, arm, image=image, sdo=sdo, timeouts=timeouts, master_node_id=master_node_id)
        self._objects = DriveObjects(sdo)
        self._identity = Identity(None, None)
        self._polarity = self._device_type = 0
        self._rated_current_a: float | None = None
        self._safety: tuple[SafetyFinding, ...] = ()

    def identify_before_reset(self) -> bool:
        """Identify the node before anything is sent that changes it; only reads.

        Returns:
            Whether it answers.

        Raises:
            ServoTimeout: only a simulation is allowed, and the node does not answer: it could be any device.
            WrongDevice: the node is another device.
            ServoError: an SDO failed.
        """
        simulation = is_simulation(self.settings.identity)
        self._sdo.step = "looking for the node"
        wait_s = self._timeouts.sdo_s if simulation else self._timeouts.probe_s
        if self._sdo.answers(od.DEVICE_TYPE, wait_s):
            self.check_identity()
            return True
        if simulation:
            raise ServoTimeout(
                self.settings.node_id,
                self.settings.joint,
                "looking for the node",
                f"no answer within {wait_s} s; only simulated drives are allowed, so no node is reset that has not "
                "identified itself as one",
                "Is the simulated drive running and connected, with this node id? One that was stopped by NMT does not "
                "answer: restart the simulation",
            )
        return False

    def require_alive(self) -> None:
        """Require an SDO answer from a node that was reset and sent no boot-up message.

        Raises:
            ServoTimeout: the node does not answer.
        """
        self._sdo.step = "booting"
        if not self._sdo.answers(od.DEVICE_TYPE, self._timeouts.sdo_s):
            raise ServoTimeout(
                self.settings.node_id,
                self.settings.joint,
                "booting",
                f"no boot-up message within {self._timeouts.boot_s} s of the reset and no answer after it",
                "Is the drive powered and connected, with this node id and bit rate?",
            )

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
            ("cycle", lambda: write_cycle(self._objects, self._arm)),
            ("PDOs", self._write_pdos),
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
        values = SafetyValues.of(self.settings, self._arm, units, self._master_node_id, self._rated_current_a)
        self._safety = secure(self._objects, values)
        # Only verified here; the watch itself starts with the cycle.
        self.watch_master(on=False)
        require_safety(self._objects, values, self._safety)

    def watch_master(self, *, on: bool) -> int | None:
        """As `DriveDialogue.watch_master`; while it is on, its value must not change."""
        watch = super().watch_master(on=on)
        self._objects.held.pop(od.HEARTBEAT_CONSUMER, None)
        if watch:
            self._objects.held[od.HEARTBEAT_CONSUMER] = watch
        return watch

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

    def _write_pdos(self) -> None:
        """Map the PDOs of each direction and switch the others off."""
        self._require_mapped_objects()
        for layout in self._image.layouts:
            self._sdo.step = f"mapping the {layout.direction.name.lower()} PDO {layout.number + 1}"
            self._objects.held |= map_pdo(self._sdo, layout)
        self._sdo.step = "switching unused PDOs off"
        for direction in od.PdoDirection:
            used = sum(layout.direction is direction for layout in self._image.layouts)
            switch_others_off(self._sdo, direction, used)

    def _require_mapped_objects(self) -> None:
        """Require the objects of the PDOs, with the size that the configuration expects."""
        self._sdo.step = "looking for the objects of its PDOs"
        for entry in [entry for layout in self._image.layouts for entry in layout.entries]:
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


def master_node_id(arm: ArmSettings) -> int:
    """Node id of the master's heartbeat: the highest that no other node has."""
    return max(set(range(1, HIGHEST_NODE_ID + 1)) - {drive.node_id for drive in arm.drives} - arm.other_nodes)


def arm_setups(arm: ArmSettings, link: BusLink, timeouts: Timeouts) -> list[DriveSetup]:
    """Bring-up of every drive of an arm."""
    return [
        DriveSetup(
            drive,
            arm,
            image=drive_image(drive),
            sdo=SdoChannel(drive.node_id, drive.joint, link, timeouts.sdo_s),
            timeouts=timeouts,
            master_node_id=master_node_id(arm),
        )
        for drive in arm.drives
    ]


def arm_with(arm: ArmSettings, setups: list[DriveSetup]) -> ArmSettings:
    """The arm's settings with the scales that its drives reported."""
    return replace(arm, drives=tuple(setup.settings for setup in setups))


def is_simulation(identity: Identity) -> bool:
    """Whether an identity is the simulation's."""
    known = SIMULATION_IDENTITY
    return identity.vendor_id == known.vendor_id and identity.product_code == known.product_code


def _ratio(numerator: int | None, denominator: int | None) -> float | None:
    """A ratio reported by a drive; None if it is incomplete or zero."""
    return numerator / denominator if numerator and denominator else None
