"""SYNC by a simulated kernel: credit, phase and time come from the received frames."""

import socket
import struct
from itertools import pairwise

import pytest

from armload_drivers.bus.kernel_sync import BcmSync, BroadcastManager
from armload_drivers.driver_errors import BusError, ForeignMaster
from armload_drivers.simulation.virtual_clock import VirtualClock

CREDIT = 2

PERIOD_S = 0.01


class Kernel:
    """Sends SYNC while it has credit, each period a microsecond late; waiting on the bus lets time pass."""

    def __init__(self, clock, latency_s=1e-6):
        self.clock, self.latency_s = clock, latency_s
        self.credit, self.due_s, self.running = 0, None, False
        self.calls, self.sent_s, self.queue = [], [], []
        self.handlers, self.stamp_s = {}, 0.0
        self.mute = self.from_outside = False
        self.counts, self.sent = True, 0
        self.stamp_shift_s = 0.0

    # What the source calls.
    def start(self, period_s, counter, credit):
        assert 0.9 * PERIOD_S <= period_s <= PERIOD_S
        self.asked_s = period_s
        self.calls.append("start")
        self.credit = credit
        self._send()

    def renew(self, period_s, credit):
        assert 0.9 * PERIOD_S <= period_s <= PERIOD_S
        self.asked_s = period_s
        self.calls.append("renew")
        if self.due_s is not None:
            self.credit = credit

    def count(self):
        return self.sent if self.counts else None

    def stop(self):
        self.calls.append("stop")
        self.due_s = None

    def _send(self):
        self.sent += 1
        if not self.mute:
            self.sent_s.append(self.clock())
            self.queue.append(self.clock())
        self.credit -= 1
        self.due_s = self.clock() + self.asked_s + self.latency_s if self.credit else None

    # The bus.
    def subscribe(self, cob_id, handler):
        self.handlers[cob_id] = handler

    def unsubscribe(self, cob_id):
        self.handlers.pop(cob_id, None)

    def drain(self):
        while self.queue:
            self.stamp_s = self.queue.pop(0) + self.stamp_shift_s
            self.handlers[0x080](b"")

    def pump_until(self, done, timeout_s):
        end_s = self.clock() + timeout_s
        while not done():
            if self.queue:
                self.stamp_s = self.queue.pop(0) + self.stamp_shift_s + self.stamp_shift_s
                self.handlers[0x080](b"")
                continue
            if self.clock() >= end_s:
                return False
            self.pass_time(min(1e-3, end_s - self.clock() + 1e-9))
        return True

    def pass_time(self, seconds):
        end_s = self.clock() + seconds
        while self.due_s is not None and self.due_s <= end_s:
            self.clock.advance(self.due_s - self.clock())
            self._send()
        self.clock.advance(max(0.0, end_s - self.clock()))


@pytest.fixture
def clock():
    return VirtualClock()


@pytest.fixture
def kernel(clock):
    return Kernel(clock)


@pytest.fixture
def sync(kernel, clock):
    source = BcmSync(kernel, clock=clock, stamp_clock=clock)
    source.begin(kernel, PERIOD_S, 0)
    return source


def twenty_times(action):
    for _ in range(20):
        action()


def nothing():
    pass


def test_time_is_that_of_the_frames_and_every_cycle_renews_the_credit(sync, kernel):
    ticks = [sync.next(kernel, nothing) for _ in range(50)]
    assert [tick.time_s for tick in ticks] == pytest.approx(kernel.sent_s)
    assert all(tick.skipped == 0 for tick in ticks)
    assert kernel.calls == ["start"] + ["renew"] * 49
    drifted_s = ticks[-1].time_s - ticks[0].time_s
    assert 49 * PERIOD_S < drifted_s < 49 * (PERIOD_S + 1e-6), (
        "the kernel's drift is seen, and less and less of it there"
    )


def test_a_stalled_cycle_ends_sync_within_two_periods(sync, kernel):
    for _ in range(5):
        sync.next(kernel, nothing)
    before = len(kernel.sent_s)
    kernel.pass_time(1.0)
    assert len(kernel.sent_s) - before <= CREDIT
    assert kernel.sent_s[-1] - kernel.sent_s[before - 1] <= 2.1 * PERIOD_S


def test_a_cycle_that_comes_back_starts_anew_with_one_sync_and_counts_what_it_missed(sync, kernel):
    for _ in range(5):
        sync.next(kernel, nothing)
    kernel.pass_time(0.105)
    before = len(kernel.sent_s)
    tick = sync.next(kernel, nothing)
    assert len(kernel.sent_s) == before + 1, "no burst"
    assert tick.skipped == 10
    assert sync.next(kernel, nothing).skipped == 0


def test_a_sync_that_nobody_used_is_skipped(sync, kernel):
    sync.next(kernel, nothing)
    kernel.pass_time(1.2 * PERIOD_S)
    assert sync.next(kernel, nothing).skipped == 1
    assert min(after - before for before, after in pairwise(kernel.sent_s)) >= 0.99 * PERIOD_S


