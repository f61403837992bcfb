"""Clients of Foxglove's WebSocket protocol: one that reads everything, and one that never reads."""

import base64
import json
import socket
import struct

from websockets.sync.client import connect

PROTOCOL = "foxglove.sdk.v1"


class Client:
    """Subscribes to everything.

    Attributes:
        server: The server's information message.
        channels: By topic.
    """

    def __init__(self, port):
        self.connection = connect(f"ws://127.0.0.1:{port}", subprotocols=[PROTOCOL], legacy=True)
        self.server = json.loads(self.connection.recv(timeout=10.0))
        channels = json.loads(self.connection.recv(timeout=10.0))["channels"]
        self.channels = {channel["topic"]: channel for channel in channels}
        self._topics = {channel["id"]: channel["topic"] for channel in channels}
        self.connection.send(subscription(self._topics))

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.connection.close()

    def __iter__(self):
        """Topic and content of each message, until the connection ends."""
        for data in self.connection:
            opcode, channel, _ = struct.unpack_from("<BIQ", data)
            assert opcode == 1
            yield self._topics[channel], json.loads(data[13:])


def subscription(channels):
    ids = [{"id": channel, "channelId": channel} for channel in channels]
    return json.dumps({"op": "subscribe", "subscriptions": ids})


def silent_client(port):
    """A client that subscribes to everything and then stops reading."""
    client = socket.socket()
    client.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    client.connect(("127.0.0.1", port))
    shake_hands(client)
    answer = client.makefile("rb", buffering=0)
    while answer.readline().strip():
        pass
    _text(answer)
    # Channels are numbered by process, so that an earlier server has taken the first numbers.
    text = subscription(channel["id"] for channel in json.loads(_text(answer))["channels"]).encode()
    client.sendall(bytes([0x81, 0x80 | 126]) + struct.pack(">H", len(text)) + bytes(4) + text)
    return client


def _text(answer):
    """The next message of the server, which is not masked."""
    size = _exactly(answer, 2)[1]
    if size >= 126:
        wide = {126: ">H", 127: ">Q"}[size]
        (size,) = struct.unpack(wide, _exactly(answer, struct.calcsize(wide)))
    return _exactly(answer, size)


def _exactly(answer, size):
    data = b""
    while len(data) < size:
        part = answer.read(size - len(data))
        assert part, "the server closed the connection"
        data += part
    return data


def shake_hands(client):
    """Request the protocol, and check that the server supports it."""
    key = base64.b64encode(bytes(16)).decode()
    client.sendall(
        "GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: {PROTOCOL}\r\n\r\n".encode()
    )
    assert b"101" in client.recv(64)
