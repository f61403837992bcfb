"""Booting and configuring one drive over CANopen: what is CANopen's own in `bring_up.drive_bring_up`.

The order for an arm: `check_identity` of every node that is already up, so that another arm is refused before anything
is sent that changes it; NMT reset, unless a drive carries torque (`safe_reset`); `check_identity` again; `configure`. A
node that does not answer yet may still be reset, because that is how drives boot, unless only a simulation is allowed:
then every node must identify itself first.

References:
    CiA 301, 7.5.2.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from armload_drivers.bring_up.drive_bring_up import DriveSetup, is_simulation
from armload_drivers.bring_up.drive_objects import set_interpolation
from armload_drivers.bring_up.sdo_channel import SdoChannel
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.canopen.canopen_sdo import CanopenSdo
from armload_drivers.canopen.pdo_setup import map_pdo, switch_others_off
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings, DriveSettings, EffortFeedback, FixedPdo
from armload_drivers.cia402.bus_budget import USUAL_RATES_HZ, forecast, with_rate_for
from armload_drivers.cia402.drive_safety import Safety, master_watch
from armload_drivers.cia402.object_dictionary import Entry, PdoDirection
from armload_drivers.cia402.process_data.drive_units import microseconds
from armload_drivers.cia402.process_data.process_image import drive_image, effort_entry, target_entry
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import SdoRefused, ServoTimeout


class CanopenSetup(DriveSetup):
    """Bring-up of one drive over CANopen; its arguments are those of `SdoRequests`."""

    def __init__(self, drive: DriveSettings, arm: ArmSettings, sdo: SdoChannel, timeouts: Timeouts) -> None:
        super().__init__(drive, arm, sdo, timeouts)
        self._image = drive_image(drive)

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
            raise self._sdo.failure(
                f"no answer within {wait_s} s; only simulated drives are allowed, so no node is reset that has not "
                "identified itself as one",
                "Is the simulated drive running and connected, with this node id? One that was stopped by NMT does not "
                "answer: restart the simulation",
                ServoTimeout,
            )
        return False

    def require_alive(self) -> None:
        """Require an SDO answer from a node that was reset and sent no boot-up message.

        Raises:
            ServoTimeout: the node does not answer.
        """
        self._sdo.step = "booting"
        if not self._sdo.answers(od.DEVICE_TYPE, self._timeouts.sdo_s):
            raise self._sdo.failure(
                f"no boot-up message within {self._timeouts.boot_s} s of the reset and no answer after it",
                "Is the drive powered and connected, with this node id and bit rate?",
                ServoTimeout,
            )

    def watch_master(self, *, on: bool) -> None:
        """Switch the drive's watch on the master's heartbeat on or off; while it is on, its value must not change."""
        self._sdo.step = "configuring the heartbeat consumer"
        watch = master_watch(self._arm) if on else 0
        try:
            written = self._sdo.write_if_there(od.HEARTBEAT_CONSUMER, watch)
        except SdoRefused:
            if Safety.MASTER_LOST.key not in self.settings.accept_missing:
                raise
            written = False
        self.objects.held.pop(od.HEARTBEAT_CONSUMER, None)
        if written and watch:
            self.objects.held[od.HEARTBEAT_CONSUMER] = watch

    def fewer_objects(self, most: int) -> str:
        """How the configuration can use PDOs of fewer objects, if there is a second one for the rest."""
        changes: dict[str, Any] = {"pdo_objects_max": most}
        if not self._has_second(PdoDirection.TRANSMIT):
            return "It has no second TPDO (1801) for the effort: use firmware that has one, or another drive"
        without = ""
        if self.settings.torque_offset and not self._has_second(PdoDirection.RECEIVE):
            changes["torque_offset"] = False
            without = ", and torque_offset = false, since there is no second RPDO (1401); feed-forward is then refused"
        return f"Set pdo_objects_max = {most}{without}{self._rate_for(**changes)}: the rest is sent in a second PDO"

    def _has_second(self, direction: PdoDirection) -> bool:
        """Whether the drive has a second PDO of a direction."""
        return self._sdo.has(direction.cob_id_entry(1))

    def _room_for_32_bits(self, entry: Entry) -> str:
        """See `DriveSetup`."""
        direction = PdoDirection.RECEIVE if entry.key == od.TORQUE_OFFSET.key else PdoDirection.TRANSMIT
        name = direction.name.lower()
        return "" if self._has_second(direction) else f"It has no second {name} PDO, which 32 bits require. "

    def fixed_mapping(self, found: tuple[FixedPdo, ...]) -> str:
        """How the configuration can use PDOs whose mapping cannot be changed, with other feedback if need be."""
        for feedback in (self.settings.feedback, *EffortFeedback):
            for offset in sorted({self.settings.torque_offset, False}, reverse=True):
                changes = {"fixed_pdos": found, "feedback": feedback, "torque_offset": offset}
                try:
                    layouts = drive_image(replace(self.settings, **changes)).layouts
                except ValueError:
                    continue
                effort = effort_entry(replace(self.settings, feedback=feedback))
                if self._sdo.bits_if_there(effort) != effort.type.bits:
                    continue
                used = {(layout.direction, layout.number) for layout in layouts}
                pdos = [pdo for pdo in found if (pdo.direction, pdo.number) in used]
                tables = (f"{pdo.key} = [{', '.join(f'0x{word:08X}' for word in pdo.mapping)}]" for pdo in pdos)
                advice = f"Set fixed_pdos = {{ {', '.join(tables)} }}"
                if feedback is not self.settings.feedback:
                    advice += f', feedback = "{feedback.name.lower()}"'
                if offset is not self.settings.torque_offset:
                    advice += ", torque_offset = false; feed-forward is then refused on this drive"
                return advice + self._rate_for(**changes)
        return (
            "Set this mapping with the manufacturer's tool if it can. A drive with a fixed mapping can be used only if "
            f"one PDO carries 6040 and {target_entry(self.settings.mode).index:04X}, one 6041 and 6064, and one 6078 "
            "or 6077; no setpoint beside them may need a value that is not known"
        )

    def _rate_for(self, **of_drives: Any) -> str:
        """See `DriveSetup`."""
        return with_rate_for(self._arm, **of_drives)

    def _write_cycle(self) -> None:
        """Set the cycle, in the objects of CiA 301 and of CiA 402.

        A drive that produces SYNC is configured not to. 1019 may be changed only while 1006 is 0.

        Raises:
            ServoError: the configuration requires a SYNC counter and the drive has none, or the drive cannot
                interpolate over the cycle.
        """
        sdo, arm = self._sdo, self._arm
        sdo.step = "setting the cycle"
        present = sdo.read_if_there(od.SYNC_COB_ID)
        if present is not None and present & od.SYNC_MEANING != od.SYNC_DEFAULT_COB_ID:
            sdo.write(od.SYNC_COB_ID, od.SYNC_DEFAULT_COB_ID)
        counter = sdo.read_if_there(od.SYNC_COUNTER_OVERFLOW)
        if counter is None and arm.sync_counter:
            raise sdo.failure(
                "the drive does not support a SYNC counter (1019)", "Set sync_counter = 0 in the configuration"
            )
        if counter is not None and counter != arm.sync_counter:
            sdo.write_if_there(od.CYCLE_PERIOD_US, 0)
            sdo.write(od.SYNC_COUNTER_OVERFLOW, arm.sync_counter)
        if self.objects.hold(od.CYCLE_PERIOD_US, microseconds(arm.cycle_s)):
            self.objects.miss(od.CYCLE_PERIOD_US)
        most_hz = forecast(arm).cycle_hz
        set_interpolation(
            self.objects,
            arm.cycle_s,
            [rate_hz for rate_hz in USUAL_RATES_HZ if rate_hz <= most_hz],
            f"At {arm.bitrate} bit/s the bus carries at most {most_hz} Hz, and the drive accepts no such cycle. Set "
            "60C2 with the manufacturer's tool, raise the bit rate, or put some joints on a second bus "
            "([bus.a], [bus.b])",
        )

    def _map(self, direction: PdoDirection) -> None:
        """Map the PDOs of a direction and switch its others off."""
        layouts = [layout for layout in self._image.layouts if layout.direction is direction]
        for layout in layouts:
            self._sdo.step = f"mapping the {direction.name.lower()} PDO {layout.number + 1}"
            self.objects.held |= map_pdo(self._sdo, layout, self)
        self._sdo.step = "switching unused PDOs off"
        switch_others_off(self._sdo, direction, {layout.number for layout in layouts})


def canopen_setups(arm: ArmSettings, link: BusLink, timeouts: Timeouts) -> list[CanopenSetup]:
    """Bring-up of every drive of an arm."""
    return [
        CanopenSetup(drive, arm, CanopenSdo(drive.node_id, drive.joint, link, timeouts.sdo_s), timeouts)
        for drive in arm.drives
    ]
