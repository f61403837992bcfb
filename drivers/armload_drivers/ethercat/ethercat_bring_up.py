"""Bring-up of the drives of one arm over EtherCAT, and inspection of a line without a cycle.

`find` puts all drives of the line in INIT, which removes their torque; `open_line` has checked before that no master
sends, and that no drive is in OP.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from armload_drivers.bring_up.arm_bring_up import ArmBringUp
from armload_drivers.bring_up.drive_bring_up import DriveSetup, configured_units
from armload_drivers.bring_up.inspection import ArmStatus, FoundNode, drive_status, inspect_node
from armload_drivers.bring_up.powered_drive import PoweredDrive, powered_drives
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings, Fieldbus, Identity
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.cia402.state_machine import State
from armload_drivers.cia402.timeouts import USUAL, Timeouts
from armload_drivers.deadline_clock import DeadlineClock
from armload_drivers.driver_errors import BusError, ServoError, ServoFault, TransitionError, WrongDevice
from armload_drivers.ethercat.coe_sdo import CoeSdo
from armload_drivers.ethercat.ethercat_cycle import EthercatCycle
from armload_drivers.ethercat.ethercat_drive import EthercatDrive
from armload_drivers.ethercat.ethercat_line import EthercatLine, LineState, open_line
from armload_drivers.ethercat.ethercat_setup import EthercatSetup

WATCH_S = 0.25
"""For how long a drive that carries torque is watched, for the speed of its axis."""


class EthercatBringUp(ArmBringUp):
    """The drives of one arm on an open line.

    Args:
        clock: Decides when frames are sent.
        timeouts: Limits of all waits.

    Attributes:
        line_setups: The same as `setups`.
        nodes: Its drives in the cycle.
        timeouts: Limits of all waits.
    """

    def __init__(
        self, arm: ArmSettings, line: EthercatLine, clock: DeadlineClock | None = None, timeouts: Timeouts = USUAL
    ) -> None:
        self._line, self._clock, self.timeouts = line, clock or DeadlineClock(), timeouts
        channels = [CoeSdo(d.node_id, d.joint, line, line.worker, self.timeouts.sdo_s) for d in arm.drives]
        self.line_setups = [
            EthercatSetup(drive, arm, sdo, self.timeouts, line) for drive, sdo in zip(arm.drives, channels, strict=True)
        ]
        super().__init__(arm, self.line_setups)
        self.nodes = [
            EthercatDrive(drive, line, sdo, self._clock, arm) for drive, sdo in zip(arm.drives, channels, strict=True)
        ]

    def find(self) -> None:
        """Find the drives and bring them to PREOP."""
        self._line.find()

    def require_no_strangers(self) -> None:
        """Read 1000 of all devices that the configuration does not name."""
        named = {drive.node_id for drive in self.arm.drives} | self.arm.other_nodes
        for node_id in sorted(set(range(1, self._line.size + 1)) - named):
            sdo = CoeSdo(node_id, "no configured joint", self._line, self._line.worker, self.timeouts.probe_s)
            try:
                device_type = sdo.read(od.DEVICE_TYPE)
            except ServoError:
                continue  # a device without objects
            if od.is_drive(device_type):
                raise WrongDevice.unnamed(node_id, len(self.arm.drives), "in the line")

    def powered_drives(self, setups: Sequence[DriveSetup]) -> list[PoweredDrive]:
        """In PREOP only something else than a master on the line can have enabled a drive, such as its maker's tool."""
        return powered_drives(setups, WATCH_S, time.sleep, lambda: "")

    def restart(self, setups: Sequence[DriveSetup]) -> list[DriveSetup]:
        """`find` has restarted them; drives that are not in PREOP are returned."""
        return [
            setup
            for setup in setups
            if not self._line.reaches(LineState.PREOP, setup.settings.node_id - 1, self.timeouts.sdo_s)
        ]

    def cycle(self, units: ArmUnits) -> EthercatCycle:
        """The cycle of drives that are configured.

        Raises:
            BusError: their mappings cannot be placed in frames, or a drive has placed other lengths.
        """
        constants = [setup.constants() for setup in self.line_setups]  # a drive may show its frame's zeros afterwards
        lengths = self._line.map()
        for node, setup in zip(self.nodes, self.line_setups, strict=True):
            expected = setup.outputs.length, setup.inputs.length
            if lengths[node.place] != expected:
                raise BusError(
                    f"{node.settings.joint}: its frame part has {lengths[node.place]} bytes (outputs, inputs), but its "
                    f"objects have {expected}: its mapping is not what it reports"
                )
            if node.settings.sync0 and not self._line.follow_clock(node.place, self.arm.cycle_s):
                raise BusError(f"{node.settings.joint}: sync0 = true, but no drive of the line has a distributed clock")
        self._line.request(LineState.PREOP)
        self.restart(self.setups)
        for node, setup, constant in zip(self.nodes, self.line_setups, constants, strict=True):
            node.map(setup.outputs, setup.inputs, constant)
        found = EthercatCycle(self.arm, self.nodes, units, line=self._line, clock=self._clock, worker=self._line.worker)
        found.read_states()
        return found

    def reset_fault(self, setup: DriveSetup) -> State:
        """A drive takes a fault reset only with process data: all drives run cycles for it, without torque."""
        for other in self.setups:
            other.configure()
        units = configured_units(self.arm, self.setups)
        node = next(node for node in self.nodes if node.settings.joint == setup.settings.joint)
        cycle = self.cycle(units)
        for each, other in zip(self.nodes, self.setups, strict=True):
            each.target_counts = each.position_counts = other.hold_present_position()
        try:
            cycle.begin()
            cycle.run()
            node.machine.request_fault_reset()
            for _ in range(cycle.count(self.timeouts.fault_reset_s)):
                cycle.run()
                if node.machine.state is not State.FAULT:
                    break
        except TransitionError as error:
            raise ServoFault(
                node.settings.node_id, node.settings.joint, "resetting the fault", str(error), "No reset is required"
            ) from error
        finally:
            cycle.end()
            cycle.close()
        setup.require_disabled()
        return setup.read_state()

    def status(self, listen_s: float) -> ArmStatus:
        """In PREOP, after this time."""
        time.sleep(listen_s)
        drives = tuple(drive_status(setup, self.timeouts) for setup in self.setups)
        return ArmStatus(drives, None, 0, False)


def find_drives(line: EthercatLine) -> list[FoundNode]:
    """All devices of a line, in their order; they are put in PREOP.

    A device without objects is described by its EEPROM.
    """
    found = []
    for place in range(line.find()):
        sdo = CoeSdo(place + 1, "unknown joint", line, line.worker, USUAL.sdo_s)
        try:
            device_type = sdo.read(od.DEVICE_TYPE)
        except ServoError:
            name, *identity = line.identity(place)
            found.append(FoundNode(place + 1, None, name, Identity(*identity), (), ()))
        else:
            found.append(inspect_node(sdo, place + 1, [device_type], Fieldbus.ETHERCAT))
    return found


@contextmanager
def open_bring_up(arm: ArmSettings, interface: str) -> Iterator[EthercatBringUp]:
    """The drives of an arm in PREOP, on a line that is closed after the block. Raises as `open_line`."""
    with open_line(interface) as line:
        bring_up = EthercatBringUp(arm, line)
        bring_up.find()
        yield bring_up
