"""The master's access to the bus: one thread sends and receives, and bus errors have their own classes.

There is no receive thread that could die unnoticed. Every wait pumps the bus; frames go to the handlers subscribed by
COB-ID. Exceptions of python-can are translated only here. On SocketCAN the controller reports errors as error frames,
while python-can's own `state` always remains ACTIVE. Bus-off is fatal; error passive and warnings are recorded.
"""

from __future__ import annotations

import errno
import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext

import can

from armload_drivers.bus.joined_bus import JoinedBus
from armload_drivers.cia402.bus_budget import FRAME_BITS
from armload_drivers.cia402.object_dictionary import NMT_COB_ID, NmtCommand
from armload_drivers.driver_errors import BusError

Handler = Callable[[bytearray], None]
"""Called with the data of a frame."""

QUEUE_FULL_TRIES = 50
QUEUE_FULL_WAIT_S = 1e-3
"""Time for a full transmit queue (ENOBUFS) to drain: 50 ms, some hundred frames."""

_BUS_OFF, _RESTARTED, _CONTROLLER = 0x40, 0x100, 0x04
"""Class bits of a SocketCAN error frame: CAN_ERR_BUSOFF, CAN_ERR_RESTARTED, CAN_ERR_CRTL."""
_PASSIVE, _WARNING, _ACTIVE = 0x30, 0x0C, 0x40
"""Bits of an error frame's second byte (CAN_ERR_CRTL_*): both directions of passive and of warning; active again."""


def data_frame(cob_id: int, data: bytes) -> can.Message:
    """A frame with an identifier of 11 bits."""
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)


