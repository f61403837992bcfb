"""Safety properties of a drive, and the ways in which drives provide them. One table, no bus.

Rules of this file:
- The first way that is met provides the property. A way is met if its condition holds and every object reads back the
  required value; an object that cannot be written but already has the required value counts as set.
- A drive without a way to a property is refused, unless its configuration accepts this by the property's name
  (`accept_missing`). A manufacturer's profile accepts nothing: that is the integrator's decision.
- A manufacturer-specific object is given in the configuration (`vendor_settings`) with the property that it provides.
  It is written and read back like any other.

References:
    CiA 301, 7.5.2.6 (1006), 7.5.2.13 (1016), 7.5.2.14 (1017), 7.5.2.26 (1029), 7.5.2.35 (event timer);
    CiA 402-2, 8 (6007, 605A to 605E), 607D, 6065, 6066, 6072, 6073, 6075.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum

import msgspec
from msgspec import Struct

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings, DriveSettings, Fieldbus
from armload_drivers.cia402.object_dictionary import DataType, Entry, PdoDirection
from armload_drivers.cia402.process_data.drive_scale import RATING_TOLERANCE
from armload_drivers.cia402.process_data.drive_units import ArmUnits, microseconds, milliseconds

HEARTBEAT_TOLERANCE = 2.5
"""A heartbeat is overdue after this many periods, on both sides."""

QUICK_STOP_AND_STAY = 6
"""605A: slow down on the quick stop ramp and stay in QUICK STOP ACTIVE, with torque on."""
QUICK_STOP_AND_LEAVE = 2
"""605A: slow down on the quick stop ramp, then SWITCH ON DISABLED: the brake holds the axis."""
SLOW_DOWN_FIRST = 1
"""605B, 605C, 605D: slow down on the ramp before the torque is removed, or before holding."""
FAULT_REACTION_RAMP = 2
"""605E: slow down on the quick stop ramp, then remove torque."""
FAULT_REACTION_SLOW_DOWN = 1
"""605E: slow down on the slow down ramp, then remove torque."""
ABORT_BY_QUICK_STOP = 3
"""6007: quick stop after the loss of the master."""
PRE_OPERATIONAL_ON_ERROR = 0
"""1029: the loss of the master also ends PDO communication, so that late frames cannot cause motion."""
FOLLOWING_ERROR_TIMEOUT_S = 0.02
"""6066: a following error outside its window for this time is a fault."""

SYNC_MANAGER_WATCHDOG_US = Entry(0x0420, 0, "sync manager watchdog", DataType.U32)
"""Register of an EtherCAT slave controller, read and written like an object; no object has an index below 0x1000."""

_RPDO_TIMER = PdoDirection.RECEIVE.timer_entry(0)


class SafetyValues(Struct, frozen=True):
    """What the required values of the objects of one drive follow from.

    Attributes:
        drive: The drive, its scale complete.
        units: Units of all drives, because motors may be coupled.
        rated_current_a: 6075 as reported by the drive; None if not reported.
    """

    drive: DriveSettings
    arm: ArmSettings
    units: ArmUnits
    rated_current_a: float | None

    @property
    def _axis(self) -> int:
        """The drive's place in the arm."""
        return [other.node_id for other in self.arm.drives].index(self.drive.node_id)

    @property
    def setpoint_timeout_ms(self) -> int:
        """Event timer of the RPDO."""
        arm = self.arm
        return milliseconds(max(arm.heartbeat_s, (arm.max_missing_cycles + 1) * arm.cycle_s))

    @property
    def following_error_counts(self) -> int:
        """6065."""
        return round(self.drive.following_error_rad * abs(self.units.axes[self._axis].counts_per_rad))

    @property
    def position_limits_counts(self) -> tuple[int, int]:
        """607D:1 and 607D:2."""
        return self.units.position_limits_counts(self._axis)


def master_watch(arm: ArmSettings) -> int:
    """Value of 1016 for watching the master's heartbeat."""
    return arm.master_node_id << 16 | milliseconds(HEARTBEAT_TOLERANCE * arm.heartbeat_s)


class Setting(Struct, frozen=True):
    """One object and its required value.

    Attributes:
        entry: The object.
        value: Its required value, of every drive or of one.
        optional: Whether a drive without it still has the property.
    """

    entry: Entry
    value: int | Callable[[SafetyValues], int]
    optional: bool = False

    def wanted(self, values: SafetyValues) -> int:
        """Its required value on one drive."""
        return self.value if isinstance(self.value, int) else self.value(values)


