"""Configuring one drive over EtherCAT, in PREOP: what is EtherCAT's own in `bring_up.drive_bring_up`."""

from __future__ import annotations

from armload_drivers.bring_up.drive_bring_up import DriveSetup
from armload_drivers.bring_up.drive_objects import set_interpolation
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings, DriveSettings, Identity
from armload_drivers.cia402.object_dictionary import PdoDirection
from armload_drivers.cia402.process_data.frame_part import FramePart
from armload_drivers.cia402.process_data.process_image import feedback_entries, setpoint_entries
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import ServoTimeout
from armload_drivers.ethercat.coe_sdo import CoeSdo
from armload_drivers.ethercat.ethercat_line import EthercatLine
from armload_drivers.ethercat.pdo_assignment import assign_pdo


class EthercatSetup(DriveSetup):
    """Bring-up of one drive over EtherCAT.

    Args:
        sdo: SDO access to it.
        timeouts: Limits of the waits.

    Attributes:
        outputs: Its outputs in the frame; known once it is configured.
        inputs: Its inputs.
    """

    outputs: FramePart
    inputs: FramePart

    def __init__(
        self, drive: DriveSettings, arm: ArmSettings, sdo: CoeSdo, timeouts: Timeouts, line: EthercatLine
    ) -> None:
        super().__init__(drive, arm, sdo, timeouts)
        self._line = line

    def require_alive(self) -> None:
        """Require an SDO answer in PREOP."""
        self._sdo.step = "starting"
        if self.settings.node_id > self._line.size or not self._sdo.answers(od.DEVICE_TYPE, self._timeouts.sdo_s):
            raise self._sdo.failure(
                f"no answer; {self._line.size} devices were found in the line",
                "Is the drive powered, and connected at this place in the line (node_id counts from 1)?",
                ServoTimeout,
            )

    def check_identity(self) -> Identity:
        """Also check the station alias, if one is configured: exchanged cables exchange joints."""
        self.require_alive()
        wanted = self.settings.alias
        if wanted is not None:
            self._sdo.step = "identifying"
            places = {self._line.alias(place): place + 1 for place in range(self._line.size)}
            if places.get(wanted) != self.settings.node_id:
                there = (
                    f"the drive with this alias is number {places[wanted]}" if wanted in places else "no drive has it"
                )
                raise self._wrong(
                    f"its station alias is {self._line.alias(self.settings.node_id - 1)} instead of {wanted}; {there}",
                    "Are two cables exchanged? Otherwise correct alias or node_id",
                )
        return super().check_identity()

    def _write_cycle(self) -> None:
        """Set 60C2."""
        set_interpolation(self.objects, self._arm.cycle_s)

    def _map(self, direction: PdoDirection) -> None:
        """Map the outputs or the inputs, or find them in the drive's own mapping."""
        outputs = direction is PdoDirection.RECEIVE
        self._sdo.step = f"mapping the {'outputs' if outputs else 'inputs'}"
        entries = (setpoint_entries if outputs else feedback_entries)(self.settings)
        part, held = assign_pdo(self._sdo, direction, entries)
        self.objects.held |= held
        if outputs:
            self.outputs = part
        else:
            self.inputs = part

    def _select_mode(self) -> None:
        """Write 6060; drives show the mode in 6061 only with process data, see `require_started`."""
        self._write_mode()
        self.objects.held[od.MODE] = int(self.settings.mode)

    def require_started(self) -> None:
        """Require the mode (6061) of a drive in OP that is not enabled yet.

        Raises:
            ServoTimeout: it reports another one.
        """
        self._sdo.step = "selecting the mode"
        self._require_mode()

    def constants(self) -> bytes:
        """Its outputs: those that are not sent in every cycle, as the drive has them; a zero could be a torque limit.

        Raises:
            ServoError: one cannot be read.
        """
        self._sdo.step = "reading other outputs"
        data = bytearray(self.outputs.length)
        for entry, offset in self.outputs.others:
            size = entry.type.bits // 8
            data[offset : offset + size] = self._sdo.read(entry).to_bytes(size, "little")
        return bytes(data)
