"""Writing objects of one drive, reading them back, and its interpolation time, before the drive is enabled.

Objects that a drive lacks, or does not allow to be written, are collected. The safety properties are defined in
`cia402.drive_safety` and written by `drive_securing`.

References:
    CiA 301, 7.5.2; CiA 402-2, 10.
"""

from __future__ import annotations

import math

from armload_drivers.bring_up.sdo_channel import READ_ONLY, SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.object_dictionary import Entry
from armload_drivers.cia402.process_data.drive_units import interpolation_time
from armload_drivers.driver_errors import SdoRefused, SettingChanged


class DriveObjects:
    """Reads and writes of one drive, and the objects that it lacks.

    Args:
        sdo: SDO access to it; its `step` names the step in progress.

    Attributes:
        sdo: SDO access to it.
        missing: Objects that the drive lacks, or that do not hold the required value.
        held: Values that were read back, and must not change before the drive is configured again.
    """

    def __init__(self, sdo: SdoChannel) -> None:
        self.sdo = sdo
        self.missing: list[Entry] = []
        self.held: dict[Entry, int] = {}

    def read(self, entry: Entry) -> int | None:
        """Read an object that not every drive has."""
        value = self.sdo.read_if_there(entry)
        if value is None:
            self.miss(entry)
        return value

    def miss(self, entry: Entry) -> None:
        """Note that an object is missing."""
        if entry not in self.missing:
            self.missing.append(entry)

    def require_held(self) -> None:
        """Require that the drive still has the values that were read back when it was configured.

        Raises:
            SettingChanged: one has changed.
        """
        self.sdo.step = "comparing the settings"
        for entry in self.held:
            self.require_unchanged(entry, self.sdo.read_if_there(entry))

    def require_unchanged(self, entry: Entry, found: int | None) -> None:
        """Require that a value is that which was read back when the drive was configured.

        Raises:
            SettingChanged: it is not.
        """
        if found != self.held[entry]:
            raise SettingChanged(
                *self.sdo.node,
                self.sdo.step,
                f"{entry} is {found}, and was {self.held[entry]} when the drive was configured",
                "Has it rebooted, or has another program changed it? Repeat the command: it configures the drive",
            )

    def hold(self, entry: Entry, value: int) -> str:
        """Write an object and read it back; one that has the value already need not be writable.

        Returns:
            Why it does not hold the value; empty if it does.
        """
        name = f"{entry.index:04X}" + (f":{entry.subindex}" if entry.subindex else "")
        refused: SdoRefused | None = None
        try:
            self.sdo.write(entry, value)
        except SdoRefused as refusal:
            refused = refusal
        try:
            found = self.sdo.read_if_there(entry)
        except SdoRefused as refusal:
            return f"{name} cannot be read back (0x{refusal.abort_code:08X})"
        if found is None:
            return f"no {name}"
        if found == value:
            self.held[entry] = value
            return ""
        if refused is None:
            return f"{name} reads {found} after {value} was written"
        if refused.abort_code == READ_ONLY:
            return f"{name} is {found}, cannot be written, and must be {value}"
        return f"{name} is {found}, and {value} was refused (0x{refused.abort_code:08X})"


def set_interpolation(drive: DriveObjects, cycle_s: float) -> None:
    """Set 60C2; a drive that has it must interpolate over the cycle.

    Raises:
        ServoError: the drive's interpolation time differs from the cycle.
    """
    sdo = drive.sdo
    value, exponent = interpolation_time(cycle_s)
    for entry, wanted in ((od.INTERPOLATION_TIME, value), (od.INTERPOLATION_EXPONENT, exponent)):
        if drive.hold(entry, wanted):
            drive.miss(entry)
    found, power = sdo.read_if_there(od.INTERPOLATION_TIME), sdo.read_if_there(od.INTERPOLATION_EXPONENT)
    if found is not None and power is not None and not math.isclose(found * 10.0**power, cycle_s, rel_tol=1e-6):
        period_s = found * 10.0**power
        remedy = f"Set cycle_hz = {1 / period_s:g}" if period_s > 0 else "Set it with the manufacturer's tool"
        raise sdo.failure(
            f"the drive interpolates over {period_s:g} s (60C2) and does not accept the cycle of {cycle_s:g} s", remedy
        )
