"""SYNC sources on a clock controlled by the test."""

from itertools import islice

import pytest

from armload_drivers.bus.sync_sources import TimerSync, sync_data, sync_messages
from armload_drivers.driver_errors import SimulationError
from armload_drivers.simulation.lockstep_sync import LockstepSync
from armload_drivers.simulation.virtual_clock import VirtualClock


class Link:
    """Records SYNCs; waiting on it lets time pass."""

    def __init__(self, clock):
        self.clock, self.sent_s = clock, []

    def send(self, message):
        assert message.arbitration_id == 0x080
        assert not message.is_extended_id
        self.sent_s.append(self.clock())

    def pump(self, timeout_s):
        # Half of the wait: a frame arrives before it ends.
        self.clock.advance(max(timeout_s / 2, 1e-6))
        return True

    def drain(self):
        pass


@pytest.fixture
def clock():
    return VirtualClock()


@pytest.fixture
def link(clock):
    return Link(clock)


def nothing():
    pass


def test_time_is_exact_after_a_million_cycles(clock):
    for _ in range(1_000_000):
        clock.advance(0.004)
    assert clock() == 4000.0


def test_lockstep_advances_time_by_a_period_before_each_sync(clock, link):
    sync = LockstepSync(clock)
    sync.begin(link, 0.004, 0)
    ticks = [sync.next(link, nothing) for _ in range(3)]
    sync.end(link)
    assert [tick.time_s for tick in ticks] == pytest.approx([0.004, 0.008, 0.012])
    assert link.sent_s == [tick.time_s for tick in ticks]
    assert all(tick.skipped == 0 for tick in ticks)


def test_a_timer_keeps_absolute_deadlines(clock, link):
    sync = TimerSync(clock=clock)
    sync.begin(link, 0.01, 0)
    for _ in range(100):
        clock.advance(0.0037)
        sync.next(link, nothing)
    assert link.sent_s == pytest.approx([0.01 * k for k in range(1, 101)], abs=1e-5)


@pytest.mark.parametrize(("late_s", "skipped"), [(0.0, 0), (0.0001, 1), (0.009, 1), (0.011, 2), (1.0, 101)])
def test_a_late_caller_skips_whole_periods_and_sends_no_burst(clock, link, late_s, skipped):
    sync = TimerSync(clock=clock)
    sync.begin(link, 0.01, 0)
    sync.next(link, nothing)
    clock.advance(0.02 + late_s - clock())
    tick = sync.next(link, nothing)
    assert tick.skipped == skipped
    assert tick.time_s == pytest.approx(0.02 + 0.01 * skipped, abs=1e-5)
    sync.next(link, nothing)
    assert len(link.sent_s) == 3
    assert link.sent_s[2] - link.sent_s[1] == pytest.approx(0.01, abs=1e-5)


def test_feedback_is_expected_from_right_before_sync(clock, link):
    for sync in (LockstepSync(clock), TimerSync(clock=clock)):
        order = []
        sync.begin(link, 0.01, 0)
        before = len(link.sent_s)
        sync.next(link, lambda order=order, before=before: order.append(len(link.sent_s) - before))
        assert order == [0]
        assert len(link.sent_s) == before + 1


def test_what_a_late_caller_has_not_read_belongs_to_an_earlier_sync(clock):
    order = []
    link = Link(clock)
    link.drain = lambda: order.append("drain")
    sync = TimerSync(clock=clock)
    sync.begin(link, 0.01, 0)
    clock.advance(0.02)
    sync.next(link, lambda: order.append("sync"))
    assert order == ["drain", "sync"]


class Patient:
    """A link that records how long its callers wait."""

    def __init__(self):
        self.waited_s, self.drained = [], 0

    def pump_until(self, done, timeout_s):
        self.waited_s.append(timeout_s)
        return done()

    def drain(self):
        self.drained += 1


def never():
    return False


def test_feedback_has_a_share_of_the_cycle(clock, link):
    sync = TimerSync(clock=clock)
    sync.begin(link, 0.01, 0)
    patient = Patient()
    sync.await_feedback(patient, never)
    assert patient.waited_s == pytest.approx([0.006])


def test_lockstep_takes_in_what_the_drives_have_sent_and_does_not_wait(clock):
    clock.follow(str)
    patient = Patient()
    LockstepSync(clock).await_feedback(patient, never)
    assert (patient.drained, patient.waited_s) == (1, [])


def test_lockstep_names_drives_that_do_not_live_any_more(clock):
    clock.follow(lambda: "they ended early")
    with pytest.raises(SimulationError, match="no longer act: they ended early"):
        LockstepSync(clock).await_feedback(Patient(), never)


def test_lockstep_does_not_ask_after_drives_that_have_answered(clock):
    clock.follow(lambda: "they ended early")
    LockstepSync(clock).await_feedback(Patient(), lambda: True)


def test_lockstep_without_drives_says_so(clock):
    with pytest.raises(SimulationError, match="none are running"):
        LockstepSync(clock).await_feedback(Patient(), never)


def test_a_counter_goes_from_one_to_its_overflow_value_and_begins_anew():
    """CiA 301, 7.2.5: the first SYNC after a start has 1."""
    assert [bytes(message.data) for message in islice(sync_messages(3), 5)] == [b"\1", b"\2", b"\3", b"\1", b"\2"]
    assert [bytes(message.data) for message in islice(sync_messages(), 2)] == [b"", b""]
    assert sync_data(240)[-1] == b"\xf0"
