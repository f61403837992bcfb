"""Which network interfaces may carry EtherCAT; nothing is sent."""

import errno
import select
import socket
import struct
from contextlib import nullcontext

import pytest

from armload_drivers.driver_errors import BusError, ForeignMaster
from armload_drivers.ethercat import network_interface
from armload_drivers.ethercat.network_interface import FrameMonitor, claimed_interface, is_running, require_unused


def test_an_interface_that_is_not_there_is_named_with_those_that_are():
    with pytest.raises(BusError, match="no network interface eth99") as raised:
        require_unused("eth99")
    assert all(name in str(raised.value) for _, name in socket.if_nameindex())
    assert not is_running("eth99")


def test_an_interface_that_carries_an_address_is_refused():
    """Loopback has one on every computer."""
    with pytest.raises(BusError, match=r"127\.0\.0\.1") as raised:
        require_unused("lo")
    assert "ip address flush dev lo" in str(raised.value)
    assert "ip route flush dev lo" in str(raised.value)


def test_two_masters_of_one_interface_are_told_apart_from_two_interfaces():
    refused = pytest.raises(ForeignMaster, match="another armload uses interface eth1")
    with claimed_interface("eth1"), claimed_interface("eth2"), refused, claimed_interface("eth1"):
        pass
    with claimed_interface("eth1"):
        pass


# Another master's frames, over a pair of sockets of this process -----------------------------------------------------


def frame(command, counter=0, state=0):
    """A frame with one datagram: 16 bytes of headers, the command, and at its end state and working counter."""
    return network_interface._FRAME.pack(
        b"\xff" * 6, b"\2\0\0\0\0\1", b"\x88\xa4", 0x100E, command, 0, 0, 0x0130, 2, 0, bytes([state, 0]), counter
    )


