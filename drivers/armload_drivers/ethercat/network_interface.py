"""Whether a network interface may carry EtherCAT, before anything is sent on it.

Its frames reach every device on the cable, so an interface that carries an address or a route, which is one to a
network, is refused, as are one that another master uses and one on which its frames are heard.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import select
import socket
import struct
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from armload_drivers.driver_errors import BusError, ForeignMaster

ETHERTYPE = 0x88A4
LISTEN_S = 0.2
"""How long another master is listened for: cycles of machines take at most 100 ms."""
PROBE_S = 0.02
"""A frame returns within this time."""
_GET_FLAGS, _GET_ADDRESS = 0x8913, 0x8915
_UP, _RUNNING = 0x1, 0x40
_NET_ADMIN, _NET_RAW = 12, 13
_REQUEST = struct.Struct("16s16x")
_BROADCAST_READ, _AL_STATUS = 7, 0x0130
_FRAME = struct.Struct("<6s6s2sHBBHHHH2sH30x")
"""Ethernet header, EtherCAT header, one datagram of two bytes with its working counter, padding to 60 bytes."""
_OP = 0x08
_ATTACH_FILTER, _LOAD_BYTE, _EQUAL, _RETURN = 26, 0x30, 0x15, 0x06
"""Socket option, and instructions, of the kernel's packet filter."""
_COMMAND_AT = 16
"""Offset of a frame's first command."""
_IN_CYCLES = (4, 5, _BROADCAST_READ, 10, 11, 12)
"""Commands that a master sends while cycles run: reads and writes of one drive (mailbox), states, process data."""


