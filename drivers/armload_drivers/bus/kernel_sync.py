"""SYNC from the Linux kernel's CAN broadcast manager (BCM), with a dead man's switch in the kernel.

Rules of this file:
- The kernel sends SYNC; this process sees it come back on the bus, and takes phase and time from the stamps of
  the frames it receives. BCM re-arms its timer with "now + interval": the period is longer than asked for by the
  timer's latency, so cycles are counted by SYNC and never computed from a start time. And the interval asked for is
  shortened by what was measured, so that SYNC keeps the configured rate on the average.
- The kernel is set up to send `CREDIT` SYNCs and then to stop. Every cycle renews the credit without touching the
  timer (SETTIMER without STARTTIMER). A cycle that hangs, a process that is stopped (SIGSTOP) or that dies
  (kill -9: its socket closes) therefore ends SYNC within two periods, with no watchdog thread that could hang
  together with what it watches.
- Other SYNC producers are detected in three ways. One that came in over the bus cannot be ours: the kernel marks what
  this computer sent. More of them than the kernel counts as sent are not all ours, whoever sent them. And where the
  kernel does not report its count: BCM is never early, so many in too short a time are too many.
- A caller that comes back late finds the credit spent: the timer is started anew, which sends one SYNC at once,
  after the caller's RPDOs and a whole period after the SYNC before. Nothing is caught up.

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
from typing import Protocol

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.sync_sources import Clock, SyncTick, sync_data
from armload_drivers.cia402.object_dictionary import SYNC_DEFAULT_COB_ID
from armload_drivers.driver_errors import BusError, ForeignMaster

CREDIT = 2
"""SYNCs that the kernel sends without hearing from the cycle."""

_HEAD = struct.Struct("@III4lII0q")
"""struct bcm_msg_head: opcode, flags, count, ival1 and ival2 in seconds and microseconds, can_id, nframes."""
_FRAME = struct.Struct("=IB3x8s")
"""struct can_frame."""
_TX_SETUP = 1
_SETTIMER, _STARTTIMER = 0x0001, 0x0002

_STEERING = 0.05
"""Share of a period's error by which the next intervals asked for change."""
_SHORTEST_ASKED = 0.9
"""Least interval asked for, in periods: far enough from what would look like another producer's SYNC."""
_GRACE = 0.1
"""Share of a period that a SYNC which may still come is waited for before a new rhythm is begun."""
_OVERDUE_PERIODS = 1.5
"""A renewed credit that brings no SYNC within this many periods came too late for the timer."""
_RHYTHM = 32
_SHORTEST_RHYTHM = 0.85
"""So many SYNCs in less than this share of their time, by the kernel's own stamps, and another node sends SYNC as
well: BCM is never early. When this process looked at them says nothing about that."""
_COUNT_EVERY = 16
"""Cycles between two looks at the kernel's count, or at the rhythm."""
_COUNTED = re.compile(r"tx_op: 080 .*# sent (\d+)")
"""The kernel's account of a BCM task for SYNC, in /proc/net/can-bcm."""
_OLDEST_PERIODS = CREDIT + 1
"""A frame is not older than this when it is looked at: SYNC would have stopped. It bounds the error of a clock step."""


class SyncProducer(Protocol):
    """What sends SYNC periodically, a limited number of times."""

    def start(self, period_s: float, counter: int, credit: int) -> None:
        """Send one SYNC now, then one per period, `credit` in all."""

    def renew(self, period_s: float, credit: int) -> None:
        """Let so many more follow, the next when it is due already, from then on in this period."""

    def count(self) -> int | None:
        """How many have been sent since the first `start` after a `stop`; None where the count is not available."""

    def stop(self) -> None:
        """Send no more. Idempotent."""


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
        """Send one SYNC now, then one per period, `credit` in all.

        Raises:
            BusError: the kernel does not do it.
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
        """Let so many more follow, the next when it is due already, from then on in this period. Raises as `start`."""
        self._setup(_SETTIMER, period_s, credit)

    def count(self) -> int | None:
        """How many SYNCs the kernel has sent for this socket; None where it does not report it."""
        if self._socket is None:
            return None
        try:
            account = Path(f"/proc/net/can-bcm/{os.fstat(self._socket.fileno()).st_ino}").read_text("ascii")
        except OSError:
            return None
        counted = _COUNTED.search(account)
        return None if counted is None else int(counted[1])

    def stop(self) -> None:
        """Send no more: the kernel forgets the task with its socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _setup(self, flags: int, period_s: float, credit: int) -> None:
        """TX_SETUP with interval 1 only: after `credit` frames the timer is not armed again."""
        seconds, microseconds = divmod(round(period_s * 1e6), 1_000_000)
        head = _HEAD.pack(_TX_SETUP, flags, credit, seconds, microseconds, 0, 0, SYNC_DEFAULT_COB_ID, len(self._frames))
        if self._socket is None:
            raise BusError("SYNC was not started")
        try:
            self._socket.send(head + b"".join(self._frames))
        except OSError as error:
            raise self._failed(error) from error

    def _failed(self, error: OSError) -> BusError:
        """What is wrong, and what to do."""
        return BusError(
            f"the kernel does not send SYNC on {self._channel}: {error}. "
            "Is the interface up, and the module can-bcm loaded (modprobe can-bcm)?"
        )


