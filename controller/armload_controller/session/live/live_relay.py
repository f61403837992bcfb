"""A relay between the live server and its clients, which disconnects a client that does not keep up.

    client <- bounded queue -> Relay <- loopback -> the SDK's server

A client must be a program, or a page that Foxglove serves: any other web page in the operator's browser could read the
arm's motion. So the relay reads the request's Origin, and its Host, which a page can make its own name (DNS rebinding).
The number of clients is bounded, and one that sends no request is disconnected.

The SDK cannot disconnect a client; it only drops messages for a slow one. So the relay reads everything from the SDK
immediately, for every client, and queues what a client has not yet read. A client whose queue grows too long, or that
reads nothing for too long while data are queued, is disconnected; the others are not affected.
"""

from __future__ import annotations

import asyncio
import socket
import struct
from collections.abc import Callable, Coroutine
from contextlib import closing, suppress
from dataclasses import dataclass
from ipaddress import ip_address
from threading import Thread
from typing import Any, Final
from urllib.parse import urlsplit

LOOPBACK: Final = "127.0.0.1"
_CHUNK_BYTES: Final = 65536
_ORIGINS: Final = {"https://app.foxglove.dev", "https://studio.foxglove.dev"}
"""Pages that may watch."""
_RESET_ON_CLOSE: Final = struct.pack("ii", 1, 0)


@dataclass(frozen=True)
class ClientLimits:
    """How far a client may fall behind. An arm of seven joints produces 0.1 MB/s, which a WLAN of 1 Mbit/s carries.

    Attributes:
        waiting_bytes: Greatest size of its queue: more than half a minute of messages.
        stalled_s: Longest time in s without reading while data are queued; covers a change of access points.
        kernel_bytes: Size of the socket's buffer. The kernel would let it grow to 4 MB, and until it is full a client
            that has stopped reading would seem to read.
        clients: Most clients at a time.
        request_s: Longest time in s for a client's request.
    """

    waiting_bytes: int = 4 * 2**20
    stalled_s: float = 10.0
    kernel_bytes: int = 2**17
    clients: int = 32
    request_s: float = 5.0


def refusal(request: bytes) -> str | None:
    """Why a client must not watch; None for a program, and for a page of Foxglove or of this computer's files.

    Args:
        request: Its HTTP request, up to the empty line.
    """
    lines = [line.partition(":") for line in request.decode("latin-1").split("\r\n")[1:]]
    headers = {name.strip().lower(): value.strip() for name, _, value in lines}
    origin = headers.get("origin")
    if origin is not None and not origin.startswith("file:") and origin not in _ORIGINS:
        return f"the web page {origin!r:.100} is not one of Foxglove's"
    host = urlsplit(f"//{headers.get('host', '')}").hostname or ""
    try:
        ip_address(host)
    except ValueError:
        own = socket.gethostname().lower()
        if host not in {"localhost", own, f"{own}.local", socket.getfqdn().lower()}:
            return f"it asked for the host {host!r:.100}, which is no name of this computer; use its address"
    return None


class ClientPace:
    """Tracks how far a client, connected at `now_s`, is behind."""

    def __init__(self, limits: ClientLimits, now_s: float) -> None:
        self._limits = limits
        self._sent_bytes = self._read_bytes = 0
        self._last_read_s = now_s

    def problem(self, size: int, waiting: int, now_s: float) -> str | None:
        """Why the client must be disconnected; None if it keeps up.

        Args:
            size: Number of bytes about to be sent to it.
            waiting: Number of bytes sent to it and not yet read.
            now_s: Present time.
        """
        taken = self._sent_bytes - waiting
        if waiting == 0 or taken > self._read_bytes:
            self._read_bytes, self._last_read_s = taken, now_s
        self._sent_bytes += size
        if waiting + size > self._limits.waiting_bytes:
            return f"more than {self._limits.waiting_bytes / 1e6:.2g} MB was waiting to be sent to it"
        if now_s - self._last_read_s > self._limits.stalled_s:
            return f"it read nothing for {self._limits.stalled_s:g} s"
        return None


