"""The simulated drives of an arm on a CAN bus: one bus object, one clock.

On a wall clock a thread receives, lets the drives act, and sends. It also wakes up by itself, and the plant continues
without SYNC, as an arm does; actions at SYNC take effect at the frame's time stamp, not when the thread processes it.
With a `VirtualClock` there is no thread: the drives act while a frame is being sent to them, on a `LockstepBus`. Time
is read only at SYNC: the sender of SYNC controls time, and the same commands give bit-identical results.

Faults are injected by `fail`, `fail_encoder`, `set_object`, `drop_feedback`, `switch_off` and `switch_on`, from any
thread; they take effect before the next frame.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from queue import SimpleQueue
from typing import Self

import can

from armload_drivers.bus.joined_bus import JoinedBus
from armload_drivers.bus.sync_sources import Clock
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.cia402.object_dictionary import Entry, NmtCommand
from armload_drivers.driver_errors import BusError, DriverError, SimulationError, StateError
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.drive_pdos import Pdo
from armload_drivers.simulation.drives.simulated_drive import SimulatedDrive
from armload_drivers.simulation.lockstep_bus import LockstepBus
from armload_drivers.simulation.plant_interface import EncoderFault, Plant, PlantAxis
from armload_drivers.simulation.virtual_clock import VirtualClock

WAKE_S = 0.002
"""On a wall clock the plant is advanced at least at this interval."""

LONGEST_GAP_S = 0.05
"""On a wall clock, the greatest time between two reads of the bus that counts for the drives' timers: a simulator that
was not scheduled must not mistake that for a silent master. The plant is advanced by the full time."""

OLDEST_S = 0.2
"""If the stamp of a SYNC is older, the interface's clock is not this computer's."""

MOST_FRAMES = 256
"""Greatest number of frames processed at once before the timers."""

_NMT_COMMANDS = {command.value: command for command in NmtCommand}


class SimulatedDrives:
    """All drives of one arm.

    Args:
        arm: The arm; the simulated drives correspond to it, with the simulation's identity.
        plant: The plant that they drive. It belongs to the drives from `start` to `stop`.
        bus: Their bus, or the `JoinedBus` of their buses; of `LockstepBus`es with a virtual clock. The caller opens and
            closes it, and nothing else may read from it.
        clock: Wall clock, or the virtual clock that lockstep SYNC advances.
        traits: Deviations of drives, by node id.

    Attributes:
        frames_lost: Number of frames that could not be sent.
    """

    def __init__(
        self,
        arm: ArmSettings,
        plant: Plant,
        bus: can.BusABC,
        clock: Clock,
        traits: Mapping[int, DriveTraits] | None = None,
    ) -> None:
        self.frames_lost = 0
        self._arm, self._plant, self._bus, self._clock = arm, plant, bus, clock
        self._virtual = clock if isinstance(clock, VirtualClock) else None
        self._joined = isinstance(bus, JoinedBus)
        self._wire = _lockstep(bus)
        self._now_s = self._wall_s = clock()
        self._messages: dict[int, can.Message] = {}
        self._setpoint_routes: dict[int, list[tuple[SimulatedDrive, Pdo]]] | None = None
        self._calls: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self._started = False
        self._failure: Exception | None = None
        chosen = {} if traits is None else traits
        self._drives = {
            drive.node_id: SimulatedDrive(
                drive,
                PlantAxis(plant, axis),
                cycle_s=arm.cycle_s,
                traits=chosen.get(drive.node_id, DriveTraits()),
                send=self._send,
                rerouted=self._invalidate_routes,
            )
            for axis, drive in enumerate(arm.drives)
        }
        self._by_bus = [[self._drives[drive.node_id] for drive in part.drives] for part in arm.by_bus()]

    def start(self) -> None:
        """Switch the drives on.

        Raises:
            StateError: they are already on.
        """
        if self._started:
            raise StateError("the simulated drives are already running")
        self._started = True
        if self._virtual is not None:
            self._start_in_lockstep(self._virtual)
            return
        self._stopping.clear()
        self._thread = threading.Thread(target=self._run, name="simulated-drives", daemon=True)
        self._thread.start()

    def _start_in_lockstep(self, clock: VirtualClock) -> None:
        """Act on every frame while it is being sent."""
        if self._wire is None:
            raise StateError("simulated drives in virtual time need a LockstepBus")
        clock.follow(self._why_ended)
        self._wire.listen(self._act)
        self._switch_all_on()

    @property
    def running(self) -> bool:
        """Whether the drives are active; `stop` raises the error that ended them early."""
        return self._started and self._failure is None and (self._thread is None or self._thread.is_alive())

    def _why_ended(self) -> str:
        """Why the drives are no longer active; empty while they are."""
        if self.running:
            return ""
        return "they have been stopped" if self._failure is None else f"they ended early: {self._failure!r}"

    def stop(self) -> None:
        """Switch the drives off. Idempotent.

        Raises:
            SimulationError: they had ended early, because of the error that is its cause.
        """
        if not self._started:
            return
        self._started = False
        if self._wire is not None:
            self._wire.listen(None)
        if self._thread is not None:
            self._stopping.set()
            self._thread.join()
            self._thread = None
        for drive in self._drives.values():
            drive.switch_off()
        self.raise_failure()

    def raise_failure(self) -> None:
        """Raise the error that ended the drives early, once; for owners that only wait.

        Raises:
            SimulationError: they have ended early.
        """
        failure, self._failure = self._failure, None
        if isinstance(failure, DriverError):
            raise failure
        if failure is not None:
            raise SimulationError(f"the simulated drives ended early: {failure!r}") from failure

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def fail(self, node_id: int, code: int, *, persistent: bool = False) -> None:
        """Let a drive detect a fault.

        Args:
            node_id: Node id of the drive.
            code: Error code (603F).
            persistent: Whether the cause persists after a fault reset.
        """
        self._calls.put(lambda: self._drives[node_id].fail(code, self._now_s, persistent=persistent))

    def fail_encoder(self, node_id: int, fault: EncoderFault) -> None:
        """Let the encoder of a drive's axis fail, inside its own loops."""
        axis = list(self._drives).index(node_id)
        self._calls.put(lambda: self._plant.fail_encoder(axis, fault))

    def set_object(self, node_id: int, entry: Entry, value: int) -> None:
        """Change an object of a drive from inside, as a tool does on a cable of its own: nothing is on the bus."""
        self._calls.put(lambda: self._drives[node_id].set_object(entry, value))

    def drop_feedback(self, node_id: int, cycles: int) -> None:
        """Drop a drive's TPDOs for a number of SYNCs."""
        self._calls.put(lambda: setattr(self._drives[node_id], "dropped_feedback", cycles))

    def switch_off(self, node_id: int) -> None:
        """Switch off a drive's supply."""
        self._calls.put(self._drives[node_id].switch_off)

    def switch_on(self, node_id: int) -> None:
        """Switch on a drive's supply: the drive boots."""
        self._calls.put(lambda: self._drives[node_id].switch_on(self._now_s))

    def _switch_all_on(self) -> None:
        """Boot every drive."""
        for drive in self._drives.values():
            drive.switch_on(self._now_s)

    def _act(self, message: can.Message) -> None:
        """In lockstep: act on a frame. An error ends the drives, and does not reach the sender of the frame."""
        if self._failure is not None:
            return
        try:
            if not self._calls.empty():
                self._carry_out_calls()
            self._receive(message)
        except Exception as error:  # noqa: BLE001 - raised where the drives are stopped
            self._failure = error

    def _run(self) -> None:
        """On a wall clock: body of the thread."""
        try:
            self._switch_all_on()
            while not self._stopping.is_set():
                message = self._bus.recv(WAKE_S)
                self._look_at_clock()
                self._carry_out_calls()
                if message is not None:
                    self._receive(message)
                self._receive_backlog()
                self._tick()
        except (can.CanError, OSError) as error:
            self._failure = BusError(f"the simulated drives lost their bus: {error}")
        except Exception as error:  # noqa: BLE001 - a thread's error is raised where the drives are stopped
            self._failure = error

    def _receive_backlog(self) -> None:
        """Process waiting frames before the timers; the number is bounded in case of a flood.

        The plant is then advanced, but only to where every frame has been read: a SYNC that arrived while this thread
        was not scheduled samples the plant at its stamp, and axes that had passed it could not go back.
        """
        for _ in range(MOST_FRAMES):
            read_s = self._clock()
            message = self._bus.recv(0.0)
            if message is None:
                self._plant.advance(read_s)
                return
            self._receive(message)

    def _look_at_clock(self) -> None:
        """Update the time from the wall clock."""
        wall_s = self._clock()
        self._now_s += min(wall_s - self._wall_s, LONGEST_GAP_S)
        self._wall_s = wall_s

    def _carry_out_calls(self) -> None:
        """Run calls from other threads; only this thread reads the queue."""
        while not self._calls.empty():
            self._calls.get_nowait()()

    def _receive(self, message: can.Message) -> None:
        """Pass a frame to the drives concerned."""
        if message.is_error_frame or message.is_remote_frame or message.is_extended_id:
            return
        cob_id, data = message.arbitration_id, message.data
        bus = int(str(message.channel)) if self._joined else 0
        if cob_id == od.SYNC_DEFAULT_COB_ID:
            self._sync(len(data), message.timestamp, bus)
            return
        if self._setpoint_routes is None:
            self._setpoint_routes = self._built_routes()
        if cob_id in self._setpoint_routes:
            for drive, pdo in self._setpoint_routes[cob_id]:
                drive.setpoints(pdo, data, self._now_s)
        elif cob_id == od.NMT_COB_ID:
            self._command(data, bus)
        elif cob_id & ~0x7F == od.SDO_RX_BASE:
            server = self._drives.get(cob_id & 0x7F)
            if server is not None:
                server.request(data, self._now_s)
        elif cob_id & ~0x7F == od.HEARTBEAT_BASE:
            for drive in self._by_bus[bus]:
                drive.heard(cob_id & 0x7F, self._now_s)

    def _sync(self, length: int, stamp_s: float, bus: int) -> None:
        """One SYNC: measure, latch, answer.

        Args:
            length: Number of data bytes; a drive with 1019 set expects the counter, others expect none.
            stamp_s: Its time on the interface's clock.
            bus: Number of its bus.
        """
        time_s = self._clock()
        if self._virtual is not None:
            self._now_s = time_s
        else:
            age_s = time.time() - stamp_s
            time_s -= age_s if 0.0 < age_s < OLDEST_S else 0.0
        self._plant.advance(time_s)
        sample = self._plant.sample(self._arm.cycle_s)
        columns = zip(
            sample.axis_position_rad.tolist(),
            sample.axis_velocity_rad_s.tolist(),
            sample.axis_demand_rad.tolist(),
            sample.axis_torque_nm.tolist(),
            strict=True,
        )
        concerned = self._by_bus[bus]
        for drive, values in zip(self._drives.values(), columns, strict=True):
            if drive not in concerned:
                continue
            drive.power.measure(*values)
            drive.power.lock_onto_sync(time_s)
            drive.sync(self._now_s, length)
        if self._virtual is not None:
            self._tick()

    def _tick(self) -> None:
        """Process the drives' timers."""
        for drive in self._drives.values():
            drive.tick(self._now_s)

    def _command(self, data: bytearray, bus: int) -> None:
        """NMT on a bus: to one node or, with node id 0, to all."""
        if len(data) != 2 or data[0] not in _NMT_COMMANDS:
            return
        command = _NMT_COMMANDS[data[0]]
        for drive in self._by_bus[bus]:
            if data[1] in {0, drive.node_id}:
                drive.command(command, self._now_s)

    def _invalidate_routes(self) -> None:
        """Rebuild the routes before the next frame: COB-IDs may have changed."""
        self._setpoint_routes = None

    def _built_routes(self) -> dict[int, list[tuple[SimulatedDrive, Pdo]]]:
        """The RPDOs that receive each COB-ID."""
        routes: dict[int, list[tuple[SimulatedDrive, Pdo]]] = {}
        for drive in self._drives.values():
            for pdo in drive.rpdos:
                if pdo.cob_id is not None:
                    routes.setdefault(pdo.cob_id, []).append((drive, pdo))
        return routes

    def _send(self, cob_id: int, data: bytes) -> None:
        """Send a frame; if that fails, the frame is lost, as on a real drive."""
        message = self._messages.get(cob_id)
        if message is None:
            message = self._messages[cob_id] = can.Message(arbitration_id=cob_id, is_extended_id=False)
        message.data = bytearray(data)
        message.dlc = len(data)
        try:
            self._bus.send(message)
        except can.CanOperationError:
            self.frames_lost += 1


def _lockstep(bus: can.BusABC) -> LockstepBus | JoinedBus | None:
    """The bus if frames can be acted on while they are sent, else None."""
    parts = bus.parts if isinstance(bus, JoinedBus) else (bus,)
    in_lockstep = all(isinstance(part, LockstepBus) for part in parts)
    return bus if in_lockstep and isinstance(bus, LockstepBus | JoinedBus) else None
