"""SYNC from the Linux kernel's CAN broadcast manager (BCM), with a dead man's switch in the kernel.

Rules of this file:
- The kernel sends SYNC; this process receives it back from the bus, and takes phase and time from the stamps of the
  received frames. BCM re-arms its timer with "now + interval", so the period exceeds the requested one by the timer's
  latency. Therefore cycles are counted by SYNC and never computed from a start time, and the requested interval is
  shortened by the measured excess, so that SYNC keeps the configured rate on average.
- The kernel is set up to send `CREDIT` SYNCs and then stop. Every cycle renews the credit without touching the timer
  (SETTIMER without STARTTIMER). If the cycle hangs, or the process is stopped (SIGSTOP) or dies (kill -9 closes its
  socket), SYNC ends within two periods, without a watchdog thread that could hang together with the cycle.
- Other SYNC producers are detected in three ways. A SYNC received from the bus is not ours: the kernel marks frames
  sent by this computer. If more SYNCs are received than the kernel reports as sent, another program sends some. If the
  kernel does not report its count: BCM is never early, so too many SYNCs in a short time reveal another producer.
- If the caller is late, the credit is used up: the timer is started anew, which sends one SYNC immediately, after the
  caller's RPDOs and at least one period after the last SYNC. Missed SYNCs are not made up.

References:
    Linux kernel, Documentation/networking/can.rst, "Broadcast Manager protocol sockets"; net/can/bcm.c,
    bcm_tx_setup.
"""

from __future__ import annotations

import os
import re
import socket
import struct
import time
from collections import deque
from collections.abc import Callable
from pathlib import Path

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.sync_sources import Clock, SyncSource, SyncTick, sync_data
from armload_drivers.cia402.object_dictionary import SYNC_DEFAULT_COB_ID
from armload_drivers.driver_errors import BusError, ForeignMaster

CREDIT = 2
"""Number of SYNCs that the kernel sends without renewal by the cycle."""

_HEAD = struct.Struct("@III4lII0q")
"""struct bcm_msg_head: opcode, flags, count, ival1 and ival2 in seconds and microseconds, can_id, nframes."""
_FRAME = struct.Struct("=IB3x8s")
"""struct can_frame."""
_TX_SETUP = 1
_SETTIMER, _STARTTIMER = 0x0001, 0x0002

_STEERING = 0.05
"""Gain from a period's error to the change of the requested interval."""
_SHORTEST_ASKED = 0.9
"""Shortest requested interval, in periods: long enough not to look like another producer's SYNC."""
_GRACE = 0.1
"""Additional wait, as a share of a period, for a pending SYNC before the timer is started anew."""
_OVERDUE_PERIODS = 1.5
"""If a renewed credit yields no SYNC within this many periods, it was renewed too late."""
_RHYTHM = 32
_SHORTEST_RHYTHM = 0.85
"""If `_RHYTHM` SYNCs take less than this share of their nominal time by the kernel's stamps, another node also sends
SYNC: BCM is never early. The times at which this process reads them are irrelevant."""
_COUNT_EVERY = 16
"""Cycles between two checks of the kernel's count, or of the rhythm, if no further SYNC is heard that no cycle used."""
_COUNTED = re.compile(r"tx_op: 080 .*# sent (\d+)")
"""The kernel's report on a BCM task for SYNC, in /proc/net/can-bcm."""
_OLDEST_PERIODS = CREDIT + 1
"""Greatest age of a frame when it is read, since SYNC would have stopped; bounds the error of a clock step."""