@pytest.fixture
def monitor():
    """A monitor, and the other end of its cable."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
    monitor = FrameMonitor.__new__(FrameMonitor)
    monitor._interface, monitor._socket, monitor._poll = "eth9", ours, select.poll()
    monitor._poll.register(ours, select.POLLIN)
    with theirs:
        yield monitor, theirs
    monitor.close()


def test_frames_are_received_in_their_order_without_waiting(monitor):
    heard, cable = monitor
    assert heard.receive() is None
    for command in (4, 5):
        cable.send(frame(command))
    assert [heard.receive()[16], heard.receive()[16], heard.receive()] == [4, 5, None]
    assert not heard.hears(0.001)
    cable.send(frame(4))
    assert heard.hears(0.001)


def test_of_a_running_master_only_what_none_sends_in_its_cycles_is_received(monitor):
    heard, cable = monitor
    cable.send(frame(2))
    heard.commands_only()
    assert heard.receive() is None, "what was received before is dropped"
    for command in range(15):
        cable.send(frame(command))
    kept = [data[16] for data in iter(heard.receive, None)]
    assert kept == [0, 1, 2, 3, 6, 8, 9, 13, 14]


def test_drives_are_counted_by_a_broadcast_read_that_changes_nothing(monitor):
    heard, cable = monitor
    cable.send(b"short")
    cable.send(frame(7, counter=3, state=0x0A))
    assert heard.drives_and_states() == (3, 0x0A)
    sent = cable.recv(100)
    assert len(sent) == 60
    assert sent[:6] == b"\xff" * 6
    assert sent[12:14] == b"\x88\xa4"
    assert sent[16] == 7
    assert struct.unpack_from("<H", sent, 20) == (0x0130,)
    assert heard.drives_and_states() == (0, 0), "nobody answers"


class Quiet:
    """A line on which nobody sends, with a number of drives and the bits of their states."""

    count, states, heard = 2, 0x02, False

    def __init__(self, interface):
        assert interface == "eth9"

    def hears(self, time_s):
        return self.heard

    def drives_and_states(self):
        return self.count, self.states

    def close(self):
        pass


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ({}, None),
        ({"states": 0x07}, None),
        ({"heard": True}, "another master sends EtherCAT frames on eth9"),
        ({"count": 0}, "no EtherCAT drive answers on eth9"),
        ({"states": 0x08}, "a drive on eth9 is in OP although no master sends"),
        ({"states": 0x0A}, "a drive on eth9 is in OP although no master sends"),
    ],
)
def test_a_line_is_used_if_nobody_sends_and_no_drive_is_in_op(monkeypatch, line, error):
    monkeypatch.setattr(network_interface, "FrameMonitor", type("Line", (Quiet,), line))
    with pytest.raises((BusError, ForeignMaster), match=error) if error else nullcontext():
        network_interface.require_quiet("eth9")


# What the kernel says ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("rights", "lacking"),
    [
        (1 << 12 | 1 << 13, []),
        (1 << 12, ["CAP_NET_RAW"]),
        (1 << 13, ["CAP_NET_ADMIN"]),
        (0, ["CAP_NET_RAW", "CAP_NET_ADMIN"]),
        (0x1FF_FFFF_FFFF, []),
        (0x1FF_FFFF_CFFF, ["CAP_NET_RAW", "CAP_NET_ADMIN"]),
    ],
)
def test_rights_that_are_lacking_are_named(monkeypatch, rights, lacking):
    status = f"Name:\tx\nCapPrm:\t0\nCapEff:\t{rights:016x}\n"
    monkeypatch.setattr(network_interface.Path, "read_text", lambda path, encoding: status)
    text = network_interface.missing_rights()
    assert [name for name in ("CAP_NET_RAW", "CAP_NET_ADMIN") if f" {name}" in text.split(". Run")[0]] == lacking
    assert bool(text) is bool(lacking)


@pytest.mark.parametrize(("flags", "runs"), [(0x41, True), (0x1043, True), (0x01, False), (0x40, False), (0, False)])
def test_an_interface_runs_if_it_is_up_with_a_cable(monkeypatch, flags, runs):
    def kernel(of, request, name):
        assert request == 0x8913, "SIOCGIFFLAGS of linux/sockios.h: the next number sets the flags"
        return name[:16] + struct.pack("<H", flags) + bytes(14)

    monkeypatch.setattr(network_interface.fcntl, "ioctl", kernel)
    assert is_running("eth9") is runs


@pytest.fixture
def unnumbered(monkeypatch):
    """An interface eth9 without an address; the tables of the kernel by name."""
    tables = {}

    def no_address(*_):
        raise OSError(errno.EADDRNOTAVAIL, "none")

    monkeypatch.setattr(network_interface.socket, "if_nameindex", lambda: [(1, "lo"), (2, "eth9")])
    monkeypatch.setattr(network_interface.fcntl, "ioctl", no_address)
    monkeypatch.setattr(network_interface, "_table", lambda name: tables.get(name, []))
    monkeypatch.setattr(network_interface, "is_running", lambda interface: True)
    return tables


@pytest.mark.parametrize(
    ("tables", "carries"),
    [
        ({}, None),
        ({"if_inet6": [["fe80" + 28 * "0", "02", "40", "20", "80", "eth9"]]}, "the address fe80::"),
        ({"if_inet6": [["fe80" + 28 * "0", "02", "40", "20", "80", "eth8"]]}, None),
        ({"route": [["Iface", "Destination"], ["eth9", "00000000"]]}, "a route"),
        ({"route": [["eth8", "00000000"]]}, None),
        ({"ipv6_route": [["0" * 32, "00", "eth9"]]}, "a route"),
        ({"ipv6_route": [["0" * 32, "00", "eth8"]]}, None),
    ],
)
def test_an_interface_of_a_network_is_refused(unnumbered, tables, carries):
    unnumbered.update(tables)
    with pytest.raises(BusError, match=f"eth9 carries {carries}") if carries else nullcontext():
        require_unused("eth9")


def test_an_interface_without_a_link_is_refused(unnumbered, monkeypatch):
    monkeypatch.setattr(network_interface, "is_running", lambda interface: False)
    with pytest.raises(BusError, match="eth9 is down or has no link"):
        require_unused("eth9")


def test_other_errors_of_the_kernel_are_not_taken_for_no_address(unnumbered, monkeypatch):
    def fails(*_):
        raise OSError(errno.EPERM, "no")

    monkeypatch.setattr(network_interface.fcntl, "ioctl", fails)
    with pytest.raises(OSError, match="no"):
        require_unused("eth9")


# Times, and what is sent ---------------------------------------------------------------------------------------------


@pytest.fixture
def clock(monkeypatch):
    """Time that passes only while something sleeps."""

    class Clock:
        now_s = 0.0

        def monotonic(self):
            return self.now_s

        def sleep(self, time_s):
            self.now_s += time_s

    clock = Clock()
    monkeypatch.setattr(network_interface, "time", clock)
    return clock


def test_another_master_is_listened_for_during_two_cycles_of_a_slow_machine(monkeypatch):
    listened_s = []
    monkeypatch.setattr(Quiet, "hears", lambda line, time_s: bool(listened_s.append(time_s)))
    monkeypatch.setattr(network_interface, "FrameMonitor", Quiet)
    network_interface.require_quiet("eth9")
    assert listened_s == [pytest.approx(2 * 0.1)]


def test_waits_end_after_their_time_and_look_often(monitor, clock):
    heard, cable = monitor
    looks = []
    receive = heard.receive
    heard.receive = lambda: looks.append(clock.now_s) or receive()
    assert not heard.hears(0.2)
    assert clock.now_s == pytest.approx(0.2, abs=0.011)
    assert len(looks) == pytest.approx(20, abs=1)
    looks.clear()
    clock.now_s = 0.0
    assert heard.drives_and_states() == (0, 0)
    assert clock.now_s == pytest.approx(0.02, abs=0.00021), "a frame returns within 20 ms"
    assert len(looks) == pytest.approx(100, abs=1)
    sent = cable.recv(100)
    # Ethernet: broadcast, a local address, 88A4; EtherCAT: 14 bytes of type 1; BRD of two bytes at 0130, counter 0.
    assert sent[:16] == b"\xff" * 6 + b"\2\0\0\0\0\1" + b"\x88\xa4" + b"\x0e\x10"
    assert sent[16:30] == b"\7\0\0\0\x30\1\2\0\0\0\0\0\0\0"
    assert sent[30:] == bytes(30)


def test_an_interface_that_has_gone_down_is_named(monitor):
    heard, cable = monitor
    cable.send(b"x")

    class Down:
        def recv(self, size):
            raise OSError(errno.ENETDOWN, "Network is down")

        def close(self):
            pass

    whole, heard._socket = heard._socket, Down()
    with whole, pytest.raises(BusError, match="interface eth9: Network is down"):
        heard.receive()


def test_the_kernels_tables_are_split_into_words_and_may_be_missing(monkeypatch, tmp_path):
    (tmp_path / "route").write_text("Iface Destination\n\neth9 00000000\n")
    monkeypatch.setattr(network_interface, "Path", lambda folder, name: tmp_path / name)
    assert network_interface._table("route") == [["Iface", "Destination"], ["eth9", "00000000"]]
    assert network_interface._table("ipv6_route") == []


def test_an_address_is_that_of_the_kernels_answer(unnumbered, monkeypatch):
    answer = bytes(20) + bytes([10, 0, 7, 1]) + bytes(8)
    asked = []
    monkeypatch.setattr(
        network_interface.fcntl, "ioctl", lambda socket, request, data: asked.append((request, data)) or answer
    )
    with pytest.raises(BusError, match=r"eth9 carries the address 10\.0\.7\.1:"):
        require_unused("eth9")
    assert asked == [(0x8915, b"eth9" + bytes(252))], "SIOCGIFADDR"
