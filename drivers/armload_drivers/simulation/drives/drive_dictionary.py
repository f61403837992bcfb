"""The objects of a simulated drive, with their values after a reset."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import SIMULATION_IDENTITY, DriveSettings, Identity
from armload_drivers.cia402.eds_parser import DeviceDescription
from armload_drivers.cia402.object_dictionary import Access, DataType, Entry
from armload_drivers.cia402.process_data.drive_units import AxisUnits, milliseconds
from armload_drivers.cia402.process_data.process_image import effort_entry, offset_entry
from armload_drivers.cia402.state_machine import State
from armload_drivers.simulation.drives.sdo_server import Dictionary

QUICK_STOP_DECELERATION_RAD_S2 = 6.0
"""6085 after a reset."""

FOLLOWING_ERROR_TIMEOUT_MS = 20
"""6066 after a reset."""


CELSIUS = 40.0
"""Temperature of every simulated drive, reported if its configuration names an object for it."""

SILENCE = 0
"""Returned by `DriveTraits.on_request` for a request to be ignored."""


@dataclass(frozen=True, slots=True)
class DriveTraits:
    """Deviations of a simulated drive from the configured one, to test a master's reaction.

    Attributes:
        identity: Value of 1018.
        device_type: Value of 1000.
        polarity: 607E after a reset.
        modes: Modes in 6502; None for the configured one.
        absent: Indices of objects that the drive lacks.
        forgets: Indices of objects that confirm every write and keep their value.
        description: The manufacturer's description that it implements exactly; identity, device type and modes are then
            those of the description, if given there.
        boot_message: Whether it sends a boot-up message after a reset.
        takes_mode: Whether it follows 6060; otherwise 6061 stays 0.
        homed: Whether the position has its reference, if the configuration names the bit that reports it.
        stuck_in: Power state that no controlword makes it leave.
        on_request: Called with every SDO request: None lets it be answered, `SILENCE` ignores it, and any other number
            is the abort code with which it is refused.
    """

    identity: Identity = SIMULATION_IDENTITY
    device_type: int = od.DEVICE_TYPE_SERVO
    polarity: int = 0
    modes: frozenset[int] | None = None
    absent: frozenset[int] = frozenset()
    forgets: frozenset[int] = frozenset()
    description: DeviceDescription | None = None
    boot_message: bool = True
    takes_mode: bool = True
    homed: bool = True
    stuck_in: State | None = None
    on_request: Callable[[bytes], int | None] | None = None


def build_dictionary(settings: DriveSettings, traits: DriveTraits, cycle_s: float) -> Dictionary:
    """Objects of one drive after a reset, without its PDO parameters, and still including absent ones.

    Positions are in units of the configured scale. The drive describes itself as a motor with its encoder on the axis:
    608F gives the counts per axis turn, 6091 a gear of 1, 6076 the axis's rated torque. Max torque (6072) is stored but
    not enforced; the plant has the limits of its motors.

    Args:
        settings: The configured drive.
        traits: Its deviations.
        cycle_s: Interpolation period until 60C2 or 1006 is written.
    """
    units = AxisUnits.of(settings, traits.polarity)
    modes = frozenset({int(settings.mode)}) if traits.modes is None else traits.modes
    identity, node_id = traits.identity, settings.node_id
    counts_per_rad = abs(units.counts_per_rad)
    limit = DataType.I32.bounds
    rated_current = 0.0 if settings.rated_current_a is None else settings.rated_current_a
    rows: list[tuple[Entry, int | str]] = [
        (od.DEVICE_TYPE, traits.device_type),
        (od.ERROR_REGISTER, 0),
        (od.ERROR_COUNT, 0),
        *((entry, 0) for entry in od.ERROR_HISTORY),
        (od.SYNC_COB_ID, od.SYNC_DEFAULT_COB_ID),
        (od.CYCLE_PERIOD_US, 0),
        (od.DEVICE_NAME, f"armload simulated drive, {settings.joint}"),
        (od.SOFTWARE_VERSION, "1"),
        (od.STORE_ALL, 1),
        (od.EMERGENCY_COB_ID, od.EMERGENCY_BASE + node_id),
        (od.HEARTBEAT_CONSUMER, 0),
        (od.HEARTBEAT_PRODUCER_MS, 0),
        (od.VENDOR_ID, identity.vendor_id or 0),
        (od.PRODUCT_CODE, identity.product_code or 0),
        (od.REVISION, identity.revision or 0x0001_0000),
        (od.SERIAL_NUMBER, node_id),
        (od.SYNC_COUNTER_OVERFLOW, 0),
        (od.COMMUNICATION_ERROR_BEHAVIOUR, 0),
        (od.SDO_RX_COB_ID, od.SDO_RX_BASE + node_id),
        (od.SDO_TX_COB_ID, od.SDO_TX_BASE + node_id),
        (od.ABORT_CONNECTION_OPTION, 1),
        (od.ERROR_CODE, 0),
        (od.CONTROLWORD, 0),
        (od.STATUSWORD, 0),
        (od.QUICK_STOP_OPTION, 2),
        (od.SHUTDOWN_OPTION, 0),
        (od.DISABLE_OPTION, 1),
        (od.HALT_OPTION, 1),
        (od.FAULT_REACTION_OPTION, 2),
        (od.MODE, 0),
        (od.MODE_DISPLAY, 0),
        (od.SUPPORTED_MODES, sum(1 << (mode - 1) for mode in modes)),
        (od.POSITION_ACTUAL, 0),
        (od.FOLLOWING_ERROR_WINDOW, round(settings.following_error_rad * counts_per_rad)),
        (od.FOLLOWING_ERROR_TIMEOUT_MS, FOLLOWING_ERROR_TIMEOUT_MS),
        (od.VELOCITY_ACTUAL, 0),
        (od.MAX_TORQUE, settings.max_torque_permille),
        (od.RATED_CURRENT_MA, round(rated_current * 1e3)),
        (od.RATED_TORQUE_MNM, round(abs(units.torque_nm_per_permille) * 1e3 / settings.rated_torque_unit_nm)),
        (od.TORQUE_ACTUAL, 0),
        (od.CURRENT_ACTUAL, 0),
        (od.TARGET_POSITION, 0),
        (od.HOME_OFFSET, 0),
        (od.HOMING_METHOD, 0),
        (od.POSITION_LIMIT_MIN, limit[0]),
        (od.POSITION_LIMIT_MAX, limit[1]),
        (od.POLARITY, traits.polarity),
        (od.QUICK_STOP_DECELERATION, round(QUICK_STOP_DECELERATION_RAD_S2 * counts_per_rad)),
        (od.ENCODER_INCREMENTS, round(2 * math.pi * counts_per_rad)),
        (od.ENCODER_REVOLUTIONS, 1),
        (od.GEAR_MOTOR_REVOLUTIONS, 1),
        (od.GEAR_SHAFT_REVOLUTIONS, 1),
        (od.FEED, round(2 * math.pi * counts_per_rad)),
        (od.FEED_SHAFT_REVOLUTIONS, 1),
        (offset_entry(settings), 0),
        (od.INTERPOLATION_SETPOINT, 0),
        (od.INTERPOLATION_TIME, milliseconds(cycle_s) if cycle_s < 0.255 else 255),
        (od.INTERPOLATION_EXPONENT, -3),
        (od.PHYSICAL_OUTPUTS, 0),
        (od.OUTPUT_MASK, 0),
        (od.FOLLOWING_ERROR_ACTUAL, 0),
    ]
    dictionary = Dictionary()
    for entry, value in rows:
        dictionary.add(entry, value)
    for index in {entry.index for entry, _ in rows if entry.subindex} - {od.ERROR_COUNT.index}:
        highest = max(entry.subindex for entry, _ in rows if entry.index == index)
        dictionary.add(Entry(index, 0, "highest sub-index", DataType.U8, Access.RO), highest)
    dictionary.allowed[od.ERROR_COUNT.key] = {0}
    dictionary.allowed[od.STORE_ALL.key] = {od.STORE_SIGNATURE}
    dictionary.allowed[od.MODE.key] = modes | {0}
    dictionary.allowed[od.QUICK_STOP_OPTION.key] = {0, 1, 2, 5, 6}
    dictionary.allowed[od.FAULT_REACTION_OPTION.key] = {0, 1, 2}
    dictionary.allowed[od.ABORT_CONNECTION_OPTION.key] = {0, 1, 2, 3}
    dictionary.allowed[od.COMMUNICATION_ERROR_BEHAVIOUR.key] = {0, 1, 2}
    dictionary.allowed[od.POLARITY.key] = {0, 0x20, 0x80, 0xA0}
    dictionary.allowed[od.SYNC_COB_ID.key] = {od.SYNC_DEFAULT_COB_ID}
    dictionary.allowed[od.SYNC_COUNTER_OVERFLOW.key] = {0, *range(2, 241)}
    for entry in (od.SHUTDOWN_OPTION, od.DISABLE_OPTION):
        dictionary.allowed[entry.key] = {0, 1}
    dictionary.allowed[od.HALT_OPTION.key] = {1, 2}
    effort = effort_entry(settings)
    if effort.key not in dictionary.entries:
        dictionary.add(effort, 0)
    if settings.temperature is not None:
        dictionary.add(settings.temperature.entry("temperature"), round(CELSIUS / settings.temperature.per_unit))
    if not settings.torque_offset:
        dictionary.remove([od.TORQUE_OFFSET.index])
    if settings.rated_current_a is None:
        dictionary.remove([od.RATED_CURRENT_MA.index, od.CURRENT_ACTUAL.index])
    return dictionary
