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
from types import SimpleNamespace

from canopen.sdo import SdoServer as CanopenServer
from canopen.sdo import constants
from canopen.sdo.exceptions import SdoAbortedError

from armload_drivers.cia402.object_dictionary import Access, DataType, Entry


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


class SdoServer(CanopenServer):  # type: ignore[misc]
    """canopen's server, for one client, without its network: a frame is answered by a frame.

    An error in what an object does is not an answer: it is raised, where canopen's server would refuse the transfer.

    Args:
        dictionary: Objects it serves.
    """

    def __init__(self, dictionary: Dictionary) -> None:
        node = SimpleNamespace(
            object_dictionary=None,
            get_data=lambda index, subindex, check_readable: dictionary.upload(index, subindex),
            set_data=lambda index, subindex, data, check_writable: dictionary.download(index, subindex, bytes(data)),
        )
        super().__init__(0, 0, node)
        self._dictionary = dictionary
        self._index = self._subindex = 0
        self._uploads = False
        self._answer: bytes | None = None

    def receive(self, request: bytes) -> bytes | None:
        """Answer one frame from a client.

        Args:
            request: Data of the frame.

        Returns:
            Data of the answer, or None if there is none.
        """
        self._answer = None
        try:
            self._serve(request)
        except (SdoAbort, SdoAbortedError) as refusal:
            self._buffer = None
            self.abort(refusal.code)
        return self._answer

    def send_response(self, response: bytes | bytearray) -> None:
        """Keep the answer."""
        self._answer = bytes(response)

    def _serve(self, request: bytes) -> None:
        """Act on a request; a segment without a transfer, a block transfer and a short frame are refused."""
        command = request[0] if len(request) == 8 else 0xFF
        match command & 0xE0:
            case constants.REQUEST_UPLOAD:
                self._uploads = True
                self.init_upload(request)
            case constants.REQUEST_SEGMENT_UPLOAD if self._uploads and self._buffer:
                self.segmented_upload(command)
            case constants.REQUEST_DOWNLOAD:
                self._uploads = False
                self.init_download(self._sized(request))
            case constants.REQUEST_SEGMENT_DOWNLOAD if not self._uploads and self._buffer is not None:
                self.segmented_download(command, request)
                self._buffer = None if command & constants.NO_MORE_DATA else self._buffer
            case constants.REQUEST_ABORTED:
                self._buffer = None
            case other:
                if other > constants.REQUEST_ABORTED and len(request) == 8:
                    _, self._index, self._subindex = constants.SDO_STRUCT.unpack_from(request)
                raise SdoAbort(Abort.UNKNOWN_COMMAND)

    def _sized(self, request: bytes) -> bytes:
        """A download with its size, which a client need not announce: then it is the object's."""
        entry = self._dictionary.entries.get(request[2] << 16 | request[1] << 8 | request[3])
        if request[0] & (constants.EXPEDITED | constants.SIZE_SPECIFIED) != constants.EXPEDITED or entry is None:
            return request
        unused = 4 - min(4, entry.type.bits // 8)
        return bytes([request[0] | constants.SIZE_SPECIFIED | unused << 2]) + request[1:]