def is_running(interface: str) -> bool:
    """Whether a cable with a device at its other end is plugged in."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        try:
            answer = fcntl.ioctl(asking, _GET_FLAGS, _REQUEST.pack(interface.encode()))
        except OSError:
            return False
    flags = int(struct.unpack_from("<H", answer, 16)[0])
    return flags & (_UP | _RUNNING) == _UP | _RUNNING


def require_unused(interface: str) -> None:
    """Refuse an interface that does not exist, is down, or belongs to a network.

    Raises:
        BusError: naming the reason and the command that changes it.
    """
    names = [name for _, name in socket.if_nameindex()]
    if interface not in names:
        raise BusError(f"there is no network interface {interface}, only {', '.join(names)}: correct [bus] channel")
    addresses = _addresses(interface)
    if addresses:
        raise BusError(
            f"interface {interface} carries {', '.join(addresses)}: it belongs to a network, whose devices EtherCAT's "
            "frames would disturb, and the other way round. Use an interface of the arm's own; free it with "
            f"`ip address flush dev {interface}`, `ip route flush dev {interface}` and "
            f"`sysctl net.ipv6.conf.{interface}.disable_ipv6=1`"
        )
    if not is_running(interface):
        raise BusError(
            f"interface {interface} is down or has no link: `ip link set {interface} up`; is the first drive powered, "
            "and the cable in its input port?"
        )


def _addresses(interface: str) -> list[str]:
    """Addresses and routes of an interface, as text."""
    found = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as asking:
        try:
            answer = fcntl.ioctl(asking, _GET_ADDRESS, struct.pack("256s", interface.encode()))
            found.append(f"the address {socket.inet_ntoa(answer[20:24])}")
        except OSError as error:
            if error.errno != errno.EADDRNOTAVAIL:
                raise
    for line in _table("if_inet6"):
        if line[-1] == interface:
            found.append(f"the address {socket.inet_ntop(socket.AF_INET6, bytes.fromhex(line[0]))}")
    if any(line[0] == interface for line in _table("route")) or any(
        line[-1] == interface for line in _table("ipv6_route")
    ):
        found.append("a route (`ip route`)")
    return found


def _table(name: str) -> list[list[str]]:
    """A table of the kernel; empty if it has none."""
    try:
        text = Path("/proc/self/net", name).read_text("ascii")
    except FileNotFoundError:
        return []
    return [line.split() for line in text.splitlines() if line.split()]


def missing_rights() -> str:
    """Why this process may not open a line, as text; empty if it may."""
    status = Path("/proc/self/status").read_text("ascii")
    held = int(next(line.split()[1] for line in status.splitlines() if line.startswith("CapEff:")), 16)
    names = [name for bit, name in ((_NET_RAW, "CAP_NET_RAW"), (_NET_ADMIN, "CAP_NET_ADMIN")) if not held >> bit & 1]
    if not names:
        return ""
    return (
        f"EtherCAT requires the right to send raw frames and to set flags of the interface; this process lacks "
        f"{' and '.join(names)}. Run it as root, or with `setpriv --ambient-caps +net_raw,+net_admin "
        "--inh-caps +net_raw,+net_admin armload ...` from a service that has them"
    )


@contextmanager
def claimed_interface(interface: str) -> Iterator[None]:
    """Within the block no other armload uses an interface.

    Raises:
        ForeignMaster: another one does.
    """
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as claim:
        try:
            claim.bind(f"\0armload ethercat {interface}")  # abstract: gone with this process, however it ends
        except OSError as error:
            if error.errno != errno.EADDRINUSE:
                raise
            raise ForeignMaster(
                f"another armload uses interface {interface}. Two masters cannot share an arm: stop the other program"
            ) from error
        yield


class FrameMonitor:
    """Receives EtherCAT's frames beside the master."""

    def __init__(self, interface: str) -> None:
        self._interface = interface
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE))
        self._socket.bind((interface, ETHERTYPE))
        self._poll = select.poll()
        self._poll.register(self._socket, select.POLLIN)

    def close(self) -> None:
        """Stop receiving."""
        self._socket.close()

    def receive(self) -> bytes | None:
        """The next frame; None if there is none, which costs a third of an attempt to read it."""
        if not self._poll.poll(0):
            return None
        try:
            return self._socket.recv(1514)
        except OSError as error:  # the interface has gone down
            raise BusError(f"interface {self._interface}: {error.strerror}") from error

    def commands_only(self) -> None:
        """From now on receive only frames that no master sends while its cycles run; discard those received before."""
        kept = [
            (_LOAD_BYTE, 0, 0, _COMMAND_AT),
            *((_EQUAL, len(_IN_CYCLES) - number, 0, command) for number, command in enumerate(_IN_CYCLES)),
            (_RETURN, 0, 0, 0xFFFF),
            (_RETURN, 0, 0, 0),
        ]
        program = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *step) for step in kept))
        self._socket.setsockopt(
            socket.SOL_SOCKET, _ATTACH_FILTER, struct.pack("HP", len(kept), ctypes.addressof(program))
        )
        while self.receive() is not None:
            pass

    def hears(self, time_s: float) -> bool:
        """Whether a frame is received within a time."""
        end_s = time.monotonic() + time_s
        while time.monotonic() < end_s:
            if self.receive() is not None:
                return True
            time.sleep(time_s / 20)
        return False

    def drives_and_states(self) -> tuple[int, int]:
        """Number of drives that answer a broadcast read, and the bits of their states; changes nothing."""
        frame = _FRAME.pack(
            b"\xff" * 6, b"\x02\0\0\0\0\x01", struct.pack(">H", ETHERTYPE), 0x1000 | 14,
            _BROADCAST_READ, 0, 0, _AL_STATUS, 2, 0, b"\0\0", 0,
        )  # fmt: skip
        end_s = time.monotonic() + PROBE_S
        self._socket.send(frame)
        while time.monotonic() < end_s:
            answer = self.receive()
            if answer is not None and len(answer) >= _FRAME.size:
                fields = _FRAME.unpack_from(answer)
                return fields[-1], fields[-2][0]
            time.sleep(PROBE_S / 100)
        return 0, 0


def require_quiet(interface: str) -> None:
    """Refuse a line that another master runs, or with a drive that is in OP without one.

    A drive leaves OP when its frames end, unless its watchdog is off. Then it may hold its axis with torque, and the
    search for drives, which puts all in INIT, would remove it.

    Raises:
        ForeignMaster: another master's frames are received.
        BusError: a drive is in OP, or none answers.
    """
    with closing(FrameMonitor(interface)) as monitor:
        if monitor.hears(LISTEN_S):
            raise ForeignMaster(
                f"another master sends EtherCAT frames on {interface}. Two masters cannot share an arm: stop the other "
                "program"
            )
        count, states = monitor.drives_and_states()
    if not count:
        raise BusError(f"no EtherCAT drive answers on {interface}: is the first drive powered and connected?")
    if states & _OP:
        raise BusError(
            f"a drive on {interface} is in OP although no master sends: its watchdog is off, and it may hold its axis "
            "with torque. Press the emergency stop, or support the arm and switch the drives off and on, then repeat "
            "this command"
        )
