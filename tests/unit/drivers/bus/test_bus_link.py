"""The master's end of the bus, with scripted bus failures."""

import errno
import time
from contextlib import nullcontext

import can
import pytest
from can import exceptions

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.bus.joined_bus import BusRole, JoinedBus
from armload_drivers.cia402.object_dictionary import NmtCommand
from armload_drivers.driver_errors import BusError

QUEUE_FULL_TRIES = 50


class FailingBus:
    """Raises the given errors on successive sends, and delivers the given frames."""

    def __init__(self, errors=(), frames=()):
        self.errors, self.frames, self.sent = list(errors), list(frames), []

    def send(self, message, timeout=None):
        if self.errors:
            raise self.errors.pop(0)
        self.sent.append(message)

    def recv(self, timeout=None):
        frame = self.frames.pop(0) if self.frames else None
        if isinstance(frame, Exception):
            raise frame
        return frame


def frame(cob_id, data=b"", **kind):
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False, **kind)


def every_can_error():
    kinds = [kind for kind in vars(exceptions).values() if isinstance(kind, type)]
    return [kind for kind in kinds if issubclass(kind, can.CanError)]


@pytest.mark.parametrize("kind", [*every_can_error(), OSError])
def test_every_error_of_python_can_is_a_bus_error(kind):
    with pytest.raises(BusError) as sending:
        BusLink(FailingBus(errors=[kind("broken")])).send(frame(0x80))
    assert isinstance(sending.value.__cause__, kind)
    with pytest.raises(BusError) as receiving:
        BusLink(FailingBus(frames=[kind("broken")])).pump(0.0)
    assert isinstance(receiving.value.__cause__, kind)


def queue_full():
    return can.CanOperationError("Failed to transmit", errno.ENOBUFS)


def test_a_full_queue_is_waited_for_and_nothing_received_meanwhile_is_lost():
    bus = FailingBus(errors=[queue_full()] * 3, frames=[frame(0x181, b"\x01"), frame(0x182, b"\x02")])
    link = BusLink(bus)
    seen = []
    link.subscribe(0x181, seen.append)
    link.subscribe(0x182, seen.append)
    link.send(frame(0x80))
    assert len(bus.sent) == 1
    assert seen == []
    assert [link.pump(0.0) for _ in range(3)] == [True, True, False]
    assert seen == [b"\x01", b"\x02"]


def test_a_queue_that_stays_full_is_an_error_that_names_the_cure():
    bus = FailingBus(errors=[queue_full()] * (QUEUE_FULL_TRIES + 2))
    with pytest.raises(BusError, match="txqueuelen"):
        BusLink(bus).send(frame(0x80))


def test_an_operating_systems_full_queue_counts_as_well():
    bus = FailingBus(errors=[OSError(errno.ENOBUFS, "No buffer space available")])
    BusLink(bus).send(frame(0x80))
    assert len(bus.sent) == 1


def test_bus_off_is_an_error_and_other_error_frames_are_counted():
    passive = can.Message(arbitration_id=0x04, is_error_frame=True, data=bytes(8))
    off = can.Message(arbitration_id=0x40, is_error_frame=True, data=bytes(8))
    link = BusLink(FailingBus(frames=[passive, off]))
    assert link.pump(0.0)
    assert link.error_frames == 1
    with pytest.raises(BusError, match="bus-off"):
        link.pump(0.0)


def error_frame(kind, data=bytes(8)):
    return can.Message(arbitration_id=kind, is_error_frame=True, data=data)


CONTROLLER, RESTARTED, PROTOCOL = 0x04, 0x100, 0x08
PASSIVE, WARNING, ACTIVE = (bytes([0, bits, 0, 0, 0, 0, 0, 0]) for bits in (0x30, 0x0C, 0x40))


@pytest.mark.parametrize(
    "end", [error_frame(CONTROLLER, WARNING), error_frame(CONTROLLER, ACTIVE), error_frame(RESTARTED)]
)
def test_a_controller_is_error_passive_until_it_reports_otherwise(end):
    passive = error_frame(CONTROLLER, PASSIVE)
    link = BusLink(FailingBus(frames=[passive, passive, end, passive]))
    states = []
    for _ in range(4):
        link.pump(0.0)
        states.append((link.error_passive, link.times_passive))
    assert states == [(True, 1), (True, 1), (False, 1), (True, 2)]


