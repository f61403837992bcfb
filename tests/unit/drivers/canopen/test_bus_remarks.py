"""What the operator reads about trouble on the bus that did not stop the arm."""

import errno

import can

from armload_drivers.bus.bus_link import BusLink
from armload_drivers.canopen.bus_remarks import BusRemarks


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
    remarks = BusRemarks(link, ())
    assert remarks.take() == ()
    link.send_frame(0x080, b"")
    (text,) = remarks.take()
    assert text.startswith("warning: bus: the transmit queue was full 1 time. Check")
    assert "txqueuelen" in text
    assert remarks.take() == ()
