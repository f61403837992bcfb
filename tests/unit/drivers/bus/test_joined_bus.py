"""Two buses as one: where frames go, which are received, and the one SYNC for both."""

import time

import can
import pytest

from armload_drivers.bus import joined_bus
from armload_drivers.bus.joined_bus import BusRole, JoinedBus

CYCLE_S = 0.01
SYNC, TPDO, RPDO, SDO, HEARTBEAT = 0x80, 0x180, 0x200, 0x600, 0x700


class Half(can.BusABC):
    """A bus that keeps what is sent and gives what was put into it."""

    def __init__(self):
        super().__init__(channel="half")
        self.channel_info = "half"
        self.sent, self.queue, self.closed, self.broken = [], [], 0, False

    def send(self, msg, timeout=None):
        if self.broken:
            raise can.CanOperationError("gone")
        self.sent.append((msg.arbitration_id, bytes(msg.data)))

    def recv(self, timeout=None):
        return self.queue.pop(0) if self.queue else None

    def shutdown(self):
        super().shutdown()
        self.closed += 1

    def put(self, cob_id, data=b"", stamp_s=0.0, *, own=False):
        message = can.Message(arbitration_id=cob_id, data=data, is_extended_id=False, timestamp=stamp_s, is_rx=not own)
        self.queue.append(message)


@pytest.fixture
def joined():
    """Makes two buses with nodes 1 and 2 on the first, 3 on the second."""
    made = []

    def make(role=BusRole.MASTER):
        halves = Half(), Half()
        made.append(JoinedBus(halves, [frozenset({1, 2}), frozenset({3})], role, CYCLE_S))
        return made[-1], *halves

    yield make
    for bus in made:
        bus.shutdown()


def send(bus, cob_id, data=b""):
    bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))


@pytest.mark.parametrize(
    ("cob_id", "data", "where"),
    [
        (RPDO + 1, b"\1", "a"), (RPDO + 3, b"\1", "b"), (SDO + 2, b"", "a"), (SDO + 3, b"", "b"),
        (0, b"\x81\x03", "b"), (0, b"\x81\x02", "a"), (0, b"\x01\x00", "ab"), (SYNC, b"", "ab"),
        (HEARTBEAT + 127, b"\5", "ab"), (SDO + 9, b"", "ab"), (0x7E5, b"", "ab"),
    ],
)  # fmt: skip
def test_a_frame_goes_to_the_bus_of_its_node_and_a_broadcast_to_both(joined, cob_id, data, where):
    bus, first, second = joined()
    send(bus, cob_id, data)
    assert [half.sent == [(cob_id, data)] for half in (first, second)] == ["a" in where, "b" in where]
    assert [bits > 0 for bits in bus.bits] == ["a" in where, "b" in where]


def test_a_frame_of_another_buss_node_is_not_the_arms(joined):
    bus, first, second = joined()
    first.put(TPDO + 3)
    second.put(TPDO + 1)
    assert bus.recv(0.0) is None
    first.put(TPDO + 1)
    second.put(TPDO + 3)
    second.put(TPDO + 9)
    assert [bus.recv(0.0).arbitration_id for _ in range(3)] == [TPDO + 1, TPDO + 3, TPDO + 9]
    second.put(TPDO + 1)
    with bus.reaching_everywhere():
        send(bus, SDO + 1)
        assert bus.recv(0.0).arbitration_id == TPDO + 1
    assert first.sent == second.sent == [(SDO + 1, b"")]


def test_the_oldest_frame_is_first(joined):
    bus, first, second = joined()
    first.put(TPDO + 1, stamp_s=2.0)
    first.put(TPDO + 2, stamp_s=3.0)
    second.put(TPDO + 3, stamp_s=1.0)
    assert [bus.recv(0.0).timestamp for _ in range(3)] == [1.0, 2.0, 3.0]
    assert bus.recv(0.001) is None


def test_an_error_of_one_bus_is_raised_when_the_other_has_been_tried(joined):
    bus, first, second = joined()
    first.broken = True
    with pytest.raises(can.CanOperationError):
        send(bus, SYNC)
    assert second.sent == [(SYNC, b"")]
    second.put(0x004, own=False)
    second.queue[-1].is_error_frame = True
    assert bus.recv(0.0).is_error_frame


def test_the_kernels_sync_is_sent_on_at_once_and_only_while_fresh(joined):
    bus, first, second = joined(BusRole.PACED_BY_KERNEL)
    now_s = time.time()
    first.put(SYNC, b"\1", now_s, own=True)
    assert bus.recv(0.0).arbitration_id == SYNC
    assert second.sent == [(SYNC, b"\1")]
    first.put(SYNC, b"\2", now_s, own=True)
    bus.recv(0.0)
    assert len(second.sent) == 1, "two at once would be a burst"
    bus._relayed_s = 0.0
    first.put(SYNC, b"\3", now_s - CYCLE_S, own=True)
    bus.recv(0.0)
    assert len(second.sent) == 1, "a stale one is not made up for"
    first.put(SYNC, b"\4", time.time())
    bus.recv(0.0)
    assert len(second.sent) == 1, "another node's is not sent on"
    assert "SYNC reached the last bus" in bus.take_skew()
    assert bus.take_skew() == ""


