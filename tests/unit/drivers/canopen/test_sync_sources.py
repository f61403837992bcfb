"""SYNC sources on a clock that the test moves."""

import pytest

from armload_drivers.canopen.sync_sources import LockstepSync, TimerSync
from armload_drivers.driver_errors import SimulationError
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
        # Half of the wait: a frame came in between.
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


class Patient:
    """A link on which somebody waits: keeps for how long, and lets things happen meanwhile."""

    def __init__(self, happens=None):
        self.waited_s, self.looks, self.drained = [], 0, 0
        self.happens = happens or {}

    def pump_until(self, done, timeout_s):
        self.waited_s.append(timeout_s)
        return done()

    def pump(self, timeout_s):
        self.waited_s.append(timeout_s)
        self.looks += 1
        self.happens.get(self.looks, nothing)()
        return False

    def drain(self):
        self.drained += 1


def never():
    return False


def test_feedback_has_a_share_of_the_cycle(clock, link):
    sync = TimerSync(feedback_share=0.5, clock=clock)
    sync.begin(link, 0.01, 0)
    patient = Patient()
    sync.await_feedback(patient, never)
    assert patient.waited_s == pytest.approx([0.005])


def test_lockstep_waits_for_as_long_as_the_drives_live(clock):
    """More than a minute on a machine that has no time for them, and the feedback still comes."""
    clock.follow(str)
    clock.advance(0.01)
    patient = Patient({40_000: lambda: clock.acted(clock())})
    LockstepSync(clock, patience_s=1e9).await_feedback(patient, lambda: patient.drained > 0)
    assert sum(patient.waited_s) > 60.0
    assert patient.drained == 1, "what was sent before they said so is taken in"


def test_lockstep_does_not_wait_for_what_was_not_sent(clock):
    clock.follow(str)
    clock.advance(0.01)
    patient = Patient({3: lambda: clock.acted(clock())})
    LockstepSync(clock).await_feedback(patient, never)
    assert (patient.looks, patient.drained) == (3, 1)
    clock.advance(0.01)
    patient.happens[5] = lambda: clock.acted(clock())
    LockstepSync(clock).await_feedback(patient, never)
    assert patient.looks == 5, "what they did at another time does not count"


def test_lockstep_names_drives_that_do_not_live_any_more(clock):
    reasons = ["", "", "their thread ended early"]
    clock.follow(lambda: reasons.pop(0))
    clock.advance(0.01)
    with pytest.raises(SimulationError, match="do not act any more: their thread ended early"):
        LockstepSync(clock).await_feedback(Patient(), never)


def test_lockstep_does_not_wait_for_ever(clock):
    clock.follow(str)
    clock.advance(0.01)
    with pytest.raises(SimulationError, match="live and have not acted"):
        LockstepSync(clock, patience_s=0.0).await_feedback(Patient(), never)


def test_lockstep_with_drives_that_tell_nothing_waits_a_second(clock):
    patient = Patient()
    LockstepSync(clock).await_feedback(patient, never)
    assert patient.waited_s == [1.0]
