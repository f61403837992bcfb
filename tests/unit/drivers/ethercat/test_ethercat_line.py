"""Mailbox requests, with a library that compares answers as SOEM does."""

from contextlib import closing, nullcontext
from types import SimpleNamespace

import pytest

from armload_drivers.driver_errors import BusError, CommandError
from armload_drivers.ethercat import ethercat_line
from armload_drivers.ethercat.ethercat_line import EthercatLine, LineState, MailboxAbort, MailboxSilence, line_state_of

BRIEF_S, LIMIT_S = 1e-3, 1.0
VALUES = {(0x1000, 0): b"\x92\x01", (0x1018, 0): b"\x04"}
VALUES |= {(0x1018, 1): b"\x11", (0x1018, 2): b"\x22", (0x60C2, 1): b"\x04", (0x60C2, 2): b"\xfd"}


class PacketError(Exception):
    """An answer to something else."""


class WkcError(Exception):
    """No answer."""


class SdoError(Exception):
    def __init__(self, code, desc):
        super().__init__(desc)
        self.abort_code, self.desc = code, desc


class Drive:
    """Answers that come late, or once more, do so ahead of the next one; SOEM compares the index of those to reads."""

    def __init__(self):
        self.silent, self.twice, self.late, self.asked = False, False, None, []

    def _answered(self, asked, value):
        """What SOEM takes for the answer to this request."""
        self.asked.append(asked)
        if self.silent:
            self.late = self.late or (asked, value)
            raise WkcError
        (answered, found), self.late = self.late or (asked, value), (asked, value) if self.twice else None
        self.twice = False
        if found is None:
            raise SdoError(0x0602_0000, "no such object")
        if answered[0] != asked[0]:
            raise PacketError
        return found

    def sdo_read(self, index, subindex, size=None):
        return self._answered((index, subindex), VALUES.get((index, subindex)))

    def sdo_write(self, index, subindex, data):
        self._answered((index, subindex), b"")


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
        SdoError=SdoError, Emergency=never,
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


@pytest.mark.parametrize("first", [(0x1018, 1), (0x1000, 0), (0x60C2, 1), (0x6041, 7)])
def test_an_answer_that_comes_twice_is_not_taken_for_another(line, drive, first):
    """On a busy machine a drive's vendor was taken for its product; an abort would be for any object."""
    refused = pytest.raises(MailboxAbort) if first not in VALUES else nullcontext()
    for wanted in [entry for entry in VALUES if entry != first]:
        line.upload(0, 0x60C2, 2, LIMIT_S)
        with refused:
            line.upload(0, 0x1018, 0, LIMIT_S)
            drive.twice = True
            line.upload(0, *first, LIMIT_S)
        assert line.upload(0, *wanted, LIMIT_S) == VALUES[wanted]


def test_an_answer_to_a_write_is_not_taken_for_what_is_read_back(line, drive):
    line.upload(0, 0x1018, 0, LIMIT_S)
    drive.twice = True
    line.download(0, 0x60C2, 1, b"\x04", LIMIT_S)
    assert line.upload(0, 0x60C2, 1, LIMIT_S) == b"\x04"
    drive.twice = True
    line.upload(0, 0x60C2, 1, LIMIT_S)
    drive.asked = []
    line.download(0, 0x60C2, 1, b"\x05", LIMIT_S)
    assert drive.asked == [(0x1000, 0), (0x1000, 0), (0x60C2, 1)], "the value, once more, ended the first of these"


def test_a_drive_that_was_asked_by_another_master_is_not_believed_at_once(line, drive):
    drive.late = (0x1018, 1), b"\x11"
    assert line.upload(0, 0x1018, 2, LIMIT_S) == b"\x22"


def test_a_drive_that_refuses_what_every_drive_has_is_silent(line, drive, monkeypatch):
    monkeypatch.delitem(VALUES, (0x1000, 0))
    with pytest.raises(MailboxSilence, match="0x1000 was refused"):
        line.upload(0, 0x6041, 0, BRIEF_S)


