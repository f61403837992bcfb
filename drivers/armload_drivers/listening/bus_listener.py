"""Listening to a bus: frames are only received. The given bus is used only through `recv`."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Final, Protocol

import can

from armload_drivers.driver_errors import BusError
from armload_drivers.listening.overheard_arm import OverheardArm, OverheardCycle

LOOK_S: Final = 0.1
"""Timeout of one `recv` on a silent bus."""
PATIENCE_S: Final = 5.0
"""Time without any complete cycle after the start that counts as an error."""


class FrameSource(Protocol):
    """The receiving half of a python-can bus."""

    def recv(self, timeout: float | None = None) -> can.Message | None:
        """The next frame; None after the timeout in s."""


def overheard(
    bus: FrameSource,
    arm: OverheardArm,
    patience_s: float = PATIENCE_S,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[OverheardCycle | None]:
    """The cycles of another master, without end.

    Args:
        bus: The bus to receive from.
        patience_s: Longest time until the first complete cycle.
        clock: Monotonic time in s.

    Yields:
        Cycles, with times measured from the first frame; None after `LOOK_S` without a complete cycle.

    Raises:
        BusError: the bus failed, or there was no complete cycle at first; states what is missing.
    """
    begun_s: float | None = None
    looked_s = started_s = clock()
    heard = False
    while True:
        message = _received(bus)
        cycle = None
        if message is not None and not (message.is_error_frame or message.is_remote_frame or message.is_extended_id):
            begun_s = message.timestamp if begun_s is None else begun_s
            cycle = arm.take(message.arbitration_id, bytes(message.data), message.timestamp - begun_s)
        if cycle is not None:
            heard = True
            looked_s = clock()
            yield cycle
            continue
        now_s = clock()
        if not heard and now_s - started_s > patience_s:
            raise BusError(_what_is_missing(arm, patience_s, frames=begun_s is not None))
        if now_s - looked_s >= LOOK_S:
            looked_s = now_s
            yield None


def _received(bus: FrameSource) -> can.Message | None:
    """One frame; None after a timeout."""
    try:
        return bus.recv(LOOK_S)
    except (can.CanError, OSError) as error:
        raise BusError(f"receiving failed: {error}. Is the interface up and its adapter connected?") from error


def _what_is_missing(arm: OverheardArm, patience_s: float, *, frames: bool) -> str:
    """Why there is no cycle, and what to check."""
    begin = f"no cycle of the arm was received within {patience_s:g} s: "
    if not frames:
        return begin + "the bus is silent. Is its master running, and are interface, channel and bit rate right?"
    silent = [
        f"{name} ({wrong} feedback frames of another length)" if wrong else name for name, wrong in arm.silent.items()
    ]
    if silent:
        return begin + (
            f"no feedback as configured from {', '.join(silent)}. Check that the drives are operational, that node_id, "
            "feedback and effort_object are those of this arm, and that its master maps statusword, position and effort"
        )
    if not arm.syncs:
        return (
            begin + "there is feedback, but no SYNC (COB-ID 0x080). Drives that send asynchronously are not supported."
        )
    return begin + "no cycle was complete: feedback of some joint arrives only occasionally"
