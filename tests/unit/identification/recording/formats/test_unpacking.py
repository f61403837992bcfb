"""Compressed parts of files, unpacked in pieces up to a bound."""

import bz2
import io

import lz4.frame
import pytest
import zstandard

from armload_identification.recording.formats.unpacking import require_bounded, unpacked

pytestmark = pytest.mark.pure

DATA = b"0123456789" * 60_000
PACKED = {
    "": DATA,
    "none": DATA,
    "zstd": zstandard.compress(DATA),
    "lz4": lz4.frame.compress(DATA),
    "bz2": bz2.compress(DATA),
}


@pytest.mark.parametrize("kind", PACKED)
def test_every_kind_is_unpacked_in_pieces(kind):
    pieces = list(unpacked(io.BytesIO(PACKED[kind]), kind))
    assert b"".join(pieces) == DATA
    assert len(pieces) > 1
    require_bounded(io.BytesIO(PACKED[kind]), kind)


def test_several_frames_of_zstandard_follow_one_another():
    assert b"".join(unpacked(io.BytesIO(2 * PACKED["zstd"]), "zstd")) == 2 * DATA


@pytest.mark.parametrize("kind", PACKED)
def test_more_than_the_bound_is_refused_and_the_bound_is_not(kind):
    assert sum(map(len, unpacked(io.BytesIO(PACKED[kind]), kind, len(DATA)))) == len(DATA)
    with pytest.raises(ValueError, match="has more than 599999 bytes"):
        list(unpacked(io.BytesIO(PACKED[kind]), kind, len(DATA) - 1))


def test_another_compression_is_named():
    with pytest.raises(ValueError, match="'rar', which is not supported"):
        list(unpacked(io.BytesIO(b""), "rar"))
