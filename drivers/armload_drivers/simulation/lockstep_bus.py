"""A CAN bus inside one process that delivers without threads: sending a frame makes every endpoint act on it.

Rules of this file:

- All endpoints of a wire receive all frames of the others, in the order of sending.
- `send` returns when every listener has acted on the frame, and on all frames sent in response. So the sender of a SYNC
  finds the answers in its queue, and the same frames give the same answers in every run.
- An endpoint without a listener stores its frames for `recv`. While it waits no other endpoint acts, so nothing can
  arrive: a wait ends immediately, as if its time had passed.
- An exception of a listener, or a signal during it, reaches the sender; the frames not yet delivered are delivered by
  the next `send`.

Not modelled: bit rate, arbitration, errors, time stamps (they are 0).
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Sequence

import can

from armload_drivers.bus.joined_bus import BusRole, JoinedBus
from armload_drivers.cia402.arm_settings import ArmSettings
from armload_drivers.driver_errors import SimulationError

Listener = Callable[[can.Message], None]
"""Acts on a frame; may send."""


class LockstepWire:
    """The wire that connects endpoints."""

    def __init__(self) -> None:
        self._endpoints: tuple[LockstepBus, ...] = ()
        self._under_way: deque[tuple[LockstepBus, can.Message]] = deque()
        self._delivering = False
        # Frames sent by another thread wait until every endpoint has acted on earlier ones.
        self._lock = threading.RLock()

    def join(self, endpoint: LockstepBus) -> None:
        """Connect an endpoint."""
        with self._lock:
            self._endpoints += (endpoint,)

    def leave(self, endpoint: LockstepBus) -> None:
        """Disconnect it. Idempotent."""
        with self._lock:
            self._endpoints = tuple(other for other in self._endpoints if other is not endpoint)

    def carry(self, sender: LockstepBus, message: can.Message) -> None:
        """Deliver a frame to all endpoints except its sender, and then the frames that they send."""
        with self._lock:
            first = not self._delivering and not self._under_way
            self._under_way.append((sender, message if first else _copy(message)))
            if self._delivering:
                return
            self._delivering = True
            try:
                while self._under_way:  # besides it, those left over after an exception
                    sender, frame = self._under_way.popleft()
                    for endpoint in self._endpoints:
                        if endpoint is sender:
                            continue
                        if endpoint.listener is not None:
                            endpoint.listener(frame)
                        else:
                            endpoint.received.append(_copy(frame) if frame is message else frame)
            finally:
                self._delivering = False


class LockstepBus(can.BusABC):
    """One endpoint of a wire.

    Args:
        wire: The wire to connect to.

    Attributes:
        wire: The wire.
        listener: Called with frames as they are sent.
        received: Frames stored for `recv` if there is no listener.
    """

    def __init__(self, wire: LockstepWire) -> None:
        super().__init__(channel="lockstep")
        self.channel_info = "lockstep bus in this process"
        self.wire = wire
        self.listener: Listener | None = None
        self.received: deque[can.Message] = deque()
        wire.join(self)

    def listen(self, listener: Listener | None) -> None:
        """Set the listener for frames as they are sent; None stores them for `recv`."""
        self.listener = listener

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send a frame; returns when every endpoint has acted on it.

        Raises:
            CanOperationError: the endpoint is closed.
        """
        if self._is_shutdown:
            raise can.CanOperationError("Cannot operate on a closed bus")
        self.wire.carry(self, msg)

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame; None if there is none, whatever the timeout.

        Raises:
            CanOperationError: the endpoint is closed.
            SimulationError: the wait would never end.
        """
        if self.received:
            return self.received.popleft()
        if self._is_shutdown:
            raise can.CanOperationError("Cannot operate on a closed bus")
        if timeout is None:
            raise SimulationError("on a lockstep bus nothing arrives during a wait: a wait requires a time limit")
        return None

    def shutdown(self) -> None:
        """Disconnect. Idempotent."""
        super().shutdown()
        self.wire.leave(self)


def lockstep_wires(arm: ArmSettings) -> tuple[LockstepWire, ...]:
    """A wire for each bus of an arm."""
    return tuple(LockstepWire() for _ in arm.by_bus())


def lockstep_bus(arm: ArmSettings, wires: Sequence[LockstepWire], role: BusRole) -> LockstepBus | JoinedBus:
    """An endpoint of each of an arm's wires, as one bus.

    Args:
        wires: Its wires, from `lockstep_wires`.
        role: Who uses the bus.
    """
    ends = [LockstepBus(wire) for wire in wires]
    if len(ends) == 1:
        return ends[0]
    members = [frozenset(drive.node_id for drive in part.drives) for part in arm.by_bus()]
    return JoinedBus(ends, members, role, arm.cycle_s, in_lockstep=True)


def _copy(message: can.Message) -> can.Message:
    """A copy of a frame, because senders reuse theirs."""
    return can.Message(
        arbitration_id=message.arbitration_id,
        is_extended_id=message.is_extended_id,
        is_remote_frame=message.is_remote_frame,
        is_error_frame=message.is_error_frame,
        dlc=message.dlc,
        data=bytes(message.data),
    )
