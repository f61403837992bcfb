"""The process that serves an arm's motion over Foxglove's WebSocket protocol to any number of clients.

    /joints    a cycle's row, as in a recording
    /frames    every link's frame in the previous one, as in a recording: the arm in 3-D
    /limits    the joints' limits, and the used share of each
    /progress  the present activity, and the fraction completed

The SDK's server listens only on loopback, behind a relay that disconnects a client that does not keep up. The SDK's
`stop` waits forever for a client that does not read (measured with 0.30), so this process ends without waiting for it.

References:
    Foxglove WebSocket protocol, https://github.com/foxglove/ws-protocol.
"""

from __future__ import annotations

import os
import signal
import socket
import time
from contextlib import suppress
from dataclasses import dataclass
from importlib.resources import files
from threading import Thread
from typing import Any

import numpy as np
import orjson

from armload_controller.cycle.arm_frames import FRAMES_SCHEMA, FRAMES_TOPIC, ArmFrames
from armload_controller.motion.joint_limits import MotionLimits
from armload_controller.session.live.live_relay import LOOPBACK, ClientLimits, Relay
from armload_identification.float_array import FloatArray
from armload_identification.recording.run_format import MESSAGE_SCHEMA, TOPIC
from armload_identification.signals.joint_torque import Transmission

LIMITS_TOPIC, PROGRESS_TOPIC = "/limits", "/progress"
LIMIT_BYTES = 65536
"""Greatest message of the cycle; the row of 16 joints takes 2 kB."""
REPEAT_S = 1.0
"""While nothing happens, the last messages are repeated at this interval for clients that connect later."""
_SDK_QUEUE = 64
"""Messages that the SDK queues for the relay, which reads them immediately."""
_NICE_LEVEL = 10
_GOODBYE_S = 1.0
"""Time to close the connections, first of the SDK's server and then of the relay."""


@dataclass(frozen=True, eq=False)
class LiveArm:
    """Data of an arm of n joints that do not change in motion.

    Attributes:
        frames: Makes messages with the links' frames.
        limits: Limits of its motion.
        torque_max_nm: (n,) greatest torque of each joint.
        transmission: Converts motor current to joint torque.
    """

    frames: ArmFrames
    limits: MotionLimits
    torque_max_nm: FloatArray
    transmission: Transmission

    def limits_message(self, row: dict[str, Any]) -> bytes:
        """The limits, and the share of each that a cycle's row, as in a recording, uses."""
        limits = self.limits
        values = {key: _values(row, key) for key in ("position_rad", "velocity_rad_s", "current_a", "torque_nm")}
        torque = self.transmission.measured(values["torque_nm"], values["current_a"])
        half = (limits.position_max_rad - limits.position_min_rad) / 2.0
        off_center = np.abs(np.array(row["position_rad"]) - limits.position_min_rad - half)
        behind = np.abs(np.array(row["command_position_rad"]) - np.array(row["position_rad"]))
        message = {
            "joint_names": limits.joint_names,
            "position_min_rad": limits.position_min_rad,
            "position_max_rad": limits.position_max_rad,
            "velocity_max_rad_s": limits.velocity_max_rad_s,
            "torque_max_nm": self.torque_max_nm,
            "following_error_max_rad": limits.following_error_rad,
            "position_share": off_center / half,
            "velocity_share": _share(values["velocity_rad_s"], limits.velocity_max_rad_s),
            "torque_share": _share(torque, self.torque_max_nm),
            "following_error_share": behind / limits.following_error_rad,
        }
        return orjson.dumps(message, option=orjson.OPT_SERIALIZE_NUMPY)


