"""Drives on another CANopen stack: Lely's, with ros2_canopen's fake slave, started and ordered about on vcan0.

They are those of `../shared/tools/canopen-drives`; each motor is alone, without gravity. Build them first:
`canopen-drives --prepare`.
"""

from __future__ import annotations

import json
import signal
import socket
import subprocess
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from armload_drivers.cia402.state_machine import POWERED, state_in

DRIVES = Path(__file__).resolve().parents[2] / "shared" / "tools" / "canopen-drives"


class ForeignDrives:
    """The drives of a range of nodes, such as 3-8, until they are closed.

    Args:
        folder: For their sockets.
        nodes: Their nodes.
        presets: Objects that are not as after a reset, such as 3:6076:0=1000, or 1018:1=5 for all nodes.
    """

    def __init__(self, folder: Path, nodes: str, presets: Sequence[str]) -> None:
        self._control, self._mine = str(folder / "control"), str(folder / "mine")
        words = [word for preset in presets for word in ("--set", preset)]
        self._process = subprocess.Popen(
            [DRIVES, "vcan0", "--nodes", nodes, "--control", self._control, *words], stdout=subprocess.PIPE, text=True
        )
        assert "orders:" in self._process.stdout.readline()

    def order(self, text: str) -> str:
        """Give an order; the answer."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as mine:
            Path(self._mine).unlink(missing_ok=True)
            mine.bind(self._mine)
            mine.settimeout(5.0)
            mine.sendto(text.encode(), self._control)
            return mine.recv(65536).decode()

    def stats(self) -> dict[int, dict[str, Any]]:
        """State of every drive by node."""
        return {drive["node"]: drive for drive in json.loads(self.order("stats"))["drives"]}

    def powered(self) -> list[int]:
        """Nodes that carry torque."""
        return [node for node, drive in self.stats().items() if state_in(drive["statusword"]) in POWERED]

    def close(self) -> None:
        """End them."""
        self._process.send_signal(signal.SIGTERM)
        self._process.wait(10.0)
        self._process.stdout.close()
