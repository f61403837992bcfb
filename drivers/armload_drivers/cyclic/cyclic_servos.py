"""The operation of an arm's drives, on either bus: `JointServos` but for `connect`.

Rules of this file:
- Only the calling thread sends and receives process data. While drives move no SDO is waited for; the settings are read
  again between cycles (`settings_watch`).
- Every cycle carries a valid target: until a drive is enabled, its target is its present position.
- The drives notice if the caller stops calling, and stop the arm. So after `enable`, `exchange` must be called every
  cycle.
- Nothing is re-enabled automatically: not after a fault, a quick stop, a lost or restarted drive.
- An error in the cycle is only raised: the caller decides how the arm is stopped. `stop`, `disable` and `close` then
  act on every drive that still answers; an axis that has left its predicted course loses its torque at once.
- Whatever ends `close`, removal of torque was read back from every drive, or the error names those of which it was not.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from contextlib import suppress
from enum import Enum, auto
from typing import Any

from armload_drivers.bring_up.drive_bring_up import DriveSetup, configured_units, is_simulation
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.process_data.drive_units import ArmUnits
from armload_drivers.cia402.state_machine import State
from armload_drivers.cia402.timeouts import Timeouts
from armload_drivers.cyclic.arm_cycle import ArmCycle
from armload_drivers.cyclic.cyclic_drive import CyclicDrive
from armload_drivers.cyclic.settings_watch import SettingsWatch
from armload_drivers.cyclic.torque_removal import STILL_CYCLES, TorqueRemoval, raise_first, torque_remains
from armload_drivers.driver_errors import DriverError, ServoError, ServoTimeout, StateError, TorqueRemains
from armload_drivers.servos import FloatArray, JointCommand, JointFeedback
from armload_drivers.uninterrupted import uninterrupted


class Phase(Enum):
    """Phase of the sequence in `servos`."""

    NEW = auto()
    CONNECTED = auto()
    ENABLED = auto()
    STOPPED = auto()
    REMAINING = auto()
    CLOSED = auto()


_ENABLED = Phase.ENABLED
"""Cached, because Python 3.11 takes 0.3 us to look up a member of an enumeration."""


class CyclicServos(ABC):
    """All drives of one arm.

    Args:
        setups: Bring-up of its drives.
        nodes: Its drives in the cycle.
        timeouts: Limits of all waits.

    Attributes:
        n: Number of joints.
        cycle_s: Duration of one cycle.
        simulated: Whether every drive has the simulation's identity; known after `connect`.
        setups: Bring-up of the drives, with the findings of `connect`.
    """

    def __init__(
        self, arm: ArmSettings, setups: Sequence[DriveSetup], nodes: Sequence[CyclicDrive], timeouts: Timeouts
    ) -> None:
        self.n = len(arm.drives)
        self.cycle_s = arm.cycle_s
        self.simulated = False
        self._arm, self.setups, self._nodes, self._timeouts = arm, setups, nodes, timeouts
        self._phase = Phase.NEW
        self._running: ArmCycle[Any] | None = None
        self._removal: TorqueRemoval | None = None
        self._settings: SettingsWatch | None = None

    @abstractmethod
    def _drain(self) -> None:
        """Drop what was received while no cycle ran."""

    @abstractmethod
    def _leave(self) -> None:
        """Leave the bus; no drive carries torque any more, or it is not known how to remove it."""

    def _configure(self) -> ArmUnits:
        """Check and configure drives that were restarted; the units of the arm. Raises as `connect`."""
        identities = [setup.check_identity() for setup in self.setups]
        for setup in self.setups:
            setup.configure()
        units = configured_units(self._arm, self.setups)
        for setup in self.setups:
            setup.secure(units)
        self.simulated = all(map(is_simulation, identities))
        return units

    def standing_rad(self) -> FloatArray:
        """(n,) positions of the joints, by SDO.

        Raises:
            StateError: not connected, or enabled or stopped.
            ServoError: a drive has restarted since `connect`, or does not answer.
            BusError: the bus failed.
        """
        self._require(Phase.CONNECTED)
        self._require_configured()
        return self._cycle.units.joint_position_rad([setup.read_position() for setup in self.setups])

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
        self._require(Phase.CONNECTED)
        step, cycle = "enabling", self._cycle
        self._begin_cycles()
        # From here on drives may carry torque: after any interruption, `close` must disable them.
        self._phase = Phase.STOPPED
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
                    self._phase = Phase.ENABLED
                    return feedback
            stuck = next(node for node in self._nodes if not node.follows)
            raise stuck.not_in_time(step, self._timeouts.enable_s, cycle.now_s())
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
        cycle, nodes = self._cycle, self._nodes
        counts, permille = cycle.units.targets(command)
        for node, target in zip(nodes, counts, strict=True):
            if abs(target - node.target_counts) > node.course.step:
                raise node.course.too_far(node.settings.joint, target - node.target_counts)
        for node, target, offset in zip(nodes, counts, permille, strict=True):
            node.target_counts, node.offset_permille = target, offset
        feedback = cycle.run_checked("in the cycle", must_follow=True)
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
        if self._phase is not Phase.ENABLED:
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
            self._phase = Phase.STOPPED
            self._begun.slow_down()

    def disable(self) -> None:
        """Engage brakes and remove torque once the arm is at standstill.

        Axes without a brake keep their torque until all others are held by their brakes. Then all are watched for
        `HOLDING_WATCH_S`. A drive that has been reported as lost is disabled by SDO, or restarted.

        Raises:
            StateError: not connected.
            ServoError: it could not be read back that a drive carries no torque; or an axis did not come to rest or
                left its course, and everything has been done.
            AxisMoves: an axis moves without torque; everything else has been done.
            BusError: the bus failed.
        """
        self._require_connected()
        if self._phase is not Phase.CONNECTED:
            with uninterrupted():
                self._remove_torque()

    def _remove_torque(self) -> None:
        """See `disable`."""
        troubles: list[DriverError] = []
        if self._phase is Phase.ENABLED and not all(node.still_for(STILL_CYCLES) for node in self._nodes):
            try:
                self.stop()
            except DriverError as error:
                troubles.append(error)
        try:
            self._begun.run()
        except TorqueRemains:
            self._phase = Phase.REMAINING
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

        If this is interrupted or fails, the torque of every drive is removed by SDO or by a restart before the error
        leaves.

        Raises:
            TorqueRemains: it could not be read back that a drive carries no torque.
            DriverError: an axis moves without torque, or left its course; everything has been done. A drive that does
                not answer is no error if removal of its torque was read back.
        """
        if self._phase in {Phase.NEW, Phase.CLOSED}:
            self._phase = Phase.CLOSED
            return
        with uninterrupted():
            self._close()

    def _close(self) -> None:
        """See `close`."""
        troubles: list[BaseException] = []
        steps = () if self._phase is Phase.REMAINING else (self.stop, self.disable)
        for step in (*steps, self._insist, self._leave):
            try:
                step()
            except BaseException as error:  # noqa: BLE001 - the next step must follow after any failure
                troubles.append(error)
        if self._phase is Phase.CONNECTED:
            troubles = [trouble for trouble in troubles if not isinstance(trouble, ServoTimeout)]
        self._phase = Phase.CLOSED
        # Torque comes first. What is no error of the drives, such as an interruption, must leave as it is.
        troubles.sort(key=lambda trouble: (not isinstance(trouble, TorqueRemains), isinstance(trouble, DriverError)))
        raise_first(troubles)

    def _insist(self) -> None:
        """Remove the torque without cycles, unless it is known to be off.

        Raises:
            TorqueRemains: it could not be read back that a drive carries no torque.
        """
        if self._phase is not Phase.CONNECTED:
            left = sorted(self._nodes, key=lambda node: not node.settings.has_brake)
            for _ in self._nodes:  # as often as it is interrupted
                with suppress(KeyboardInterrupt):
                    self._begun.without_cycle(left)
                    break
            raise_first([torque_remains(left)])

    # Helpers -------------------------------------------------------------------------------------------------

    def _require(self, phase: Phase) -> None:
        """Require the given phase."""
        if self._phase is not phase:
            raise StateError(f"the servos are {self._phase.name.lower()}, but must be {phase.name.lower()} for this")

    def _require_configured(self) -> None:
        """Refuse drives that have restarted since `connect`."""
        self._drain()
        for node in self._nodes:
            node.require_configured()

    @property
    def _cycle(self) -> ArmCycle[Any]:
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

    @abstractmethod
    def _require_started(self) -> None:
        """Check what a drive shows only while cycles run, before it is enabled."""

    def _require_connected(self) -> None:
        """Require a connection."""
        if self._phase in {Phase.NEW, Phase.CLOSED}:
            raise StateError(f"the servos are {self._phase.name.lower()}: connect them first")

    def _begin_cycles(self) -> None:
        """Preset targets and start the drives, unless one is not as `connect` has left it."""
        self._require_configured()
        for setup in self.setups:
            setup.require_as_configured()
        for node, setup in zip(self._nodes, self.setups, strict=True):
            node.target_counts = node.position_counts = setup.hold_present_position()
            node.offset_permille = 0
            setup.watch_master(on=True)
        self._keep_brakes_closed()
        self._settings = SettingsWatch([setup.objects for setup in self.setups], self.cycle_s)
        self._removal = TorqueRemoval(self._cycle, self._nodes, self.setups, self._timeouts)
        try:
            self._cycle.begin()
            self._require_started()
        except BaseException:
            with suppress(DriverError):
                self._cycle.end()
            raise

    def _keep_brakes_closed(self) -> None:
        """If the arm is opened to test its brakes, keep all closed, or none if one drive refuses."""
        braked = [setup for setup in self.setups if self._arm.brakes_closed and setup.settings.has_brake]
        try:
            for setup in braked:
                setup.keep_brake_closed()
        except BaseException:
            for setup in braked:
                with suppress(DriverError):
                    setup.release_brake()
            raise

    def _end_cycles(self) -> None:
        """End the cycles and the drives' watch on their master; no drive carries torque any more."""
        self._cycle.end()
        self._phase = Phase.CONNECTED
        for node, setup in zip(self._nodes, self.setups, strict=True):
            if not (node.lost or node.restarted or node.is_gone):
                setup.watch_master(on=False)
                if self._arm.brakes_closed and node.settings.has_brake:
                    setup.release_brake()

    def _back_out(self, error: BaseException) -> None:
        """After a failed enabling, disable the drives that already have torque."""
        self._phase = Phase.STOPPED
        try:
            self.disable()
        except DriverError as again:
            error.add_note(f"Disabling also failed: {again}")
