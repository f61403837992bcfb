"""SDO access of the master: its frames, and its errors."""

import itertools
import struct

import can
import canopen.sdo.exceptions
import pytest

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.canopen.canopen_sdo import CanopenSdo
from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.driver_errors import BusError, DriverError, SdoRefused, ServoError, ServoTimeout
from armload_drivers.simulation.drives.sdo_server import Dictionary, SdoServer


class Bus:
    """A bus with an SDO server; `answers` replaces its answers."""

    def __init__(self, answers=None):
        dictionary = Dictionary()
        dictionary.add(od.DEVICE_TYPE, 0x20192)
        dictionary.add(od.DEVICE_NAME, "a drive with a long name")
        dictionary.add(od.TARGET_POSITION, 0)
        self.dictionary = dictionary
        self.server = SdoServer(dictionary)
        self.answers = answers
        self.requests = []
        self.queue = []

    def send(self, message, timeout=None):
        data = bytes(message.data)
        self.requests.append(data)
        answers = [self.server.receive(data)] if self.answers is None else self.answers(data)
        for answer in answers:
            if answer is not None:
                self.queue.append(can.Message(arbitration_id=0x585, data=answer, is_extended_id=False))

    def recv(self, timeout=None):
        return self.queue.pop(0) if self.queue else None


def channel(bus):
    sdo = CanopenSdo(5, "joint_2", BusLink(bus), timeout_s=0.01)
    sdo.step = "identifying"
    return sdo


def test_reading_and_writing():
    bus = Bus()
    sdo = channel(bus)
    assert sdo.read(od.DEVICE_TYPE) == 0x20192
    assert sdo.read_text_if_there(od.DEVICE_NAME) == "a drive with a long name"
    sdo.write(od.TARGET_POSITION, -7)
    assert sdo.read(od.TARGET_POSITION) == -7
    assert bus.requests[-2] == struct.pack("<BHBi", 0x23, 0x607A, 0, -7)


def test_what_a_drive_does_not_have():
    sdo = channel(Bus())
    assert sdo.read_if_there(od.POLARITY) is None
    assert not sdo.write_if_there(od.POLARITY, 0)
    assert not sdo.write_if_there(od.DEVICE_TYPE, 1), "it is read only"
    assert sdo.write_if_there(od.TARGET_POSITION, 1)


def test_a_refusal_names_everything_and_is_sent_once():
    bus = Bus()
    with pytest.raises(SdoRefused) as raised:
        channel(bus).write(od.DEVICE_TYPE, 1)
    error = raised.value
    assert (error.node_id, error.joint, error.step, error.abort_code) == (5, "joint_2", "identifying", 0x06010002)
    for part in ("joint_2", "node 5", "identifying", "1000:0", "0x06010002", "read only"):
        assert part in str(error)
    assert len(bus.requests) == 1


def test_refusals_for_other_reasons_are_not_swallowed():
    bus = Bus()
    bus.dictionary.allowed[od.TARGET_POSITION.key] = {0}
    with pytest.raises(SdoRefused):
        channel(bus).write_if_there(od.TARGET_POSITION, 1)


def test_silence_is_a_timeout_that_names_the_object():
    bus = Bus(answers=lambda request: [])
    with pytest.raises(ServoTimeout, match="1000:0 device type"):
        channel(bus).read(od.DEVICE_TYPE)
    assert bus.requests[1][0] == 0x80, "the server is informed that the client no longer waits"
    assert not channel(bus).answers(od.DEVICE_TYPE, 0.001)


def test_an_answer_counts_that_arrived_while_this_process_did_not_run(monkeypatch):
    seconds = itertools.count()
    monkeypatch.setattr("armload_drivers.bus.bus_link.time.monotonic", lambda: float(next(seconds)))
    assert channel(Bus()).read(od.DEVICE_TYPE) == 0x20192


def test_an_abort_is_an_answer_too():
    assert channel(Bus()).answers(od.POLARITY, 0.01)


@pytest.mark.parametrize(
    "answer",
    [
        struct.pack("<BHBI", 0x43, 0x1018, 1, 7),  # another object's answer
        b"\x43\x00\x10",  # too short
        struct.pack("<BHBI", 0xE3, 0x1000, 0, 7),  # no command of the standard
    ],
)
def test_an_answer_that_is_none_is_an_error_and_no_value(answer):
    with pytest.raises(ServoError) as raised:
        channel(Bus(answers=lambda request: [answer])).read(od.DEVICE_TYPE)
    assert not isinstance(raised.value, (ServoTimeout, SdoRefused))
    assert "another master" in str(raised.value)


def test_a_late_answer_to_an_earlier_request_is_dropped():
    bus = Bus()
    sdo = channel(bus)
    bus.queue.append(
        can.Message(arbitration_id=0x585, data=struct.pack("<BHBI", 0x43, 0x1000, 0, 99), is_extended_id=False)
    )
    sdo._link.pump(0.0)
    assert sdo.read(od.DEVICE_TYPE) == 0x20192


def test_reading_until_a_value_is_there():
    sdo = channel(Bus())
    assert sdo.read_until(od.TARGET_POSITION, 0, 1.0) == 0
    assert sdo.read_until(od.TARGET_POSITION, 5, 0.0) == 0


def test_every_exception_of_the_sdo_library_has_a_translation():
    """The translation knows two classes; a new one in the library needs a decision."""
    kinds = {
        name
        for name, kind in vars(canopen.sdo.exceptions).items()
        if isinstance(kind, type) and issubclass(kind, Exception)
    }
    assert kinds == {"SdoError", "SdoAbortedError", "SdoCommunicationError"}


