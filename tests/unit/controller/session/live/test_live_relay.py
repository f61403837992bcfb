"""The live view's relay: a client that does not keep up is disconnected, without effect on others."""

import json
import socket
from contextlib import ExitStack, closing, contextmanager
from threading import Thread

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.cycle.arm_frames import ArmFrames
from armload_controller.cycle.plugins import CycleStep
from armload_controller.motion.leg_interpolator import Reference
from armload_controller.motion.phase import PhaseState, Segment
from armload_controller.session.live.live_relay import ClientLimits, ClientPace, Relay, refusal
from armload_controller.session.live.live_server import LiveArm, serve_clients
from armload_controller.session.live.live_view import LiveView
from armload_controller.session.run_session import NoDisplay
from armload_drivers.servos import JointCommand, JointFeedback
from tests.foxglove_clients import Client, shake_hands, silent_client

EVERY_S = 0.05

ROBOT = load_robot("prbt")
ARM = LiveArm(
    ArmFrames(ROBOT.chain, ROBOT.joint_names),
    ROBOT.limits.motion,
    ROBOT.limits.torque_max_nm,
    ROBOT.drives.transmission,
)
SMALL = ClientLimits(waiting_bytes=30_000, stalled_s=1e9, kernel_bytes=4096)
LATER = 20
REQUEST = b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"


class Lines(NoDisplay):
    """Records the operator's messages."""

    def __init__(self):
        self.texts = []

    def step(self, text):
        self.texts.append(text)


def moving(cycle):
    """The plug-ins' view of a cycle of an arm whose first joint turns by 1 mrad per cycle."""
    position, nothing = np.array([cycle * 1e-3, 0.6, 1.2, 0.0, 0.5, 0.0]), np.zeros(6)
    word, missing = np.zeros(6, np.uint16), np.zeros(6, bool)
    command = JointCommand(position, nothing, nothing)
    reference = Reference(position, nothing, nothing, Segment.HOLD, PhaseState(0.0, 0.0, 0.0))
    feedback = JointFeedback(cycle, cycle * EVERY_S * 1.01, position, None, nothing, None, word, missing)
    return CycleStep(feedback, command, reference, command, reference, lambda reason: None)


@contextmanager
def served(host="127.0.0.1", limits=SMALL):
    """The cycle's end of the view, with the server in this process, and the server's first answer."""
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    thread = Thread(target=serve_clients, args=(theirs, host, 0, ARM, limits))
    thread.start()
    try:
        answer = json.loads(ours.recv(65536))
        yield LiveView(ours, Lines()), answer
    finally:
        ours.close()
        thread.join(20.0)
        theirs.close()
    assert not thread.is_alive()


def test_a_client_that_ends_reading_is_disconnected_and_the_others_see_every_frame():
    with ExitStack() as stack:
        view, answer = stack.enter_context(served())
        port = answer["port"]
        lines = view._display.texts
        silent = stack.enter_context(silent_client(port))
        silent_port = silent.getsockname()[1]
        coming = iter(stack.enter_context(Client(port)))

        def seen(cycle):
            """Show a cycle and wait until the watching client has it; returns the first joint's angle in rad."""
            view.on_cycle(moving(cycle))
            view.show_warnings()
            return next(message for topic, message in coming if topic == "/joints")["position_rad"][0]

        cycle, disconnected = 0, None
        while disconnected is None or cycle < disconnected + LATER:
            assert seen(cycle) == pytest.approx(cycle * 1e-3)
            if lines and disconnected is None:
                disconnected = cycle
            cycle += 1
            assert cycle < 2000
        assert lines == [
            f"warning: the live view's client 127.0.0.1, port {silent_port}, was disconnected: "
            "more than 0.03 MB was waiting to be sent to it"
        ]
        silent.settimeout(10.0)
        left = []
        with pytest.raises(ConnectionResetError):
            left.extend(iter(lambda: silent.recv(65536), b""))
        assert sum(map(len, left)) < SMALL.waiting_bytes + 2 * SMALL.kernel_bytes + 8192

        silent.close()
        again = stack.enter_context(Client(port))
        view.step("nothing new of the arm")
        joints = next(message for topic, message in again if topic == "/joints")
        assert joints["position_rad"][0] == pytest.approx((cycle - 1) * 1e-3)
        assert view.left_out == 0


@contextmanager
def relayed(limits=SMALL):
    """A test server behind a relay: a client's connection, the server's end of it, and the reports."""
    reports = []
    with socket.create_server(("127.0.0.1", 0)) as server:
        listener = socket.create_server(("127.0.0.1", 0))
        relay = Relay(listener, server.getsockname()[1], limits, reports.append)
        with closing(socket.create_connection(listener.getsockname(), 10.0)) as client:
            client.sendall(REQUEST)
            own, _ = server.accept()
            own.settimeout(10.0)
            with own:
                assert own.recv(100) == REQUEST
                yield client, own, reports
        relay.close(10.0)
    assert not relay._thread.is_alive()