class BroadcastManager:
    """SYNC by the kernel's broadcast manager.

    Args:
        channel: Network interface, such as can0.
    """

    def __init__(self, channel: str) -> None:
        self._channel = channel
        self._socket: socket.socket | None = None
        self._frames: list[bytes] = []

    def start(self, period_s: float, counter: int, credit: int) -> None:
        """Send one SYNC now, then one per period, `credit` in total.

        Raises:
            BusError: the kernel refuses.
        """
        self._frames = [_FRAME.pack(SYNC_DEFAULT_COB_ID, len(data), data) for data in sync_data(counter)]
        if self._socket is None:
            try:
                self._socket = socket.socket(socket.AF_CAN, socket.SOCK_DGRAM, socket.CAN_BCM)
                self._socket.connect((self._channel,))
            except OSError as error:
                self.stop()
                raise self._failed(error) from error
        self._setup(_SETTIMER | _STARTTIMER, period_s, credit)

    def renew(self, period_s: float, credit: int) -> None:
        """Set the credit without restarting the timer; the period applies after the next SYNC. Raises as `start`."""
        self._setup(_SETTIMER, period_s, credit)

    def count(self) -> int | None:
        """SYNCs that the kernel has sent since the first `start` after a `stop`; None if it does not report them."""
        if self._socket is None:
            return None
        try:
            account = Path(f"/proc/net/can-bcm/{os.fstat(self._socket.fileno()).st_ino}").read_text("ascii")
        except OSError:
            return None
        counted = _COUNTED.search(account)
        return None if counted is None else int(counted[1])

    def stop(self) -> None:
        """Stop SYNC: the kernel removes the task with its socket. Idempotent."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _setup(self, flags: int, period_s: float, credit: int) -> None:
        """Send TX_SETUP with interval 1 only: after `credit` frames the timer is not re-armed."""
        seconds, microseconds = divmod(round(period_s * 1e6), 1_000_000)
        head = _HEAD.pack(_TX_SETUP, flags, credit, seconds, microseconds, 0, 0, SYNC_DEFAULT_COB_ID, len(self._frames))
        if self._socket is None:
            raise BusError("SYNC was not started")
        try:
            self._socket.send(head + b"".join(self._frames))
        except OSError as error:
            raise self._failed(error) from error

    def _failed(self, error: OSError) -> BusError:
        """Error with its cause and remedy."""
        return BusError(
            f"the kernel does not send SYNC on {self._channel}: {error}. "
            "Is the interface up, and the module can-bcm loaded (modprobe can-bcm)?"
        )


class BcmSync(SyncSource):
    """SYNC from the kernel, with a credit renewed by the cycle.

    Args:
        producer: Sends SYNC a limited number of times.
        clock: Monotonic clock; SYNCs are stamped on it.
        stamp_clock: Clock of the frames' stamps. It may step: stamps are used only for the age of frames.
    """

    heard = True

    def __init__(
        self,
        producer: BroadcastManager,
        clock: Clock = time.monotonic,
        stamp_clock: Clock = time.time,
    ) -> None:
        super().__init__(clock)
        self._producer, self._stamp_clock = producer, stamp_clock
        self._forget(0.0, 0)

    def begin(self, link: BusLink, cycle_s: float, counter: int) -> None:
        """Subscribe to SYNC; the first `next` starts it."""
        self._forget(cycle_s, counter)
        link.subscribe(SYNC_DEFAULT_COB_ID, lambda _: self._take_sync(link))

    def _forget(self, cycle_s: float, counter: int) -> None:
        """As before the first SYNC."""
        self._cycle_s = self._asked_s = cycle_s
        self._counter, self._credit_left = counter, 0
        self._used_s: float | None = None
        self._last_s: float | None = None
        self._rhythm: deque[float] = deque(maxlen=_RHYTHM)
        self._heard = self._cycles = self._unused = 0
        self._came_in = self._reported = self._waiting = False
        self._on_sync: Callable[[], None] = _nothing

    def next(self, link: BusLink, on_sync: Callable[[], None]) -> SyncTick:
        """Renew the kernel's credit and wait for the next SYNC.

        Raises:
            BusError: no SYNC is sent, or the bus failed.
            ForeignMaster: another node also sends SYNC.
        """
        link.drain()
        self._on_sync = on_sync
        self._waiting = True
        before_s = self._used_s
        if self._credit_left > 0:
            self._producer.renew(self._asked_s, CREDIT)
            self._credit_left = CREDIT
        else:
            self._start(link)
        if not self._await(link):
            # The credit ran out between reading the bus and renewing it.
            self._start(link)
            if not self._await(link):
                self._waiting = False
                raise BusError("no SYNC came back from the bus. Is the interface up? Is its transmit queue full?")
        self._cycles += 1
        if not self._reported and (how := self._other_producer()):
            # Reported once, so that the arm can still be stopped and disabled while the other producer is active.
            self._reported = True
            raise ForeignMaster(
                f"{how}: another node also produces SYNC (COB-ID 0x080). Stop the other program, or disconnect its "
                "device"
            )
        time_s = self._clock() if self._used_s is None else self._used_s
        skipped = 0 if before_s is None else max(0, round((time_s - before_s) / self._cycle_s) - 1)
        return SyncTick(time_s, skipped)

    def end(self, link: BusLink) -> None:
        """Stop SYNC."""
        self._producer.stop()
        self._credit_left = 0
        link.unsubscribe(SYNC_DEFAULT_COB_ID)

    def _start(self, link: BusLink) -> None:
        """Restart the timer, at the earliest one period after the last SYNC, and only if none arrives."""
        if self._last_s is not None:
            due_s = self._last_s + (1.0 + _GRACE) * self._cycle_s
            if link.pump_until(lambda: not self._waiting, due_s - self._clock()):
                # The credit had been renewed just after a SYNC was sent: the kernel had one more than assumed.
                self._producer.renew(self._asked_s, CREDIT)
                self._credit_left = CREDIT
                return
        self._producer.start(self._asked_s, self._counter, CREDIT)
        self._credit_left = CREDIT
        self._last_s = None

    def _await(self, link: BusLink) -> bool:
        """Pump until SYNC is received."""
        return link.pump_until(lambda: not self._waiting, _OVERDUE_PERIODS * self._cycle_s)

    def _other_producer(self) -> str:
        """How another SYNC producer was detected, as text; empty if there is none."""
        if self._came_in:
            return "a SYNC was received from the bus"
        unused = self._heard - self._cycles
        more, self._unused = unused > self._unused, unused
        # At once, as the drives answer every SYNC and would soon be taken for twins.
        if more or self._cycles % _COUNT_EVERY == 0:
            # The received count is read first: the kernel's count can only grow in between.
            heard, sent = self._heard, self._producer.count()
            if sent is None:
                return self._too_dense()
            if heard > sent:
                return f"{heard} SYNCs were received, but the kernel has sent {sent} for this master"
        return ""

    def _too_dense(self) -> str:
        """Report SYNC that is more frequent than the kernel sends it; empty if not."""
        rhythm = self._rhythm
        if len(rhythm) == _RHYTHM and rhythm[-1] - rhythm[0] < _SHORTEST_RHYTHM * (_RHYTHM - 1) * self._cycle_s:
            return "SYNC is more frequent than this master sends it"
        return ""

    def _take_sync(self, link: BusLink) -> None:
        """Process a SYNC: the awaited one, or one that no cycle used."""
        age_s = min(max(self._stamp_clock() - link.stamp_s, 0.0), _OLDEST_PERIODS * self._cycle_s)
        time_s = self._clock() - age_s
        if self._rhythm and link.stamp_s < self._rhythm[-1]:
            # The stamps' clock was set back.
            self._rhythm.clear()
        if self._rhythm:
            self._steer(link.stamp_s - self._rhythm[-1])
        self._rhythm.append(link.stamp_s)
        self._heard += 1
        self._came_in |= link.from_outside
        self._last_s = time_s
        self._credit_left -= 1
        if self._waiting:
            self._waiting = False
            self._used_s = time_s
            self._on_sync()

    def _steer(self, period_s: float) -> None:
        """Shorten the requested interval while the kernel's timer is late, and lengthen it again otherwise."""
        cycle_s = self._cycle_s
        if 0.5 * cycle_s < period_s < 1.5 * cycle_s:
            asked_s = self._asked_s - _STEERING * (period_s - cycle_s)
            self._asked_s = min(max(asked_s, _SHORTEST_ASKED * cycle_s), cycle_s)


def _nothing() -> None:
    """No caller waits for SYNC."""
