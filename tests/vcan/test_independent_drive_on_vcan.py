"""`CanopenServos` and drives independent of this project, two processes on vcan0."""

import json
import subprocess
import sys
from pathlib import Path

import can
import numpy as np
import pytest

from armload_drivers.bus.kernel_sync import BcmSync, BroadcastManager
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.cia402.arm_settings import OperationMode
from armload_drivers.servos import JointCommand
from tests import independent_drive

pytestmark = pytest.mark.vcan

ZERO = np.zeros(3)
DEGREE = np.deg2rad(1.0)


@pytest.mark.parametrize("mode", list(OperationMode), ids=lambda mode: mode.name)
def test_they_are_booted_enabled_moved_and_disabled(independent_arm, mode):
    arm = independent_arm(mode, heartbeat_s=0.3, coupling=np.eye(3))
    nodes = [str(drive.node_id) for drive in arm.drives]
    drives = subprocess.Popen(
        [sys.executable, str(Path(independent_drive.__file__)), "socketcan", "vcan0", str(int(mode)), *nodes],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert drives.stdout.readline() == "ready\n"
        with can.Bus(interface="socketcan", channel="vcan0") as bus:
            servos = CanopenServos(arm, bus, BcmSync(BroadcastManager("vcan0")))
            servos.connect()
            assert not servos.simulated
            start = servos.enable().position_rad
            for cycle in range(1, 51):
                servos.exchange(JointCommand(start + DEGREE * cycle / 50, ZERO, ZERO))
            for _ in range(3):
                reached = servos.exchange(JointCommand(start + DEGREE, ZERO, ZERO))
            np.testing.assert_allclose(reached.position_rad, start + DEGREE, atol=1e-6)
            servos.stop()
            servos.disable()
            servos.close()
        output, _ = drives.communicate(timeout=20)
    finally:
        drives.kill()
        drives.wait()
    counts = independent_drive.COUNTS_PER_TURN / 360.0
    for axis, drive in enumerate(json.loads(output)):
        assert drive["position"] == pytest.approx(5000 * (axis + 1) + counts, abs=2)
        assert drive["states"][-5:] == [
            independent_drive.READY,
            independent_drive.SWITCHED_ON,
            independent_drive.ENABLED,
            independent_drive.QUICK_STOP,
            independent_drive.DISABLED,
        ]
        assert drive["jump"] < 0.4 * counts
