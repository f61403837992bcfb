"""`JointServos` over CANopen: the drives of an arm on any bus that python-can opens.

Rules of this file:
- Only the calling thread sends and receives: no other thread, no callback from elsewhere. While drives move no SDO is
  waited for; the settings are read again between cycles (`settings_watch`).
- Every frame contains a valid target: until a drive is enabled, its target is its present position.
- The heartbeat is sent by the cycle. If the caller stops calling, it ends, and the drives stop the arm (1016, 6007, and
  the time-out of the RPDO). So after `enable`, `exchange` must be called every cycle.
- Nothing is re-enabled automatically: not after a fault, a quick stop, a lost or rebooted drive.
- An error in the cycle is only raised: the caller decides how the arm is stopped. `stop`, `disable` and `close` then
  act on every drive that still answers; an axis that has left its predicted course loses its torque at once.
- Whatever ends `close`, removal of torque was read back from every drive, or the error names those of which it was not.

The bus belongs to the caller: open it before, and close it after `close`.
"""

from __future__ import annotations

import math
from contextlib import suppress
from enum import Enum, auto
from functools import partial

import can

from armload_core.arrays import FloatArray
from armload_drivers.bring_up.drive_bring_up import DriveReport, arm_with, is_simulation
from armload_drivers.bus.bus_link import BusErrors, BusLink
from armload_drivers.bus.bus_scan import require_no_strangers
from armload_drivers.bus.sync_sources import SyncSource
from armload_drivers.canopen.bus_remarks import BusRemarks
from armload_drivers.canopen.canopen_cycle import CanopenCycle
from armload_drivers.canopen.canopen_setup import canopen_setups
from armload_drivers.canopen.drive_node import DriveNode
from armload_drivers.canopen.rhythm import Rhythm
from armload_drivers.canopen.safe_reset import answering_drives, powered_drives, reset_drives
from armload_drivers.canopen.settings_watch import SettingsWatch
from armload_drivers.canopen.torque_removal import STILL_CYCLES, TorqueRemoval, raise_first, torque_remains
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.bus_budget import require_room
from armload_drivers.cia402.drive_safety import Safety
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.cia402.process_data.process_image import drive_image
from armload_drivers.cia402.state_machine import State
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.driver_errors import DriverError, ServoError, ServoTimeout, StateError, TorqueRemains
from armload_drivers.servos import JointCommand, JointFeedback
from armload_drivers.uninterrupted import uninterrupted


class _Phase(Enum):
    """Phase of the sequence in `servos`."""

    NEW = auto()
    CONNECTED = auto()
    ENABLED = auto()
    STOPPED = auto()
    REMAINING = auto()
    CLOSED = auto()


_ENABLED = _Phase.ENABLED
"""Cached, because Python 3.11 takes 0.3 us to look up a member of an enumeration."""


