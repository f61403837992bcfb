"""An object dictionary and its SDO server, without a bus.

Expedited and segmented transfers in both directions. Block transfers are refused with the standard's abort code;
clients then fall back to segmented ones.

References:
    CiA 301, 7.2.4 (SDO protocol), table 22 (abort codes).
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Collection, Iterable
from dataclasses import dataclass, field
from enum import IntEnum

from armload_drivers.cia402.object_dictionary import Access, DataType, Entry

_INITIATE = struct.Struct("<BHB")
_ABORT = struct.Struct("<BHBI")
_SIZE = struct.Struct("<I")
_SEGMENT = 7
_EXPEDITED, _SIZED, _TOGGLE, _LAST = 0x02, 0x01, 0x10, 0x01


class Abort(IntEnum):
    """SDO abort codes that this server uses."""

    TOGGLE = 0x0503_0000
    UNKNOWN_COMMAND = 0x0504_0001
    UNSUPPORTED_ACCESS = 0x0601_0000
    WRITE_ONLY = 0x0601_0001
    READ_ONLY = 0x0601_0002
    NO_OBJECT = 0x0602_0000
    NOT_MAPPABLE = 0x0604_0041
    PDO_TOO_LONG = 0x0604_0042
    LENGTH = 0x0607_0010
    NO_SUBINDEX = 0x0609_0011
    VALUE_RANGE = 0x0609_0030
    VALUE_TOO_HIGH = 0x0609_0031
    DEVICE_STATE = 0x0800_0022


class SdoAbort(Exception):
    """A transfer is refused; leaves the drive only as an abort frame.

    Attributes:
        code: The reason.
    """

    def __init__(self, code: Abort) -> None:
        super().__init__(code.name)
        self.code = code


@dataclass(slots=True)
class Dictionary:
    """Values of one device's objects and the rules for writing them.

    Attributes:
        entries: Entries by key.
        values: Integer values by key; the device reads and writes these directly.
        texts: Values of strings by key.
        allowed: Permitted values by key; without an entry, all values of the type.
        vetoes: Called with the new value before a write by SDO; raises `SdoAbort` to refuse it.
        reactions: Called after a write by SDO.
        forgets: Indices of objects that confirm every write and keep their value.
        complete: Whether all entries exist: one added later is not accessible by SDO, but the device stores its value.
    """

    entries: dict[int, Entry] = field(default_factory=dict)
    values: dict[int, int] = field(default_factory=dict)
    texts: dict[int, bytes] = field(default_factory=dict)
    allowed: dict[int, Collection[int]] = field(default_factory=dict)
    vetoes: dict[int, Callable[[int], None]] = field(default_factory=dict)
    reactions: dict[int, Callable[[], None]] = field(default_factory=dict)
    forgets: Collection[int] = ()
    complete: bool = False

    def add(self, entry: Entry, value: int | str) -> None:
        """Add an entry with its initial value; an existing value in a complete dictionary is kept."""
        if self.complete:
            if isinstance(value, int):
                self.values.setdefault(entry.key, value)
            return
        self.entries[entry.key] = entry
        if isinstance(value, str):
            self.texts[entry.key] = value.encode()
        else:
            self.values[entry.key] = value

    def remove(self, indices: Iterable[int]) -> None:
        """Remove objects from SDO access; the device keeps their values."""
        gone = set(indices)
        self.entries = {key: entry for key, entry in self.entries.items() if entry.index not in gone}

    def _find(self, index: int, subindex: int) -> Entry:
        """An entry; raises the abort for a missing object or sub-index."""
        entry = self.entries.get(index << 8 | subindex)
        if entry is None:
            known = any(key >> 8 == index for key in self.entries)
            raise SdoAbort(Abort.NO_SUBINDEX if known else Abort.NO_OBJECT)
        return entry

    def upload(self, index: int, subindex: int) -> bytes:
        """Bytes of an object for SDO."""
        entry = self._find(index, subindex)
        if entry.access is Access.WO:
            raise SdoAbort(Abort.WRITE_ONLY)
        if entry.type is DataType.STRING:
            return self.texts[entry.key]
        value = self.values[entry.key]
        if entry.type.is_real:
            return struct.pack("<" + entry.type.code, value)
        # Too large a value is truncated to its low bytes: a description may give an object too small a type.
        return (value & (1 << entry.type.bits) - 1).to_bytes(entry.type.bits // 8, "little")

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object from the bytes of an SDO transfer."""
        entry = self._find(index, subindex)
        if entry.access is Access.RO:
            raise SdoAbort(Abort.READ_ONLY)
        if entry.type is DataType.STRING:
            self.texts[entry.key] = data
            return
        if len(data) * 8 != entry.type.bits:
            raise SdoAbort(Abort.LENGTH)
        (value,) = struct.unpack("<" + entry.type.code, data)
        key = entry.key
        if key in self.allowed and value not in self.allowed[key]:
            raise SdoAbort(Abort.VALUE_RANGE)
        if key in self.vetoes:
            self.vetoes[key](value)
        if index in self.forgets:
            return
        self.values[key] = value
        if key in self.reactions:
            self.reactions[key]()