def test_the_clock_of_a_drive_is_its_lines_if_it_has_one(line, drive):
    given = []
    drive.dc_sync = lambda *arguments: given.append(arguments)
    line._master.config_dc = lambda: False
    assert not line.follow_clock(0, 2e-3)
    assert given == [], "without a clock SYNC0 would never come"
    line._master.config_dc = lambda: True
    assert line.follow_clock(0, 2e-3)
    assert given == [(True, 2_000_000)], "on, every 2 ms in ns"


class ConfigMapError(Exception):
    def __init__(self, *errors):
        super().__init__()
        self.error_list = errors


class Emergency(Exception):
    pass


class Slave:
    """One of three drives of a line, with scripted answers: `says` is returned, or raised, in turn."""

    man, id, rev = 7, 8, 9

    def __init__(self, place):
        self.place, self.name, self.state, self.al_status = place, f"drive {place}", 8, 0x1B
        self.asked, self.says, self.written, self.received = [], [], [], 0
        self.output, self.input, self.watchdog = bytes(2 + place), bytes([place] * 4), None
        self.emergency = None

    def _answer(self, *asked):
        self.asked.append(asked)
        said = self.says.pop(0) if self.says else b"\x01"
        if isinstance(said, Exception):
            raise said
        return said

    def sdo_read(self, index, subindex, size=None):
        return self._answer(index, subindex, size)

    def sdo_write(self, index, subindex, data):
        return self._answer(index, subindex, data)

    def write_state(self):
        self.written.append(self.state)

    def state_check(self, state, limit_us):
        assert limit_us == 0
        return self._answer(state)

    def get_watchdog(self, which):
        return self._answer(which)

    def set_watchdog(self, which, time_ms):
        self._answer(which, time_ms)

    def get_max_watchdog_time(self):
        return 600.0

    def eeprom_read(self, word):
        assert word == 4, "the station alias, ETG.1000.6"
        return b"\x34\x12\xff\xff"

    def mbx_receive(self):
        self.received += 1
        if self.says:
            raise self.says.pop(0)

    def add_emergency_callback(self, take):
        self.emergency = take


class Master:
    context_initialized, expected_wkc = True, 9

    def __init__(self):
        self.slaves = [Slave(place) for place in range(3)]
        self.state, self.written, self.reads, self.closed = 0, [], 0, 0
        self.mapped = self.limits_us = None

    def open(self, interface):
        if interface == "none":
            raise ConnectionError("no such device")

    def close(self):
        self.closed += 1

    def config_init(self):
        return len(self.slaves) or -1

    def write_state(self):
        self.written.append(self.state)

    def read_state(self):
        self.reads += 1

    def config_map(self):
        if self.mapped is not None:
            raise self.mapped

    def send_processdata(self):
        self.limits_us = []

    def receive_processdata(self, limit_us):
        self.limits_us.append(limit_us)
        return 9.0


@pytest.fixture
def master():
    return Master()


@pytest.fixture
def made(master, monkeypatch):
    never = type("Never", (Exception,), {})
    library = SimpleNamespace(
        Master=lambda: master, WkcError=WkcError, PacketError=PacketError, MailboxError=never, SdoInfoError=never,
        SdoError=SdoError, Emergency=Emergency, ConfigMapError=ConfigMapError,
        al_status_code_to_string=lambda code: f"text of {code}",
    )  # fmt: skip
    monkeypatch.setattr(ethercat_line, "soem", lambda: library)
    with closing(EthercatLine("eth1")) as line:
        line.find()
        yield line