@pytest.mark.parametrize(
    "other", [error_frame(PROTOCOL, PASSIVE), error_frame(CONTROLLER, b"\0"), error_frame(CONTROLLER)]
)
def test_other_error_frames_say_nothing_about_the_controllers_state(other):
    link = BusLink(FailingBus(frames=[other, error_frame(CONTROLLER, PASSIVE), other]))
    states = []
    for _ in range(3):
        link.pump(0.0)
        states.append(link.error_passive)
    assert states == [False, True, True]
    assert link.error_frames == 3


def test_frames_of_another_kind_are_not_handled():
    extended = can.Message(arbitration_id=0x181, data=b"\x01", is_extended_id=True)
    link = BusLink(FailingBus(frames=[frame(0x181, is_remote_frame=True), extended, frame(0x181, b"\x02")]))
    seen = []
    link.subscribe(0x181, seen.append)
    assert [link.pump(0.0) for _ in range(4)] == [True, True, True, False]
    assert seen == [b"\x02"]


def test_a_bus_that_is_never_silent_ends_no_wait():
    class Busy(FailingBus):
        def recv(self, timeout=None):
            assert time.monotonic() < end_s, "waits too long"
            return frame(0x181)

    end_s = time.monotonic() + 5.0
    assert not BusLink(Busy()).pump_until(lambda: False, 0.01)


def test_a_condition_that_becomes_true_without_a_frame_is_seen_at_the_end_of_the_wait():
    answers = [False, True]
    assert BusLink(FailingBus()).pump_until(lambda: answers.pop(0), 0.01)


def test_a_condition_that_holds_needs_no_frame():
    assert BusLink(FailingBus()).pump_until(lambda: True, 0.0)


@pytest.mark.parametrize(("errors", "sent"), [(50, 1), (51, 0)])
def test_a_full_queue_is_tried_fifty_times_for_a_millisecond_each(errors, sent):
    bus = FailingBus(errors=[queue_full()] * errors)
    waited = []
    bus.recv = waited.append
    link = BusLink(bus)
    with nullcontext() if sent else pytest.raises(BusError, match="stays full"):
        link.send(frame(0x80))
    assert len(bus.sent) == sent
    assert waited == [1e-3] * 50
    assert link.queue_full == 1


def test_one_bus_is_the_busiest_and_has_no_skew():
    link = BusLink(FailingBus(frames=[frame(0x181, bytes(8))]))
    assert (link.bits, link.error_frames, link.times_passive, link.queue_full) == (0, 0, 0, 0)
    link.send(frame(0x80))
    sent = link.bits
    link.pump(0.0)
    # CiA 102: 47 bits of a frame without data, 111 of one with 8 bytes, and stuff bits every four of 34 and of 98.
    assert (sent, link.busiest_bits - sent) == (47 + 8, 111 + 24)
    assert link.take_skew() == ""
    with link.everywhere():
        pass


def test_of_several_buses_the_busiest_counts():
    parts = [can.Bus(interface="virtual", channel=f"busiest-{number}") for number in range(2)]
    joined = JoinedBus(parts, [frozenset({1}), frozenset({2})], BusRole.MASTER, 0.01)
    link = BusLink(joined)
    for node_id in (2, 2, 1):
        link.send(frame(0x600 + node_id))
    assert link.busiest_bits == 2 * 55
    link.send(frame(0x80))
    assert "SYNC reached the last bus" in link.take_skew()
    with link.everywhere():
        assert joined.everywhere
    assert not joined.everywhere
    joined.shutdown()


def test_a_command_goes_to_a_node_and_handlers_of_a_block_are_gone_after_it():
    bus = FailingBus(frames=[frame(0x181, b"\1"), frame(0x182, b"\2"), frame(0x181, b"\3")])
    link, seen = BusLink(bus), []
    link.command(NmtCommand.RESET_NODE, 5)
    assert (bus.sent[0].arbitration_id, bytes(bus.sent[0].data)) == (0, b"\x81\5")
    link.subscribe(0x181, seen.append)
    with link.subscribed_meanwhile():
        link.subscribe(0x182, seen.append)
        link.unsubscribe(0x181)
        link.unsubscribe(0x199)
        link.pump(0.0)
        link.pump(0.0)
    link.pump(0.0)
    assert seen == [b"\2", b"\3"]
