"""Numbers out of many small JSON objects of one shape, without a dictionary per object.

Decoding a log of hundreds of thousands of messages one by one costs minutes. The kernel here walks a buffer
of MCAP records and writes the numbers behind the wanted keys into one table: any order of keys and any white
space, `null` as NaN, true and false as 1 and 0, keys not asked for are skipped. Objects are flat; a value is
a number or a list of numbers. Numbers are right to one unit in the last place.
"""

from __future__ import annotations

from collections.abc import Sequence

import numba
import numpy as np
from numba import boolean, float64, int64, types, uint8, uint64
from numpy.typing import NDArray

_BYTES = types.Array(uint8, 1, "C", readonly=True)
_MESSAGE_OPCODE = 5
_RECORD_HEADER_BYTES = 9
_MESSAGE_HEADER_BYTES = 22
_MALFORMED = -1
_MANTISSA_DIGITS = 18
_FNV_OFFSET = 0xCBF29CE484222325
_FNV_PRIME = 0x100000001B3
_POWERS_OF_TEN = 10.0 ** np.arange(23)
"""Exactly representable; larger exponents are applied in steps."""
_QUOTE, _BACKSLASH, _COLON, _COMMA, _POINT = 34, 92, 58, 44, 46
_OPEN_LIST, _CLOSE_LIST, _OPEN_OBJECT, _CLOSE_OBJECT = 91, 93, 123, 125
_NULL, _TRUE = 110, 116


def key_table(keys: Sequence[str], widths: Sequence[int]) -> NDArray[np.int64]:
    """Where the numbers of each key go.

    Args:
        keys: The wanted keys.
        widths: Numbers behind each: 1 for a plain value, else the length of the list.

    Returns:
        (len(keys), 3): hash of the key, first column, number of columns.
    """
    first = 0
    rows = []
    for key, width in zip(keys, widths, strict=True):
        value = _FNV_OFFSET
        for byte in key.encode():
            value = ((value ^ byte) * _FNV_PRIME) & 0xFFFFFFFFFFFFFFFF
        rows.append([int(np.uint64(value).astype(np.int64)), first, width])
        first += width
    return np.array(rows, dtype=np.int64).reshape(-1, 3)


@numba.njit(types.Tuple((int64, int64))(_BYTES, int64, int64), cache=True)
def _skip_string(data, position, end):  # type: ignore[no-untyped-def]
    """Hash of the string that begins at `position`, and the position behind its closing quote."""
    value = np.uint64(_FNV_OFFSET)
    position += 1
    while position < end and data[position] != _QUOTE:
        if data[position] == _BACKSLASH:
            position += 1
        if position < end:
            value = (value ^ np.uint64(data[position])) * np.uint64(_FNV_PRIME)
        position += 1
    return np.int64(value), position + 1


@numba.njit(float64(uint64, int64), cache=True)
def _scaled(mantissa, exponent):  # type: ignore[no-untyped-def]
    """Mantissa times ten to the exponent; exact below 2^53 and 10^22."""
    value = np.float64(mantissa)
    while exponent > 0 and value > 0.0 and not np.isinf(value):
        step = min(exponent, 22)
        value *= _POWERS_OF_TEN[step]
        exponent -= step
    while exponent < 0 and value > 0.0:
        step = min(-exponent, 22)
        value /= _POWERS_OF_TEN[step]
        exponent += step
    return value


@numba.njit(types.Tuple((int64, int64))(_BYTES, int64, int64), cache=True)
def _exponent(data, position, end):  # type: ignore[no-untyped-def]
    """The exponent written at `position`, 0 where there is none, and the position behind it."""
    if position >= end or data[position] not in (101, 69):
        return 0, position
    position += 1
    negative = position < end and data[position] == 45
    if position < end and data[position] in (43, 45):
        position += 1
    written = 0
    while position < end and 48 <= data[position] <= 57:
        written = min(written * 10 + int(data[position]) - 48, 100000)
        position += 1
    return (-written if negative else written), position