class Relay:
    """Serves clients in its own thread, each through a separate connection to the server on this computer.

    Args:
        listener: Socket that clients connect to.
        port: Port of the server on the loopback interface.
        limits: How far each client may fall behind.
        report: Called with a sentence for the operator for each disconnected client, in the relay's thread.
    """

    def __init__(self, listener: socket.socket, port: int, limits: ClientLimits, report: Callable[[str], None]) -> None:
        self._listener, self._port, self._limits, self._report = listener, port, limits, report
        self._clients: set[asyncio.Task[Any]] = set()
        self._last_refusal = ""
        self._loop = asyncio.new_event_loop()
        self._closing = asyncio.Event()
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def close(self, timeout_s: float) -> None:
        """Accept no more clients, and send the connected ones their queues. Stop the server first.

        Args:
            timeout_s: Longest time to wait.
        """
        self._loop.call_soon_threadsafe(self._closing.set)
        self._thread.join(timeout_s)

    def _run(self) -> None:
        """The relay's thread."""
        with closing(self._loop):
            self._loop.run_until_complete(self._serve())

    async def _serve(self) -> None:
        """Accept clients until `close`."""
        async with await asyncio.start_server(self._client, sock=self._listener):
            await self._closing.wait()
        while self._clients:
            await asyncio.wait(self._clients)

    async def _client(self, from_client: asyncio.StreamReader, to_client: asyncio.StreamWriter) -> None:
        """Serve a client until either side disconnects."""
        task = asyncio.current_task()
        if task is None:
            raise RuntimeError("a client is served by a task")
        self._clients.add(task)
        task.add_done_callback(self._clients.discard)
        if to_client.get_extra_info("peername") is None:  # gone already
            to_client.transport.abort()
            return
        own_end = to_client.get_extra_info("socket")
        own_end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, self._limits.kernel_bytes)
        request, problem = await self._request(from_client)
        if problem is not None:
            host, port, *_ = to_client.get_extra_info("peername")
            to_client.write(b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
            to_client.close()
            if problem != self._last_refusal:  # told once, not for each of hundreds
                self._last_refusal = problem
                self._report(f"the live view refused a client, {host}, port {port}: {problem}")
            return
        try:
            from_server, to_server = await asyncio.open_connection(LOOPBACK, self._port)
        except OSError:  # the server has ended
            to_client.transport.abort()
            return
        try:
            to_server.write(request)
            await _until_first_ends(
                self._forward_to_client(from_server, to_client), _forward_to_server(from_client, to_server)
            )
        finally:
            to_server.transport.abort()
            to_client.close()
            with suppress(OSError, TimeoutError):
                await asyncio.wait_for(to_client.wait_closed(), self._limits.stalled_s)
            to_client.transport.abort()

    async def _request(self, from_client: asyncio.StreamReader) -> tuple[bytes, str | None]:
        """A client's request, and why it is refused; None if it is not."""
        if len(self._clients) > self._limits.clients:
            return b"", f"there are {self._limits.clients} clients already"
        try:
            request = await asyncio.wait_for(from_client.readuntil(b"\r\n\r\n"), self._limits.request_s)
        except (OSError, EOFError, TimeoutError, asyncio.LimitOverrunError):
            return b"", f"it sent no request within {self._limits.request_s:g} s"
        return request, refusal(request)

    async def _forward_to_client(self, from_server: asyncio.StreamReader, to_client: asyncio.StreamWriter) -> None:
        """Forward the server's data to a client, until the server ends or the client is too far behind."""
        clock = asyncio.get_running_loop().time
        pace = ClientPace(self._limits, clock())
        while data := await from_server.read(_CHUNK_BYTES):
            problem = pace.problem(len(data), to_client.transport.get_write_buffer_size(), clock())
            if problem is not None:
                host, port, *_ = to_client.get_extra_info("peername")
                # reset: otherwise the kernel keeps trying to send its buffer to a client that does not read
                end = to_client.get_extra_info("socket")
                end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET_ON_CLOSE)
                to_client.transport.abort()
                self._report(f"the live view's client {host}, port {port}, was disconnected: {problem}")
                return
            # not drained: the pace bounds the queue, and the server never waits
            to_client.write(data)


async def _forward_to_server(from_client: asyncio.StreamReader, to_server: asyncio.StreamWriter) -> None:
    """Forward a client's data to the server, as fast as the server reads."""
    while data := await from_client.read(_CHUNK_BYTES):
        to_server.write(data)
        await to_server.drain()


async def _until_first_ends(*works: Coroutine[Any, Any, None]) -> None:
    """Run several coroutines until the first ends or loses its connection."""
    tasks = [asyncio.ensure_future(work) for work in works]
    await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
    for task in tasks:
        task.cancel()
        with suppress(OSError, asyncio.CancelledError):
            await task
