"""SDO access to one drive while no cycle runs, or after the drive has left it.

Reads are allowed at any time. Writes never energise: they set targets that hold, a fault reset, or remove torque.

References:
    CiA 301, 7.2.4; CiA 402-2, 8.
"""

from __future__ import annotations

import time
from contextlib import suppress

from armload_drivers.bring_up.sdo_channel import SdoChannel
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings, DriveSettings
from armload_drivers.cia402.emergency import error_text
from armload_drivers.cia402.object_dictionary import Entry
from armload_drivers.cia402.process_data.process_image import setpoint_entries
from armload_drivers.cia402.state_machine import POWERED, MasterMachine, State, state_in
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import SdoRefused, ServoFault, StatuswordError, TransitionError


def drive_state(sdo: SdoChannel) -> State:
    """Power state of a drive, by SDO.

    Raises:
        ServoError: the drive does not answer, or its statusword encodes no state.
    """
    word = sdo.read(od.STATUSWORD)
    try:
        return state_in(word)
    except StatuswordError as error:
        raise sdo.failure(str(error), "Does this drive follow CiA 402? See its manual") from error


class SdoRequests:
    """SDO access to one drive, by purpose.

    Args:
        sdo: SDO access to it.
        timeouts: Limits of the waits.

    Attributes:
        settings: The drive's settings.
    """

    def __init__(self, drive: DriveSettings, arm: ArmSettings, sdo: SdoChannel, timeouts: Timeouts) -> None:
        self.settings = drive
        self._arm = arm
        self._sdo, self._timeouts = sdo, timeouts

    def is_up(self) -> bool:
        """Whether the node answers, within a short time."""
        self._sdo.step = "looking for the node"
        return self._sdo.answers(od.DEVICE_TYPE, self._timeouts.probe_s)

    def read_state(self) -> State:
        """As `state_of`."""
        return drive_state(self._sdo)

    def read_powered_state(self) -> State | None:
        """Power state if the motor carries torque in it, else None. Raises as `read_state`."""
        self._sdo.step = "looking for torque"
        state = self.read_state()
        return state if state in POWERED else None

    def read_values(self, entries: tuple[Entry, ...]) -> list[int | None]:
        """Present values of objects; None for those that the drive does not have."""
        self._sdo.step = "reading actual values"
        return [self._sdo.read_if_there(entry) for entry in entries]

    def read_temperature_celsius(self) -> float | None:
        """The configured temperature; None if none is configured or the drive does not have the object."""
        configured = self.settings.temperature
        if configured is None:
            return None
        self._sdo.step = "reading the temperature"
        value = self._sdo.read_real_if_there(configured.entry("temperature"))
        return None if value is None else value * configured.per_unit

    def read_position(self) -> int:
        """Actual position in the drive's units, by SDO."""
        self._sdo.step = "reading the position"
        return self._sdo.read(od.POSITION_ACTUAL)

    def ask_position(self) -> None:
        """Request the actual position by SDO, without waiting."""
        self._sdo.ask(od.POSITION_ACTUAL)

    def answered_position(self) -> int | None:
        """The answer to `ask_position`; None if it has not arrived."""
        return self._sdo.answer(od.POSITION_ACTUAL)

    def read_fault(self) -> str:
        """Why the drive is in FAULT, as text. Only reads.

        Raises:
            ServoError: the drive is not in FAULT.
        """
        self._sdo.step = "looking for the fault"
        state = self.read_state()
        if state is not State.FAULT:
            raise self._sdo.failure(f"the drive is in {state.title}", "No reset is required")
        return self._read_cause()

    def _read_cause(self) -> str:
        """Why the drive is in FAULT, as text."""
        code = self._sdo.read_if_there(od.ERROR_CODE)
        return "603F does not give a cause" if code is None else error_text(code)

    def require_disabled(self) -> None:
        """Refuse to continue with a drive in FAULT, or with one that another program has enabled.

        Raises:
            ServoFault: with the drive's error code.
            ServoError: the drive carries torque.
        """
        self._sdo.step = "checking the state"
        state = self.read_state()
        if state in {State.FAULT, State.FAULT_REACTION_ACTIVE}:
            raise ServoFault(
                self.settings.node_id,
                self.settings.joint,
                "enabling",
                f"the drive is in FAULT: {self._read_cause()}",
                "Remove the cause, then reset the fault (`armload drives reset`) and enable again",
            )
        if state in POWERED:
            raise self._sdo.failure(
                f"the drive carries torque in {state.title}, which this program has not requested",
                "Another program has enabled it: stop that program, then repeat this command",
            )

    def hold_present_position(self) -> int:
        """Write the present position to the target, and a torque offset of zero; returns the position in counts."""
        self._sdo.step = "presetting the target"
        counts = self._sdo.read(od.POSITION_ACTUAL)
        for entry in setpoint_entries(self.settings):
            if entry is od.TARGET_POSITION or entry is od.INTERPOLATION_SETPOINT:
                self._sdo.write(entry, counts)
            elif entry.key == od.TORQUE_OFFSET.key:
                self._sdo.write(entry, 0)
        return counts

    def keep_brake_closed(self) -> None:
        """Close the brake, and keep it closed while the drive is enabled.

        Raises:
            ServoError: the drive has no output for it, or does not keep the setting.
        """
        self._sdo.step = "keeping the brake closed"
        for entry in (od.PHYSICAL_OUTPUTS, od.OUTPUT_MASK):
            value = self._sdo.read_if_there(entry)
            if value is not None:
                self._sdo.write(entry, value | od.SET_BRAKE)
                value = self._sdo.read(entry)
            if value is None or not value & od.SET_BRAKE:
                raise self._sdo.failure(
                    f"the drive does not let its brake be kept closed: {'no ' if value is None else ''}{entry}",
                    "Test the brake with the manufacturer's tool",
                )

    def release_brake(self) -> None:
        """Leave the brake to the drive again."""
        self._sdo.step = "leaving the brake to the drive"
        for entry in (od.OUTPUT_MASK, od.PHYSICAL_OUTPUTS):
            value = self._sdo.read_if_there(entry)
            if value is not None:
                self._sdo.write(entry, value & ~od.SET_BRAKE)

    def reset_fault(self) -> State:
        """Reset a fault by SDO, by a bounded number of rising edges; nothing is enabled.

        Returns:
            The drive's state afterwards.

        Raises:
            ServoFault: the drive stays in FAULT: the cause persists.
            ServoError: the drive is not in FAULT, or an SDO failed.
        """
        self._sdo.step = "resetting the fault"
        machine = MasterMachine()
        try:
            machine.receive(self._sdo.read(od.STATUSWORD), 0.0)
            machine.request_fault_reset()
        except (StatuswordError, TransitionError) as error:
            raise self._sdo.failure(str(error), "No reset is required") from error
        begun_s = time.monotonic()
        while machine.state is State.FAULT and time.monotonic() - begun_s < self._timeouts.fault_reset_s:
            self._sdo.write(od.CONTROLWORD, machine.controlword(time.monotonic() - begun_s))
            machine.receive(self._sdo.read(od.STATUSWORD), time.monotonic() - begun_s)
        self._sdo.write(od.CONTROLWORD, 0)
        self.require_disabled()
        return self.read_state()

    def require_storage(self) -> None:
        """Require a drive that stores its settings on request (1010:1, bit 0).

        Raises:
            ServoError: it does not.
        """
        self._sdo.step = "looking for its memory"
        able = self._sdo.read_if_there(od.STORE_ALL)
        if able is None or not able & 1:
            what = f"no {od.STORE_ALL}" if able is None else f"{od.STORE_ALL} is 0x{able:X}, without bit 0"
            raise self._sdo.failure(
                f"the drive does not store its settings on request: {what}", "Store them with the manufacturer's tool"
            )

    def store_settings(self) -> None:
        """Store the present settings in the drive's memory.

        Raises:
            ServoError: the drive refuses, or does not confirm it in time.
        """
        self._sdo.step = "storing the settings"
        with self._sdo.limited_to(self._timeouts.store_s):
            self._sdo.write(od.STORE_ALL, od.STORE_SIGNATURE)

    def remove_torque(self, limit_s: float) -> None:
        """Remove the torque of a drive that has left the cycle, by SDO.

        Args:
            limit_s: Limit of one request.

        Raises:
            ServoError: the drive does not answer, or keeps its torque.
        """
        self._sdo.step = "removing torque by SDO"
        with self._sdo.limited_to(limit_s):
            with suppress(SdoRefused):  # what counts is the state
                self._sdo.write(od.CONTROLWORD, 0)
            state = self.read_state()
        if state in POWERED:
            raise self._sdo.failure(f"the drive keeps its torque, it is in {state.title}", "Use the emergency stop")
