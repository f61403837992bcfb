"""Requests beside the cycle, on a line that answers when the test allows it."""

from concurrent.futures import ThreadPoolExecutor
from threading import Event

import pytest

from armload_drivers.cia402 import object_dictionary as od
from armload_drivers.cia402.drive_safety import SYNC_MANAGER_WATCHDOG_US
from armload_drivers.driver_errors import SdoRefused, ServoTimeout
from armload_drivers.ethercat.coe_sdo import CoeSdo
from armload_drivers.ethercat.ethercat_line import MailboxAbort, MailboxSilence

VALUES = {od.DEVICE_TYPE.index: 0x20192, od.ERROR_CODE.index: 0x2310, od.INTERPOLATION_TIME.index: 2}
LIMIT_S = 10.0


class Line:
    """Answers while `may_answer`; `trouble` is what a request raises instead."""

    def __init__(self):
        self.may_answer, self.begun = Event(), Event()
        self.requests, self.trouble = [], None

    def upload(self, place, index, subindex, limit_s):
        self.requests.append(index)
        self.begun.set()
        assert self.may_answer.wait(LIMIT_S)
        if self.trouble is not None:
            raise self.trouble
        return VALUES[index].to_bytes(4, "little")


@pytest.fixture
def line():
    return Line()


@pytest.fixture
def worker():
    with ThreadPoolExecutor(1) as worker:
        yield worker


@pytest.fixture
def sdo(line, worker):
    yield CoeSdo(1, "joint_1", line, worker, LIMIT_S)
    line.may_answer.set()


def finish(worker):
    worker.submit(lambda: None).result(LIMIT_S)


def test_an_answer_that_comes_late_is_not_taken_for_that_of_the_next_request(sdo, line, worker):
    """A hung drive delays the requests of the others; joint_3's 605B was once compared with another object's value."""
    sdo.ask(od.DEVICE_TYPE)
    assert line.begun.wait(LIMIT_S)
    assert sdo.answer(od.DEVICE_TYPE) is None
    sdo.ask(od.ERROR_CODE)
    line.may_answer.set()
    finish(worker)
    assert sdo.answer(od.ERROR_CODE) == VALUES[od.ERROR_CODE.index]
    assert sdo.answer(od.ERROR_CODE) is None


def test_requests_that_nobody_waits_for_do_not_queue_up(sdo, line, worker):
    sdo.ask(od.DEVICE_TYPE)
    assert line.begun.wait(LIMIT_S)
    for _ in range(20):
        sdo.ask(od.ERROR_CODE)
    line.may_answer.set()
    finish(worker)
    assert line.requests == [od.DEVICE_TYPE.index, od.ERROR_CODE.index]


def test_requests_without_an_answer_are_counted_until_one_is_answered(sdo, line, worker):
    line.may_answer.set()
    for trouble, count in (
        (MailboxSilence("no answer"), 1),
        (MailboxSilence("no answer"), 2),
        (MailboxAbort(0x0602_0000, "no such object"), 0),
        (MailboxSilence("no answer"), 1),
        (None, 0),
    ):
        line.trouble = trouble
        sdo.ask(od.DEVICE_TYPE)
        finish(worker)
        assert sdo.unanswered == count
        assert (sdo.answer(od.DEVICE_TYPE) is None) == (trouble is not None)


class Direct:
    """A line that answers at once, and notes what was asked of which drive."""

    def __init__(self):
        self.asked, self.trouble = [], None

    def _note(self, *asked):
        self.asked.append(asked)
        if self.trouble is not None:
            raise self.trouble

    def upload(self, *asked):
        self._note(*asked)
        return b"\x34\x12"

    def download(self, *asked):
        self._note(*asked)

    def watchdog_us(self, *asked):
        self._note(*asked)
        return 100_000

    def set_watchdog_us(self, *asked):
        self._note(*asked)


def test_objects_and_the_watchdog_are_read_and_written_at_the_drives_place(worker):
    line = Direct()
    sdo = CoeSdo(3, "joint_3", line, worker, 0.5)
    assert sdo.read(od.STATUSWORD) == 0x1234
    sdo.write(od.MODE, 8)
    assert sdo.read(SYNC_MANAGER_WATCHDOG_US) == 100_000
    sdo.write(SYNC_MANAGER_WATCHDOG_US, 70_000)
    assert line.asked[:4] == [(2, 0x6041, 0, 0.5), (2, 0x6060, 0, b"\x08", 0.5), (2,), (2, 70_000)]


@pytest.mark.parametrize(
    ("verb", "act"), [("reading", lambda sdo: sdo.read(od.MODE)), ("writing", lambda sdo: sdo.write(od.MODE, 8))]
)
def test_what_a_drive_refuses_or_leaves_open_is_said_with_its_object(worker, verb, act):
    line = Direct()
    sdo = CoeSdo(3, "joint_3", line, worker, 0.5)
    line.trouble = MailboxAbort(0x0601_0002, "read-only")
    with pytest.raises(SdoRefused, match=f"(?i)joint_3.*{verb} 6060:0 modes of operation") as refused:
        act(sdo)
    assert refused.value.abort_code == 0x0601_0002
    line.trouble = MailboxSilence("no answer within 0.5 s")
    with pytest.raises(ServoTimeout, match=f"joint_3.*{verb} 6060:0 modes of operation: no answer within 0.5 s"):
        act(sdo)


def test_only_another_sub_index_of_the_same_object_needs_one_in_between(sdo, line, worker):
    line.may_answer.set()
    for entry in (od.INTERPOLATION_TIME, od.INTERPOLATION_TIME, od.ERROR_CODE, od.DEVICE_TYPE, od.DEVICE_TYPE):
        sdo.ask(entry)
        finish(worker)
    assert line.requests == [0x60C2, 0x60C2, 0x603F, 0x1000, 0x1000]
