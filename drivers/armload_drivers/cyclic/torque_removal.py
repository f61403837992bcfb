"""Stops of the drives of one arm, and removal of their torque.

At standstill, in this order: fade torque offsets to zero; wait for standstill; drives whose axes have a brake; drives
whose axes have none, once all others are held; check that the arm does not move.

In motion: an axis that leaves its predicted course (`cia402.axis_course`) has lost its loop. Its torque is removed in
the next cycle, and its brake engages; the others finish their ramp. If more than one axis has lost its loop, or one
does not come to rest in time, the torque of all is removed at once. No wait keeps torque on.

A drive that does not report by its feedback that it has obeyed, or whose feedback has stopped, is asked by SDO, and
then restarted (NMT reset; INIT on EtherCAT), which also ends FAULT REACTION ACTIVE; its answer is read back. Nothing
follows an error before every drive was asked.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from typing import Any

from armload_drivers.bring_up.drive_bring_up import DriveSetup
from armload_drivers.cia402.axis_brakes import HELD_RAD, HOLDING_WATCH_S, axis_moves
from armload_drivers.cia402.state_machine import POWERED, State
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.cyclic.arm_cycle import ArmCycle
from armload_drivers.cyclic.cyclic_drive import CyclicDrive
from armload_drivers.driver_errors import AxisMoves, BusError, ServoTimeout, TorqueRemains
from armload_drivers.servos import JointFeedback

STILL_CYCLES = 3
"""Number of cycles without motion that count as standstill."""
OBEYS_CYCLES = 2
"""A drive that still reports torque after so many cycles of "disable voltage" is asked by SDO."""

_WITHOUT_TORQUE = frozenset(State) - POWERED
_MOVING = frozenset({State.OPERATION_ENABLED, State.FAULT_REACTION_ACTIVE})
_STEP = "removing torque"


class TorqueRemoval:
    """Stops one arm and removes its torque; made anew whenever the arm is enabled.

    Args:
        nodes: Its drives.
        setups: SDO access to them, in the same order.
        timeouts: Limits of the waits.
    """

    def __init__(
        self,
        cycle: ArmCycle[Any],
        nodes: Sequence[CyclicDrive],
        setups: Sequence[DriveSetup],
        timeouts: Timeouts,
    ) -> None:
        self._cycle, self._nodes = cycle, nodes
        self._setups = dict(zip(nodes, setups, strict=True))
        self._timeouts = timeouts
        self._astray: list[CyclicDrive] = []
        self._dropped: dict[CyclicDrive, int] = {}
        self._asked_by_sdo: list[CyclicDrive] = []
        self._awaited: set[CyclicDrive] = set()
        self._followed: dict[CyclicDrive, float] = {}
        self._mute: set[CyclicDrive] = set()

    def slow_down(self) -> None:
        """Wait until drives that were asked for a quick stop stand still; torque is removed at once where that fails.

        Raises:
            LoopLost: an axis left its course, or did not come to rest in time; all others have come to rest.
            ServoTimeout: a drive did not reach the requested state, or stopped answering.
            BusError: the bus failed.
        """
        known = len(self._drop_astray())
        late = self._run_until(_stands_still, self._timeouts.stop_s, "quick stop")
        self._drop_if(late)
        raise_first([*(node.astray("quick stop") for node in self._astray[known:]), late])

    def run(self) -> None:
        """Remove the torque completely.

        Raises:
            TorqueRemains: it could not be read back that a drive carries no torque.
            ServoError: everything has been done; but an axis left its course, did not come to rest or moves without
                torque, or a drive stopped answering or reports torque falsely.
            BusError: the bus failed.
        """
        known = len(self._drop_astray())
        self._cycle.fade_offsets()
        # After an interrupted stop the drives still decelerate.
        late = self._run_until(_is_still, self._timeouts.stop_s, "waiting for standstill")
        self._drop_if(late)
        braked = [node for node in self._nodes if node.settings.has_brake]
        troubles = [self._switch_off(part) for part in (braked, [node for node in self._nodes if node not in braked])]
        moving = self._moving()
        # Feedback that has returned may show torque.
        off = [node for node in self._in_cycle() if node.state in _WITHOUT_TORQUE]
        outside = [node for node in self._nodes if node not in off]
        self._await_rest([node for node in outside if node not in self._dropped])
        self.without_cycle(outside)
        strays = [node.astray(_STEP) for node in self._astray[known:]]
        raise_first([torque_remains(outside), *strays, *troubles, late, moving])

    def without_cycle(self, nodes: list[CyclicDrive]) -> None:
        """Remove the torque of drives by SDO, or else by a restart: what remains if cycles cannot be run.

        That it has restarted is no proof: some drives keep their torque while they reset their communication.

        Args:
            nodes: The drives. Those of which it was read back that they carry no torque are taken out at once, so that
                this can be continued if it is interrupted.
        """
        self._take_out(nodes, self._timeouts.torque_off_s)
        boot_s = 0.0 if self._awaited >= set(nodes) else self._timeouts.boot_s  # a second time is not waited for
        for node in nodes:
            self._reset(node)
        self._awaited |= set(nodes)
        with suppress(BusError):
            self._cycle.await_restart(nodes, boot_s)
        self._take_out(nodes, self._timeouts.sdo_s)

    def _take_out(self, nodes: list[CyclicDrive], limit_s: float) -> None:
        """Ask drives by SDO, and take out those that carry no torque."""
        for node in list(nodes):
            if self._off_by_sdo(node, limit_s):
                nodes.remove(node)

    # At once -------------------------------------------------------------------------------------------------

    def _drop_astray(self) -> list[CyclicDrive]:
        """Drop the torque of axes that have left their course, or of all if there is more than one.

        Returns:
            All that have left it so far.
        """
        self._astray += [node for node in self._nodes if node.course.lost and node not in self._astray]
        self._remove_torque(self._nodes if len(self._astray) > 1 else self._astray)
        return self._astray

    def _drop_if(self, late: ServoTimeout | None) -> None:
        """If an axis did not come to rest in time, drop the torque of all drives, and wait until they have obeyed."""
        moving = [node for node in self._in_cycle() if not (node in self._dropped or _is_still(node))]
        if late is None or not moving:
            return
        for node in moving:
            node.course.leave(f"it did not come to rest within {self._timeouts.stop_s} s")
        self._remove_torque(self._nodes)
        self._run_until(_is_off, self._timeouts.disable_s)

    def _remove_torque(self, nodes: Iterable[CyclicDrive]) -> None:
        """Ask drives to remove torque at once, from the next cycle on."""
        for node in nodes:
            if node not in self._dropped:
                self._dropped[node] = 0
                node.machine.drop()

    def _insist(self) -> None:
        """Ask by SDO, or reset, drives that were dropped and do not report that they carry no torque."""
        for node, cycles in self._dropped.items():
            if node in self._asked_by_sdo or (node.state in _WITHOUT_TORQUE and not node.is_silent):
                continue
            self._dropped[node] = cycles + 1
            reacts = node.state is State.FAULT_REACTION_ACTIVE
            if reacts or cycles >= OBEYS_CYCLES:
                if reacts or not self._off_by_sdo(node, self._timeouts.torque_off_s):
                    self._reset(node)
                self._asked_by_sdo.append(node)

    def _off_by_sdo(self, node: CyclicDrive, limit_s: float) -> bool:
        """Remove a drive's torque by SDO; whether this was read back."""
        setup = self._setups[node]

        def remove() -> None:
            node.leave_cycle()
            setup.remove_torque(limit_s)

        try:
            self._cycle.meanwhile(remove)
        except Exception:  # noqa: BLE001 - whatever fails, the other drives must be asked too
            return False
        return True

    def _reset(self, node: CyclicDrive) -> None:
        """Reset a drive, which removes its torque."""
        with suppress(Exception):  # the other drives must be reset too
            self._cycle.meanwhile(node.restart)

    # At standstill -------------------------------------------------------------------------------------------

    def _run_until(self, done: Callable[[CyclicDrive], bool], limit_s: float, step: str = _STEP) -> ServoTimeout | None:
        """Run cycles until a condition holds for every drive in the cycle, and no torque offset is fading.

        Meanwhile the torque of axes that leave their course is dropped. Of dropped drives only this is awaited.

        Returns:
            The error for a drive that stopped answering, or for which the condition does not hold in time; else None.

        Raises:
            BusError: the bus failed.
        """
        waiting: list[CyclicDrive] = []
        gone: list[CyclicDrive] = []
        for _ in range(self._cycle.count(limit_s)):
            last = self._run_cycle()
            gone += [node for node in self._in_cycle() if node.is_gone and node not in gone]
            waiting = [
                node
                for node in self._in_cycle()
                if node not in gone and not (_is_off(node) if node in self._dropped else done(node))
            ]
            if not waiting and not self._cycle.fading:
                break
        errors = [node.gone(step) for node in gone]
        if errors:
            return errors[0]
        return waiting[0].not_in_time(step, limit_s, last.time_s) if waiting else None

    def _run_cycle(self) -> JointFeedback:
        """One cycle; the torque of axes that have left their course is dropped."""
        feedback = self._cycle.run()
        self._follow_lost(self._cycle.now_s())
        self._drop_astray()
        self._insist()
        return feedback

    def _follow_lost(self, now_s: float) -> None:
        """Follow drives that have left the cycle by their positions, which are read by SDO without waiting."""
        for node in self._nodes:
            if not (node.lost or node.is_gone) or node in self._dropped or node in self._asked_by_sdo:
                continue
            setup, asked_s = self._setups[node], self._followed.get(node)
            if asked_s is None:
                node.leave_cycle()  # a stopped node answers no SDO
                node.forget_rest()
            elif (counts := setup.answered_position()) is not None:
                node.take_position(counts, asked_s, now_s)
                self._mute.discard(node)
            elif now_s - asked_s < self._timeouts.sdo_s:
                continue
            else:
                self._mute.add(node)
            setup.ask_position()
            self._followed[node] = now_s

    def _in_cycle(self) -> list[CyclicDrive]:
        """Drives whose feedback tells what they do."""
        return [node for node in self._nodes if not (node.lost or node in self._asked_by_sdo)]

    def _switch_off(self, nodes: list[CyclicDrive]) -> ServoTimeout | None:
        """Remove the torque of some drives; the error for one that does not report this in time, else None."""
        self._cycle.ask(
            State.SWITCH_ON_DISABLED,
            _STEP,
            lambda node: node in nodes and not (node.lost or node in self._dropped),
        )
        late = self._run_until(lambda node: node not in nodes or _is_off(node), self._timeouts.disable_s)
        # A drive that ignores the request is acceptable as long as it carries no torque.
        keeping = [node for node in self._in_cycle() if node in nodes and node.state not in _WITHOUT_TORQUE]
        self._asked_by_sdo += keeping
        return late if keeping or any(node.is_gone for node in nodes) else None

    def _moving(self) -> AxisMoves | None:
        """Watch the axes without torque; the error for one that moves, or None."""
        begun = [math.nan if node.lost or node.is_gone else node.position_counts for node in self._nodes]
        for _ in range(self._cycle.count(HOLDING_WATCH_S)):
            self._run_cycle()
        for node, counts, axis in zip(self._nodes, begun, self._cycle.units.axes, strict=True):
            moved_rad = abs((node.position_counts - counts) / axis.counts_per_rad)
            if moved_rad > HELD_RAD and node.state in _WITHOUT_TORQUE:
                return axis_moves(node.settings, moved_rad)
        return None

    def _await_rest(self, nodes: list[CyclicDrive]) -> None:
        """Wait until axes stand still, no longer than for a quick stop, and not for those that answer nothing."""

        def may_move(node: CyclicDrive) -> bool:
            unknown = (node.lost or node.is_gone) and node not in self._followed
            return unknown or not (node in self._mute or node in self._dropped or _is_still(node))

        begun_s = self._cycle.now_s()
        while any(map(may_move, nodes)) and self._cycle.now_s() - begun_s < self._timeouts.stop_s:
            self._run_cycle()