def test_credit_that_runs_out_between_the_look_and_its_renewal(sync, kernel):
    sync.next(kernel, nothing)
    # The kernel has sent its last frame, which has not been received yet.
    kernel.pass_time(1.2 * PERIOD_S)
    kernel.queue.clear()
    kernel.due_s = None
    assert sync.next(kernel, nothing).time_s == kernel.sent_s[-1]
    assert kernel.calls[-2:] == ["renew", "start"]


def test_sync_that_does_not_leave_is_an_error(sync, kernel):
    kernel.mute = True
    with pytest.raises(BusError, match="SYNC"):
        sync.next(kernel, nothing)


def test_another_producer_is_reported_once(sync, kernel):
    def with_another_producer():
        kernel.pass_time(0.3 * PERIOD_S)
        kernel.queue.append(kernel.clock())
        kernel.drain()
        return sync.next(kernel, nothing)

    sync.next(kernel, nothing)
    with pytest.raises(ForeignMaster):
        twenty_times(with_another_producer)
    twenty_times(with_another_producer)


def test_a_process_that_is_not_run_again_and_again_is_no_other_producer(sync, kernel):
    """The process receives several frames at once, late."""
    for cycle in range(200):
        sync.next(kernel, nothing)
        kernel.pass_time((0.9 if cycle % 2 else 7.3) * PERIOD_S)


def test_a_clock_that_is_set_back_is_no_other_producer(kernel, clock):
    source = BcmSync(kernel, clock=clock, stamp_clock=lambda: clock() + kernel.stamp_shift_s)
    source.begin(kernel, PERIOD_S, 0)
    for cycle in range(100):
        source.next(kernel, nothing)
        if cycle == 50:
            kernel.stamp_shift_s = -5.0


def test_feedback_belongs_to_the_sync_it_follows(sync, kernel):
    order = []
    sync.next(kernel, lambda: order.append(kernel.clock()))
    assert order == kernel.sent_s
    begun_s = kernel.clock()
    sync.await_feedback(kernel, lambda: False)
    assert kernel.clock() - begun_s == pytest.approx(0.6 * PERIOD_S)
    sync.end(kernel)
    assert kernel.calls[-1] == "stop"
    assert 0x080 not in kernel.handlers


def test_a_sync_that_came_in_over_the_bus_is_somebody_elses(sync, kernel):
    sync.next(kernel, nothing)
    kernel.from_outside = True
    with pytest.raises(ForeignMaster, match="was received from the bus"):
        sync.next(kernel, nothing)
    sync.next(kernel, nothing)


def cycles_until_reported(sync, kernel, most):
    for cycle in range(most):
        try:
            sync.next(kernel, nothing)
        except ForeignMaster as error:
            return cycle, str(error)
    return None


def test_one_sync_too_many_is_counted_at_once_however_rare_it_is(sync, kernel):
    assert cycles_until_reported(sync, kernel, 100) is None, "alone"
    kernel.queue.append(kernel.clock())
    cycle, text = cycles_until_reported(sync, kernel, 100)
    assert cycle == 0
    assert "SYNCs were received, but the kernel has sent" in text
    assert cycles_until_reported(sync, kernel, 100) is None, "reported once"


def test_where_the_kernel_reports_no_count_the_rhythm_is_left(sync, kernel):
    kernel.counts = False
    kernel.queue.append(kernel.clock())
    assert cycles_until_reported(sync, kernel, 100) is None, "one more is within what may happen"

    def crowd():
        kernel.pass_time(0.3 * PERIOD_S)
        kernel.queue.append(kernel.clock())
        sync.next(kernel, nothing)

    with pytest.raises(ForeignMaster, match="is more frequent"):
        for_ever(crowd)


def for_ever(action, most=1000):
    for _ in range(most):
        action()


def test_a_sync_that_the_kernel_still_owes_is_not_doubled(sync, kernel):
    """The credit was renewed right after a SYNC that was sent but not received: there is one more than counted."""
    kernel.latency_s = -1e-4
    sync.next(kernel, nothing)
    sync.next(kernel, nothing)
    sync._credit_left = 0
    before = len(kernel.sent_s)
    for _ in range(5):
        sync.next(kernel, nothing)
    gaps = [after - earlier for earlier, after in pairwise(kernel.sent_s[before - 1 :])]
    assert len(gaps) == 5
    assert min(gaps) > 0.9 * PERIOD_S, "no two SYNCs back to back"


def test_syncs_that_were_sent_and_not_heard_accuse_nobody(sync, kernel):
    for cycle in range(100):
        kernel.sent += cycle % 7 == 0
        sync.next(kernel, nothing)