Condition = Callable[[DriveSettings, float | None], str]
"""Returns why a way is not available, from the configuration and the reported rated current (6075) in A; empty if it
is."""


def _no_condition(drive: DriveSettings, rated_current_a: float | None) -> str:
    """A condition that always holds."""
    return ""


class Way(Struct, frozen=True):
    """One way in which a drive can have a property.

    Attributes:
        text: What provides the property.
        settings: Objects with their required values.
        note: What else is verified, or not.
        reads: Objects that the condition needs.
        condition: Returns why the way is not available to a drive; empty if it is.
        by_vendor: Whether the settings are manufacturer-specific, from the configuration.
        fieldbus: The only bus on which it exists; None if it exists on all.
    """

    text: str
    settings: tuple[Setting, ...] = ()
    note: str = ""
    reads: tuple[Entry, ...] = ()
    condition: Condition = _no_condition
    by_vendor: bool = False
    fieldbus: Fieldbus | None = None

    @property
    def verified(self) -> str:
        """How the property is verified."""
        back = "reads back as written" if self.settings else "reads back as configured" if self.by_vendor else ""
        return "; ".join(filter(None, (back, self.note)))


def _rated_current_known(drive: DriveSettings, rated_current_a: float | None) -> str:
    """6075 must be known, because 6073 is in per mille of it."""
    configured = drive.rated_current_a
    if not rated_current_a:
        return "6075 reports no rated current"
    if configured is not None and not math.isclose(rated_current_a, configured, rel_tol=RATING_TOLERANCE):
        return f"6075 reports {rated_current_a:g} A, the configuration {configured:g} A"
    return ""


def _vendor(what: str) -> Way:
    """A way by manufacturer-specific objects."""
    return Way(f"the manufacturer's object for {what} (`vendor_settings`)", by_vendor=True)


def _max_torque(values: SafetyValues) -> int:
    """6072 and 6073 are both in per mille."""
    return values.drive.max_torque_permille


_WATCH = Setting(od.HEARTBEAT_CONSUMER, lambda values: master_watch(values.arm))
_WATCHDOG = Setting(SYNC_MANAGER_WATCHDOG_US, lambda values: microseconds(values.arm.watchdog_s))
_QUICK_STOP_ON_ABORT = Setting(od.ABORT_CONNECTION_OPTION, ABORT_BY_QUICK_STOP)
_QUICK_STOP_ON_FAULT = Setting(od.FAULT_REACTION_OPTION, FAULT_REACTION_RAMP)
_PRE_OPERATIONAL = Setting(od.COMMUNICATION_ERROR_BEHAVIOUR, PRE_OPERATIONAL_ON_ERROR)
_CANOPEN, _ETHERCAT = Fieldbus.CANOPEN, Fieldbus.ETHERCAT


