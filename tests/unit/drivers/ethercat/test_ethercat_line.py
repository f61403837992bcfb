"""Mailbox requests, with a library that compares answers as SOEM does."""

from contextlib import closing
from types import SimpleNamespace

import pytest

from armload_drivers.ethercat import ethercat_line
from armload_drivers.ethercat.ethercat_line import EthercatLine, MailboxSilence

BRIEF_S, LIMIT_S = 1e-3, 1.0
VALUES = {(0x1000, 0): b"\x92\x01", (0x1018, 0): b"\x04", (0x60C2, 1): b"\x04", (0x60C2, 2): b"\xfd"}


class PacketError(Exception):
    """An answer to something else."""


class WkcError(Exception):
    """No answer."""


class Drive:
    """Answers a request that it got while it was silent later, in place of another; only the index is compared."""

    def __init__(self):
        self.silent, self.late, self.asked = False, None, []

    def sdo_read(self, index, subindex, size=None):
        self.asked.append((index, subindex))
        if self.silent:
            self.late = self.late or (index, subindex)
            raise WkcError
        answered, self.late = self.late or (index, subindex), None
        if answered[0] != index:
            raise PacketError
        return VALUES[answered]


@pytest.fixture
def drive():
    return Drive()


@pytest.fixture
def line(drive, monkeypatch):
    master = SimpleNamespace(
        open=lambda interface: None, config_init=lambda: 1, slaves=[drive], context_initialized=False
    )
    never = type("Never", (Exception,), {})
    library = SimpleNamespace(
        Master=lambda: master, WkcError=WkcError, PacketError=PacketError, MailboxError=never, SdoInfoError=never,
        SdoError=never, Emergency=never,
    )  # fmt: skip
    monkeypatch.setattr(ethercat_line, "soem", lambda: library)
    monkeypatch.setattr(EthercatLine, "request", lambda self, state, place=None: None)
    with closing(EthercatLine("eth1")) as line:
        line.find()
        yield line


@pytest.mark.parametrize(("given_up", "wanted"), [((0x60C2, 1), (0x60C2, 2)), ((0x1000, 0), (0x1000, 0))])
def test_the_answer_to_a_request_that_was_given_up_is_not_taken_for_another(line, drive, given_up, wanted):
    """Both have the same index; the late answer is taken by a request for another object, which fails."""
    drive.silent = True
    with pytest.raises(MailboxSilence):
        line.upload(0, *given_up, BRIEF_S)
    drive.silent, drive.asked = False, []
    assert line.upload(0, *wanted, LIMIT_S) == VALUES[wanted]
    assert drive.asked[0][0] != wanted[0]
    drive.asked = []
    assert line.upload(0, *wanted, LIMIT_S) == VALUES[wanted]
    assert drive.asked == [wanted], "once is enough"


def test_the_clock_of_a_drive_is_its_lines_if_it_has_one(line, drive):
    given = []
    drive.dc_sync = lambda *arguments: given.append(arguments)
    line._master.config_dc = lambda: False
    assert not line.follow_clock(0, 2e-3)
    assert given == [], "without a clock SYNC0 would never come"
    line._master.config_dc = lambda: True
    assert line.follow_clock(0, 2e-3)
    assert given == [(True, 2_000_000)], "on, every 2 ms in ns"