@pytest.mark.parametrize(
    ("status", "state"),
    [
        (0, "NONE"),
        (1, "INIT"),
        (2, "PREOP"),
        (3, "BOOT"),
        (4, "SAFEOP"),
        (8, "OP"),
        (0x14, "SAFEOP"),
        (0x11, "INIT"),
        (7, "NONE"),
    ],
)
def test_a_state_is_in_the_low_four_bits_of_the_al_status(status, state):
    """ETG.1000.6, register 0130."""
    assert line_state_of(status) is LineState[state]


def test_drives_are_found_in_preop_and_left_in_init(master, made):
    assert made.size == 3
    assert master.written == [2]
    made.close()
    assert (master.written, master.closed) == ([2, 1], 1)
    with pytest.raises(MailboxSilence, match="has 0 devices only"):
        made.upload(0, 0x1000, 0, LIMIT_S)
    master.context_initialized = False
    made.close()
    assert master.closed == 1


def test_an_empty_line_has_no_drives(master, made):
    master.slaves = []
    assert made.find() == 0
    assert master.written == [2], "nobody to be brought to PREOP"
    with pytest.raises(BusError, match="interface none cannot be opened: no such device"):
        EthercatLine("none")


def test_an_error_of_a_drive_is_acknowledged_before_a_state_is_requested(master, made):
    master.slaves[1].state = 0x14
    made.request(LineState.OP)
    assert [slave.written for slave in master.slaves] == [[], [0x14], []]
    assert master.written[-1] == 8
    made.request(LineState.SAFEOP, 2)
    assert master.slaves[2].written == [4], "of one drive only"
    assert master.written[-1] == 8
    assert made.statuses() == [8, 0x14, 4]
    assert made.reason(1) == "0x001B text of 27"


def test_a_state_is_awaited_within_its_limit_and_while_the_cable_is_in(master, made, monkeypatch):
    clock = SimpleNamespace(now=0.0)
    clock.monotonic = lambda: clock.now
    clock.sleep = lambda time_s: setattr(clock, "now", clock.now + time_s)
    monkeypatch.setattr(ethercat_line, "time", clock)
    monkeypatch.setattr(ethercat_line, "is_running", lambda interface: interface == "eth1")
    slave = master.slaves[1]
    slave.says = [2, 2, 0x18]
    assert made.reaches(LineState.OP, 1, 1.0)
    assert (slave.asked, clock.now) == ([(8,)] * 3, pytest.approx(0.004)), "a look every 2 ms"
    slave.says, clock.now = [2] * 1000, 0.0
    assert not made.reaches(LineState.OP, 1, 0.1)
    assert clock.now == pytest.approx(0.1, abs=0.0021)
    monkeypatch.setattr(ethercat_line, "is_running", lambda interface: False)
    clock.now = 0.0
    assert not made.reaches(LineState.OP, 1, 0.1)
    assert clock.now == 0.0


def test_a_request_is_repeated_until_its_limit(master, made):
    slave = master.slaves[1]
    made.upload(1, 0x6041, 0, LIMIT_S)
    slave.asked, slave.says = [], [Emergency(), WkcError(), AssertionError(), b"\x01", b"\x07\x08"]
    assert made.upload(1, 0x6041, 0, LIMIT_S) == b"\x07\x08"
    assert slave.asked == [(0x6041, 0, 256), *[(0x1000, 0, None)] * 3, (0x6041, 0, 256)], "another object in between"
    assert 0.9e6 < master.sdo_read_timeout <= 1e6
    assert master.sdo_write_timeout == master.sdo_read_timeout
    made.download(1, 0x6060, 0, b"\x08", LIMIT_S)
    assert slave.asked[-1] == (0x6060, 0, b"\x08")
    for trouble, why in (
        (Emergency(), "only an emergency message arrived"),
        (WkcError("lost"), "lost"),
        (WkcError(), "WkcError"),
        (AssertionError(), "an error of another drive"),
    ):
        slave.says = [trouble] * 100_000
        with pytest.raises(MailboxSilence, match=f"^{why}$"):
            made.upload(1, 0x6041, 0, BRIEF_S)
    with pytest.raises(MailboxSilence, match="no answer within 0 s"):
        made.upload(2, 0x6041, 0, 0.0)
    with pytest.raises(MailboxSilence, match="has 3 devices only"):
        made.upload(3, 0x6041, 0, LIMIT_S)