class CanopenServos:
    """All drives of one arm over CANopen.

    Args:
        arm: The arm.
        bus: An open bus; nothing else may read from it.
        sync: Source of SYNC.
        timeouts: Limits of all waits.

    Attributes:
        n: Number of joints.
        cycle_s: Duration of one cycle.
        simulated: Whether every drive has the simulation's identity; known after `connect`.
        reports: Findings of `connect`, per joint.
    """

    def __init__(self, arm: ArmSettings, bus: can.BusABC, sync: SyncSource, timeouts: Timeouts | None = None) -> None:
        self.n = len(arm.drives)
        self.cycle_s = arm.cycle_s
        self.simulated = False
        self.reports: tuple[DriveReport, ...] = ()
        self._arm, self._sync = arm, sync
        self._timeouts = timeouts or Timeouts()
        self._phase = _Phase.NEW
        self._link = link = BusLink(bus)
        self._setups = canopen_setups(arm, link, self._timeouts)
        self._nodes = [
            DriveNode(
                drive,
                drive_image(drive),
                link,
                sync,
                cycle_s=arm.cycle_s,
                heartbeat_s=arm.heartbeat_s,
                max_missing_cycles=arm.max_missing_cycles,
            )
            for drive in arm.drives
        ]
        self._running: CanopenCycle | None = None
        self._removal: TorqueRemoval | None = None
        self._settings: SettingsWatch | None = None
        self._rhythms = Rhythm("SYNC", arm.cycle_s), Rhythm("feedback", arm.cycle_s)
        self._bus_remarks = BusRemarks(link, self._nodes, self._rhythms)
        self._taken_over = ""

    # Bring-up ------------------------------------------------------------------------------------------------

    def connect(self) -> None:
        """Boot, identify, configure and verify every drive; nothing is energised.

        Raises:
            StateError: already connected, or closed.
            BusOverload: the cycle exceeds the bus's capacity.
            WrongDevice: a node is not the configured drive.
            ServoTimeout: only simulated drives are allowed, and a node does not answer; then no node has been reset.
            ServoError: a drive carries torque that must not be removed, and nothing was reset; or a node failed at the
                step that the error names.
            BusError: the bus failed.
        """
        self._require(_Phase.NEW)
        require_room(self._arm)
        self._link.drain()  # answers to another master's requests
        answering = answering_drives(self._setups, self._arm, self._link)
        require_no_strangers(self._link, self._arm, self._timeouts.scan_s)
        powered = powered_drives(answering, self._arm, self._link)
        for setup in reset_drives(self._setups, powered, self._link, self._timeouts.boot_s):
            setup.require_alive()
        for node in self._nodes:
            node.booted = False
        self._taken_over = ", ".join(drive.setup.settings.joint for drive in powered)
        identities = [setup.check_identity() for setup in self._setups]
        polarities = [setup.configure() for setup in self._setups]
        units = ArmUnits(arm_with(self._arm, self._setups), polarities)
        for setup in self._setups:
            setup.secure(units)
        self.reports = tuple(setup.report() for setup in self._setups)
        for node, report in zip(self._nodes, self.reports, strict=True):
            if any(finding.of is Safety.DRIVE_LOST and finding.way is None for finding in report.safety):
                node.heartbeat_limit_s = math.inf
        self._running = CanopenCycle(self._arm, self._nodes, self._link, self._sync, units, self._rhythms)
        self.simulated = all(map(is_simulation, identities))
        self._phase = _Phase.CONNECTED

    # Operation -----------------------------------------------------------------------------------------------

    def standing_rad(self) -> FloatArray:
        """(n,) positions of the joints, by SDO.

        Raises:
            StateError: not connected, or enabled or stopped.
            ServoError: a drive has rebooted since `connect`, or does not answer.
            BusError: the bus failed.
        """
        self._require(_Phase.CONNECTED)
        self._require_configured()
        return self._cycle.units.joint_position_rad([setup.read_position() for setup in self._setups])

    def enable(self) -> JointFeedback:
        """Bring every drive to OPERATION ENABLED, holding its present position.

        Returns:
            Feedback of the first enabled cycle.

        Raises:
            StateError: not connected, or still enabled or stopped.
            ServoError: a drive is not as `connect` has left it: rebooted, changed or enabled by another program; or it
                refused a request.
            ServoFault: a drive is in FAULT; `drive_check.reset` resets it once the cause is removed.
            ServoTimeout: a drive did not reach the state in time.
            BusError: the bus failed.
        """
        self._require(_Phase.CONNECTED)
        step, cycle = "enabling", self._cycle
        self._begin_cycles()
        # From here on drives may carry torque: after any interruption, `close` must disable them.
        self._phase = _Phase.STOPPED
        try:
            for _ in range(cycle.count(self._timeouts.enable_s)):
                for node in self._nodes:
                    if node.state is not State.OPERATION_ENABLED:
                        node.target_counts = node.position_counts
                feedback = cycle.run_checked(step, must_follow=False)
                cycle.ask(
                    State.OPERATION_ENABLED,
                    step,
                    lambda node: node.state is not None and node.machine.goal is None,
                )
                if all(node.follows for node in self._nodes):
                    self._phase = _Phase.ENABLED
                    return feedback
            stuck = next(node for node in self._nodes if not node.follows)
            raise stuck.not_in_time(step, self._timeouts.enable_s, self._sync.now_s())
        except BaseException as error:
            self._back_out(error)
            raise

    def exchange(self, command: JointCommand) -> JointFeedback:
        """Send one cycle's setpoints and return the feedback sampled at the SYNC that latched them.

        Raises:
            StateError: not enabled.
            CommandError: a setpoint cannot be sent, or no axis could follow it in a cycle; nothing was sent.
            LoopLost: an axis has left its predicted course; `stop` removes its torque at once.
            ServoFault: a drive reports a fault.
            ServoTimeout: feedback or heartbeat of a drive has been missing for too long.
            SettingChanged: a drive no longer has a setting that was read back when it was configured.
            ForeignMaster: another node commands the drives, or writes their objects.
            ServoError: a drive left its state by itself, or two drives have the same node id.
            BusError: the bus failed.
        """
        self._require(_ENABLED)
        raw = self._cycle.units.targets(command)
        for node, counts in zip(self._nodes, raw.position_counts, strict=True):
            if not -node.step <= counts - node.target_counts <= node.step:
                raise node.course.too_far(node.settings.joint, counts - node.target_counts)
        for node, counts, permille in zip(self._nodes, raw.position_counts, raw.effort, strict=True):
            node.target_counts = counts
            node.offset_permille = permille
        feedback = self._cycle.run_checked("in the cycle", must_follow=True)
        if self._settings is not None:
            self._settings.step()
        return feedback

    def stop(self, suspect: int | None = None) -> None:
        """Quick stop: decelerate every drive on its own ramp and hold, with torque on.

        Torque offsets are faded to zero linearly within `OFFSET_FADE_S`, including those of drives that are already
        decelerating by themselves. Has no effect if no drive is enabled. Does not wait for drives that have been
        reported as lost. The torque of an axis that leaves its predicted course, before or during the stop, is removed
        at once; if an axis does not come to rest in time, that of all.

        Args:
            suspect: See `JointServos.stop`.

        Raises:
            StateError: not connected.
            LoopLost: an axis left its course during the stop, or did not come to rest in time.
            ServoTimeout: a drive did not reach the requested state, or stopped answering.
            BusError: the bus failed.
        """
        self._require_connected()
        if self._phase is not _Phase.ENABLED:
            return
        with uninterrupted():
            if suspect is not None:
                self._nodes[suspect].course.suspect()
            self._cycle.fade_offsets()
            self._cycle.ask(
                State.QUICK_STOP_ACTIVE,
                "quick stop",
                lambda node: node.state is State.OPERATION_ENABLED and not node.course.lost,
            )
            self._phase = _Phase.STOPPED
            self._begun.slow_down()

    def disable(self) -> None:
        """Engage brakes and remove torque once the arm is at standstill.

        Axes without a brake keep their torque until all others are held by their brakes. Then all are watched for
        `HOLDING_WATCH_S`. A drive that has been reported as lost is disabled by SDO, or reset.

        Raises:
            StateError: not connected.
            ServoError: it could not be read back that a drive carries no torque; or an axis did not come to rest or
                left its course, and everything has been done.
            AxisMoves: an axis moves without torque; everything else has been done.
            BusError: the bus failed.
        """
        self._require_connected()
        if self._phase is not _Phase.CONNECTED:
            with uninterrupted():
                self._remove_torque()

    def _remove_torque(self) -> None:
        """See `disable`."""
        troubles: list[DriverError] = []
        if self._phase is _Phase.ENABLED and not all(node.still_for(STILL_CYCLES) for node in self._nodes):
            try:
                self.stop()
            except DriverError as error:
                troubles.append(error)
        try:
            self._begun.run()
        except TorqueRemains:
            self._phase = _Phase.REMAINING
            raise
        except ServoError as error:
            troubles.append(error)
        try:
            self._end_cycles()
        except DriverError as error:
            troubles.append(error)
        raise_first(troubles)

    def close(self) -> None:
        """Leave the bus, after stopping and disabling if necessary. Idempotent.

        If this is interrupted or fails, the torque of every drive is removed by SDO or NMT reset before the error
        leaves.

        Raises:
            TorqueRemains: it could not be read back that a drive carries no torque.
            DriverError: an axis moves without torque, or left its course; everything has been done. A drive that does
                not answer is no error if removal of its torque was read back.
        """
        if self._phase in {_Phase.NEW, _Phase.CLOSED}:
            self._phase = _Phase.CLOSED
            return
        with uninterrupted():
            self._close()

    def _close(self) -> None:
        """See `close`."""
        troubles: list[BaseException] = []
        steps = () if self._phase is _Phase.REMAINING else (self.stop, self.disable)
        for step in (*steps, self._insist, partial(self._sync.end, self._link)):
            try:
                step()
            except BaseException as error:  # noqa: BLE001 - the next step must follow after any failure
                troubles.append(error)
        if self._phase is _Phase.CONNECTED:
            troubles = [trouble for trouble in troubles if not isinstance(trouble, ServoTimeout)]
        self._phase = _Phase.CLOSED
        # Torque comes first. What is no error of the drives, such as an interruption, must leave as it is.
        troubles.sort(key=lambda trouble: (not isinstance(trouble, TorqueRemains), isinstance(trouble, DriverError)))
        raise_first(troubles)

    def _insist(self) -> None:
        """Remove the torque without cycles, unless it is known to be off.

        Raises:
            TorqueRemains: it could not be read back that a drive carries no torque.
        """
        if self._phase is not _Phase.CONNECTED:
            left = sorted(self._nodes, key=lambda node: not node.settings.has_brake)
            for _ in self._nodes:  # as often as it is interrupted
                with suppress(KeyboardInterrupt):
                    self._begun.without_cycle(left)
                    break
            raise_first([torque_remains(left)])

    def take_remarks(self) -> tuple[str, ...]:
        """What the operator should know since the last call: torque that `connect` removed, problems on the bus."""
        joints, self._taken_over = self._taken_over, ""
        trouble = self._bus_remarks.take()
        if not joints:
            return trouble
        return (f"{joints}: held with torque after the last master ended; the reset removed the torque", *trouble)

    @property
    def bus_load(self) -> float:
        """Measured share of the bus over the last second of cycles, every frame at its worst-case length."""
        return 0.0 if self._running is None else self._running.bus_load

    @property
    def bus_errors(self) -> BusErrors:
        """Errors that the interface has reported so far."""
        return BusErrors(self._link.error_frames, self._link.error_passive, self._link.queue_full)

    # Helpers -------------------------------------------------------------------------------------------------

    def _require(self, phase: _Phase) -> None:
        """Require the given phase."""
        if self._phase is not phase:
            raise StateError(f"the servos are {self._phase.name.lower()}, but must be {phase.name.lower()} for this")

    def _require_configured(self) -> None:
        """Refuse drives that have rebooted since `connect`; drops what other programs received meanwhile."""
        self._link.drain()
        for node in self._nodes:
            node.require_configured()

    @property
    def _cycle(self) -> CanopenCycle:
        """The cycle, which exists after `connect`."""
        if self._running is None:
            raise StateError("the servos are not connected: connect them first")
        return self._running

    @property
    def _begun(self) -> TorqueRemoval:
        """The removal of torque, which exists once the arm has been enabled."""
        if self._removal is None:
            raise StateError("the servos were never enabled")
        return self._removal

    def _require_connected(self) -> None:
        """Require a connection."""
        if self._phase in {_Phase.NEW, _Phase.CLOSED}:
            raise StateError(f"the servos are {self._phase.name.lower()}: connect them first")

    def _begin_cycles(self) -> None:
        """Preset targets and start the nodes, unless one is not as `connect` has left it."""
        self._require_configured()
        for setup in self._setups:
            setup.require_as_configured()
        for node, setup in zip(self._nodes, self._setups, strict=True):
            node.target_counts = node.position_counts = setup.hold_present_position()
            node.offset_permille = 0
            setup.watch_master(on=True)
        self._settings = SettingsWatch([setup.objects for setup in self._setups], self.cycle_s)
        self._removal = TorqueRemoval(self._cycle, self._nodes, self._setups, self._link, self._timeouts)
        self._cycle.begin()

    def _end_cycles(self) -> None:
        """End PDO communication and the drives' watch on the heartbeat; no drive carries torque any more."""
        self._cycle.end()
        self._phase = _Phase.CONNECTED
        for node, setup in zip(self._nodes, self._setups, strict=True):
            if not (node.lost or node.booted or node.is_gone):
                setup.watch_master(on=False)

    def _back_out(self, error: BaseException) -> None:
        """After a failed enabling, disable the drives that already have torque."""
        self._phase = _Phase.STOPPED
        try:
            self.disable()
        except DriverError as again:
            error.add_note(f"Disabling also failed: {again}")
