"""PDOs of a simulated drive: communication and mapping parameters, packing and unpacking of frames.

A PDO may be remapped while its COB-ID has bit 31 set, as CiA 301 prescribes: disable, set the count to 0, write the
entries, set the count, set the type, enable. Every write that violates this order is refused.

References:
    CiA 301, 7.5.2.35 to 7.5.2.38 (1400, 1600, 1800, 1A00).
"""

from __future__ import annotations

import struct

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.object_dictionary import DataType, Entry, PdoDirection
from armload_drivers.simulation.drives.sdo_server import Abort, Dictionary, SdoAbort

_TYPES = frozenset(range(241)) | {254, 255}
_MAX_BITS = 64


class Pdo:
    """One PDO of a drive, kept consistent with its parameters.

    Args:
        direction: As seen from the drive.
        number: Number of the PDO, from 0.
        node_id: Node id of the drive.
        dictionary: Its objects; the PDO's parameters are added.
        mapped: Initial mapping; if empty, the PDO is initially disabled. A complete dictionary takes precedence: it
            defines which parameters exist, their access, and the mapping.

    Attributes:
        cob_id: Identifier in use; None while disabled.
        type: Transmission type.
        synchronous: Whether SYNC latches or sends it.
        timer_s: Event timer; 0 if there is none.
        pending: Data of a received frame that waits for SYNC.
        deadline_s: Receive: when the next frame is overdue; None if none is expected. Transmit: when the event timer
            sends.
        syncs: Number of SYNCs since the last transmission.
        last_event: Transmit, event-driven: last sent value of the triggering objects.
    """

    def __init__(
        self,
        direction: PdoDirection,
        number: int,
        node_id: int,
        dictionary: Dictionary,
        mapped: tuple[Entry, ...] = (),
    ) -> None:
        self._direction, self._number = direction, number
        self._dictionary = dictionary
        self._cob_entry = direction.cob_id_entry(number)
        self._type_entry = direction.type_entry(number)
        self._timer_entry = direction.timer_entry(number)
        self._count_entry = direction.count_entry(number)
        disabled = 0 if mapped else od.PDO_DISABLED
        rtr = od.PDO_NO_RTR if direction is PdoDirection.TRANSMIT else 0
        index = self._cob_entry.index
        dictionary.add(Entry(index, 0, "highest sub-index", DataType.U8, od.Access.RO), 5)
        dictionary.add(self._cob_entry, direction.default_cob_id(number, node_id) | disabled | rtr)
        dictionary.add(self._type_entry, 255)
        dictionary.add(Entry(index, 3, "inhibit time", DataType.U16), 0)
        dictionary.add(self._timer_entry, 0)
        dictionary.add(self._count_entry, len(mapped))
        dictionary.allowed[self._type_entry.key] = _TYPES
        dictionary.vetoes[self._cob_entry.key] = self._check_cob_id
        dictionary.vetoes[self._count_entry.key] = self._check_count
        for position in range(1, od.PDO_MAX_ENTRIES + 1):
            entry = direction.map_entry(number, position)
            dictionary.add(entry, mapped[position - 1].mapping if position <= len(mapped) else 0)
            dictionary.vetoes[entry.key] = self._check_entry
        for entry in (self._cob_entry, self._type_entry, self._timer_entry, self._count_entry):
            dictionary.reactions[entry.key] = self.refresh
        self.refresh()

    def refresh(self) -> None:
        """Apply the parameters and discard pending frames and timers."""
        values = self._dictionary.values
        word = values[self._cob_entry.key]
        self.cob_id = None if word & od.PDO_DISABLED else word & 0x7FF
        self.type = values[self._type_entry.key]
        self.synchronous = self.type < od.PDO_EVENT_DRIVEN
        self.timer_s = values[self._timer_entry.key] * 1e-3
        self.pending: bytes | None = None
        self.deadline_s: float | None = None
        self.syncs = 0
        self.last_event: int | None = None
        entries = self._mapped_entries()
        self._keys = tuple(entry.key for entry in entries)
        self._struct = struct.Struct("<" + "".join(entry.type.code for entry in entries))
        self.length = self._struct.size

    def carries(self, entry: Entry) -> bool:
        """Whether an object is mapped."""
        return entry.key in self._keys

    def store(self, data: bytes) -> None:
        """Write a received frame's objects into the dictionary."""
        values = self._dictionary.values
        for key, value in zip(self._keys, self._struct.unpack_from(data), strict=True):
            values[key] = value

    def pack(self) -> bytes:
        """A frame's data: the mapped objects."""
        values = self._dictionary.values
        return self._struct.pack(*[values[key] for key in self._keys])

    def _mapped_entries(self) -> list[Entry]:
        """Mapped entries; empty, with the PDO disabled, if a description maps objects that it does not have."""
        values, known = self._dictionary.values, self._dictionary.entries
        words = [
            values.get(self._direction.map_entry(self._number, position).key, 0)
            for position in range(1, values[self._count_entry.key] + 1)
        ]
        found = [entry for word in words if (entry := known.get(word >> 8)) is not None and entry.type.code]
        if len(found) == len(words) and sum(entry.type.bits for entry in found) <= _MAX_BITS:
            return found
        self.cob_id = None
        return []

    def _check_cob_id(self, word: int) -> None:
        """Identifiers change only while the PDO is disabled, before or after the write."""
        old = self._dictionary.values[self._cob_entry.key]
        enabled = not old & od.PDO_DISABLED and not word & od.PDO_DISABLED
        if (enabled and word & 0x7FF != old & 0x7FF) or word & 0x2000_0000:
            raise SdoAbort(Abort.VALUE_RANGE)

    def _check_disabled(self) -> None:
        """The mapping may change only while the PDO is disabled, if it can be."""
        allowed = self._dictionary.allowed.get(self._cob_entry.key)
        fixed = allowed is not None and self._dictionary.values[self._cob_entry.key] | od.PDO_DISABLED not in allowed
        if fixed or self._dictionary.entries[self._cob_entry.key].access is od.Access.RO:
            return
        if not self._dictionary.values[self._cob_entry.key] & od.PDO_DISABLED:
            raise SdoAbort(Abort.UNSUPPORTED_ACCESS)

    def _check_entry(self, word: int) -> None:
        """Require that a mapped object exists with this size, and is mappable in this direction."""
        self._check_disabled()
        if self._dictionary.values[self._count_entry.key]:
            raise SdoAbort(Abort.UNSUPPORTED_ACCESS)
        if word == 0:
            return
        entry = self._dictionary.entries.get(word >> 8)
        if entry is None:
            raise SdoAbort(Abort.NO_OBJECT)
        if not self._direction.carries(entry.mappable) or entry.mapping != word:
            raise SdoAbort(Abort.NOT_MAPPABLE)

    def _check_count(self, count: int) -> None:
        """Require that all counted entries are present and fit into one frame."""
        self._check_disabled()
        if count > od.PDO_MAX_ENTRIES:
            raise SdoAbort(Abort.VALUE_TOO_HIGH)
        bits = 0
        for position in range(1, count + 1):
            word = self._dictionary.values[self._direction.map_entry(self._number, position).key]
            if word == 0:
                raise SdoAbort(Abort.NO_OBJECT)
            bits += word & 0xFF
        if bits > _MAX_BITS:
            raise SdoAbort(Abort.PDO_TOO_LONG)
