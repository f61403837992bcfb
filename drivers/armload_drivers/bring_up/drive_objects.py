"""Objects of one drive written before it is enabled: supervision, limits, the cycle.

What a drive lacks, or does not let be written, is collected in words. Where safety rests on an object, a drive
without it is refused unless its configuration accepts that by name (`accept_missing`): then other means
must stop the arm.

References:
    CiA 301, 7.5.2; CiA 402-2, 8 (device control) and 10.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from armload_drivers.bus.sdo_channel import SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings, DriveSettings
from armload_drivers.cia402.drive_units import ArmUnits, interpolation_time, microseconds, milliseconds
from armload_drivers.cia402.object_dictionary import Entry, PdoDirection
from armload_drivers.driver_errors import MissingSafety

HEARTBEAT_TOLERANCE = 2.5
"""A heartbeat is overdue after this many periods, on both sides."""

QUICK_STOP_AND_STAY = 6
"""605A: slow down on the quick stop ramp and stay in QUICK STOP ACTIVE, with torque on."""
SLOW_DOWN_FIRST = 1
"""605B, 605C, 605D: slow down on the ramp before the torque goes, or before holding."""
FAULT_REACTION_RAMP = 2
"""605E: slow down on the quick stop ramp, then remove torque."""
ABORT_BY_QUICK_STOP = 3
"""6007: a lost master is answered with a quick stop."""
PRE_OPERATIONAL_ON_ERROR = 0
"""1029: a lost master also ends PDO communication, so that late frames set nothing in motion."""
FOLLOWING_ERROR_TIMEOUT_S = 0.02
"""6066: a following error outside its window for so long is a fault."""

SAFETY: Mapping[int, str] = MappingProxyType(
    {
        0x1016: "the drive does not notice that its master died",
        0x1017: "the master notices a lost drive by its missing feedback only",
        0x6007: "what the drive does when it loses its master is not known",
        0x605A: "how the drive carries out a quick stop is not known",
        0x605E: "how the drive stops after a fault is not known",
        0x6065: "the drive does not stop when it cannot follow",
        0x607D: "the drive does not know the joint's limits",
        0x6072: "the drive does not limit its torque",
    }
)
"""Objects that safety rests on, and what their absence means."""


class DriveObjects:
    """Writes to one drive, and what it turned out to lack.

    Args:
        sdo: SDO access to it; its `step` names what is being done.

    Attributes:
        sdo: Likewise.
        missing: Objects that the drive does not have, or does not let be written.
    """

    def __init__(self, sdo: SdoChannel) -> None:
        self.sdo = sdo
        self.missing: list[Entry] = []

    def read(self, entry: Entry) -> int | None:
        """Read an object that not every drive has."""
        value = self.sdo.read_if_there(entry)
        if value is None:
            self.missing.append(entry)
        return value

    def write(self, entry: Entry, value: int) -> None:
        """Write an object that not every drive has."""
        if not self.sdo.write_if_there(entry, value):
            self.missing.append(entry)

    def require_safety(self, drive: DriveSettings) -> None:
        """Refuse a drive that lacks what safety rests on and was not accepted so.

        Raises:
            MissingSafety: naming every such object, what follows from it, and how it is accepted.
        """
        lacking = {entry.index for entry in self.missing if entry.index in SAFETY}
        refused = sorted(lacking - {int(name, 16) for name in drive.accept_missing})
        if refused:
            reasons = "; ".join(f"{index:04X} ({SAFETY[index]})" for index in refused)
            names = ", ".join(f'"{index:04X}"' for index in refused)
            raise MissingSafety(
                drive.node_id,
                drive.joint,
                self.sdo.step,
                f"the drive lacks objects that safety rests on: {reasons}",
                f"Make sure by other means that the arm stops, then say so: accept_missing = [{names}]",
            )


def write_supervision(drive: DriveObjects, arm: ArmSettings) -> None:
    """Heartbeats, and what the drive does when it is left alone, is stopped or fails."""
    drive.sdo.step = "setting supervision"
    drive.write(od.HEARTBEAT_PRODUCER_MS, milliseconds(arm.heartbeat_s))
    drive.write(od.HEARTBEAT_CONSUMER, 0)
    drive.write(od.COMMUNICATION_ERROR_BEHAVIOUR, PRE_OPERATIONAL_ON_ERROR)
    drive.write(od.ABORT_CONNECTION_OPTION, ABORT_BY_QUICK_STOP)
    drive.write(od.QUICK_STOP_OPTION, QUICK_STOP_AND_STAY)
    for entry in (od.SHUTDOWN_OPTION, od.DISABLE_OPTION, od.HALT_OPTION):
        drive.write(entry, SLOW_DOWN_FIRST)
    drive.write(od.FAULT_REACTION_OPTION, FAULT_REACTION_RAMP)


def write_limits(drive: DriveObjects, settings: DriveSettings, units: ArmUnits, axis: int) -> None:
    """Following error window, position limits and greatest torque."""
    drive.sdo.step = "setting limits"
    counts_per_rad = abs(units.axes[axis].counts_per_rad)
    lower, upper = units.position_limits_counts(axis)
    drive.write(od.FOLLOWING_ERROR_WINDOW, round(settings.following_error_rad * counts_per_rad))
    drive.write(od.FOLLOWING_ERROR_TIMEOUT_MS, milliseconds(FOLLOWING_ERROR_TIMEOUT_S))
    drive.write(od.POSITION_LIMIT_MIN, lower)
    drive.write(od.POSITION_LIMIT_MAX, upper)
    drive.write(od.MAX_TORQUE, settings.max_torque_permille)


def write_cycle(drive: DriveObjects, arm: ArmSettings) -> None:
    """The cycle, in the objects of CiA 301 and of CiA 402.

    A drive that produces SYNC itself is configured not to. 1019 may change only while 1006 is 0.

    Raises:
        ServoError: the configuration asks for a SYNC counter, and the drive has none.
    """
    sdo = drive.sdo
    sdo.step = "setting the cycle"
    value, exponent = interpolation_time(arm.cycle_s)
    if sdo.read_if_there(od.SYNC_COB_ID) not in {None, od.SYNC_DEFAULT_COB_ID}:
        sdo.write(od.SYNC_COB_ID, od.SYNC_DEFAULT_COB_ID)
    counter = sdo.read_if_there(od.SYNC_COUNTER_OVERFLOW)
    if counter is None and arm.sync_counter:
        raise sdo.failure("the drive knows no SYNC counter (1019)", "Set sync_counter = 0 in the configuration")
    if counter is not None and counter != arm.sync_counter:
        sdo.write_if_there(od.CYCLE_PERIOD_US, 0)
        sdo.write(od.SYNC_COUNTER_OVERFLOW, arm.sync_counter)
    drive.write(od.CYCLE_PERIOD_US, microseconds(arm.cycle_s))
    drive.write(od.INTERPOLATION_TIME, value)
    drive.write(od.INTERPOLATION_EXPONENT, exponent)


def write_setpoint_timeout(drive: DriveObjects, arm: ArmSettings) -> None:
    """How long the drive waits for setpoints (event timer of the RPDO)."""
    drive.sdo.step = "setting the setpoint time-out"
    overdue_s = max(arm.heartbeat_s, (arm.max_missing_cycles + 1) * arm.cycle_s)
    drive.write(PdoDirection.RECEIVE.timer_entry(0), milliseconds(overdue_s))