@pytest.mark.parametrize("latency_s", [0.0, 1e-4, 6e-4])
def test_the_kernels_latency_is_taken_off_what_is_asked_for(clock, latency_s):
    kernel = Kernel(clock, latency_s)
    sync = BcmSync(kernel, clock=clock, stamp_clock=clock)
    sync.begin(kernel, PERIOD_S, 0)
    ticks = [sync.next(kernel, nothing).time_s for _ in range(300)]
    periods = [after - before for before, after in pairwise(ticks[200:])]
    assert sum(periods) / len(periods) == pytest.approx(PERIOD_S, abs=2e-6)
    assert all(period <= PERIOD_S + 1e-3 for period in periods)


def test_a_timer_that_is_far_too_late_is_not_chased(clock):
    kernel = Kernel(clock, 3e-3)
    sync = BcmSync(kernel, clock=clock, stamp_clock=clock)
    sync.begin(kernel, PERIOD_S, 0)
    for _ in range(300):
        sync.next(kernel, nothing)
    assert kernel.asked_s == pytest.approx(0.9 * PERIOD_S)


@pytest.mark.parametrize(
    ("share", "steers"), [(-500.0, False), (0.5, False), (0.51, True), (1.49, True), (1.5, False), (2.0, False)]
)
def test_a_period_that_is_no_latency_steers_nothing(sync, share, steers):
    sync._steer(1.1 * PERIOD_S)
    asked_s = sync._asked_s
    assert asked_s < PERIOD_S
    sync._steer(share * PERIOD_S)
    assert (sync._asked_s != asked_s) is steers
    assert (sync._asked_s > asked_s) is (steers and share < 1.0)


# The broadcast manager, as far as it needs no interface ------------------------------------------------------------


def test_a_kernel_that_refuses_is_named_with_the_interface():
    manager = BroadcastManager("no_such_can")
    for _ in range(2):
        with pytest.raises(BusError, match=r"does not send SYNC on no_such_can.*modprobe can-bcm"):
            manager.start(PERIOD_S, 0, CREDIT)
        assert manager.count() is None
        manager.stop()


def test_nothing_is_renewed_that_was_not_started():
    manager = BroadcastManager("no_such_can")
    assert manager.count() is None
    with pytest.raises(BusError, match="not started"):
        manager.renew(PERIOD_S, CREDIT)


def test_a_socket_that_has_failed_is_a_bus_error():
    manager = BroadcastManager("no_such_can")
    manager._socket = socket.socket()
    manager._socket.close()
    with pytest.raises(BusError, match="does not send SYNC on no_such_can"):
        manager.renew(PERIOD_S, CREDIT)


# The kernel's interface ------------------------------------------------------------------------------------------


class Socket:
    """Notes what is sent to the kernel."""

    def __init__(self, *kind):
        self.kind, self.sent, self.to, self.closed = kind, [], None, False

    def connect(self, address):
        self.to = address

    def send(self, data):
        self.sent.append(data)

    def fileno(self):
        return 0

    def close(self):
        self.closed = True


@pytest.fixture
def manager(monkeypatch):
    made = []
    monkeypatch.setattr(socket, "socket", lambda *kind: made.append(Socket(*kind)) or made[-1])
    return BroadcastManager("can7"), made


def test_the_kernel_gets_a_task_of_so_many_frames(manager):
    """struct bcm_msg_head of linux/can/bcm.h: TX_SETUP 1; SETTIMER 1 and STARTTIMER 2; ival1 in s and us."""
    bcm, made = manager
    with pytest.raises(BusError, match="SYNC was not started"):
        bcm.renew(0.004, 2)
    bcm.start(1.25, 3, 2)
    bcm.renew(0.004, 5)
    (opened,) = made
    assert opened.to == ("can7",)
    started, renewed = opened.sent
    assert struct.unpack_from("@III4lII0q", started) == (1, 3, 2, 1, 250_000, 0, 0, 0x080, 3)
    assert struct.unpack_from("@III4lII0q", renewed) == (1, 1, 5, 0, 4000, 0, 0, 0x080, 3)
    frames = started[struct.calcsize("@III4lII0q") :]
    assert [struct.unpack_from("=IB3x8s", frames, at) for at in (0, 16, 32)] == [
        (0x080, 1, bytes([number]) + bytes(7)) for number in (1, 2, 3)
    ]
    bcm.stop()
    bcm.stop()
    assert opened.closed


@pytest.mark.parametrize(
    ("account", "count"),
    [
        ("rx_op: 080 [1]\ntx_op: 080 [1] timer=4000 # sent 4711\n", 4711),
        ("tx_op: 081 [1] # sent 5\n", None),
        ("", None),
    ],
)
def test_the_kernels_own_count_is_read(manager, monkeypatch, account, count):
    from armload_drivers.bus import kernel_sync

    bcm, _ = manager
    assert bcm.count() is None, "not started"
    bcm.start(0.004, 0, 2)
    monkeypatch.setattr(kernel_sync.Path, "read_text", lambda path, encoding: account)
    assert bcm.count() == count

    def missing(path, encoding):
        raise FileNotFoundError

    monkeypatch.setattr(kernel_sync.Path, "read_text", missing)
    assert bcm.count() is None
