"""The bus within one process: recipients, order and time of frames."""

import threading

import can
import pytest

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.driver_errors import SimulationError
from armload_drivers.simulation.lockstep_bus import LockstepBus, LockstepWire


def frame(cob_id, data=b""):
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)


@pytest.fixture
def ends():
    """Three endpoints of one wire."""
    wire = LockstepWire()
    with LockstepBus(wire) as a, LockstepBus(wire) as b, LockstepBus(wire) as c:
        yield a, b, c


def heard(bus):
    return [message.arbitration_id for message in iter(lambda: bus.recv(0.0), None)]


def test_everybody_but_the_sender_hears_a_frame(ends):
    a, b, c = ends
    a.send(can.Message(arbitration_id=0x1_2345, data=b"\x01\x02", is_extended_id=True))
    for other in (b, c):
        message = other.recv(0.0)
        assert (message.arbitration_id, message.is_extended_id, message.data, message.dlc) == (
            0x1_2345, True, b"\x01\x02", 2,
        )  # fmt: skip
        assert message.is_rx
    assert a.recv(0.0) is None


@pytest.mark.parametrize("kind", ["is_remote_frame", "is_error_frame"])
def test_frames_of_other_kinds_stay_what_they_are(ends, kind):
    a, b, _ = ends
    a.send(can.Message(arbitration_id=0x40, is_extended_id=False, **{kind: True}))
    assert getattr(b.recv(0.0), kind)


def test_a_frame_is_the_senders_to_change_once_it_is_sent(ends):
    a, b, _ = ends
    message = frame(0x181, b"\x01")
    a.send(message)
    message.data[0] = 2
    a.send(message)
    assert [b.recv(0.0).data for _ in range(2)] == [b"\x01", b"\x02"]


def test_a_listener_has_acted_when_send_returns(ends):
    a, b, _ = ends
    b.listen(lambda message: b.send(frame(message.arbitration_id + 1)))
    a.send(frame(0x10))
    assert heard(a) == [0x11]


def test_all_hear_the_same_order_whoever_answers_first(ends):
    """Answers of the first listener come after the frame that the others have not received yet."""
    a, b, c = ends
    order = []

    def first(message):
        if message.arbitration_id == 0x10:
            b.send(frame(0x20))
            b.send(frame(0x21))

    def second(message):
        order.append(message.arbitration_id)
        if message.arbitration_id == 0x20:
            c.send(frame(0x30))

    b.listen(first)
    c.listen(second)
    a.send(frame(0x10))
    a.send(frame(0x11))
    assert order == [0x10, 0x20, 0x21, 0x11]
    assert heard(a) == [0x20, 0x21, 0x30]


def test_what_a_listener_raises_reaches_the_sender_and_nothing_is_lost(ends):
    a, b, c = ends

    def stumble(message):
        b.listen(None)
        b.send(frame(0x99))
        raise KeyboardInterrupt

    b.listen(stumble)
    with pytest.raises(KeyboardInterrupt):
        a.send(frame(0x10))
    a.send(frame(0x11))
    assert heard(a) == [0x99]
    assert heard(b) == [0x11]
    assert heard(c) == [0x99, 0x11], "only the frame in the middle of which it happened is lost to those after it"


def test_a_wait_is_over_at_once(ends):
    a, _, _ = ends
    assert a.recv(1e6) is None
    link = BusLink(a)
    assert not link.pump_until(lambda: False, 1e6)
    with pytest.raises(SimulationError, match="requires a time limit"):
        a.recv()


def test_frames_of_several_threads_arrive_whole_and_each_thread_in_its_order(ends):
    a, b, c = ends
    b.listen(lambda message: b.send(frame(message.arbitration_id | 0x400)))

    def send(base):
        for number in range(300):
            a.send(frame(base + number % 256, bytes([number % 256])))

    threads = [threading.Thread(target=send, args=(base,)) for base in (0x000, 0x100, 0x200)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    frames = heard(c)
    assert len(frames) == 2 * 900
    for asked, answered in zip(frames[::2], frames[1::2], strict=True):
        assert answered == asked | 0x400
    for base in (0x000, 0x100, 0x200):
        assert [cob_id & 0xFF for cob_id in frames[::2] if cob_id & 0x300 == base] == [n % 256 for n in range(300)]


def test_a_closed_endpoint_hears_and_sends_nothing(ends):
    a, b, _ = ends
    b.shutdown()
    a.send(frame(0x10))
    for use in (lambda: b.send(frame(0x11)), lambda: b.recv(0.0)):
        with pytest.raises(can.CanOperationError, match="closed"):
            use()
