"""A controller's side of RTDE for tests, after Universal Robots' published guide, on the loopback interface."""

from __future__ import annotations

import socket
import struct
import threading
import time
from contextlib import contextmanager
from dataclasses import dataclass, field

TYPES = {
    "timestamp": ("DOUBLE", "d"),
    "robot_mode": ("INT32", "i"),
    "actual_q": ("VECTOR6D", "6d"),
    "actual_qd": ("VECTOR6D", "6d"),
    "actual_current": ("VECTOR6D", "6d"),
    "target_moment": ("VECTOR6D", "6d"),
    "payload": ("DOUBLE", "d"),
    "payload_cog": ("VECTOR3D", "3d"),
}


@dataclass
class Controller:
    """What a controller answers, and the rows that it sends after the start.

    Attributes:
        rows: Per package, the values of every output by name.
        version: Version of its software.
        accepts_version: Whether it supports protocol version 2.
        starts: Whether it accepts the start.
        lacks: Outputs that it does not have.
        piece: Bytes sent at a time.
        cut: Bytes that the last package lacks.
        version_bytes: Bytes of its answer about its version.
        pause_s: Time after each piece of a data package.
        requests: Requests received, by type and content.
    """

    rows: list = field(default_factory=list)
    version: tuple = (5, 12, 0, 1)
    accepts_version: bool = True
    starts: bool = True
    lacks: tuple = ()
    piece: int = 10_000
    cut: int = 0
    version_bytes: int = 16
    pause_s: float = 0.0
    requests: list = field(default_factory=list)

    @contextmanager
    def listening(self):
        """Its address, for one client; the connection is closed after the last row."""
        with socket.create_server(("127.0.0.1", 0)) as server:
            thread = threading.Thread(target=self._serve, args=(server,))
            thread.start()
            yield f"127.0.0.1:{server.getsockname()[1]}"
            thread.join(20.0)

    def _serve(self, server):
        server.settimeout(10.0)
        connection, _ = server.accept()
        with connection:
            connection.settimeout(10.0)
            try:
                while self._answer(connection):
                    pass
            except ConnectionError:
                return

    def _answer(self, connection):
        header = connection.recv(3, socket.MSG_WAITALL)
        if len(header) < 3:
            return False
        size, kind = struct.unpack(">HB", header)
        content = connection.recv(size - 3, socket.MSG_WAITALL) if size > 3 else b""
        self.requests.append((chr(kind), content))
        names = content[8:].decode().split(",") if kind == ord("O") else []
        kinds = ["NOT_FOUND" if name in self.lacks else TYPES[name][0] for name in names]
        answers = {
            "V": struct.pack(">B", self.accepts_version),
            "v": struct.pack(">4I", *self.version)[: self.version_bytes],
            "O": b"\x01" + ",".join(kinds).encode(),
            "S": struct.pack(">B", self.starts),
        }
        # controllers send texts at any time
        self._send(connection, "M", b"\x02hi\x01s\x00")
        self._send(connection, chr(kind), answers[chr(kind)])
        if names:
            self._names = names
        if kind == ord("S") and self.starts:
            for number, row in enumerate(self.rows):
                values = b"".join(struct.pack(f">{TYPES[name][1]}", *row[name]) for name in self._names)
                last = number == len(self.rows) - 1
                self._send(connection, "U", b"\x01" + values[: len(values) - self.cut * last])
            return False
        return True

    def _send(self, connection, kind, content):
        package = struct.pack(">HB", 3 + len(content), ord(kind)) + content
        for start in range(0, len(package), self.piece):
            connection.sendall(package[start : start + self.piece])
            if kind == "U":
                time.sleep(self.pause_s)


def row(
    time_s,
    position=(0.0,) * 6,
    current=(0.0,) * 6,
    mode=7,
    payload_kg=1.5,
    center_m=(0.0, 0.1, 0.2),
    moment=(0.0,) * 6,
):
    """The outputs of one package."""
    return {
        "timestamp": (time_s,),
        "robot_mode": (mode,),
        "actual_q": position,
        "actual_qd": (0.0,) * 6,
        "actual_current": current,
        "target_moment": moment,
        "payload": (payload_kg,),
        "payload_cog": center_m,
    }