def test_a_failing_bus_is_reported_as_such():
    class Broken(Bus):
        def send(self, message, timeout=None):
            raise can.CanOperationError("gone")

    with pytest.raises(BusError):
        channel(Broken()).read(od.DEVICE_TYPE)
    assert issubclass(BusError, DriverError)


# Answers that fit no request -------------------------------------------------------------------------------------

OTHER = struct.pack("<BHBI", 0x43, 0x1018, 1, 7)
ASKED = struct.pack("<BHBI", 0x43, 0x607A, 0, 5)
READ = struct.pack("<BHBI", 0x43, 0x1000, 0, 0x20192)


def test_a_write_that_is_answered_like_a_read_was_not_confirmed():
    bus = Bus(answers=lambda request: [struct.pack("<BHBI", 0x43, 0x607A, 0, 5)])
    with pytest.raises(ServoError, match="answered 0x43 to a write"):
        channel(bus).write(od.TARGET_POSITION, 5)


def test_the_late_answer_to_what_nobody_waits_for_is_passed_over():
    bus = Bus(answers=lambda request: [ASKED, READ] if request[1:3] == b"\x00\x10" else [])
    sdo = channel(bus)
    sdo.ask(od.TARGET_POSITION)
    assert sdo.answer(od.TARGET_POSITION) is None
    assert sdo.read(od.DEVICE_TYPE) == 0x20192


def test_any_other_answer_is_not_passed_over():
    bus = Bus(answers=lambda request: [OTHER, READ] if request[1:3] == b"\x00\x10" else [])
    sdo = channel(bus)
    sdo.ask(od.TARGET_POSITION)
    with pytest.raises(ServoError, match="answered for object 1018:1"):
        sdo.read(od.DEVICE_TYPE)


def test_a_second_answer_to_the_request_before_has_two_possible_causes():
    """Two drives answered it, or another client read the same object."""
    answers = iter([[READ], [READ]])
    sdo = channel(Bus(answers=lambda request: next(answers)))
    sdo.read(od.DEVICE_TYPE)
    with pytest.raises(ServoError, match="1000:0 was answered twice: two drives have node id 5, or another SDO client"):
        sdo.read(od.TARGET_POSITION)


@pytest.mark.parametrize(
    "wrong",
    [ASKED[:5], OTHER, struct.pack("<BHBI", 0x80, 0x607A, 0, 0x0800_0000), struct.pack("<BHBI", 0x60, 0x607A, 0, 5)],
    ids=["too short", "another object", "a refusal", "a confirmed write"],
)
def test_what_does_not_answer_what_was_asked_is_no_value(wrong):
    bus = Bus(answers=lambda request: [wrong])
    sdo = channel(bus)
    sdo.ask(od.TARGET_POSITION)
    sdo._link.drain()
    assert sdo.answer(od.TARGET_POSITION) is None
    bus.queue.append(can.Message(arbitration_id=0x585, data=ASKED, is_extended_id=False))
    sdo._link.drain()
    assert sdo.answer(od.TARGET_POSITION) == 5


def refusing(code):
    return channel(Bus(answers=lambda request: [struct.pack("<BHBI", 0x80, *struct.unpack("<HB", request[1:4]), code)]))


@pytest.mark.parametrize(("code", "there"), [(0x0602_0000, False), (0x0601_0001, True), (0x0800_0022, True)])
def test_an_object_that_cannot_be_read_is_there_all_the_same(code, there):
    assert refusing(code).has(od.TARGET_POSITION) is there


REAL = od.Entry(0x3201, 1, "temperature", od.DataType.F32)


def test_a_real_object():
    data = struct.pack("<BHBf", 0x43, 0x3201, 1, 41.5)
    assert channel(Bus(answers=lambda request: [data])).read_real_if_there(REAL) == 41.5
    assert refusing(0x0602_0000).read_real_if_there(REAL) is None
    with pytest.raises(SdoRefused):
        refusing(0x0800_0022).read_real_if_there(REAL)
    short = struct.pack("<BHBI", 0x4B, 0x3201, 1, 7)
    with pytest.raises(ServoError, match="2 bytes are not a REAL32"):
        channel(Bus(answers=lambda request: [short])).read_real_if_there(REAL)


@pytest.mark.parametrize("read", ["read_if_there", "bits_if_there"])
def test_only_a_missing_object_is_none(read):
    with pytest.raises(SdoRefused, match="0x08000022"):
        getattr(refusing(0x0800_0022), read)(od.TARGET_POSITION)


def test_a_server_is_told_that_its_answer_is_not_waited_for_any_more():
    """CiA 301, table 22: SDO protocol timed out."""
    bus = Bus(answers=lambda request: [])
    with pytest.raises(ServoTimeout, match=r"no answer within 0\.01 s"):
        channel(bus).read(od.DEVICE_TYPE)
    assert (bus.requests[1][0], bus.requests[1][4:]) == (0x80, struct.pack("<I", 0x0504_0000))


@pytest.mark.parametrize(
    ("entry", "value", "command"), [(od.MODE, 8, 0x2F), (od.CONTROLWORD, 6, 0x2B), (od.TARGET_POSITION, 1, 0x23)]
)
def test_a_write_announces_its_size(entry, value, command):
    """CiA 301, 7.2.4.3.3: expedited, with 4 - size unused bytes."""
    bus = Bus(answers=lambda request: [struct.pack("<BHB4x", 0x60, entry.index, entry.subindex)])
    channel(bus).write(entry, value)
    assert bus.requests == [struct.pack("<BHBi", command, entry.index, entry.subindex, value)]