def test_bytes_pass_both_ways_and_what_waits_is_delivered_after_the_server_s_end():
    with relayed() as (client, server, reports):
        client.sendall(b"question")
        assert server.recv(100) == b"question"
        server.sendall(bytes(20_000))
        server.close()
        received = bytearray()
        while data := client.recv(1000):
            received += data
        assert received == bytes(20_000)
        assert reports == []


def test_the_server_s_connection_ends_with_the_client_s():
    with relayed() as (client, server, _):
        client.close()
        assert server.recv(100) == b""


def test_a_client_that_is_disconnected_never_keeps_the_server_waiting_and_frees_its_connection():
    """If the relay waited for the client, sending would time out."""
    with relayed(ClientLimits(waiting_bytes=300_000, stalled_s=1e9, kernel_bytes=4096)) as (_, server, reports):
        with pytest.raises(ConnectionError):
            server.sendall(bytes(100_000_000))
        assert len(reports) == 1


def paced(*events):
    """Results of a pace for successive (bytes given, bytes waiting, time)."""
    pace = ClientPace(ClientLimits(waiting_bytes=1000, stalled_s=10.0), 0.0)
    return [pace.problem(*event) for event in events]


def test_a_client_may_be_slow_for_as_long_as_it_takes_something():
    assert paced((500, 0, 0.0), *((10, 499, 9.0 * k) for k in range(1, 50))) == [None] * 50


def test_a_client_that_takes_nothing_while_something_waits_is_too_slow():
    assert paced((100, 0, 1.0), (100, 100, 10.9), (100, 200, 11.1))[:2] == [None, None]
    assert paced((100, 0, 1.0), (100, 100, 10.9), (100, 200, 11.1))[2] == "it read nothing for 10 s"


def test_time_in_which_there_was_nothing_to_send_does_not_count():
    assert paced((100, 0, 1.0), (100, 0, 60.0), (100, 100, 69.0)) == [None] * 3


@pytest.mark.parametrize("host", ["::1", "localhost"])
def test_other_names_of_the_loopback_interface_are_served(host):
    try:
        socket.create_server((host, 0), family=socket.getaddrinfo(host, 0)[0][0]).close()
    except OSError as error:
        pytest.skip(f"{host}: {error}")
    with served(host) as (_, answer), socket.create_connection((host, answer["port"]), 10.0) as client:
        shake_hands(client)


def test_a_name_that_cannot_be_is_a_problem():
    with served("..") as (_, answer):
        assert "label empty" in answer["problem"]


def asked(port, *headers, host="127.0.0.1"):
    """The first bytes of the answer to a request with these headers; empty if the connection was closed."""
    with socket.create_connection(("127.0.0.1", port), timeout=10.0) as client:
        lines = ["GET / HTTP/1.1", f"Host: {host}:{port}", *headers, "Upgrade: websocket", "Connection: Upgrade"]
        lines += [f"Sec-WebSocket-Key: {'A' * 22}==", "Sec-WebSocket-Version: 13"]
        lines += ["Sec-WebSocket-Protocol: foxglove.sdk.v1", "", ""]
        client.sendall("\r\n".join(lines).encode())
        return client.recv(12)


def test_no_web_page_reads_the_arm():
    """Any page in the operator's browser could; its own name for this computer (DNS rebinding) does not help."""
    with served() as (_, answer):
        port = answer["port"]
        assert asked(port) == b"HTTP/1.1 101"
        assert asked(port, "Origin: https://app.foxglove.dev") == b"HTTP/1.1 101"
        assert asked(port, "Origin: file://") == b"HTTP/1.1 101"
        for origin in (
            "https://evil.example",
            "null",
            "https://app.foxglove.dev.evil.example",
            f"http://127.0.0.1:{port}",
        ):
            assert asked(port, f"Origin: {origin}") == b"HTTP/1.1 403"
        assert asked(port, host="evil.example") == b"HTTP/1.1 403"


@pytest.mark.parametrize(
    ("host", "good"),
    [("localhost:8765", True), ("[::1]:8765", True), ("192.168.1.4:8765", True), ("evil.example", False), ("", False)],
)
def test_the_host_is_a_name_of_this_computer(host, good):
    assert (refusal(f"GET / HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()) is None) is good


def test_connections_without_a_request_do_not_shut_the_view():
    """450 of them took all of the process's files, and no later client was served or told why."""
    with served(limits=ClientLimits(clients=4, request_s=0.3)) as (view, answer), ExitStack() as stack:
        port, lines = answer["port"], view._display.texts
        idle = [stack.enter_context(socket.create_connection(("127.0.0.1", port), 10.0)) for _ in range(450)]
        for client in idle:
            assert client.recv(12) == b"HTTP/1.1 403"
        assert asked(port) == b"HTTP/1.1 101"
        view.show_warnings()
        assert any("refused a client" in line for line in lines)