@numba.njit(types.Tuple((float64, int64))(_BYTES, int64, int64), cache=True)
def _number(data, position, end):  # type: ignore[no-untyped-def]
    """The value that begins at `position` and the position behind it; that is -1 where there is none."""
    first = data[position]
    if 97 <= first <= 122:
        while position < end and 97 <= data[position] <= 122:
            position += 1
        return (np.nan if first == _NULL else (1.0 if first == _TRUE else 0.0)), position
    if first == 45:
        position += 1
    mantissa = np.uint64(0)
    shift = 0
    digits = 0
    significant = 0
    behind_point = False
    while position < end:
        character = data[position]
        if character == _POINT and not behind_point:
            behind_point = True
        elif 48 <= character <= 57:
            digits += 1
            if significant < _MANTISSA_DIGITS:
                mantissa = mantissa * np.uint64(10) + np.uint64(character - 48)
                significant += 1 if mantissa > np.uint64(0) else 0
                shift -= 1 if behind_point else 0
            elif not behind_point:
                shift += 1
        else:
            break
        position += 1
    if digits == 0:
        return 0.0, _MALFORMED
    exponent, position = _exponent(data, position, end)
    value = _scaled(mantissa, shift + exponent)
    return (-value if first == 45 else value), position


@numba.njit(int64(int64[:, ::1], int64), cache=True)
def _row_of(keys, value):  # type: ignore[no-untyped-def]
    """Row of the key with this hash, or -1."""
    for candidate in range(keys.shape[0]):
        if keys[candidate, 0] == value:
            return candidate
    return -1


@numba.njit(boolean(_BYTES, int64, int64, int64[:, ::1], float64[::1]), cache=True)
def _parse_object(data, position, end, keys, row):  # type: ignore[no-untyped-def]
    """Write the numbers of one flat JSON object into `row`; False where it is not as asked for."""
    row[:] = np.nan
    slot = -1
    index = 0
    closed = False
    while position < end:
        character = data[position]
        if character == _QUOTE:
            value, position = _skip_string(data, position, end)
            while position < end and data[position] <= 32:
                position += 1
            if position < end and data[position] == _COLON:
                slot = _row_of(keys, value)
                index = 0
        elif character == 45 or 48 <= character <= 57 or 97 <= character <= 122:
            number, position = _number(data, position, end)
            if position == _MALFORMED or (slot >= 0 and index >= keys[slot, 2]):
                return False
            if slot >= 0:
                row[keys[slot, 1] + index] = number
            index += 1
        else:
            if character == _CLOSE_LIST and slot >= 0 and index != keys[slot, 2]:
                return False
            if character == _CLOSE_OBJECT:
                closed = True
            elif character > 32 and character not in (_COMMA, _COLON, _OPEN_LIST, _CLOSE_LIST, _OPEN_OBJECT):
                return False
            position += 1
    return closed


@numba.njit(types.Tuple((int64, int64))(_BYTES, int64[::1], int64[:, ::1], float64[:, ::1]), cache=True)
def parse_messages(data, channels, keys, table):  # type: ignore[no-untyped-def]
    """Read every message of some channels in a buffer of whole MCAP records.

    Args:
        data: (bytes,) the records; one that is cut short at the end is left out.
        channels: Ids of the wanted channels.
        keys: From `key_table`.
        table: (enough rows, columns) is written, one row per well-formed message.

    Returns:
        Number of rows written, and of messages that were not as asked for.
    """
    position = np.int64(0)
    rows = 0
    malformed = 0
    while position + _RECORD_HEADER_BYTES <= data.size:
        length = np.int64(0)
        for byte in range(8):
            length |= np.int64(data[position + 1 + byte]) << np.int64(8 * byte)
        start = position + _RECORD_HEADER_BYTES
        end = start + length
        if length < 0 or end > data.size:
            break
        if data[position] == _MESSAGE_OPCODE and length >= _MESSAGE_HEADER_BYTES:
            channel = np.int64(data[start]) + 256 * np.int64(data[start + 1])
            if np.any(channels == channel):
                if _parse_object(data, start + _MESSAGE_HEADER_BYTES, end, keys, table[rows]):
                    rows += 1
                else:
                    malformed += 1
        position = end
    return rows, malformed
