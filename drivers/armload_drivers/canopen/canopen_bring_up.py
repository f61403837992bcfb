"""Bring-up of the drives of one arm over CANopen."""

from __future__ import annotations

from collections.abc import Sequence

import can

from armload_drivers.bring_up.arm_bring_up import ArmBringUp
from armload_drivers.bring_up.drive_bring_up import DriveSetup
from armload_drivers.bring_up.powered_drive import PoweredDrive
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.bus_scan import require_no_strangers
from armload_drivers.canopen.canopen_setup import canopen_setups
from armload_drivers.canopen.safe_reset import powered_drives, reset_drives
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.timeouts import Timeouts


class CanopenBringUp(ArmBringUp):
    """The drives of one arm on an open bus.

    Args:
        bus: An open bus; nothing else may read from it.
        timeouts: Limits of all waits.
    """

    def __init__(self, arm: ArmSettings, bus: can.BusABC, timeouts: Timeouts | None = None) -> None:
        self._link, self._timeouts = BusLink(bus), timeouts or Timeouts()
        super().__init__(arm, canopen_setups(arm, self._link, self._timeouts))

    def require_no_strangers(self) -> None:
        """Query all node ids at once."""
        require_no_strangers(self._link, self.arm, self._timeouts.scan_s)

    def powered_drives(self, setups: Sequence[DriveSetup]) -> list[PoweredDrive]:
        """As `safe_reset.powered_drives`."""
        return powered_drives(setups, self.arm, self._link)

    def restart(self, setups: Sequence[DriveSetup]) -> list[DriveSetup]:
        """NMT reset; drives that sent no boot-up message are returned."""
        return reset_drives(setups, (), self._link, self._timeouts.boot_s)
