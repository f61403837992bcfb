"""What an arm does, handed to a process that shows it live: a plug-in of the cycle and the operator's display in one.

    cycle -> LiveView -- bounded socket --> live_server (a process of its own) --> any number of clients

Rules. The cycle never waits: what does not fit into the socket is left out and counted, so neither a client nor the
server can delay a setpoint. The server is a process of its own, so that it takes neither the interpreter's lock nor
locked memory from the cycle. A client that does not keep up is disconnected there, and the operator reads of it between
two motions: a terminal may block. Clients look; nothing that they send is listened to.
"""

from __future__ import annotations

import ipaddress
import socket
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from importlib.util import find_spec
from multiprocessing import get_context
from typing import Self

import orjson

from armload_controller.config.robot import Robot
from armload_controller.control_errors import CommissioningError, ConfigurationError
from armload_controller.cycle.arm_frames import ArmFrames
from armload_controller.cycle.plugins import CycleStep
from armload_controller.cycle.run_recorder import joint_row, phase_of
from armload_controller.session.live_server import LIMIT_BYTES, LiveArm, serve
from armload_controller.session.run_session import Display, Operator

EVERY_S = 0.05
"""Time on the servos' clock between two messages; only to look at."""
_START_S = 60.0
"""Time that the server's process has to start; it loads its libraries, on a computer that may be busy."""
_END_S = 5.0
"""Time that it has to say goodbye to its clients."""


@dataclass(frozen=True)
class LiveAddress:
    """Where to serve.

    Attributes:
        host: Name or address of a network interface of this computer.
        port: TCP port; 0 is any that is free.
    """

    host: str = "127.0.0.1"
    port: int = 8765

    @classmethod
    def parse(cls, text: str) -> Self:
        """The address of HOST:PORT.

        Raises:
            ConfigurationError: it is none.
        """
        host, _, port = text.rpartition(":")
        if not host or not port.isdecimal() or int(port) > 65535:
            raise ConfigurationError("command line", "--live-address", text, "HOST:PORT, such as 127.0.0.1:8765")
        return cls(host.strip("[]"), int(port))

    @property
    def loopback(self) -> bool:
        """Only programs of this computer can connect."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"


class LiveView:
    """A plug-in that hands over what the cycle does, and a `Display` that hands over what the operator sees.

    Args:
        link: One end of a socket that keeps messages apart.
        display: What the operator sees; everything is shown there first.

    Attributes:
        left_out: Messages that did not fit.
        ended: The other end is gone; nothing is handed over any more.
    """

    name = "live view"

    def __init__(self, link: socket.socket, display: Display) -> None:
        link.setblocking(False)
        self._link, self._display = link, display
        self._text, self._share = "", 0.0
        self._shown_s = float("-inf")
        self.left_out = 0
        self.ended = False

    def on_cycle(self, step: CycleStep) -> None:
        """Hand over the last command with the feedback that belongs to it, every `EVERY_S`."""
        reference = step.sent_reference
        # a session's clock may begin anew
        if step.sent is None or reference is None or 0.0 <= step.feedback.time_s - self._shown_s < EVERY_S:
            return
        self._shown_s = step.feedback.time_s
        row = joint_row(step.feedback, step.sent, reference.segment, phase_of(reference))
        self._hand_over({"joints": row})

    def step(self, text: str) -> None:
        """Show that something begins."""
        self.show_warnings()
        self._display.step(text)
        self._text, self._share = text, 0.0
        self._hand_over({})

    @contextmanager
    def track(self, text: str, total: int) -> Iterator[Callable[[int], None]]:
        """Show something of known length."""
        with self._display.track(text, total) as shown:
            self._text, self._share = text, 0.0
            self._hand_over({})

            def done(count: int) -> None:
                self._share = count / total
                shown(count)

            yield done
        self._hand_over({})
        self.show_warnings()

    def show_warnings(self) -> None:
        """Show what the server has reported since, such as a client that it disconnected."""
        with suppress(OSError):
            while answer := self._link.recv(LIMIT_BYTES):
                self._display.step(f"warning: {orjson.loads(answer)['warning']}")

    def _hand_over(self, message: dict[str, object]) -> None:
        """Send a message with the progress in it, or leave it out."""
        if self.ended:
            return
        message["progress"] = {"text": self._text, "share": self._share}
        try:
            self._link.send(orjson.dumps(message, option=orjson.OPT_SERIALIZE_NUMPY))
        except ConnectionError:
            self.ended = True
        except OSError:
            self.left_out += 1


def live_at(live: bool, address: str | None) -> LiveAddress | None:
    """Where to serve by what the command line says; None where nothing is to be served.

    Args:
        live: Serve, at the usual address if no other is given.
        address: HOST:PORT to serve at.

    Raises:
        ConfigurationError: the address is none.
        CommissioningError: the library that serves is not installed.
    """
    if not live and address is None:
        return None
    if find_spec("foxglove") is None:
        raise CommissioningError('--live needs foxglove-sdk: pip install "armload[live]"')
    return LiveAddress() if address is None else LiveAddress.parse(address)


@contextmanager
def shown_live(operator: Operator, robot: Robot, address: LiveAddress | None) -> Iterator[Operator]:
    """The operator, with a live view of the arm served meanwhile.

    Args:
        operator: The person at the arm.
        robot: The arm.
        address: Where to serve; None serves nothing.

    Yields:
        The operator, whose sessions are seen in the view.

    Raises:
        CommissioningError: the address cannot be served; nothing was moved.
    """
    if address is None:
        yield operator
        return
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours:
        process = get_context("spawn").Process(
            target=serve, args=(theirs, address.host, address.port, _live_arm(robot)), name="live view", daemon=True
        )
        with theirs:
            process.start()
        try:
            port = _port_of(ours, address)
            host = f"[{address.host}]" if ":" in address.host else address.host
            operator.display.step(f"live: in Foxglove, open a connection to ws://{host}:{port}")
            if not address.loopback:
                operator.display.step(
                    "warning: anyone who can connect to this computer can watch the arm, but not command it"
                )
            view = LiveView(ours, operator.display)
            yield replace(operator, display=view, watching=(*operator.watching, view))
            view.show_warnings()
            if view.ended:
                operator.display.step("warning: the live view ended before the motion did")
        finally:
            ours.close()
            process.join(_END_S)
            process.kill()
            process.join()
            process.close()


def _live_arm(robot: Robot) -> LiveArm:
    """What the server has to know of an arm."""
    limits = robot.limits
    frames = ArmFrames(robot.chain, robot.joint_names)
    return LiveArm(frames, limits.motion, limits.torque_max_nm, robot.drives.transmission)


def _port_of(link: socket.socket, address: LiveAddress) -> int:
    """The port that is served.

    Raises:
        CommissioningError: none is.
    """
    link.settimeout(_START_S)
    try:
        answer = link.recv(LIMIT_BYTES)
    except TimeoutError as error:
        raise CommissioningError(f"the live view did not start within {_START_S:g} s: run without --live") from error
    problem = "its process ended" if not answer else orjson.loads(answer).get("problem")
    if problem is not None:
        raise CommissioningError(
            f"--live cannot serve {address.host}:{address.port}: {problem}. Give another with --live-address HOST:PORT"
        )
    port: int = orjson.loads(answer)["port"]
    return port
