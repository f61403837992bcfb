"""The live view: a plug-in of the cycle, and a wrapper of the operator's display, that feed a separate server process.

    cycle -> LiveView -- bounded socket --> live_server (a separate process) --> any number of clients

Rules. The cycle never waits: messages that do not fit into the socket are dropped and counted, so neither a client nor
the server can delay a setpoint. The server is a separate process, so it takes neither the interpreter's lock nor locked
memory from the cycle. It disconnects a client that does not keep up; the operator is informed between two motions,
since a terminal may block. Clients only watch; anything they send is ignored.
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
from armload_controller.session.live.live_server import LIMIT_BYTES, LiveArm, serve
from armload_controller.session.run_session import Display, Operator

EVERY_S = 0.05
"""Time on the servos' clock between two messages, which serve display only."""
_START_TIMEOUT_S = 60.0
"""Time allowed for the server's process to start and load its libraries, possibly on a busy computer."""
_END_TIMEOUT_S = 5.0
"""Time allowed for it to close its clients' connections."""


@dataclass(frozen=True)
class LiveAddress:
    """Address of the live server.

    Attributes:
        host: Name or address of a network interface of this computer.
        port: TCP port; 0 for any free one.
    """

    host: str = "127.0.0.1"
    port: int = 8765

    @classmethod
    def parse(cls, text: str) -> Self:
        """The address from HOST:PORT.

        Raises:
            ConfigurationError: the text does not have this form.
        """
        host, _, port = text.rpartition(":")
        if not host or not port.isdecimal() or int(port) > 65535:
            raise ConfigurationError("command line", "--live-address", text, "HOST:PORT, such as 127.0.0.1:8765")
        return cls(host.strip("[]"), int(port))

    @property
    def loopback(self) -> bool:
        """Whether only programs on this computer can connect."""
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return self.host == "localhost"


class LiveView:
    """A plug-in that sends the cycle's rows to the server, and a `Display` that sends the operator's progress.

    Args:
        link: One end of a socket that preserves message boundaries.
        display: The operator's display; everything is shown there first.

    Attributes:
        left_out: Number of messages that were dropped.
        ended: Whether the other end is closed; nothing more is sent.
    """

    name = "live view"

    def __init__(self, link: socket.socket, display: Display) -> None:
        link.setblocking(False)
        self._link, self._display = link, display
        self._progress_text, self._progress_share = "", 0.0
        self._last_sent_s = float("-inf")
        self.left_out = 0
        self.ended = False

    def on_cycle(self, step: CycleStep) -> None:
        """Send the last command with its feedback, every `EVERY_S`."""
        reference = step.sent_reference
        # a new session's clock may start again
        if step.sent is None or reference is None or 0.0 <= step.feedback.time_s - self._last_sent_s < EVERY_S:
            return
        self._last_sent_s = step.feedback.time_s
        row = joint_row(step.feedback, step.sent, reference.segment, phase_of(reference))
        self._hand_over({"joints": row})

    def step(self, text: str) -> None:
        """Show the start of an activity."""
        self.show_warnings()
        self._display.step(text)
        self._progress_text, self._progress_share = text, 0.0
        self._hand_over({})

    @contextmanager
    def track(self, text: str, total: int) -> Iterator[Callable[[int], None]]:
        """Show an activity of known length."""
        with self._display.track(text, total) as shown:
            self._progress_text, self._progress_share = text, 0.0
            self._hand_over({})

            def done(count: int) -> None:
                self._progress_share = count / total
                shown(count)

            yield done
        self._hand_over({})
        self.show_warnings()

    def show_warnings(self) -> None:
        """Show the server's new warnings, such as the disconnection of a client."""
        with suppress(OSError):
            while answer := self._link.recv(LIMIT_BYTES):
                self._display.step(f"warning: {orjson.loads(answer)['warning']}")

    def _hand_over(self, message: dict[str, object]) -> None:
        """Send a message with the progress added, or drop it."""
        if self.ended:
            return
        message["progress"] = {"text": self._progress_text, "share": self._progress_share}
        try:
            self._link.send(orjson.dumps(message, option=orjson.OPT_SERIALIZE_NUMPY))
        except ConnectionError:
            self.ended = True
        except OSError:
            self.left_out += 1


def live_at(live: bool, address: str | None) -> LiveAddress | None:
    """The server's address from the command line; None if no live view is requested.

    Args:
        live: Whether to serve, at the default address if none is given.
        address: HOST:PORT to serve at.

    Raises:
        ConfigurationError: the address is invalid.
        CommissioningError: the server's library is not installed.
    """
    if not live and address is None:
        return None
    if find_spec("foxglove") is None:
        raise CommissioningError('--live needs foxglove-sdk: pip install "armload[live]"')
    return LiveAddress() if address is None else LiveAddress.parse(address)


@contextmanager
def shown_live(operator: Operator, robot: Robot, address: LiveAddress | None) -> Iterator[Operator]:
    """Serve a live view of the arm within a `with` block.

    Args:
        operator: The person at the arm.
        address: Address to serve at; None for no live view.

    Yields:
        The operator, whose sessions appear in the view.

    Raises:
        CommissioningError: the address cannot be served; nothing was moved.
    """
    if address is None:
        yield operator
        return
    frames = ArmFrames(robot.chain, robot.joint_names)
    arm = LiveArm(frames, robot.limits.motion, robot.limits.torque_max_nm, robot.drives.transmission)
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours:
        process = get_context("spawn").Process(
            target=serve, args=(theirs, address.host, address.port, arm), name="live view", daemon=True
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
            process.join(_END_TIMEOUT_S)
            process.kill()
            process.join()
            process.close()


def _port_of(link: socket.socket, address: LiveAddress) -> int:
    """The port that the server listens on."""
    link.settimeout(_START_TIMEOUT_S)
    try:
        answer = link.recv(LIMIT_BYTES)
    except TimeoutError as error:
        raise CommissioningError(
            f"the live view did not start within {_START_TIMEOUT_S:g} s: run without --live"
        ) from error
    problem = "its process ended" if not answer else orjson.loads(answer).get("problem")
    if problem is not None:
        raise CommissioningError(
            f"--live cannot serve {address.host}:{address.port}: {problem}. Give another with --live-address HOST:PORT"
        )
    port: int = orjson.loads(answer)["port"]
    return port
