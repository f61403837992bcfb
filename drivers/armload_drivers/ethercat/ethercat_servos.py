"""`JointServos` over EtherCAT: the drives of an arm on a network interface of its own.

Rules of this file, besides those of `cyclic.cyclic_servos`:
- Frames are sent by the cycle itself. If the caller stops calling, they end, and the watchdogs of the drives' sync
  managers stop the arm.
- Drives are configured in PREOP, and stay there until they are enabled.

The line belongs to the caller: open it before (`open_line`), and close it after `close`.
"""

from __future__ import annotations

from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.timeouts import USUAL, Timeouts
from armload_drivers.cyclic.cyclic_servos import CyclicServos, Phase
from armload_drivers.deadline_clock import DeadlineClock
from armload_drivers.ethercat.ethercat_bring_up import EthercatBringUp
from armload_drivers.ethercat.ethercat_cycle import EthercatCycle
from armload_drivers.ethercat.ethercat_line import EthercatLine


class EthercatServos(CyclicServos):
    """All drives of one arm over EtherCAT.

    Args:
        clock: Decides when frames are sent.
        timeouts: Limits of all waits.
    """

    def __init__(self, arm: ArmSettings, line: EthercatLine, clock: DeadlineClock, timeouts: Timeouts = USUAL) -> None:
        self._bring_up = EthercatBringUp(arm, line, clock, timeouts)
        super().__init__(arm, self._bring_up.setups, self._bring_up.nodes, timeouts)
        self._ethercat_cycle: EthercatCycle | None = None
        self._reported = (0, 0)

    def connect(self) -> None:
        """Find, identify, configure and verify every drive; nothing is energised.

        Raises:
            StateError: already connected, or closed.
            WrongDevice: a device is not the configured drive.
            ServoError: a drive carries torque, or failed at the step that the error names.
            BusError: the bus failed.
        """
        self._require(Phase.NEW)
        self._bring_up.find()
        for setup in self.setups:
            setup.check_identity()
        self._bring_up.require_no_strangers()
        for drive in self._bring_up.powered_drives(self.setups):
            raise drive.refusal()
        self._running = self._ethercat_cycle = self._bring_up.cycle(self._configure())
        self._phase = Phase.CONNECTED

    def _require_started(self) -> None:
        """The drives' modes; until this is checked, `close` must end the cycles."""
        for setup in self._bring_up.line_setups:
            self._cycle.meanwhile(setup.require_started)

    def _drain(self) -> None:
        """Read the drives' states again."""
        if self._ethercat_cycle is not None:
            self._ethercat_cycle.read_states()

    def _leave(self) -> None:
        """Stop listening for other masters; the line puts the drives in INIT when it is closed."""
        if self._ethercat_cycle is not None:
            self._ethercat_cycle.close()

    def take_remarks(self) -> tuple[str, ...]:
        """Frames that did not return, or in which not every drive took part, since the last call."""
        cycle = self._ethercat_cycle
        if cycle is None:
            return ()
        (lost, wrong), self._reported = self._reported, (cycle.lost, cycle.wrong)
        found = [
            f"{count} of {cycle.sent} frames {what}"
            for count, what in (
                (cycle.lost - lost, "did not return in time"),
                (cycle.wrong - wrong, "had a wrong working counter"),
            )
            if count
        ]
        return (f"warning: bus: {', '.join(found)}. Check cables, plugs and drives",) if found else ()
