"""Booting, checking and configuring one drive by SDO, up to the point where it could be enabled.

The order for a whole arm: `check_identity` of every node that is up already, so that a foreign arm is refused
before anything is sent to it that changes something; NMT reset; `check_identity` again; `configure`. A node that does
not answer yet may be reset all the same, for that is how drives boot, but not where only a simulation is allowed: then
every node must identify itself first. Nothing here energises a drive. What a drive lacks is reported, not guessed.

References:
    CiA 301, 7.5.2; CiA 402-2, 6 to 8.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from armload_drivers.bring_up.drive_dialogue import DriveDialogue
from armload_drivers.bring_up.drive_objects import (
    DriveObjects,
    write_cycle,
    write_limits,
    write_setpoint_timeout,
    write_supervision,
)
from armload_drivers.bring_up.pdo_setup import map_pdo, switch_others_off
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.sdo_channel import SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY, ArmSettings, DriveSettings, Identity
from armload_drivers.cia402.drive_scale import ReportedScale, resolve
from armload_drivers.cia402.drive_units import ArmUnits, AxisUnits
from armload_drivers.cia402.process_image import DriveImage, drive_image
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import (
    CommandError,
    ServoTimeout,
    WrongDevice,
)

HIGHEST_NODE_ID = 127


@dataclass(frozen=True, slots=True)
class DriveReport:
    """What was found on one drive.

    Attributes:
        joint: Name of its joint.
        node_id: Node id.
        name: Device name (1008); empty where not reported.
        identity: 1018, as reported.
        supported_modes: 6502.
        polarity: 607E; 0 where not reported.
        missing: Objects that the drive does not have, or does not let be written, in words.
    """

    joint: str
    node_id: int
    name: str
    identity: Identity
    supported_modes: int
    polarity: int
    missing: tuple[str, ...]


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
        self._modes = self._polarity = 0

    def identify_before_reset(self) -> None:
        """Know who is there before anything is sent that changes something; only reads.

        Raises:
            ServoTimeout: only a simulation is allowed here, and the node does not answer: it could be anybody.
            WrongDevice: it answers and is another device.
            ServoError: an SDO failed.
        """
        simulation = is_simulation(self.settings.identity)
        self._sdo.step = "looking for the node"
        wait_s = self._timeouts.sdo_s if simulation else self._timeouts.probe_s
        if self._sdo.answers(od.DEVICE_TYPE, wait_s):
            self.check_identity()
        elif simulation:
            raise ServoTimeout(
                self.settings.node_id,
                self.settings.joint,
                "looking for the node",
                f"no answer within {wait_s} s; only simulated drives are allowed, so nothing is reset that has not "
                "shown to be one",
                "Is the simulated drive there, supplied and connected, with this node id? One that was stopped by NMT "
                "answers nothing: start the simulation anew",
            )

    def require_alive(self) -> None:
        """The node was reset and sent no boot-up message: it must answer SDO.

        Raises:
            ServoTimeout: it does not.
        """
        self._sdo.step = "booting"
        if not self._sdo.answers(od.DEVICE_TYPE, self._timeouts.sdo_s):
            raise ServoTimeout(
                self.settings.node_id,
                self.settings.joint,
                "booting",
                f"no boot-up message within {self._timeouts.boot_s} s of the reset and no answer after it",
                "Is the drive supplied and connected, with this node id and bit rate?",
            )

    def check_identity(self) -> Identity:
        """Device type and identity, against the configuration and, where it has none, the device description.

        Returns:
            The reported identity (1018).

        Raises:
            WrongDevice: it is no CiA 402 drive, or not the configured one.
            ServoError: an SDO failed.
        """
        self._sdo.step = "identifying"
        profile = self._sdo.read(od.DEVICE_TYPE) & 0xFFFF
        if profile != od.DEVICE_TYPE_SERVO & 0xFFFF:
            raise self._wrong(f"device profile {profile} instead of 402", "Another kind of device has this node id")
        self._identity = found = Identity(
            self._sdo.read(od.VENDOR_ID),
            self._sdo.read_if_there(od.PRODUCT_CODE),
            self._sdo.read_if_there(od.REVISION),
        )
        wanted = self._wanted_identity()
        for what, is_, should in (
            ("vendor id", found.vendor_id, wanted.vendor_id),
            ("product code", found.product_code, wanted.product_code),
            ("revision", found.revision, wanted.revision),
        ):
            if should is not None and is_ != should:
                text = "nothing" if is_ is None else f"0x{is_:08X}"
                raise self._wrong(
                    f"{what} (1018) is {text} instead of 0x{should:08X}",
                    "Is this the arm that the configuration describes? Then correct its identity there",
                )
        return found

    def _wanted_identity(self) -> Identity:
        """The identity required of 1018: the configuration's, else the description's; never its exact revision."""
        configured, described = self.settings.identity, self.settings.description
        if described is None or configured.vendor_id is not None:
            return configured
        return Identity(described.vendor_id, described.product_code)

    # Configuration -------------------------------------------------------------------------------------------

    def steps(self) -> tuple[tuple[str, Callable[[], None]], ...]:
        """What `configure` does between identity and units of the arm, by name and in order."""
        return (
            ("modes", self._check_mode),
            ("scaling", self._read_scale),
            ("supervision", lambda: write_supervision(self._objects, self._arm)),
            ("cycle", lambda: write_cycle(self._objects, self._arm)),
            ("PDOs", self._write_pdos),
            ("mode", self._select_mode),
        )

    def configure(self) -> int:
        """Check and write everything that needs this drive alone, in PRE-OPERATIONAL.

        Returns:
            Polarity (607E), 0 where the drive does not report it.

        Raises:
            WrongDevice: a mode or scale contradicts the configuration.
            SdoRefused: a necessary object was refused.
            ServoError: the drive does not keep what was written.
        """
        for _, step in self.steps():
            step()
        return self._polarity

    def write_limits(self, units: ArmUnits, axis: int) -> None:
        """What needs the units of the whole arm, because motors may be coupled; then the drive is judged.

        Raises:
            MissingSafety: the drive lacks what safety rests on.
            SdoRefused: a necessary object was refused.
        """
        write_limits(self._objects, self.settings, units, axis)
        self._sdo.step = "judging what the drive lacks"
        self._objects.require_safety(self.settings)

    def report(self) -> DriveReport:
        """What was found."""
        return DriveReport(
            joint=self.settings.joint,
            node_id=self.settings.node_id,
            name=self._read_name(),
            identity=self._identity,
            supported_modes=self._modes,
            polarity=self._polarity,
            missing=tuple(str(entry) for entry in self._objects.missing),
        )

    def read_units(self) -> AxisUnits:
        """The drive's scale, from the configuration and from what the drive reports. Only reads.

        Raises:
            WrongDevice: the two contradict each other.
            ServoError: an SDO failed.
        """
        self._read_scale()
        return AxisUnits.of(self.settings, self._polarity)

    def _wrong(self, what: str, remedy: str) -> WrongDevice:
        """Error about this drive at this step."""
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
        self._modes = modes or 0

    def _read_scale(self) -> None:
        """Polarity, and the scale that the drive reports checked against the configuration."""
        self._sdo.step = "reading the scaling"
        read, optional = self._objects.read, self._sdo.read_if_there
        self._polarity = read(od.POLARITY) or 0
        torque_mnm, current_ma = read(od.RATED_TORQUE_MNM), optional(od.RATED_CURRENT_MA)
        reported = ReportedScale(
            increments_per_motor_turn=_ratio(read(od.ENCODER_INCREMENTS), read(od.ENCODER_REVOLUTIONS)),
            gear_ratio=_ratio(read(od.GEAR_MOTOR_REVOLUTIONS), read(od.GEAR_SHAFT_REVOLUTIONS)),
            feed_per_shaft_turn=_ratio(optional(od.FEED), optional(od.FEED_SHAFT_REVOLUTIONS)),
            rated_torque_nm=None if torque_mnm is None else torque_mnm * 1e-3,
            rated_current_a=None if current_ma is None else current_ma * 1e-3,
        )
        try:
            self.settings = resolve(self.settings, reported)
        except CommandError as error:
            raise self._wrong(str(error), "Correct the configuration, or the drive's parameters") from error

    def _write_pdos(self) -> None:
        """Map the PDOs of each direction and switch the others off."""
        for layout in self._image.layouts:
            self._sdo.step = f"mapping the {layout.direction.name.lower()} PDO {layout.number + 1}"
            map_pdo(self._sdo, layout)
        self._sdo.step = "switching unused PDOs off"
        for direction in od.PdoDirection:
            used = sum(layout.direction is direction for layout in self._image.layouts)
            switch_others_off(self._sdo, direction, used)
        write_setpoint_timeout(self._objects, self._arm)

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


def master_node_id(arm: ArmSettings) -> int:
    """Node id that the master's heartbeat carries: the highest that no drive has."""
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
    """Whether an identity is that of a simulated drive."""
    known = SIMULATION_IDENTITY
    return identity.vendor_id == known.vendor_id and identity.product_code == known.product_code


def _ratio(numerator: int | None, denominator: int | None) -> float | None:
    """A ratio that a drive reports; None where it does not."""
    return numerator / denominator if numerator and denominator else None