def torque_remains(nodes: Sequence[CyclicDrive]) -> TorqueRemains | None:
    """Error for drives of which it is not known that they carry no torque; None if there are none."""
    if not nodes:
        return None
    first, *others = (node.settings for node in nodes)
    also = f", and likewise {', '.join(f'{d.joint} (node {d.node_id})' for d in others)}" if others else ""
    what = f"the drive may still carry torque: that it was removed could not be read back{also}"
    return TorqueRemains(first.node_id, first.joint, _STEP, what, "Press the emergency stop")


def raise_first(errors: Iterable[BaseException | None]) -> None:
    """Raise the first error, with the others as notes."""
    found = [error for error in errors if error is not None]
    for other in found[1:]:
        found[0].add_note(f"Also: {other}")
    if found:
        raise found[0]


def _is_off(node: CyclicDrive) -> bool:
    """Whether a drive carries no torque and has reached the requested state, or is in a fault."""
    return node.state in _WITHOUT_TORQUE and (node.machine.reached or node.faulty)


def _is_still(node: CyclicDrive) -> bool:
    """Whether an axis is at standstill."""
    return node.still_for(STILL_CYCLES)


def _stands_still(node: CyclicDrive) -> bool:
    """Whether an axis is at standstill, and its drive keeps it there."""
    return node.state not in _MOVING and _is_still(node)
