"""Layer setting services on a real SocketCAN interface, by the command, with an independent slave."""

import can
import pytest

from tests.lss_slave import LssSlave, serve

pytestmark = pytest.mark.vcan

IDENTITY = (0x0000_02DC, 0x1234_5678, 0x0001_0000, 0x0000_0007)
COMMAND = ("drives", "assign", "socketcan:vcan0", "--node-id", "23")


def test_a_node_gets_an_id_and_answers_by_it(armload):
    slave = LssSlave(IDENTITY)
    with can.Bus(interface="socketcan", channel="vcan0") as bus, serve(bus, slave):
        done = armload(*COMMAND, "--new-bitrate", "500000", "--yes")
        assert done.exit_code == 0, done.output
        assert "0x000002DC:0x12345678:0x00010000:0x00000007: node id 23" in done.output
        assert slave.stored == (23, bytes([0, 2]))
        scanned = armload("drives", "scan", "socketcan:vcan0", "--json")
        assert '"node_id": 23' in scanned.output
        again = armload(*COMMAND, "--yes")
        assert "node id 23 is in use" in str(again.exception)
