"""The joints of an arm of Universal Robots over its Real-Time Data Exchange (RTDE, protocol version 2): outputs only.

A session: version 2 is requested, the controller's version read, a recipe of outputs set up, and started; from then on
the controller sends a package per period. No inputs are set up, so nothing that is sent here can move the arm.

`ur-rtde` from PyPI is not used: its getters return the latest value of one field each, so that positions and currents
of a row come from different packages, and packages between two calls are lost unnoticed.

References:
    Universal Robots, "Real-Time Data Exchange (RTDE) Guide": header, package types, data types and output names.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Iterator
from enum import IntEnum
from typing import Final, Self

import numpy as np

from armload_drivers.driver_errors import BusError
from armload_drivers.listening.overheard_arm import OverheardCycle, ToldPayload
from armload_drivers.servos import JointFeedback

PORT: Final = 30004
JOINTS: Final = 6
LOOK_S: Final = 0.1
"""Longest wait for a package."""
PATIENCE_S: Final = 5.0
"""Longest wait for a connection or an answer."""
RUNNING: Final = 7
"""The `robot_mode` in which brakes are released and the motors carry the arm."""
_VERSION: Final = 2
_FAST_SINCE: Final = 5
"""First major version of controllers that send at 500 Hz; earlier ones (CB3) send at 125 Hz."""
_HEADER: Final = struct.Struct(">HB")
_MAJOR: Final = struct.Struct(">I")
_DATA_TYPES: Final = {"DOUBLE": ">f8", "VECTOR3D": "3>f8", "VECTOR6D": "6>f8", "INT32": ">i4"}
_NOT_FOUND: Final = "NOT_FOUND"
_REQUIRED: Final = {
    "timestamp": "DOUBLE",
    "robot_mode": "INT32",
    "actual_q": "VECTOR6D",
    "actual_qd": "VECTOR6D",
    "actual_current": "VECTOR6D",
}
_OPTIONAL: Final = {"payload": "DOUBLE", "payload_cog": "VECTOR3D", "target_moment": "VECTOR6D"}


class Package(IntEnum):
    """Types of packages, as the guide numbers them."""

    TEXT = ord("M")
    SETUP_OUTPUTS = ord("O")
    PROTOCOL_VERSION = ord("V")
    CONTROLLER_VERSION = ord("v")
    START = ord("S")
    DATA = ord("U")


class RtdeClient:
    """A connection to a controller; a context manager that closes it.

    Args:
        host: Its name or address; `HOST:PORT` for another port than 30004.

    Attributes:
        rate_hz: Rate of the packages.

    Raises:
        BusError: no connection, or the controller does not send what is needed.
    """

    def __init__(self, host: str) -> None:
        self._name = host
        address, _, port = host.partition(":")
        if not address or (port and not port.isdecimal()):
            raise BusError(f"{host!r}: expected the name or address of the controller, such as 192.168.0.10")
        try:
            self._socket = socket.create_connection((address, int(port or PORT)), PATIENCE_S)
        except OSError as error:
            raise BusError(
                f"{host}: no connection to RTDE ({error.strerror or error}). Is the controller on, its address right, "
                "and RTDE enabled under Settings > Security > Services?"
            ) from error
        try:
            self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._packages = self._received()
            self._set_up()
        except BaseException:
            self._socket.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *ignored: object) -> None:
        self._socket.close()

    def _set_up(self) -> None:
        """Agree on version, rate and outputs, and start."""
        if self._ask(Package.PROTOCOL_VERSION, struct.pack(">H", _VERSION)) != b"\x01":
            raise BusError(
                f"{self._name}: the controller does not support RTDE version 2. It needs software 3.10 or later."
            )
        version = self._ask(Package.CONTROLLER_VERSION, b"")
        if len(version) < _MAJOR.size:
            raise BusError(f"{self._name}: the controller's version has {len(version)} bytes. Is this port RTDE's?")
        major = _MAJOR.unpack_from(version)[0]
        self.rate_hz = 500.0 if major >= _FAST_SINCE else 125.0
        outputs = _REQUIRED | _OPTIONAL
        types = self._recipe(outputs)
        missing = [name for name, kind in types.items() if kind == _NOT_FOUND]
        if missing and not set(missing) & _REQUIRED.keys():
            outputs = {name: kind for name, kind in outputs.items() if name not in missing}
            types = self._recipe(outputs)
        wrong = [f"{name} ({kind} instead of {outputs[name]})" for name, kind in types.items() if kind != outputs[name]]
        if wrong:
            raise BusError(f"{self._name}: the controller does not send {', '.join(wrong)}")
        fields = [("recipe", "u1"), *((name, _DATA_TYPES[kind]) for name, kind in types.items())]
        self._package = np.dtype(fields)
        if self._ask(Package.START, b"") != b"\x01":
            raise BusError(f"{self._name}: the controller does not start to send. Is another RTDE client using it up?")

    def _recipe(self, outputs: dict[str, str]) -> dict[str, str]:
        """Request outputs; their types by name."""
        answer = self._ask(Package.SETUP_OUTPUTS, struct.pack(">d", self.rate_hz) + ",".join(outputs).encode())
        types = answer[1:].decode(errors="replace").split(",")
        if len(types) != len(outputs):
            raise BusError(f"{self._name}: {len(types)} types were answered for {len(outputs)} outputs")
        return dict(zip(outputs, types, strict=True))

    def _ask(self, kind: Package, payload: bytes) -> bytes:
        """Send a request; its answer."""
        try:
            self._socket.sendall(_HEADER.pack(_HEADER.size + len(payload), kind) + payload)
        except OSError as error:
            raise BusError(f"{self._name}: the controller closed the connection") from error
        end_s = time.monotonic() + PATIENCE_S
        for package in self._packages:
            if package is not None and package[0] == kind:
                return package[1]
            if time.monotonic() >= end_s:
                break
        raise BusError(f"{self._name}: no answer to request {kind.name} within {PATIENCE_S:g} s. Is this port RTDE's?")

    def _received(self) -> Iterator[tuple[int, bytes] | None]:
        """Type and content of each package, without end; None whenever none is complete after `LOOK_S`."""
        self._socket.settimeout(LOOK_S)
        buffer = b""
        while True:
            looked_s = time.monotonic()
            while len(buffer) < (size := self._first_size(buffer)) and time.monotonic() - looked_s <= LOOK_S:
                buffer += self._next_bytes()
            if len(buffer) < size:
                yield None
            else:
                _, kind = _HEADER.unpack_from(buffer)
                content, buffer = buffer[_HEADER.size : size], buffer[size:]
                yield kind, content

    def _first_size(self, buffer: bytes) -> int:
        """Size of the first package; that of a header while this is not complete."""
        if len(buffer) < _HEADER.size:
            return _HEADER.size
        size, _ = _HEADER.unpack_from(buffer)
        if size < _HEADER.size:
            raise BusError(f"{self._name}: a package of {size} bytes. Is this port RTDE's?")
        return int(size)

    def _next_bytes(self) -> bytes:
        """What the controller sent; empty after `LOOK_S`."""
        try:
            received = self._socket.recv(65536)
        except TimeoutError:
            return b""
        except OSError as error:
            raise BusError(f"{self._name}: receiving failed: {error}") from error
        if not received:
            raise BusError(f"{self._name}: the controller closed the connection")
        return received

    def cycles(self) -> Iterator[OverheardCycle | None]:
        """The cycles of the arm, without end; times are measured from the first package, on the controller's clock.

        Yields:
            Cycles; None after `LOOK_S` without one.

        Raises:
            BusError: the connection ended, or no package arrived at first.
        """
        begun_s: float | None = None
        last_s, count, started_s = 0.0, 0, time.monotonic()
        for package in self._packages:
            if package is not None and package[0] == Package.DATA:
                fields = self._fields(package[1])
                now_s = float(fields["timestamp"])
                if not np.isfinite(now_s):
                    raise BusError(f"{self._name}: a data package without a time ({now_s})")
                begun_s = now_s if begun_s is None else begun_s
                time_s = now_s - begun_s
                lost = max(round((time_s - last_s) * self.rate_hz) - 1, 0) if count else 0
                last_s, count = time_s, count + 1
                yield _cycle(fields, time_s, count, lost)
            elif not count and time.monotonic() - started_s > PATIENCE_S:
                raise BusError(f"{self._name}: the controller sends nothing after the start was accepted")
            else:
                yield None

    def _fields(self, content: bytes) -> np.void:
        """The outputs of a data package."""
        if len(content) != self._package.itemsize:
            raise BusError(f"{self._name}: a data package of {len(content)} bytes instead of {self._package.itemsize}")
        fields: np.void = np.frombuffer(content, self._package)[0]
        return fields


def _cycle(fields: np.void, time_s: float, count: int, lost: int) -> OverheardCycle:
    """A data package as a cycle."""
    sent = fields.dtype.names or ()
    told = None
    if "payload" in sent and "payload_cog" in sent:
        x, y, z = fields["payload_cog"].tolist()
        if np.isfinite([told_kg := float(fields["payload"]), x, y, z]).all():
            told = ToldPayload(told_kg, (x, y, z))
    feedback = JointFeedback(
        cycle=count,
        time_s=time_s,
        position_rad=fields["actual_q"].astype(float),
        velocity_rad_s=fields["actual_qd"].astype(float),
        current_a=fields["actual_current"].astype(float),
        torque_nm=None,
        statusword=np.zeros(JOINTS, dtype=np.uint16),
        missing=np.zeros(JOINTS, dtype=np.bool_),
    )
    target_nm = fields["target_moment"].astype(float) if "target_moment" in sent else None
    enabled = bool(fields["robot_mode"] == RUNNING)
    return OverheardCycle(feedback, None, enabled=enabled, lost=lost, told=told, target_torque_nm=target_nm)
