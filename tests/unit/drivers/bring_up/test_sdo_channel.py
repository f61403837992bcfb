"""SDO access, independent of the bus: which refusals mean that an object is missing, sizes, limits, and waiting."""

import struct

import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.driver_errors import SdoRefused, ServoError, ServoTimeout
from tests.scripted_sdo import (
    GENERAL,
    NO_OBJECT,
    NO_SUBINDEX,
    READ_ONLY,
    TOO_LONG,
    TOO_SHORT,
    WRITE_ONLY,
    WRONG_LENGTH,
    ScriptedSdo,
)

POLL_S = 0.005

pytestmark = pytest.mark.pure

POSITION, WORD = od.TARGET_POSITION, od.STATUSWORD
REAL = od.Entry(0x3201, 1, "temperature", od.DataType.F32)


@pytest.mark.parametrize(
    ("entry", "data", "value"),
    [(POSITION, b"\xfe\xff\xff\xff", -2), (WORD, b"\xfe\xff", 0xFFFE), (WORD, b"\x37\x02\x99\x99", 0x0237)],
    ids=["signed", "unsigned", "longer than the object"],
)
def test_numbers_are_little_endian_and_signed_as_their_type(entry, data, value):
    sdo = ScriptedSdo({entry: data})
    assert sdo.read(entry) == sdo.read_if_there(entry) == value
    sdo.ask(entry)
    assert sdo.answer(entry) == value
    assert sdo.answer(entry) is None, "it was asked once"


@pytest.mark.parametrize(
    ("code", "there", "bits"),
    [
        (NO_OBJECT, False, None),
        (NO_SUBINDEX, False, None),
        (WRITE_ONLY, True, 32),
        (GENERAL, True, "raises"),
    ],
)
def test_only_two_refusals_of_a_read_mean_that_there_is_no_object(code, there, bits):
    sdo = ScriptedSdo({POSITION: 0, REAL: 0}, {("read", POSITION): code, ("read", REAL): code})
    assert sdo.has(POSITION) is there
    if there:
        for read, entry in ((sdo.read_if_there, POSITION), (sdo.read_real_if_there, REAL), (sdo.read, POSITION)):
            with pytest.raises(SdoRefused) as raised:
                read(entry)
            assert raised.value.abort_code == code
            assert "does not support this" in str(raised.value)
    else:
        assert sdo.read_if_there(POSITION) is None
        assert sdo.read_real_if_there(REAL) is None
        with pytest.raises(SdoRefused, match=r"joint_4 \(node 4\).*The drive has no 607A:0"):
            sdo.read(POSITION)
    if bits == "raises":
        with pytest.raises(SdoRefused):
            sdo.bits_if_there(POSITION)
    else:
        assert sdo.bits_if_there(POSITION) == bits


def test_the_size_is_what_the_node_sends():
    assert ScriptedSdo({POSITION: b"\1\2"}).bits_if_there(POSITION) == 16
    assert ScriptedSdo({POSITION: 0}).has(POSITION)


def test_real_numbers_and_integers_are_read_as_what_they_are():
    sdo = ScriptedSdo({REAL: struct.pack("<f", -41.5), WORD: 7})
    assert sdo.read_real_if_there(REAL) == -41.5
    assert sdo.read_real_if_there(WORD) == 7
    with pytest.raises(ServoError, match="3 bytes are not a REAL32"):
        ScriptedSdo({REAL: b"\0\0\0"}).read_real_if_there(REAL)


def test_text_without_its_padding_and_without_what_is_no_utf8():
    sdo = ScriptedSdo({od.DEVICE_NAME: b"Servo \xff9\0\0"})
    assert sdo.read_text_if_there(od.DEVICE_NAME) == "Servo \ufffd9"
    assert ScriptedSdo({}).read_text_if_there(od.DEVICE_NAME) == ""


