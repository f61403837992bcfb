"""Where the objects that are exchanged stand among the bytes that a drive sends or receives: packed and unpacked."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence

from msgspec import Struct

from armload_drivers.cia402.object_dictionary import DataType, Entry

_SIZES = {8: DataType.U8, 16: DataType.U16, 32: DataType.U32}


class FramePart(Struct, frozen=True):
    """The bytes of one drive in one direction, or of one PDO.

    Attributes:
        length: Their number.
        offsets: Offset of each object that is needed.
        others: Other objects with offset and number of bytes.
    """

    length: int
    offsets: dict[Entry, int]
    others: tuple[tuple[Entry, int], ...]

    def packer(self, entries: Sequence[Entry], constants: bytes) -> Callable[..., bytes]:
        """All bytes, as a function of the values of some objects; the rest is that of `constants`."""
        if self._in_order(entries) and not any(constants):
            return self._struct_of(entries).pack
        data = bytearray(constants)
        fields = [(struct.Struct("<" + entry.type.code).pack_into, self.offsets[entry]) for entry in entries]

        def packed(*values: int) -> bytes:
            for (pack_into, offset), value in zip(fields, values, strict=True):
                pack_into(data, offset, value)
            return bytes(data)

        return packed

    def unpacker(self, entries: Sequence[Entry]) -> Callable[[bytes | bytearray], tuple[int, ...]]:
        """The values of some objects, as a function of all bytes."""
        if self._in_order(entries):
            return self._struct_of(entries).unpack
        ordered = sorted(entries, key=self.offsets.__getitem__)
        unpack, places = self._struct_of(ordered).unpack, [ordered.index(entry) for entry in entries]

        def unpacked(data: bytes | bytearray) -> tuple[int, ...]:
            values = unpack(data)
            return tuple(values[place] for place in places)

        return unpacked

    def _in_order(self, entries: Sequence[Entry]) -> bool:
        """Whether the objects follow one another as they are given."""
        offsets = [self.offsets[entry] for entry in entries]
        return offsets == sorted(offsets)

    def _struct_of(self, entries: Sequence[Entry]) -> struct.Struct:
        """Format of objects in the order of their offsets; what is between them is skipped, or 0."""
        codes, at = "<", 0
        for entry in entries:
            codes += f"{self.offsets[entry] - at}x{entry.type.code}"
            at = self.offsets[entry] + entry.type.bits // 8
        return struct.Struct(f"{codes}{self.length - at}x")


def frame_part(mapped: Sequence[int], entries: Sequence[Entry]) -> FramePart:
    """Where objects are in a mapping."""
    wanted = {entry.mapping: entry for entry in entries}
    offsets: dict[Entry, int] = {}
    others: list[tuple[Entry, int]] = []
    bit = 0
    for word in mapped:
        index, subindex, bits = word >> 16, word >> 8 & 0xFF, word & 0xFF
        if bit % 8 == 0:
            if word in wanted and wanted[word] not in offsets:
                offsets[wanted[word]] = bit // 8
            elif index and bits in _SIZES:
                others.append((Entry(index, subindex, "also mapped", _SIZES[bits]), bit // 8))
        bit += bits
    return FramePart((bit + 7) // 8, offsets, tuple(others))