class Safety(Enum):
    """The properties; `accept_missing` uses their names in lower case.

    Attributes:
        title: What the drive does.
        lost: The consequence of its absence.
        remedy: What a person must do before the property may be accepted as missing.
        ways: The ways to provide it; the first that is met counts.
    """

    TORQUE_LIMIT = (
        "limits its torque",
        "the drive does not limit its torque",
        "Set the limit with the manufacturer's tool, check it there, and set torque_limit_in_drive = true",
        Way("6072 = max_torque_permille", (Setting(od.MAX_TORQUE, _max_torque),)),
        Way(
            "6073 = max_torque_permille, of the rated current (6075)",
            (Setting(od.MAX_CURRENT, _max_torque),),
            "6075 reports a current, and it equals the configured one, if any",
            (od.RATED_CURRENT_MA,),
            _rated_current_known,
        ),
        _vendor("the limit"),
        Way(
            "a limit set in the drive (`torque_limit_in_drive = true`)",
            note="only by the integrator's statement: nothing is read, and on a real arm the operator must confirm",
            condition=lambda drive, _: (
                "" if drive.torque_limit_in_drive else "torque_limit_in_drive is not set to true in the configuration"
            ),
        ),
    )
    MASTER_LOST = (
        "stops when its master is lost",
        "the drive's reaction to the loss of its master is unknown",
        "Set its reaction to a lost heartbeat with the manufacturer's tool; pull the bus cable in slow motion: it must "
        "stop",
        Way(
            "6007 = 3 (quick stop), with the master's heartbeat watched (1016) and, if present, 1029 = 0",
            (_WATCH, _QUICK_STOP_ON_ABORT, msgspec.structs.replace(_PRE_OPERATIONAL, optional=True)),
            fieldbus=_CANOPEN,
        ),
        Way(
            "1029 = 0 (PRE-OPERATIONAL), with the master's heartbeat watched (1016)",
            (_WATCH, _PRE_OPERATIONAL),
            "see the drive's manual for how an axis stops when it leaves OPERATIONAL",
            fieldbus=_CANOPEN,
        ),
        Way(
            "6007 = 3 (quick stop), and the sync manager's watchdog (register 0420) ends OP",
            (_WATCHDOG, _QUICK_STOP_ON_ABORT),
            fieldbus=_ETHERCAT,
        ),
        Way(
            "605E = 2 (quick stop ramp), and the sync manager's watchdog (register 0420) ends OP",
            (_WATCHDOG, _QUICK_STOP_ON_FAULT),
            "see the drive's manual for whether leaving OP is a fault to it",
            fieldbus=_ETHERCAT,
        ),
        _vendor("a lost master"),
    )
    SETPOINTS_LOST = (
        "stops when SYNC or setpoints are missing",
        "an axis that no longer receives setpoints, while the master's heartbeat continues, is stopped by the master "
        "only",
        "Set its SYNC or RPDO monitoring with the manufacturer's tool; then end SYNC in slow motion: it must stop",
        Way(
            "event timer of the RPDO (1400:5)",
            (Setting(_RPDO_TIMER, lambda values: values.setpoint_timeout_ms),),
            fieldbus=_CANOPEN,
        ),
        Way(
            "SYNC period (1006)",
            (Setting(od.CYCLE_PERIOD_US, lambda values: microseconds(values.arm.cycle_s)),),
            "see the drive's manual for how many missing SYNCs it tolerates",
            fieldbus=_CANOPEN,
        ),
        Way("sync manager's watchdog (register 0420)", (_WATCHDOG,), fieldbus=_ETHERCAT),
        _vendor("missing setpoints"),
    )
    QUICK_STOP = (
        "slows down on a quick stop, and the axis is held",
        "the drive's quick stop behaviour is unknown",
        "Look up in its manual what a quick stop does, or set it with the manufacturer's tool; then try one in slow "
        "motion",
        Way("605A = 6 (ramp, then held with torque)", (Setting(od.QUICK_STOP_OPTION, QUICK_STOP_AND_STAY),)),
        Way(
            "605A = 2 (ramp, then held by the brake)",
            (Setting(od.QUICK_STOP_OPTION, QUICK_STOP_AND_LEAVE),),
            "the axis has a brake",
            condition=lambda drive, _: "" if drive.has_brake else "the axis has no brake",
        ),
        _vendor("the quick stop"),
    )
    FAULT_REACTION = (
        "slows down on a fault before its torque is removed",
        "the drive's reaction to a fault is unknown",
        "Look up in its manual how it stops after a fault, or set it with the manufacturer's tool",
        Way("605E = 2 (quick stop ramp)", (_QUICK_STOP_ON_FAULT,)),
        Way("605E = 1 (slow down ramp)", (Setting(od.FAULT_REACTION_OPTION, FAULT_REACTION_SLOW_DOWN),)),
        _vendor("the fault reaction"),
    )
    DISABLE_REACTION = (
        "slows down before its torque is removed on command",
        "if another master disables a moving axis, the axis is stopped by its brake alone",
        "",
        Way(
            "605B = 1 and 605C = 1 (ramp first), and 605D = 1 if present",
            (
                Setting(od.SHUTDOWN_OPTION, SLOW_DOWN_FIRST),
                Setting(od.DISABLE_OPTION, SLOW_DOWN_FIRST),
                Setting(od.HALT_OPTION, SLOW_DOWN_FIRST, optional=True),
            ),
        ),
        Way(
            "this master removes torque at standstill only",
            note="the position (6064) moves by less than 0.005 rad/s for some cycles",
        ),
    )
    FOLLOWING_ERROR = (
        "stops when it cannot follow",
        "the drive does not stop when it cannot follow",
        "Set the following error window with the manufacturer's tool",
        Way(
            "6065 = following_error_rad, and 6066 if present",
            (
                Setting(od.FOLLOWING_ERROR_WINDOW, lambda values: values.following_error_counts),
                Setting(od.FOLLOWING_ERROR_TIMEOUT_MS, milliseconds(FOLLOWING_ERROR_TIMEOUT_S), optional=True),
            ),
        ),
        _vendor("the following error"),
    )
    POSITION_LIMITS = (
        "keeps to the joint's limits",
        "the drive does not enforce the joint's limits",
        "Set the position limits with the manufacturer's tool, or rely on limit switches that you have tested",
        Way(
            "607D = the joint's limits",
            (
                Setting(od.POSITION_LIMIT_MIN, lambda values: values.position_limits_counts[0]),
                Setting(od.POSITION_LIMIT_MAX, lambda values: values.position_limits_counts[1]),
            ),
        ),
        _vendor("the joint's limits"),
    )
    DRIVE_LOST = (
        "is monitored by the master",
        "the master detects a lost drive only by its missing feedback",
        "No setting is possible; the other axes stop max_missing_cycles later",
        Way(
            "heartbeat (1017)",
            (Setting(od.HEARTBEAT_PRODUCER_MS, lambda values: milliseconds(values.arm.heartbeat_s)),),
            fieldbus=_CANOPEN,
        ),
        Way(
            "working counter and EtherCAT state",
            note="nothing is set: the master compares them in motion",
            fieldbus=_ETHERCAT,
        ),
    )

    def __init__(self, title: str, lost: str, remedy: str, *ways: Way) -> None:
        self.title, self.lost, self.remedy, self.ways = title, lost, remedy, ways

    def ways_on(self, fieldbus: Fieldbus) -> tuple[Way, ...]:
        """The ways that exist on a bus."""
        return tuple(way for way in self.ways if way.fieldbus in {None, fieldbus})

    @property
    def key(self) -> str:
        """Its name in `accept_missing` and in results."""
        return self.name.lower()


