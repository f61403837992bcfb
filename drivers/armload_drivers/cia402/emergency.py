"""Emergency messages, and error codes (603F) as text.

References:
    CiA 301, 7.2.7 (EMCY, error register 1001); CiA 402-2, table "error codes".
"""

from __future__ import annotations

import struct
from importlib.resources import files

from msgspec import Struct

_HEADER = struct.Struct("<HB")

_TABLE = files("armload_configs").joinpath("emergency_codes.txt").read_text("ascii")
"""Read with the module: a fault in motion waits for no file."""
_CODES = {int(code, 16): meaning for code, _, meaning in (line.partition(" ") for line in _TABLE.splitlines())}


def error_text(code: int) -> str:
    """Error code (603F, EMCY bytes 0 and 1) with its meaning.

    Codes that the standard does not list get the meaning of their class; vendor codes have none.
    """
    if code == 0:
        return "0x0000 no error"
    if code >= 0xFF00:
        return f"0x{code:04X} vendor-specific, see the drive's manual"
    for mask in (0xFFFF, 0xFFF0, 0xFF00, 0xF000):
        text = _CODES.get(code & mask)
        if text is not None:
            return f"0x{code:04X} {text}"
    return f"0x{code:04X} not listed by CiA 402"


class Emergency(Struct, frozen=True):
    """One emergency message.

    Attributes:
        code: Error code; 0 if the error is no longer present.
        register: Error register; None if the frame was too short.
        manufacturer: The vendor's bytes that were received.
    """

    code: int
    register: int | None
    manufacturer: bytes

    @property
    def text(self) -> str:
        """Code, meaning, and the vendor's bytes if any of them is not zero."""
        words = error_text(self.code)
        if any(self.manufacturer):
            words += f" (vendor bytes {self.manufacturer.hex(' ')})"
        return words


def parse_emergency(data: bytes) -> Emergency | None:
    """Parse an EMCY frame of any length; None if it does not contain a code.

    Short frames are accepted, because some drives send them.
    """
    if len(data) < 2:
        return None
    if len(data) < _HEADER.size:
        return Emergency(int.from_bytes(data[:2], "little"), None, b"")
    code, register = _HEADER.unpack_from(data)
    return Emergency(code, register, bytes(data[3:8]))


def pack(code: int, register: int) -> bytes:
    """EMCY frame of a drive without vendor bytes (8 bytes)."""
    return _HEADER.pack(code, register).ljust(8, b"\0")
