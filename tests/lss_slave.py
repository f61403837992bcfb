"""A node that is configured by layer setting services, written from CiA 305 and not from the master's code.

It has no node id until one is assigned; then it answers reads of 1000. `serve` puts it on a bus of two threads.
"""

import struct
import threading
from contextlib import contextmanager

import can

TO_NODES, FROM_NODES = 0x7E5, 0x7E4


class LssSlave:
    """Its services, without a bus.

    Args:
        identity: Vendor id, product code, revision, serial number.
        node_id: Its node id; None if it has none.
        refuses: Command specifier that is answered with error 1.
        confuses: Command specifier that is answered with another one.
        forgets: Word of the identity at whose end fastscan is not answered.
        device_type: Value of 1000.
    """

    def __init__(self, identity, node_id=None, refuses=None, device_type=0x0002_0192, *, confuses=None, forgets=None):
        self.identity, self.node_id, self.refuses, self.device_type = identity, node_id, refuses, device_type
        self.confuses, self.forgets = confuses, forgets
        self.configuring = False
        self.pending = self.rate = self.stored = None
        self._matching = [False] * 4
        self._sub = 0

    def receive(self, cob_id, data):
        """The answer to a frame: COB-ID and data; None if there is none."""
        if cob_id == TO_NODES and len(data) == 8:
            answer = self._service(bytes(data))
            return None if answer is None else (FROM_NODES, answer.ljust(8, b"\0"))
        if self.node_id is not None and cob_id == 0x600 + self.node_id:
            index, subindex = struct.unpack_from("<HB", data, 1)
            if (index, subindex) == (0x1000, 0):
                return 0x580 + self.node_id, struct.pack("<BHBI", 0x43, index, 0, self.device_type)
            return 0x580 + self.node_id, struct.pack("<BHBI", 0x80, index, subindex, 0x0602_0000)
        return None

    def _service(self, data):
        command = data[0]
        if command == 0x04:
            if self.configuring and not data[1] and self.pending is not None:
                self.node_id = self.pending
            self.configuring = bool(data[1])
        elif 0x40 <= command <= 0x43:
            self._matching[command - 0x40] = struct.unpack_from("<I", data, 1)[0] == self.identity[command - 0x40]
            if command == 0x43 and all(self._matching):
                self.configuring = True
                return b"\x44"
        elif command == 0x51 and self.node_id is None and not self.configuring:
            return self._fastscan(*struct.unpack_from("<IBBB", data, 1))
        elif self.configuring and command in {0x11, 0x13, 0x17}:
            if command == self.confuses:
                return bytes([command ^ 1, 0])
            if command == self.refuses:
                return bytes([command, 1])
            if command == 0x11:
                self.pending = data[1]
            elif command == 0x13:
                self.rate = data[1:3]
            else:
                self.stored = self.pending, self.rate
            return bytes([command, 0])
        return None

    def _fastscan(self, number, bit, sub, following):
        if bit == 0x80:
            self._sub = 0
            return b"\x4f"
        if sub != self._sub or number >> bit != self.identity[sub] >> bit:
            return None
        if bit == 0 and following != sub:
            if sub == self.forgets:
                return None
            self._sub = following
            self.configuring = following < sub
        return b"\x4f"


@contextmanager
def serve(bus, slave):
    """The slave on a python-can bus, in a thread."""
    ended = threading.Event()

    def run():
        while not ended.is_set():
            message = bus.recv(0.01)
            answer = None if message is None else slave.receive(message.arbitration_id, message.data)
            if answer is not None:
                bus.send(can.Message(arbitration_id=answer[0], data=answer[1], is_extended_id=False))

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
