"""The master's end of the bus: one thread sends and receives, and errors of the bus have names.

There is no receive thread that could die unseen. Whoever waits for something pumps the bus meanwhile; frames
go to the handlers subscribed by COB-ID. Exceptions of python-can are translated here and nowhere else.
"""

from __future__ import annotations

import errno
import time
from collections import deque
from collections.abc import Callable

import can

from armload_drivers.errors import BusError
from armload_drivers.objects import NMT_COB_ID, NmtCommand

Handler = Callable[[bytearray], None]
"""Takes in the data of a frame."""

QUEUE_FULL_TRIES = 50
QUEUE_FULL_WAIT_S = 1e-3
"""A full transmit queue (ENOBUFS) is given this long to drain: 50 ms, some hundred frames."""

_BUS_OFF = 0x40
"""Class bit of a SocketCAN error frame (CAN_ERR_BUSOFF)."""


class BusLink:
    """Sending and receiving on one bus.

    Args:
        bus: An open bus of python-can. It stays the caller's to close.

    Attributes:
        error_frames: Error frames seen.
    """

    def __init__(self, bus: can.BusABC) -> None:
        self.error_frames = 0
        self._bus = bus
        self._handlers: dict[int, Handler] = {}
        self._backlog: deque[can.Message] = deque()

    def subscribe(self, cob_id: int, handler: Handler) -> None:
        """Have frames of a COB-ID handled."""
        self._handlers[cob_id] = handler

    def send(self, message: can.Message) -> None:
        """Send a frame.

        Raises:
            BusError: the bus does not take it.
        """
        try:
            self._bus.send(message)
        except (can.CanError, OSError) as error:
            self._send_again(message, error)

    def send_frame(self, cob_id: int, data: bytes) -> None:
        """Send a frame that is not prepared. Raises as `send`."""
        self.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))

    def command(self, command: NmtCommand, node_id: int) -> None:
        """Send an NMT command. Raises as `send`."""
        self.send_frame(NMT_COB_ID, bytes([command.value, node_id]))

    def pump(self, timeout_s: float) -> bool:
        """Wait for one frame and have it handled.

        Args:
            timeout_s: How long to wait; 0 takes what is there.

        Returns:
            Whether a frame came.

        Raises:
            BusError: the bus failed or is off.
        """
        if self._backlog:
            message: can.Message | None = self._backlog.popleft()
        else:
            message = self._receive(timeout_s)
        if message is None:
            return False
        handler = self._handlers.get(message.arbitration_id)
        if message.is_error_frame:
            self._error_frame(message)
        elif handler is not None and not message.is_remote_frame and not message.is_extended_id:
            handler(message.data)
        return True

    def pump_until(self, done: Callable[[], bool], timeout_s: float) -> bool:
        """Handle frames until a condition holds or time is over.

        Returns:
            Whether the condition holds.

        Raises:
            BusError: the bus failed or is off.
        """
        deadline_s = time.monotonic() + timeout_s
        while not done():
            left_s = deadline_s - time.monotonic()
            if left_s <= 0.0:
                return False
            self.pump(left_s)
        return True

    def _receive(self, timeout_s: float) -> can.Message | None:
        """One frame, None after the timeout."""
        try:
            return self._bus.recv(timeout_s)
        except (can.CanError, OSError) as error:
            raise BusError(f"receiving failed: {error}. Is the interface up and its adapter connected?") from error

    def _error_frame(self, message: can.Message) -> None:
        """Count error frames; bus-off ends everything."""
        self.error_frames += 1
        if message.arbitration_id & _BUS_OFF:
            raise BusError(
                "the controller is bus-off: it does not send any more. Check wiring, termination and bit rate, "
                "then restart the interface"
            )

    def _send_again(self, message: can.Message, error: Exception) -> None:
        """Wait for room in a full queue, taking in what comes meanwhile; any other error is final."""
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