def test_a_refusal_is_an_abort_with_its_code_in_32_bits(master, made):
    master.slaves[0].says = [b"\x01", SdoError(0x0602_0000 - (1 << 32), "no such object")]
    with pytest.raises(MailboxAbort, match="no such object") as refused:
        made.upload(0, 0x6041, 0, LIMIT_S)
    assert refused.value.code == 0x0602_0000


def test_a_watchdogs_time_is_in_microseconds_and_limited_by_its_register(master, made):
    slave = master.slaves[0]
    slave.says = [100.25]
    assert made.watchdog_us(0) == 100_250
    made.set_watchdog_us(0, 600_000)
    assert slave.asked == [("processdata",), ("processdata", 600.0)]
    with pytest.raises(MailboxAbort, match="at most 600 ms are possible") as refused:
        made.set_watchdog_us(0, 600_001)
    assert refused.value.code == 0x0609_0031, "value of parameter written too high (CiA 301)"
    slave.says = [WkcError()] * 4 + [1.0]
    assert made.watchdog_us(0) == 1000, "in the fifth frame"
    slave.says = [WkcError()] * 5
    with pytest.raises(MailboxSilence, match="no answer to 5 frames"):
        made.watchdog_us(0)


def test_what_is_in_the_eeprom_is_told(made):
    assert made.alias(1) == 0x1234
    assert made.identity(2) == ("drive 2", 7, 8, 9)


def test_an_emergency_message_is_passed_on_with_the_makers_five_bytes(master, made):
    taken = []
    made.on_emergency(1, lambda *message: taken.append(message))
    master.slaves[1].emergency(SimpleNamespace(error_code=0x2310, error_reg=2, b1=0x11, w1=0x3322, w2=0x5544))
    assert taken == [(0x2310, 2, b"\x11\x22\x33\x44\x55")]
    master.slaves[1].says = [WkcError()]
    made.poll_mailbox(1)
    made.poll_mailbox(1)
    assert master.slaves[1].received == 2


def test_process_data_goes_out_with_its_exact_length_and_comes_in(master, made):
    assert made.map() == [(2, 4), (3, 4), (4, 4)]
    made.put(1, b"abc")
    assert master.slaves[1].output == b"abc"
    with pytest.raises(CommandError, match="4 bytes of outputs instead of 3"):
        made.put(1, b"abcd")
    assert made.get(2) == b"\2\2\2\2"
    assert (made.exchange(2.5e-3), master.limits_us, made.expected_counter) == (9, [2500], 9)
    master.mapped = ConfigMapError(WkcError("of 3"), PacketError())
    with pytest.raises(BusError, match="cannot be mapped: of 3; PacketError"):
        made.map()


def test_a_line_is_opened_only_if_nothing_else_uses_its_interface_and_it_may_be(master, made, monkeypatch):
    asked = []
    for name in ("require_unused", "require_quiet"):
        monkeypatch.setattr(ethercat_line, name, lambda interface, name=name: asked.append((name, interface)))
    monkeypatch.setattr(
        ethercat_line, "claimed_interface", lambda interface: closing(SimpleNamespace(close=lambda: None))
    )
    monkeypatch.setattr(ethercat_line, "missing_rights", lambda: "")
    with ethercat_line.open_line("eth7") as line:
        assert line.interface == "eth7"
    assert asked == [("require_unused", "eth7"), ("require_quiet", "eth7")]
    assert master.closed == 1
    monkeypatch.setattr(ethercat_line, "missing_rights", lambda: "no right to do so")
    with pytest.raises(BusError, match="no right to do so"), ethercat_line.open_line("eth7"):
        pytest.fail("opened")