SAFETY_KEYS = tuple(item.key for item in Safety)


def property_of(index: int) -> Safety | None:
    """The property that an object of the standard provides; None if it provides none."""
    for of in Safety:
        if any(setting.entry.index == index for way in of.ways for setting in way.settings):
            return of
    return None


class SafetyFinding(Struct, frozen=True):
    """Finding on one property of one drive.

    Attributes:
        of: The property.
        way: The way that is met; None if none is.
        accepted: Whether the configuration accepts its absence.
        obstacles: Text and reason for each earlier way that is not met.
    """

    of: Safety
    way: Way | None
    accepted: bool
    obstacles: tuple[tuple[str, str], ...]

    @property
    def refused(self) -> bool:
        """Whether the drive must not be moved because of it."""
        return self.way is None and not self.accepted

    @property
    def found(self) -> str:
        """What provides the property, or why nothing does, as text."""
        if self.way is not None:
            return self.way.text
        return "; ".join(dict.fromkeys(reason for _, reason in self.obstacles))


def settings_of(way: Way, of: Safety, drive: DriveSettings) -> tuple[Setting, ...]:
    """The objects of a way on one drive, including manufacturer-specific ones."""
    if not way.by_vendor:
        return way.settings
    return tuple(Setting(each.entry, each.value) for each in drive.vendor_settings if each.meets == of.key)


def has_a_way(
    of: Safety, drive: DriveSettings | None, is_there: Callable[[Entry], bool], fieldbus: Fieldbus = Fieldbus.CANOPEN
) -> bool:
    """Whether a drive can have a property, judged by its objects; nothing is read or written.

    Args:
        of: The property.
        drive: Its configuration; None if there is none, and only the objects of the standard count.
        is_there: Returns whether the drive has an object.
        fieldbus: The bus.
    """
    for way in of.ways_on(fieldbus):
        if way.by_vendor:
            if drive is not None and settings_of(way, of, drive):
                return True
        elif way.settings:
            entries = [setting.entry for setting in way.settings if not setting.optional]
            if all(map(is_there, (*entries, *way.reads))):
                return True
        elif way.condition is _no_condition or (drive is not None and not way.condition(drive, None)):
            return True
    return False


def acceptance(refused: tuple[Safety, ...], drive: DriveSettings) -> str:
    """The configuration line that accepts the missing properties together with those accepted before."""
    names = sorted(drive.accept_missing | {item.key for item in refused})
    return "accept_missing = [" + ", ".join(f'"{name}"' for name in names) + "]"
