"""SDO access to a drive of which a test decides every answer."""

import struct
from collections import deque

from armload_drivers.bring_up.sdo_channel import SdoChannel
from armload_drivers.driver_errors import ServoTimeout

NO_OBJECT, NO_SUBINDEX = 0x0602_0000, 0x0609_0011
READ_ONLY, WRITE_ONLY, GENERAL = 0x0601_0002, 0x0601_0001, 0x0800_0000
WRONG_LENGTH, TOO_LONG, TOO_SHORT = 0x0607_0010, 0x0607_0012, 0x0607_0013


class ScriptedSdo(SdoChannel):
    """Objects by entry, as numbers, bytes, or as a function that is called at each read; others do not exist.

    Attributes:
        refusals: Abort codes by ("read" or "write", entry).
        sizes: Bytes of an object that has another size than the standard's.
        written: Entries and bytes that were written, in order.
        silent: Whether requests are not answered.
        limits_s: The limit of each request.
        waited_s: Time that was waited.
    """

    def __init__(self, values, refusals=None, sizes=None):
        super().__init__(4, "joint_4", 0.5)
        self.values, self.refusals, self.sizes = dict(values), refusals or {}, sizes or {}
        self.written, self.steps, self.limits_s = [], [], []
        self.silent, self.waited_s, self.asked = False, 0.0, deque()

    def _transfer(self, entry, data):
        self.limits_s.append(self._limit_s)
        self.steps.append(self.step)
        action, verb = ("read", "reading") if data is None else ("write", "writing")
        if self.silent:
            raise self.failure(f"{verb} {entry}: no answer", "Is it powered?", ServoTimeout)
        code = self.refusals.get((action, entry))
        if code is None and entry not in self.values:
            code = NO_OBJECT
        size = self.sizes.get(entry, max(1, entry.type.bits // 8))
        if code is None and data is not None and len(data) != size:
            code = WRONG_LENGTH
        if code is not None:
            raise self._refused(verb, entry, code, "said the drive")
        if data is not None:
            self.written.append((entry, bytes(data)))
            if not callable(self.values[entry]):
                self.values[entry] = bytes(data)
            return b""
        value = self.values[entry]
        value = value() if callable(value) else value
        if isinstance(value, int):
            value = struct.pack("<q", value)[:size]
        return value

    def ask(self, entry):
        self.asked.append(entry)

    def _take(self):
        return self._transfer(self.asked.popleft(), None) if self.asked else None

    def _wait(self, time_s):
        self.waited_s += time_s

    def numbers(self, *entries):
        """The numbers that were written to objects, in order."""
        return [int.from_bytes(data, "little", signed=True) for entry, data in self.written if entry in entries]