class SdoServer:
    """Answers one client.

    Args:
        dictionary: The objects.
    """

    def __init__(self, dictionary: Dictionary) -> None:
        self._dictionary = dictionary
        self._index = 0
        self._subindex = 0
        self._toggle = 0
        self._outgoing: bytes | None = None
        self._incoming: bytearray | None = None

    def receive(self, request: bytes) -> bytes | None:
        """Process a request and return the answer of eight bytes; None if there is none."""
        if len(request) != 8:
            return self._abort(Abort.UNKNOWN_COMMAND)
        command = request[0]
        handler = {
            0: self._download_segment,
            1: self._initiate_download,
            2: self._initiate_upload,
            3: self._upload_segment,
        }.get(command >> 5)
        if command >> 5 == 4:
            self._outgoing, self._incoming = None, None
            return None
        try:
            if handler is None:
                _, self._index, self._subindex = _INITIATE.unpack_from(request)
                raise SdoAbort(Abort.UNKNOWN_COMMAND)
            return handler(command, request)
        except SdoAbort as refusal:
            return self._abort(refusal.code)

    def _abort(self, code: Abort) -> bytes:
        """Abort frame for the present transfer."""
        self._outgoing, self._incoming = None, None
        return _ABORT.pack(0x80, self._index, self._subindex, code)

    def _initiate_upload(self, _: int, request: bytes) -> bytes:
        """Answer a read: with the data if they fit into the frame, else with their size."""
        _, self._index, self._subindex = _INITIATE.unpack_from(request)
        data = self._dictionary.upload(self._index, self._subindex)
        if 0 < len(data) <= 4:
            head = _INITIATE.pack(0x43 | (4 - len(data)) << 2, self._index, self._subindex)
            return head + data.ljust(4, b"\0")
        self._outgoing, self._toggle = data, 0
        return _INITIATE.pack(0x41, self._index, self._subindex) + _SIZE.pack(len(data))

    def _upload_segment(self, command: int, _: bytes) -> bytes:
        """Send the next seven bytes."""
        if self._outgoing is None:
            raise SdoAbort(Abort.UNKNOWN_COMMAND)
        self._check_toggle(command)
        data, rest = self._outgoing[:_SEGMENT], self._outgoing[_SEGMENT:]
        self._outgoing = rest or None
        head = self._toggle_bit() | (_SEGMENT - len(data)) << 1 | (0 if rest else _LAST)
        return bytes([head]) + data.ljust(_SEGMENT, b"\0")

    def _initiate_download(self, command: int, request: bytes) -> bytes:
        """Process a write: immediately if it is expedited, else after its segments."""
        _, self._index, self._subindex = _INITIATE.unpack_from(request)
        if command & _EXPEDITED:
            size = 4 - (command >> 2 & 3) if command & _SIZED else self._expected_size()
            self._dictionary.download(self._index, self._subindex, bytes(request[4 : 4 + size]))
        else:
            self._incoming, self._toggle = bytearray(), 0
        return _INITIATE.pack(0x60, self._index, self._subindex).ljust(8, b"\0")

    def _expected_size(self) -> int:
        """Size of the object in bytes, for clients that do not state how many they send."""
        entry = self._dictionary.entries.get(self._index << 8 | self._subindex)
        return 4 if entry is None else entry.type.bits // 8

    def _download_segment(self, command: int, request: bytes) -> bytes:
        """Collect up to seven bytes and write the object after the last."""
        if self._incoming is None:
            raise SdoAbort(Abort.UNKNOWN_COMMAND)
        self._check_toggle(command)
        self._incoming += request[1 : 8 - (command >> 1 & 7)]
        if command & _LAST:
            data, self._incoming = bytes(self._incoming), None
            self._dictionary.download(self._index, self._subindex, data)
        return bytes([0x20 | self._toggle_bit()]).ljust(8, b"\0")

    def _check_toggle(self, command: int) -> None:
        """Check that the toggle bit alternates, starting with 0."""
        if bool(command & _TOGGLE) != bool(self._toggle):
            raise SdoAbort(Abort.TOGGLE)

    def _toggle_bit(self) -> int:
        """Toggle bit of this answer; flips it for the next."""
        bit, self._toggle = self._toggle, self._toggle ^ _TOGGLE
        return bit
