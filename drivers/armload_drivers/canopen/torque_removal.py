"""Removal of torque from all drives of an arm at standstill, over CANopen.

The order: fade torque offsets to zero; wait for standstill; drives whose axes have a brake; drives whose axes have
none, once all others are held; check that the arm does not move; drives that have left the cycle, by SDO, once they
stand. A drive whose feedback shows that it keeps its torque is also disabled by SDO: its feedback may be frozen.
"""

from __future__ import annotations

from collections.abc import Sequence

from armload_drivers.bring_up.drive_bring_up import DriveSetup
from armload_drivers.bus.bus_link import BusLink
from armload_drivers.canopen.canopen_cycle import CanopenCycle
from armload_drivers.canopen.drive_node import DriveNode
from armload_drivers.cia402.axis_brakes import HELD_RAD, HOLDING_WATCH_S, axis_moves
from armload_drivers.cia402.object_dictionary import NmtCommand
from armload_drivers.cia402.state_machine import POWERED, State
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import AxisMoves, ServoTimeout

STILL_CYCLES = 3
"""Number of cycles without motion that count as standstill."""

_WITHOUT_TORQUE = frozenset(State) - POWERED
_STEP = "removing torque"


class TorqueRemoval:
    """Removes the torque of one arm.

    Args:
        cycle: Its cycle, running.
        nodes: Its drives.
        setups: SDO access to them, in the same order.
        link: The bus.
        timeouts: Limits of the waits.
    """

    def __init__(
        self,
        cycle: CanopenCycle,
        nodes: Sequence[DriveNode],
        setups: Sequence[DriveSetup],
        link: BusLink,
        timeouts: Timeouts,
    ) -> None:
        self._cycle, self._nodes = cycle, nodes
        self._setups = dict(zip(nodes, setups, strict=True))
        self._link, self._timeouts = link, timeouts

    def run(self) -> AxisMoves | None:
        """Remove the torque completely.

        Returns:
            The error to raise for an axis that moves without torque; None if all stand still.

        Raises:
            ServoTimeout: a drive did not come to rest, or keeps its torque.
            BusError: the bus failed.
        """
        cycle, nodes = self._cycle, self._nodes
        cycle.fade_offsets()
        cycle.run_until(lambda node: node.still_for(STILL_CYCLES), "waiting for standstill", self._timeouts.disable_s)
        braked = [node for node in nodes if node.settings.has_brake]
        troubles = [
            trouble
            for part in (braked, [node for node in nodes if node not in braked])
            if part and (trouble := self._switch_off(part)) is not None
        ]
        moving = self._moving()
        for node in nodes:
            if node.lost:
                self._switch_off_by_sdo(node)
        if troubles:
            raise troubles[0]
        return moving

    def _switch_off(self, nodes: list[DriveNode]) -> ServoTimeout | None:
        """Remove the torque of some drives.

        Returns:
            The error to raise for a drive whose feedback reports torque but whose SDO answer does not; else None.

        Raises:
            ServoTimeout: a drive keeps its torque, and does not answer by SDO.
            ServoError: a drive keeps its torque, also according to SDO.
        """
        self._cycle.ask(State.SWITCH_ON_DISABLED, _STEP, lambda node: node in nodes and not node.lost)
        try:
            self._cycle.run_until(lambda node: node not in nodes or _is_off(node), _STEP, self._timeouts.disable_s)
        except ServoTimeout as error:
            # A drive that ignores the request is acceptable as long as it carries no torque.
            keeping = [node for node in nodes if not (node.lost or node.state in _WITHOUT_TORQUE)]
            for node in keeping:
                if not self._switch_off_by_sdo(node):
                    raise
                node.lost = True
            if keeping:
                error.add_note("Read by SDO, the drive reports no torque: its cyclic feedback is wrong.")
                return error
        return None

    def _switch_off_by_sdo(self, node: DriveNode) -> bool:
        """Remove a drive's torque outside the cycle, by SDO; False if it does not answer."""
        # A stopped node answers no SDO; in PRE-OPERATIONAL it does, and ignores late setpoints.
        self._link.command(NmtCommand.PRE_OPERATIONAL, node.settings.node_id)
        setup = self._setups[node]
        if not setup.is_up():
            return False
        self._await_rest(node, setup)
        setup.remove_torque()
        return True

    def _moving(self) -> AxisMoves | None:
        """Watch the axes without torque; the error for one that moves, or None."""
        begun = [node.position_counts for node in self._nodes]
        for _ in range(self._cycle.count(HOLDING_WATCH_S)):
            self._cycle.run()
        for node, counts, axis in zip(self._nodes, begun, self._cycle.units.axes, strict=True):
            moved_rad = abs((node.position_counts - counts) / axis.counts_per_rad)
            if moved_rad > HELD_RAD and not (node.lost or node.is_gone):
                return axis_moves(node.settings, moved_rad)
        return None

    def _await_rest(self, node: DriveNode, setup: DriveSetup) -> None:
        """Wait until a drive that has left the cycle is at standstill, by SDO.

        Raises:
            ServoTimeout: the axis keeps moving.
        """
        before, still = setup.read_position(), 0
        for _ in range(self._cycle.count(self._timeouts.stop_s)):
            last = self._cycle.run()
            counts = setup.read_position()
            still = still + 1 if node.is_still(counts - before) else 0
            if still >= STILL_CYCLES:
                return
            before = counts
        raise node.not_in_time("waiting for standstill", self._timeouts.stop_s, last.time_s)


def _is_off(node: DriveNode) -> bool:
    """Whether a drive carries no torque and has reached the requested state, or is in a fault."""
    return node.state in _WITHOUT_TORQUE and (node.machine.reached or node.faulty)