def serve(link: socket.socket, host: str, port: int, arm: LiveArm) -> None:
    """Serve until the other end of the link is closed, then end this process.

    Args:
        link: See `serve_clients`.
        host: Address to listen on.
        port: Port to listen on; 0 for any free one.
        arm: Data of the arm.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the motion, which is shown until it ends
    os.nice(_NICE_LEVEL)
    serve_clients(link, host, port, arm, ClientLimits())
    os._exit(0)


def serve_clients(link: socket.socket, host: str, port: int, arm: LiveArm, limits: ClientLimits) -> None:
    """Serve until the other end of the link is closed.

    Args:
        link: Carries one JSON object per message: `joints` is a cycle's row, `progress` a text and a fraction. The
            first reply is the `port` or the `problem`; each later one is a `warning` for the operator.
        host: Address to listen on.
        port: Port to listen on; 0 for any free one.
        arm: Data of the arm.
        limits: How far a client may fall behind.
    """
    try:
        listener = _listener(host, port)
    except (OSError, UnicodeError) as error:
        link.send(orjson.dumps({"problem": getattr(error, "strerror", None) or str(error)}))
        return
    import foxglove

    foxglove.set_log_level("CRITICAL")  # its messages on clients would disturb the operator's display
    context = foxglove.Context()
    server = foxglove.start_server(
        name="armload", host=LOOPBACK, port=0, context=context, message_backlog_size=_SDK_QUEUE
    )
    channels = {
        topic: foxglove.Channel(topic, schema=schema, context=context)
        for topic, schema in (
            (TOPIC, MESSAGE_SCHEMA),
            (FRAMES_TOPIC, FRAMES_SCHEMA),
            (LIMITS_TOPIC, _schema("limits")),
            (PROGRESS_TOPIC, _schema("progress")),
        )
    }
    with link.dup() as warnings:
        warnings.setblocking(False)

        def warn(text: str) -> None:
            with suppress(OSError):  # the operator's end is full, or closed
                warnings.send(orjson.dumps({"warning": text}))

        relay = Relay(listener, server.port, limits, warn)
        link.send(orjson.dumps({"port": listener.getsockname()[1]}))
        link.settimeout(REPEAT_S)
        last: dict[str, Any] = {}
        while True:
            try:
                data = link.recv(LIMIT_BYTES)
            except TimeoutError:
                data = b"{}"
            except ConnectionError:  # closed with warnings that nobody read
                break
            if not data:
                break
            last |= orjson.loads(data)
            now_ns = time.time_ns()
            for topic, message in _messages(last, arm, now_ns).items():
                channels[topic].log(message, log_time=now_ns)
        goodbye = Thread(target=server.stop, daemon=True)
        goodbye.start()
        goodbye.join(_GOODBYE_S)
        relay.close(_GOODBYE_S)


def _schema(name: str) -> dict[str, Any]:
    """The JSON schema of a topic's messages."""
    found: dict[str, Any] = orjson.loads(files(__package__).joinpath(f"{name}.json").read_bytes())
    return found


def _listener(host: str, port: int) -> socket.socket:
    """A listening socket at the first address of a host, IPv4 or IPv6."""
    family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
    return socket.create_server(address[:2], family=family, dualstack_ipv6=family is socket.AF_INET6)


def _messages(state: dict[str, Any], arm: LiveArm, now_ns: int) -> dict[str, bytes]:
    """The messages by topic."""
    messages = {}
    if "progress" in state:
        messages[PROGRESS_TOPIC] = orjson.dumps(state["progress"])
    if "joints" in state:
        row = state["joints"]
        messages[TOPIC] = orjson.dumps(row)
        messages[FRAMES_TOPIC] = arm.frames.message(np.array(row["position_rad"]), now_ns)
        messages[LIMITS_TOPIC] = arm.limits_message(row)
    return messages


def _values(row: dict[str, Any], key: str) -> FloatArray | None:
    """Numbers of a row; None if the drives do not report them."""
    return np.array(row[key]) if key in row else None


def _share(values: FloatArray | None, greatest: FloatArray) -> FloatArray | None:
    """(n,) used share of a limit."""
    return None if values is None else np.abs(values) / greatest
