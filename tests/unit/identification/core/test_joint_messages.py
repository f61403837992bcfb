"""The scanner of recorded messages: the same numbers as a full JSON parser, or none."""

from __future__ import annotations

import json
import random
import struct

import numpy as np
import orjson
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armload_core import kernels

pytestmark = pytest.mark.pure

CHANNEL, OTHER = 7, 8
CHANNELS = struct.pack("<H", CHANNEL)
VELOCITY, CURRENT, TORQUE = 1, 2, 4
GOOD = {
    "cycle": 12,
    "time_s": 100.001,
    "phase_s": 0.25,
    "segment": "periods",
    "position_rad": [0.1, -2.25],
    "current_a": [1.5, -0.0],
    "statusword": [1591, 1591],
    "missing": [False, False],
}
WIDTH = 2 + 2 * 2


def record(content: bytes, opcode=5, channel=CHANNEL):
    if opcode == 5:
        content = struct.pack("<HIQQ", channel, 0, 0, 0) + content
    return struct.pack("<BQ", opcode, len(content)) + content


def scan(records, room=4, arrays=CURRENT, joints=2, at=0, channels=CHANNELS):
    table = np.full((room, 2 + joints * (1 + bin(arrays).count("1"))), 77.0)
    rows, missing, end = kernels.joint_rows_into(records, at, channels, arrays, joints, table)
    return table[:rows], missing, end


def text(**changes):
    return json.dumps(GOOD | changes).encode()


def test_rows_are_the_numbers_of_the_messages():
    still = text(phase_s=None, missing=[True, False])
    records = record(text()) + record(b"{}", channel=OTHER) + record(b"anything", opcode=8) + record(still)
    records += record(orjson.dumps(GOOD | {"phase_s": None}))
    rows, missing, end = scan(records)
    assert (missing, end) == (1, len(records))
    np.testing.assert_array_equal(
        rows, [[100.001, 0.25, 0.1, -2.25, 1.5, -0.0], [100.001, np.nan, 0.1, -2.25, 1.5, -0.0]]
    )
    assert np.signbit(rows[0, 5])


def test_arrays_come_in_their_order_whatever_the_messages_order():
    content = {"torque_nm": [5, 6], "velocity_rad_s": [3, 4], **GOOD}
    rows, _, _ = scan(record(json.dumps(content).encode()), arrays=VELOCITY | TORQUE)
    np.testing.assert_array_equal(rows, [[100.001, 0.25, 0.1, -2.25, 3.0, 4.0, 5.0, 6.0]])


def test_it_goes_on_where_it_stopped():
    records = b"".join(record(text(time_s=k)) for k in range(5))
    first, _, at = scan(records, room=3)
    rest, _, end = scan(records, room=3, at=at)
    assert [*first[:, 0], *rest[:, 0]] == [0, 1, 2, 3, 4]
    assert end == len(records)


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"{}",
        b"[]",
        text()[:-1],
        text() + b"x",
        text(time_s=None),
        text(time_s="1"),
        text(time_s=True),
        text(position_rad=[0.1]),
        text(position_rad=[0.1, 0.2, 0.3]),
        text(position_rad=[0.1, None]),
        text(position_rad=[[0.1, 0.2], [0.1, 0.2]]),
        text(current_a=None),
        text(missing=[False]),
        text(missing=[0, 0]),
        text(missing=None),
        text(more={"a": 1}),
        text(segment="äpproach"),
        text(segment='"'),
        text().replace(b'"segment"', b'"time_s"'),
        text().replace(b"12,", b"012,"),
        text().replace(b"12,", b"12.,"),
        text().replace(b"12,", b".5,"),
        text().replace(b"12,", b"+1,"),
        text().replace(b"12,", b"1e,"),
        text().replace(b"12,", b"NaN,"),
        text().replace(b"100.001", b"-0"),
        text().replace(b"100.001", b"1" * 20),
        text().replace(b"100.001", b"1e400"),
        text().replace(b"100.001", b"1e-400"),
        text().replace(b'"current_a"', b'"torque_nm"'),
        text().replace(b"[1591, 1591]", b"[1591, 1591,]"),
        text().replace(b"[1591, 1591]", b"[1591 1591]"),
        text().replace(b"periods", b"peri\nods"),
    ],
)
def test_what_is_not_exactly_a_recorded_message_is_left_to_others(content):
    before = record(text())
    rows, missing, end = scan(before + record(content) + before)
    assert (len(rows), missing, end) == (1, 0, len(before))


@pytest.mark.parametrize(
    "odd",
    [record(b"", opcode=4), struct.pack("<BQ", 5, 100) + b"short", b"\x05\x01", record(b"")[:9] + b"", b"\x05" * 12],
)
def test_channels_and_records_that_are_not_whole_are_left_to_others(odd):
    before = record(text())
    assert scan(before + odd)[2] == len(before)