class BusLink:
    """Sending and receiving on one bus.

    Args:
        bus: An open python-can bus. The caller closes it.

    Attributes:
        error_frames: Number of error frames.
        error_passive: Whether the controller's error counters are so high that it may no longer signal errors.
        times_passive: Number of times that it became error passive.
        queue_full: Number of times that the transmit queue was full.
        bits: Worst-case bits of all frames sent and received, for the measured load.
        stamp_s: Time stamp of the frame being handled, on the interface's clock.
        from_outside: Whether that frame was received from the bus and not sent by a program on this computer. Only
            SocketCAN reports this; with other interfaces every frame counts as received.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self.error_frames = 0
        self.error_passive = False
        self.times_passive = 0
        self.queue_full = 0
        self.bits = 0
        self.stamp_s = 0.0
        self.from_outside = True
        self._bus = bus
        self._joined = bus if isinstance(bus, JoinedBus) else None
        self._handlers: dict[int, Handler] = {}
        self._backlog: deque[can.Message] = deque()

    def subscribe(self, cob_id: int, handler: Handler) -> None:
        """Call a handler for frames of a COB-ID."""
        self._handlers[cob_id] = handler

    def unsubscribe(self, cob_id: int) -> None:
        """Ignore frames of a COB-ID again."""
        self._handlers.pop(cob_id, None)

    @contextmanager
    def subscribed_meanwhile(self) -> Iterator[None]:
        """After the block the handlers are those from before it, whatever was subscribed within."""
        before = dict(self._handlers)
        try:
            yield
        finally:
            self._handlers = before

    def everywhere(self) -> AbstractContextManager[None]:
        """Within the block, frames of the arm's nodes are sent to, and received from, every bus of the arm."""
        return nullcontext() if self._joined is None else self._joined.reaching_everywhere()

    @property
    def busiest_bits(self) -> int:
        """As `bits`, of the busiest bus of the arm."""
        return self.bits if self._joined is None else max(self._joined.bits)

    def take_skew(self) -> str:
        """As `JoinedBus.take_skew`; empty with one bus."""
        return "" if self._joined is None else self._joined.take_skew()

    def send(self, message: can.Message) -> None:
        """Send a frame.

        Raises:
            BusError: the frame could not be sent.
        """
        self.bits += FRAME_BITS[message.dlc]
        try:
            self._bus.send(message)
        except (can.CanError, OSError) as error:
            self._send_again(message, error)

    def send_frame(self, cob_id: int, data: bytes) -> None:
        """Send a frame from COB-ID and data. Raises as `send`."""
        self.send(data_frame(cob_id, data))

    def command(self, command: NmtCommand, node_id: int) -> None:
        """Send an NMT command. Raises as `send`."""
        self.send_frame(NMT_COB_ID, bytes([command.value, node_id]))

    def pump(self, timeout_s: float) -> bool:
        """Wait for one frame and handle it.

        Args:
            timeout_s: Longest wait; 0 only handles a frame already received.

        Returns:
            Whether a frame was received.

        Raises:
            BusError: the bus failed or is off.
        """
        message = self._backlog.popleft() if self._backlog else self._receive(timeout_s)
        if message is None:
            return False
        if message.is_error_frame:
            self._error_frame(message)
            return True
        self.bits += FRAME_BITS[message.dlc]
        handler = self._handlers.get(message.arbitration_id)
        if handler is not None and not message.is_remote_frame and not message.is_extended_id:
            self.stamp_s, self.from_outside = message.timestamp, message.is_rx
            handler(message.data)
        return True

    def drain(self) -> None:
        """Handle all frames already received. Raises as `pump`."""
        pump = self.pump
        while pump(0.0):
            pass

    def pump_until(self, done: Callable[[], bool], timeout_s: float) -> bool:
        """Handle frames until a condition holds or the time is over.

        Returns:
            Whether the condition holds.

        Raises:
            BusError: the bus failed or is off.
        """
        deadline_s = time.monotonic() + timeout_s
        while not done():
            left_s = deadline_s - time.monotonic()
            # Without a frame, `pump` has used up the remaining time, on a simulated bus without really waiting.
            # A frame counts that arrived while this process did not run; a bus that is never silent ends the wait too.
            if not self.pump(max(left_s, 0.0)) or left_s <= 0.0:
                return done()
        return True

    def pump_for(self, wait_s: float) -> None:
        """Handle frames for some time. Raises as `pump`."""
        self.pump_until(lambda: False, wait_s)

    def _receive(self, timeout_s: float) -> can.Message | None:
        """One frame; None after the timeout."""
        try:
            return self._bus.recv(timeout_s)
        except (can.CanError, OSError) as error:
            raise BusError(f"receiving failed: {error}. Is the interface up and its adapter connected?") from error

    def _error_frame(self, message: can.Message) -> None:
        """Record an error of the controller; bus-off raises."""
        self.error_frames += 1
        if message.arbitration_id & _BUS_OFF:
            raise BusError(
                "the controller is bus-off and no longer sends. Check wiring, termination and bit rate, "
                "then restart the interface"
            )
        if message.arbitration_id & _RESTARTED:
            self.error_passive = False
        if message.arbitration_id & _CONTROLLER and len(message.data) > 1:
            bits = message.data[1]
            if bits & _PASSIVE:
                self.times_passive += not self.error_passive
                self.error_passive = True
            elif bits & (_WARNING | _ACTIVE):
                self.error_passive = False

    def _send_again(self, message: can.Message, error: Exception) -> None:
        """Repeat while the transmit queue is full, storing received frames; any other error raises."""
        self.queue_full += 1
        for _ in range(QUEUE_FULL_TRIES):
            code = getattr(error, "error_code", None) or getattr(error, "errno", None)
            if code != errno.ENOBUFS:
                raise BusError(f"sending failed: {error}. Is the interface up and its adapter connected?") from error
            received = self._receive(QUEUE_FULL_WAIT_S)
            if received is not None:
                self._backlog.append(received)
            try:
                self._bus.send(message)
            except (can.CanError, OSError) as again:
                error = again
            else:
                return
        raise BusError(
            "the transmit queue stays full: no node acknowledges, or the queue is too short "
            "(ip link set CHANNEL txqueuelen 100)"
        ) from error
