"""Reads what bring-up has read back again while the arm moves, and compares.

Nothing on the bus repeats these values, and a tool on a cable of its own changes them unheard. Requests are sent
between cycles and never waited for; at most one per drive is open. The bus's budget contains them (`bus_budget`).
PDO mappings and parameters of TPDOs are not read again: a mapping changes only while its PDO is off, and TPDOs are
awaited in every cycle.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from armload_drivers.bring_up.drive_objects import DriveObjects
from armload_drivers.cia402.bus_budget import READ_AGAIN_S
from armload_drivers.cia402.object_dictionary import Entry

_NOT_READ = range(0x1600, 0x1C00)
ANSWER_S = 0.5
"""An answer that takes longer is not expected any more; the object is asked for again in its turn."""


class SettingsWatch:
    """Reads the settings of an arm's drives again, in turn.

    Args:
        cycle_s: Duration of a cycle.
    """

    def __init__(self, drives: Sequence[DriveObjects], cycle_s: float) -> None:
        rows = [
            (number, drive, entry, value)
            for drive in drives
            for number, (entry, value) in enumerate(drive.held.items())
            if entry.index not in _NOT_READ
        ]
        # One object of every drive, then the next of every drive: no drive has to answer in a hurry.
        self._turns = deque((drive, entry, value) for _, drive, entry, value in sorted(rows, key=lambda row: row[0]))
        self._per_cycle = len(self._turns) * cycle_s / READ_AGAIN_S
        self._patience = math.ceil(ANSWER_S / cycle_s)
        self._due = 0.0
        self._open: dict[DriveObjects, tuple[Entry, int, int]] = {}

    def step(self) -> None:
        """Take what has arrived since the last cycle, and send the requests that are due.

        Raises:
            SettingChanged: naming object, drive, the value now and before.
            BusError: the bus failed.
        """
        if self._open:
            self._take()
        self._due += self._per_cycle
        while self._due >= 1.0:
            drive, entry, value = self._turns[0]
            self._due -= 1.0
            self._turns.rotate(-1)
            if drive not in self._open:  # a drive that has not answered yet loses this turn, and delays no other
                self._open[drive] = entry, value, self._patience
                drive.sdo.ask(entry)

    def _take(self) -> None:
        """Compare the answers that have arrived."""
        for drive, (entry, value, left) in list(self._open.items()):
            found = drive.sdo.answer(entry)
            if found is None and left:
                self._open[drive] = entry, value, left - 1
                continue
            del self._open[drive]
            if found is not None and found != value:
                drive.sdo.step = "reading the settings again"
                drive.require_unchanged(entry, found)
