"""Writing objects of one drive, reading them back, and its interpolation time, before the drive is enabled.

Objects that a drive lacks, or does not allow to be written, are collected. The safety properties are defined in
`cia402.drive_safety` and written by `drive_securing`.

References:
    CiA 301, 7.5.2; CiA 402-2, 10.
"""

from __future__ import annotations

from collections.abc import Sequence

from armload_drivers.bring_up.sdo_channel import READ_ONLY, SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.bus_budget import USUAL_RATES_HZ
from armload_drivers.cia402.object_dictionary import Entry
from armload_drivers.cia402.process_data.drive_units import interpolation_times
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


def set_interpolation(
    drive: DriveObjects,
    cycle_s: float,
    rates_hz: Sequence[int] = USUAL_RATES_HZ,
    otherwise: str = "Set 60C2 with the manufacturer's tool",
) -> None:
    """Set 60C2; a drive that has it must interpolate over the cycle.

    Args:
        rates_hz: Other rates that the bus carries.
        otherwise: What to do about a drive that accepts none of them.

    Raises:
        ServoError: the drive does not interpolate over the cycle; names a rate that it accepts.
    """
    sdo = drive.sdo
    drive.read(od.INTERPOLATION_EXPONENT)  # notes it if it is missing
    if _interpolates_over(drive, cycle_s):
        return
    found = sdo.read_if_there(od.INTERPOLATION_TIME)
    if not found:  # 0 is no period: the drive has no interpolation time of its own
        drive.miss(od.INTERPOLATION_TIME)
        return
    power = sdo.read_if_there(od.INTERPOLATION_EXPONENT)
    period_s = found * 10.0 ** (_MILLISECONDS if power is None else power)
    nearest = sorted(rates_hz, key=lambda rate_hz: abs(rate_hz * cycle_s - 1.0))
    accepted = next((rate_hz for rate_hz in nearest if _interpolates_over(drive, 1 / rate_hz)), None)
    raise sdo.failure(
        f"the drive interpolates over {period_s:g} s (60C2) and does not accept the cycle of {cycle_s:g} s",
        otherwise if accepted is None else f"Set cycle_hz = {accepted}",
    )


_MILLISECONDS = -3
"""60C2:2 of a drive that has only 60C2:1."""


def _interpolates_over(drive: DriveObjects, cycle_s: float) -> bool:
    """Try to set 60C2 to a cycle, in a form that the drive accepts; the exponent is fixed in some drives."""
    present = drive.sdo.read_if_there(od.INTERPOLATION_EXPONENT)
    for value, exponent in sorted(interpolation_times(cycle_s), key=lambda form: form[1] != present):
        if present is None and exponent != _MILLISECONDS:
            continue
        if present is not None and drive.hold(od.INTERPOLATION_EXPONENT, exponent):
            continue
        if not drive.hold(od.INTERPOLATION_TIME, value):
            return True
    for entry in (od.INTERPOLATION_EXPONENT, od.INTERPOLATION_TIME):
        drive.held.pop(entry, None)
    return False
