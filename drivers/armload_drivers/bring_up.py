"""Booting, checking and configuring one drive by SDO, up to the point where it could be enabled.

The order for a whole arm: `check_identity` of every node that is up already, so that a foreign arm is refused
before anything is sent to it that changes something; NMT reset; `await_boot`; `check_identity` again;
`configure`. Nothing here energises a drive. What a drive lacks is reported, not guessed.

References:
    CiA 301, 7.5.2; CiA 402-2, 6 to 8.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from armload_drivers import objects as od
from armload_drivers.arm import ArmSettings, DriveSettings, Identity
from armload_drivers.cia402 import POWERED, State, decode
from armload_drivers.emergency import describe
from armload_drivers.errors import SdoRefused, ServoFault, ServoTimeout, StatuswordError, WrongDevice
from armload_drivers.objects import Entry, PdoDirection
from armload_drivers.pdo_setup import map_pdo, switch_others_off
from armload_drivers.process_image import DriveImage
from armload_drivers.sdo_channel import SdoChannel
from armload_drivers.timeouts import Timeouts
from armload_drivers.units import ArmUnits, interpolation_time, microseconds, milliseconds

HEARTBEAT_TOLERANCE = 2.5
"""A heartbeat is overdue after this many periods, on both sides."""

SCALE_TOLERANCE = 1e-3
"""Relative difference of a position scale that passes as rounding."""
RATING_TOLERANCE = 1e-2
"""Relative difference of a rated current or torque that passes as rounding."""

QUICK_STOP_AND_STAY = 6
"""605A: slow down on the quick stop ramp and stay in QUICK STOP ACTIVE, with torque on."""
FAULT_REACTION_RAMP = 2
"""605E: slow down on the quick stop ramp, then remove torque."""
ABORT_BY_QUICK_STOP = 3
"""6007: a lost master is answered with a quick stop."""
PRE_OPERATIONAL_ON_ERROR = 0
"""1029: a lost master also ends PDO communication, so that late frames set nothing in motion."""


@dataclass(frozen=True, slots=True)
class DriveReport:
    """What was found on one drive.

    Attributes:
        joint: Name of its joint.
        node_id: Node id.
        name: Device name (1008); empty where it does not tell.
        identity: What 1018 tells.
        supported_modes: 6502.
        polarity: 607E; 0 where it does not tell.
        missing: Objects that the drive does not have, or does not let be written, in words.
    """

    joint: str
    node_id: int
    name: str
    identity: Identity
    supported_modes: int
    polarity: int
    missing: tuple[str, ...]


class DriveSetup:
    """Bring-up of one drive.

    Args:
        drive: Its settings.
        arm: The arm's settings.
        axis: Its index.
        image: Its PDOs.
        sdo: SDO access to it.
        timeouts: Limits of the waits.
        master_node_id: Whose heartbeat it is to watch.
    """

    def __init__(
        self,
        drive: DriveSettings,
        arm: ArmSettings,
        axis: int,
        *,
        image: DriveImage,
        sdo: SdoChannel,
        timeouts: Timeouts,
        master_node_id: int,
    ) -> None:
        self._drive, self._arm, self._axis = drive, arm, axis
        self._image, self._sdo, self._timeouts = image, sdo, timeouts
        self._master_node_id = master_node_id
        self._missing: list[str] = []

    def is_up(self) -> bool:
        """Whether the node answers at all; a short look."""
        self._sdo.step = "looking for the node"
        return self._sdo.answers(od.DEVICE_TYPE, self._timeouts.probe_s)

    def require_alive(self) -> None:
        """The node was reset and sent no boot-up message: it has to answer SDO.

        Raises:
            ServoTimeout: it does not.
        """
        self._sdo.step = "booting"
        if not self._sdo.answers(od.DEVICE_TYPE, self._timeouts.sdo_s):
            raise ServoTimeout(
                self._drive.node_id,
                self._drive.joint,
                "booting",
                f"no boot-up message within {self._timeouts.boot_s} s of the reset and no answer after it",
                "Is the drive supplied and connected, with this node id and bit rate?",
            )

    def check_identity(self) -> Identity:
        """Device type and identity.

        Returns:
            What 1018 tells.

        Raises:
            WrongDevice: it is no CiA 402 drive, or not the configured one.
            ServoError: an SDO failed.
        """
        self._sdo.step = "identifying"
        profile = self._sdo.read(od.DEVICE_TYPE) & 0xFFFF
        if profile != od.DEVICE_TYPE_SERVO & 0xFFFF:
            raise self._wrong(f"device profile {profile} instead of 402", "Another kind of device has this node id")
        found = Identity(
            self._sdo.read(od.VENDOR_ID),
            self._sdo.read_if_there(od.PRODUCT_CODE),
            self._sdo.read_if_there(od.REVISION),
        )
        wanted = self._drive.identity
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

    def configure(self, identity: Identity) -> DriveReport:
        """Check and write everything the cycle relies on, in PRE-OPERATIONAL.

        Raises:
            WrongDevice: a mode or scale contradicts the configuration.
            SdoRefused: a necessary object was refused.
            ServoError: the drive does not keep what was written.
        """
        self._missing = []
        modes = self._check_mode()
        self._sdo.step = "reading the scaling"
        polarity = self._optional(od.POLARITY) or 0
        self._check_scaling()
        self._write_supervision()
        self._write_limits(polarity)
        self._write_cycle()
        self._write_pdos()
        self._select_mode()
        return DriveReport(
            joint=self._drive.joint,
            node_id=self._drive.node_id,
            name=self._read_name(),
            identity=identity,
            supported_modes=modes,
            polarity=polarity,
            missing=tuple(self._missing),
        )

    def hold_present_position(self) -> int:
        """Write the fresh actual position to the target, and no torque offset; returns the position."""
        self._sdo.step = "presetting the target"
        counts = self._sdo.read(od.POSITION_ACTUAL)
        for entry in self._image.rpdo.entries:
            if entry is od.TARGET_POSITION or entry is od.INTERPOLATION_SETPOINT:
                self._sdo.write(entry, counts)
            elif entry is od.TORQUE_OFFSET:
                self._sdo.write(entry, 0)
        return counts

    def require_no_fault(self) -> None:
        """Refuse to go on with a drive in FAULT.

        Raises:
            ServoFault: with the drive's error code.
        """
        self._sdo.step = "checking for faults"
        word = self._sdo.read(od.STATUSWORD)
        try:
            state = decode(word)
        except StatuswordError as error:
            raise self._sdo.failure(str(error), "Does this drive follow CiA 402? See its manual") from error
        if state in {State.FAULT, State.FAULT_REACTION_ACTIVE}:
            code = self._sdo.read_if_there(od.ERROR_CODE)
            cause = "603F does not tell why" if code is None else describe(code)
            raise ServoFault(
                self._drive.node_id,
                self._drive.joint,
                "enabling",
                f"the drive is in FAULT: {cause}",
                "Remove the cause, then reset the fault by name and enable anew",
            )

    def remove_torque(self) -> None:
        """Take the torque of a drive that has left the cycle, by SDO.

        Raises:
            ServoError: it does not answer, or keeps its torque.
        """
        self._sdo.step = "removing torque by SDO"
        self._sdo.write(od.CONTROLWORD, 0)
        word = self._sdo.read(od.STATUSWORD)
        if decode(word) in POWERED:
            raise self._sdo.failure(f"the drive keeps its torque, statusword 0x{word:04X}", "Use the emergency stop")

    def watch_master(self, *, on: bool) -> None:
        """Have the drive watch the master's heartbeat, or not."""
        self._sdo.step = "setting the heartbeat to watch"
        time_ms = milliseconds(HEARTBEAT_TOLERANCE * self._arm.heartbeat_s) if on else 0
        self._sdo.write_if_there(od.HEARTBEAT_CONSUMER, self._master_node_id << 16 | time_ms)

    def _wrong(self, what: str, remedy: str) -> WrongDevice:
        """Error about this drive at this step."""
        return WrongDevice(self._drive.node_id, self._drive.joint, self._sdo.step, what, remedy)

    def _optional(self, entry: Entry) -> int | None:
        """Read an object that not every drive has."""
        value = self._sdo.read_if_there(entry)
        if value is None:
            self._missing.append(str(entry))
        return value

    def _preferred(self, entry: Entry, value: int) -> None:
        """Write an object that not every drive has."""
        if not self._sdo.write_if_there(entry, value):
            self._missing.append(str(entry))

    def _read_name(self) -> str:
        """Device name."""
        self._sdo.step = "reading the name"
        try:
            return self._sdo.read_text(od.DEVICE_NAME)
        except SdoRefused:
            return ""

    def _check_mode(self) -> int:
        """The configured mode has to be among 6502."""
        self._sdo.step = "checking the mode"
        modes = self._optional(od.SUPPORTED_MODES)
        mode = self._drive.mode
        if modes is not None and not modes >> (mode - 1) & 1:
            offered = [str(number + 1) for number in range(32) if modes >> number & 1]
            raise self._wrong(
                f"mode {int(mode)} ({mode.name}) is not offered, only {', '.join(offered) or 'none'} (6502)",
                "Set this drive's mode in the configuration to one it offers: 7 or 8",
            )
        return modes or 0

    def _check_scaling(self) -> None:
        """What the drive tells of its scaling must not contradict the configuration."""
        read = self._optional
        encoder, turns = read(od.ENCODER_INCREMENTS), read(od.ENCODER_REVOLUTIONS)
        gear = self._ratio(read(od.GEAR_MOTOR_REVOLUTIONS), read(od.GEAR_SHAFT_REVOLUTIONS)) or 1.0
        optional = self._sdo.read_if_there
        feed = self._ratio(optional(od.FEED), optional(od.FEED_SHAFT_REVOLUTIONS))
        increments = self._ratio(encoder, turns)
        counts = feed if feed is not None else None if increments is None else increments * gear
        configured = self._drive.counts_per_rad
        if counts is not None:
            self._compare("position units per rad", counts / (2 * math.pi), configured, SCALE_TOLERANCE)
        torque_mnm = read(od.RATED_TORQUE_MNM)
        if torque_mnm:
            axis_nm = torque_mnm * 1e-3 * gear
            self._compare("rated torque in N m", axis_nm, self._drive.rated_torque_nm, RATING_TOLERANCE)
        if self._drive.rated_current_a is not None:
            current_ma = read(od.RATED_CURRENT_MA)
            if current_ma:
                self._compare("rated current in A", current_ma * 1e-3, self._drive.rated_current_a, RATING_TOLERANCE)

    @staticmethod
    def _ratio(numerator: int | None, denominator: int | None) -> float | None:
        """A ratio that a drive tells; None where it does not."""
        return numerator / denominator if numerator and denominator else None

    def _compare(self, what: str, told: float, configured: float, tolerance: float) -> None:
        """Refuse a contradiction."""
        if not math.isclose(told, configured, rel_tol=tolerance):
            raise self._wrong(
                f"the drive tells {what} = {told:.6g}, the configuration {configured:.6g}",
                "One of the two is wrong, and the arm would move by the wrong amount: correct it",
            )

    def _write_supervision(self) -> None:
        """Heartbeats, and what the drive does when it is left alone or fails."""
        self._sdo.step = "setting supervision"
        self._preferred(od.HEARTBEAT_PRODUCER_MS, milliseconds(self._arm.heartbeat_s))
        self._preferred(od.HEARTBEAT_CONSUMER, 0)
        self._preferred(od.COMMUNICATION_ERROR_BEHAVIOUR, PRE_OPERATIONAL_ON_ERROR)
        self._preferred(od.ABORT_CONNECTION_OPTION, ABORT_BY_QUICK_STOP)
        self._preferred(od.QUICK_STOP_OPTION, QUICK_STOP_AND_STAY)
        self._preferred(od.FAULT_REACTION_OPTION, FAULT_REACTION_RAMP)

    def _write_limits(self, polarity: int) -> None:
        """Following error window, position limits and greatest torque."""
        self._sdo.step = "setting limits"
        signs = [0] * len(self._arm.drives)
        signs[self._axis] = polarity
        units = ArmUnits(self._arm, signs)
        counts_per_rad = abs(units.axes[self._axis].counts_per_rad)
        lower, upper = units.position_limits_counts(self._axis)
        self._preferred(od.FOLLOWING_ERROR_WINDOW, round(self._drive.following_error_rad * counts_per_rad))
        self._preferred(od.POSITION_LIMIT_MIN, lower)
        self._preferred(od.POSITION_LIMIT_MAX, upper)
        self._preferred(od.MAX_TORQUE, self._drive.max_torque_permille)

    def _write_cycle(self) -> None:
        """The cycle, as CiA 301 and as CiA 402 tell it."""
        self._sdo.step = "setting the cycle"
        value, exponent = interpolation_time(self._arm.cycle_s)
        self._preferred(od.CYCLE_PERIOD_US, microseconds(self._arm.cycle_s))
        self._preferred(od.SYNC_COUNTER_OVERFLOW, 0)
        self._preferred(od.INTERPOLATION_TIME, value)
        self._preferred(od.INTERPOLATION_EXPONENT, exponent)

    def _write_pdos(self) -> None:
        """Map the first PDO of each direction and switch the others off."""
        for layout in (self._image.rpdo, self._image.tpdo):
            self._sdo.step = f"mapping the {layout.direction.name.lower()} PDO"
            map_pdo(self._sdo, layout)
            self._sdo.step = "switching unused PDOs off"
            switch_others_off(self._sdo, layout.direction)
        self._sdo.step = "setting the setpoint time-out"
        overdue_s = max(self._arm.heartbeat_s, (self._arm.max_missing_cycles + 1) * self._arm.cycle_s)
        self._preferred(PdoDirection.RECEIVE.timer_entry(0), milliseconds(overdue_s))

    def _select_mode(self) -> None:
        """Write 6060 and wait for 6061."""
        self._sdo.step = "selecting the mode"
        mode = int(self._drive.mode)
        self._sdo.write(od.MODE, mode)
        found = self._sdo.read_until(od.MODE_DISPLAY, mode, self._timeouts.mode_s)
        if found != mode:
            raise ServoTimeout(
                self._drive.node_id,
                self._drive.joint,
                self._sdo.step,
                f"6061 tells mode {found} after {self._timeouts.mode_s} s, {mode} was asked for",
                "Is the mode licensed and allowed in the drive's present state?",
            )