def test_sync_on_the_second_bus_is_a_foreign_one_to_a_master(joined):
    bus, _, second = joined(BusRole.PACED_BY_KERNEL)
    second.put(SYNC, own=True)
    assert bus.recv(0.0).is_rx


def test_sync_is_heard_once_by_a_listener_and_on_their_own_bus_by_drives(joined):
    bus, first, second = joined(BusRole.LISTENER)
    second.put(SYNC)
    first.put(SYNC)
    assert bus.recv(0.0).channel == 0
    assert bus.recv(0.0) is None
    drives, first, second = joined(BusRole.DRIVES)
    second.put(SYNC)
    first.put(SYNC)
    assert {drives.recv(0.0).channel for _ in range(2)} == {0, 1}
    assert not second.sent


def test_both_are_closed(joined):
    bus, first, second = joined()
    bus.shutdown()
    assert first.closed
    assert second.closed


@pytest.fixture
def clock(monkeypatch):
    """Time that the test sets, for stamps and for waits."""

    class Clock:
        now_s = 1000.0

        def time(self):
            return self.now_s

        def monotonic(self):
            return self.now_s

    clock = Clock()
    monkeypatch.setattr(joined_bus, "time", clock)
    return clock


@pytest.mark.parametrize(("age_s", "sent_on"), [(0.4 * CYCLE_S, True), (0.6 * CYCLE_S, False)])
def test_a_sync_is_stale_after_half_a_cycle(joined, clock, age_s, sent_on):
    bus, first, second = joined(BusRole.PACED_BY_KERNEL)
    first.put(SYNC, b"", clock.now_s - age_s, own=True)
    bus.recv(0.0)
    assert bool(second.sent) is sent_on


@pytest.mark.parametrize(("after_s", "count"), [(0.4 * CYCLE_S, 1), (0.6 * CYCLE_S, 2)])
def test_two_syncs_are_half_a_cycle_apart(joined, clock, after_s, count):
    bus, first, second = joined(BusRole.PACED_BY_KERNEL)
    for _ in range(2):
        first.put(SYNC, b"", clock.now_s, own=True)
        bus.recv(0.0)
        clock.now_s += after_s
    assert len(second.sent) == count
    assert bus.bits[1] == count * bus.bits[0] // 2, "each of its frames counts, and each received one"


def test_the_distance_of_sync_on_the_buses_is_told_as_median_and_worst(joined, clock):
    bus, _, second = joined()
    whole = second.send
    for delay_s in (0.001, 0.004, 0.002):

        def late(message, timeout, delay_s=delay_s):
            clock.now_s += delay_s
            whole(message)

        second.send = late
        send(bus, SYNC)
    send(bus, TPDO + 1)
    assert bus.take_skew() == "SYNC reached the last bus 2.00 ms after the first (median; at most 4.00 ms)"
    assert bus.take_skew() == ""


def test_in_lockstep_nothing_is_measured_and_no_wait_is_long():
    halves = Half(), Half()
    bus = JoinedBus(halves, [frozenset({1}), frozenset({3})], BusRole.MASTER, CYCLE_S, in_lockstep=True)
    send(bus, SYNC)
    assert bus.take_skew() == ""
    assert bus.recv(None) is None
    assert bus.recv(60.0) is None
    heard = []
    for half in halves:
        half.listen = heard.append
    bus.listen(heard.append)
    message = can.Message(arbitration_id=TPDO + 3, is_extended_id=False)
    for listener in heard[:2]:
        listener(message)
    assert heard[2:] == [message], "of the bus that has node 3"
    bus.listen(None)
    assert heard[-2:] == [None, None]
    bus.shutdown()


@pytest.mark.parametrize(("timeout_s", "waited_s"), [(None, [5e-4, 5e-4]), (0.1, [5e-4, 5e-4]), (1e-4, [1e-4, 1e-4])])
def test_buses_that_cannot_be_waited_for_together_are_waited_for_in_turn(joined, clock, timeout_s, waited_s):
    bus, first, second = joined()
    waited = []

    def recv(timeout=None):
        if timeout:
            waited.append(timeout)
            clock.now_s += timeout
            second.put(TPDO + 3)

    first.recv, whole = recv, second.recv
    second.recv = lambda timeout: (waited.append(timeout) if timeout else None) or whole()
    assert bus.recv(timeout_s).arbitration_id == TPDO + 3
    assert waited == pytest.approx(waited_s)
