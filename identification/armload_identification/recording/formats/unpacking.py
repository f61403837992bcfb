"""Compressed parts of files, unpacked piece by piece: a little of one may become more than there is memory or disk."""

from __future__ import annotations

import bz2
from collections.abc import Callable, Iterator, Mapping
from typing import IO, Any, BinaryIO, Final

import lz4.frame
import zstandard

from armload_identification.recording.read_boundary import MOST_BYTES

_PIECE_BYTES: Final = 2**18
_OPENED: Final[Mapping[str, Callable[[BinaryIO], IO[bytes] | Any]]] = {
    "": lambda packed: packed,
    "none": lambda packed: packed,
    "zstd": lambda packed: zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True),
    "lz4": lz4.frame.open,
    "bz2": bz2.open,
}


def unpacked(packed: BinaryIO, compression: str, most: int = MOST_BYTES) -> Iterator[bytes]:
    """What a compressed part contains, in pieces.

    Args:
        packed: The part.
        compression: Its name in the file.
        most: Most bytes that it may contain.

    Raises:
        ValueError: it contains more, or the compression is unknown.
    """
    if compression not in _OPENED:
        raise ValueError(f"a part is compressed with {compression!r}, which is not supported")
    stream, left = _OPENED[compression](packed), most
    while piece := stream.read(_PIECE_BYTES):
        left -= len(piece)
        if left < 0:
            raise ValueError(f"a compressed part has more than {most} bytes when it is unpacked")
        yield piece


def require_bounded(packed: BinaryIO, compression: str) -> None:
    """Raise `ValueError` if a compressed part takes more memory than a reader may hold."""
    for _ in unpacked(packed, compression):
        pass
