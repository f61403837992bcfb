"""What the operator reads about trouble on the bus that did not stop the arm."""

import errno

import can

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.canopen.bus_remarks import BusRemarks
from armload_drivers.cyclic.rhythm import Rhythm


class FullOnce:
    """A bus whose transmit queue is full at the first attempt."""

    def __init__(self):
        self.attempts = 0

    def send(self, message):
        self.attempts += 1
        if self.attempts == 1:
            raise can.CanOperationError("Failed to transmit", errno.ENOBUFS)

    def recv(self, timeout):
        return None


def test_a_full_queue_is_remarked_upon_once():
    link = BusLink(FullOnce())
    remarks = BusRemarks(link, (), ())
    assert remarks.take() == ()
    link.send_frame(0x080, b"")
    (text,) = remarks.take()
    assert text.startswith("warning: bus: the transmit queue was full 1 time. Check")
    assert "txqueuelen" in text
    assert remarks.take() == ()


def test_periods_that_differ_by_more_than_a_fifth_are_remarked_upon_with_figures():
    rhythm = Rhythm("SYNC", 0.004)
    remarks = BusRemarks(BusLink(FullOnce()), (), (rhythm,))
    times = [0.0, 0.004, 0.0081, 0.0131, 0.0171, 0.0201, 0.0241]
    for time_s in times:
        rhythm.note(time_s)
    (text,) = remarks.take()
    assert text.startswith("warning: 2 of 6 periods of SYNC differ from 4 ms by more than a fifth (3.00 to 5.00 ms)")
    assert remarks.take() == ()


def test_skipped_periods_a_clock_set_back_and_a_new_beginning_are_no_irregularity():
    rhythm = Rhythm("feedback", 0.004)
    for time_s in (0.0, 0.004, 0.016, 0.0165 - 1.0, 0.0205 - 1.0):
        rhythm.note(time_s)
    rhythm.begin()
    rhythm.note(7.0)
    assert rhythm.take() == ""