class BcmSync:
    """SYNC from the kernel, its credit renewed by the cycle.

    Args:
        producer: Usually a `BroadcastManager`.
        feedback_share: Share of the cycle that feedback may take; the rest is left to the caller.
        clock: Monotonic clock; SYNCs are stamped on it.
        stamp_clock: Clock of the frames' stamps. It may step; a stamp only gives the age of a frame.
    """

    heard = True

    def __init__(
        self,
        producer: SyncProducer,
        feedback_share: float = 0.6,
        clock: Clock = time.monotonic,
        stamp_clock: Clock = time.time,
    ) -> None:
        self._producer = producer
        self._feedback_share = feedback_share
        self._clock, self._stamp_clock = clock, stamp_clock
        self._cycle_s = self._asked_s = 0.0
        self._counter = 0
        self._credit_left = 0
        self._used_s: float | None = None
        self._last_s: float | None = None
        self._rhythm: deque[float] = deque(maxlen=_RHYTHM)
        self._heard = 0
        self._cycles = 0
        self._came_in = False
        self._reported = False
        self._waiting = False
        self._on_sync: Callable[[], None] = _nothing

    def now_s(self) -> float:
        """Time on the monotonic clock."""
        return self._clock()

    def begin(self, link: BusLink, cycle_s: float, counter: int) -> None:
        """Listen for SYNC; the first `next` starts it."""
        self._cycle_s = self._asked_s = cycle_s
        self._counter = counter
        self._credit_left = 0
        self._used_s = self._last_s = None
        self._rhythm.clear()
        self._heard = self._cycles = 0
        self._came_in = self._reported = self._waiting = False
        link.subscribe(SYNC_DEFAULT_COB_ID, lambda _: self._take_sync(link))

    def next(self, link: BusLink, on_sync: Callable[[], None]) -> SyncTick:
        """Renew the kernel's credit and wait for the next SYNC.

        Raises:
            BusError: SYNC does not leave, or the bus failed.
            ForeignMaster: another node sends SYNC as well.
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
            # The credit ran out between the look at the bus and its renewal.
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

    def await_feedback(self, link: BusLink, complete: Callable[[], bool]) -> None:
        """Wait for a share of the cycle."""
        link.pump_until(complete, self._feedback_share * self._cycle_s)

    def end(self, link: BusLink) -> None:
        """Stop SYNC."""
        self._producer.stop()
        self._credit_left = 0
        link.unsubscribe(SYNC_DEFAULT_COB_ID)

    def _start(self, link: BusLink) -> None:
        """Begin a new rhythm, a period after the last SYNC at the earliest, and only if none comes by itself."""
        if self._last_s is not None:
            due_s = self._last_s + (1.0 + _GRACE) * self._cycle_s
            if link.pump_until(lambda: not self._waiting, due_s - self._clock()):
                # The credit was renewed just after a SYNC had left: the kernel had one more than was thought.
                self._producer.renew(self._asked_s, CREDIT)
                self._credit_left = CREDIT
                return
        self._producer.start(self._asked_s, self._counter, CREDIT)
        self._credit_left = CREDIT
        self._last_s = None

    def _await(self, link: BusLink) -> bool:
        """Pump until SYNC is there, which ends the waiting."""
        return link.pump_until(lambda: not self._waiting, _OVERDUE_PERIODS * self._cycle_s)

    def _other_producer(self) -> str:
        """How another SYNC producer was detected, in words; empty where there is none."""
        if self._came_in:
            return "a SYNC was received from the bus"
        if self._cycles % _COUNT_EVERY == 0:
            # What was heard is looked at first: the kernel may send one more meanwhile, and never one less.
            heard, sent = self._heard, self._producer.count()
            if sent is None:
                return self._too_dense()
            if heard > sent:
                return f"{heard} SYNCs were received, but the kernel has sent {sent} for this master"
        return ""

    def _too_dense(self) -> str:
        """Whether SYNC comes more often than the kernel lets it leave, in words."""
        rhythm = self._rhythm
        if len(rhythm) == _RHYTHM and rhythm[-1] - rhythm[0] < _SHORTEST_RHYTHM * (_RHYTHM - 1) * self._cycle_s:
            return "SYNC is more frequent than this master sends it"
        return ""

    def _take_sync(self, link: BusLink) -> None:
        """A SYNC: the one that is waited for, or one that no cycle used."""
        age_s = min(max(self._stamp_clock() - link.stamp_s, 0.0), _OLDEST_PERIODS * self._cycle_s)
        time_s = self._clock() - age_s
        if self._rhythm and link.stamp_s < self._rhythm[-1]:
            # The clock of the stamps was set back.
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
        """Ask for shorter intervals where the kernel's timer is late, and for longer ones where it is not any more."""
        cycle_s = self._cycle_s
        if 0.5 * cycle_s < period_s < 1.5 * cycle_s:
            asked_s = self._asked_s - _STEERING * (period_s - cycle_s)
            self._asked_s = min(max(asked_s, _SHORTEST_ASKED * cycle_s), cycle_s)


def _nothing() -> None:
    """No caller waits for SYNC."""