def test_blanks_and_lists_that_nobody_asked_for_are_passed_over():
    content = b' { "a" : [ ] , "b" : [ 1 , "x" , null , true ] ,"c":null,\r\n\t' + text()[1:] + b"\n "
    assert len(scan(record(content))[0]) == 1


def numbers(count):
    """Numerals of all lengths and sizes, with hard cases: halfway between two doubles, and next to that."""
    rng = random.Random(4)
    for _ in range(count):
        yield repr(struct.unpack("<d", rng.randbytes(8))[0])
        yield repr(rng.uniform(-4, 4))
        yield f"{rng.uniform(-4, 4):.{rng.randrange(1, 19)}f}"
        yield f"{rng.randrange(2**64)}e{rng.randrange(-40, 25)}"
        half = (rng.randrange(2**52, 2**53) * 2 + 1) << rng.randrange(0, 10)
        yield str(half + rng.choice([-1, 0, 1]))
        digits = str(half * 5 ** rng.randrange(1, 5))
        yield f"{digits[:2]}.{digits[2:]}"
    yield from ("0.0", "-0.0", "0e5", "1E2", "1e+2", "9007199254740993", "5e-324", "2.5E-3", "18446744073709551615")


def test_every_number_is_rounded_as_python_rounds_it():
    taken = 0
    for numeral in numbers(1200):
        if numeral in {"nan", "inf", "-inf"}:
            continue
        rows, _, _ = scan(record(text().replace(b"100.001", numeral.encode())))
        if len(rows):
            taken += 1
            assert rows[0, 0] == float(numeral), numeral
            assert np.signbit(rows[0, 0]) == numeral.startswith("-")
    assert taken > 3_500


def test_what_a_recorder_writes_is_taken():
    """Counts through a gear have 17 digits; the fast path must read them too."""
    rng = np.random.default_rng(2)
    for values in (rng.integers(-(2**19), 2**19, 500) * (2 * np.pi / 2**19 / 101), rng.normal(size=500) * 1e-6):
        for one, two in values.reshape(-1, 2).tolist():
            rows, _, _ = scan(record(orjson.dumps(GOOD | {"position_rad": [one, two]})))
            assert rows[0, 2:4].tolist() == [one, two]


def reference(content: bytes):
    """The row by a full parser; None if there is none."""
    try:
        message = orjson.loads(content)
        row = [message["time_s"], message["phase_s"], *message["position_rad"], *message["current_a"]]
        if any(isinstance(value, bool | str) for value in row) or len(row) != WIDTH or True in message["missing"]:
            return None
        return np.array(row, dtype=np.float64)
    except (ValueError, TypeError, KeyError):
        return None


PIECES = [
    b'"',
    b",",
    b"[",
    b"]",
    b"{",
    b"}",
    b"null",
    b"true",
    b"-",
    b"1",
    b".",
    b"e",
    b"0",
    b" ",
    b"\\",
    b"\x00",
    b"\xff",
    b":",
]


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.lists(st.tuples(st.integers(0, 400), st.integers(0, 12), st.sampled_from([b"", *PIECES])), max_size=3))
def test_damaged_messages_are_read_as_a_full_parser_does_or_not_at_all(edits):
    content = text(phase_s=None)
    for place, cut, piece in edits:
        start = place % len(content)
        content = content[:start] + piece + content[start + cut :]
    rows, missing, end = scan(record(content))
    if len(rows):
        np.testing.assert_array_equal(rows[0], reference(content))
    elif missing:
        assert True in orjson.loads(content)["missing"]
    else:
        assert end == 0


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.binary(max_size=200), st.integers(0, 200))
def test_any_bytes_are_survived(noise, at):
    rows, _, end = scan(record(text()) + noise, at=at)
    assert len(rows) <= 4
    assert at <= end <= max(at, len(record(text()) + noise))


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"at": -1}, ValueError),
        ({"joints": 0}, ValueError),
        ({"joints": 5000}, ValueError),
        ({"arrays": 8}, ValueError),
        ({"channels": b"\x07"}, ValueError),
        ({"table": np.zeros((3, WIDTH + 1))}, ValueError),
        ({"table": np.zeros((3, WIDTH), dtype=np.float32)}, ValueError),
        ({"table": np.zeros((WIDTH, 3)).T}, (ValueError, BufferError)),
        ({"table": None}, TypeError),
        ({"records": "text"}, TypeError),
    ],
)
def test_arguments_that_do_not_fit_are_refused(change, error):
    arguments = {
        "records": record(text()),
        "at": 0,
        "channels": CHANNELS,
        "arrays": CURRENT,
        "joints": 2,
        "table": np.zeros((3, WIDTH)),
    }
    with pytest.raises(error):
        kernels.joint_rows_into(*(arguments | change).values())