@pytest.mark.parametrize("code", [WRONG_LENGTH, TOO_LONG, TOO_SHORT])
@pytest.mark.parametrize(("size", "value"), [(2, -7), (2, 32767), (2, -32768), (1, 127), (3, -(1 << 23))])
def test_a_value_is_written_in_the_size_that_the_node_states(code, size, value):
    sdo = ScriptedSdo({POSITION: bytes(size)}, sizes={POSITION: size})
    refused = iter([code])
    transfer = sdo._transfer

    def once(entry, data):
        if data is not None and len(data) != size:
            raise sdo._refused("writing", entry, next(refused), "its length")
        return transfer(entry, data)

    sdo._transfer = once
    sdo.write(POSITION, value)
    assert sdo.written == [(POSITION, value.to_bytes(size, "little", signed=True))]


def test_unsigned_values_of_another_size_may_use_their_highest_bit():
    sdo = ScriptedSdo({WORD: b"\0"}, sizes={WORD: 1})
    sdo.write(WORD, 0xFF)
    assert sdo.written == [(WORD, b"\xff")]


@pytest.mark.parametrize("value", [256, -129])
def test_a_value_that_does_not_fit_the_nodes_size_is_refused_and_not_cut(value):
    sdo = ScriptedSdo({POSITION: b"\0"}, sizes={POSITION: 1})
    with pytest.raises(SdoRefused):
        sdo.write(POSITION, value)
    assert not sdo.written


@pytest.mark.parametrize("size", [0, 5, 8])
def test_no_number_has_no_or_more_than_four_bytes(size):
    sdo = ScriptedSdo({POSITION: bytes(size)}, sizes={POSITION: size})
    with pytest.raises(SdoRefused):
        sdo.write(POSITION, 1)
    assert not sdo.written


def test_a_refusal_for_another_reason_or_of_an_unreadable_object_is_not_tried_again():
    sdo = ScriptedSdo({POSITION: 0}, {("write", POSITION): GENERAL})
    with pytest.raises(SdoRefused):
        sdo.write(POSITION, 1)
    assert len(sdo.steps) == 1
    sdo = ScriptedSdo({POSITION: 0}, {("write", POSITION): TOO_LONG, ("read", POSITION): WRITE_ONLY})
    with pytest.raises(SdoRefused) as raised:
        sdo.write(POSITION, 1)
    assert raised.value.abort_code == TOO_LONG


@pytest.mark.parametrize(
    ("code", "written"), [(None, True), (NO_OBJECT, False), (NO_SUBINDEX, False), (READ_ONLY, False)]
)
def test_what_is_missing_or_read_only_is_not_written(code, written):
    sdo = ScriptedSdo({POSITION: 0}, {("write", POSITION): code})
    assert sdo.write_if_there(POSITION, 1) is written
    with pytest.raises(SdoRefused):
        ScriptedSdo({POSITION: 0}, {("write", POSITION): WRITE_ONLY}).write_if_there(POSITION, 1)


def test_a_node_answers_with_a_value_or_a_refusal_but_not_with_silence():
    assert ScriptedSdo({WORD: 0}).answers(WORD, 0.01)
    sdo = ScriptedSdo({})
    assert sdo.answers(WORD, 0.01)
    sdo.silent = True
    assert not sdo.answers(WORD, 0.02)
    with pytest.raises(ServoTimeout):
        sdo.read(WORD)
    assert sdo.limits_s == [0.01, 0.02, 0.5], "the other limit holds for the block alone"


def test_reading_until_a_value_ends_with_it_or_with_the_time():
    values = iter(range(100))
    sdo = ScriptedSdo({WORD: lambda: next(values)})
    assert sdo.read_until(WORD, 3, 1.0) == 3
    assert sdo.waited_s == pytest.approx(3 * POLL_S)
    assert sdo.read_until(WORD, 1000, 4.5 * POLL_S) == 9, "read at once, and five times after a wait"
