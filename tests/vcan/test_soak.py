"""Ten minutes of streaming six joints at 50 Hz on vcan0: no frame and no recorder row is lost.

Not part of `make test`: `pytest -m soak tests/vcan/test_soak.py`, on an otherwise idle machine with vcan0, because late
feedback counts as missing. Late and lost frames are counted separately. ARMLOAD_SOAK_S shortens the test.
"""

import os
import subprocess
import sys
import time
from dataclasses import replace

import can
import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.motion.phase import Segment
from armload_drivers.bus.kernel_sync import BcmSync, BroadcastManager
from armload_drivers.canopen.canopen_servos import CanopenServos
from armload_drivers.servos import JointCommand
from armload_identification.recording.file_reading import read_recording_file

CYCLE_HZ = 50
SECONDS = float(os.environ.get("ARMLOAD_SOAK_S", "600"))
pytestmark = [pytest.mark.soak, pytest.mark.timeout(SECONDS + 240.0)]
DRIVES = """
import sys, time
import can, numpy as np
from armload_controller.config.robot import load_robot
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from tests.ideal_plant import IdealPlant

robot = load_robot("er50").with_bus("socketcan", "vcan0", None, 50.0)
with can.Bus(interface="socketcan", channel="vcan0") as bus:
    with SimulatedDrives(robot.drives.settings, IdealPlant(np.zeros(6)), bus, time.monotonic) as drives:
        print("ready", flush=True)
        sys.stdin.readline()
        print(drives.frames_lost, flush=True)
"""


@pytest.fixture
def drives():
    process = subprocess.Popen([sys.executable, "-c", DRIVES], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "ready\n"
    yield process
    if process.poll() is None:
        process.communicate("\n", timeout=20)


class Counted:
    """Number of handled frames with some COB-IDs."""

    def __init__(self, link, cob_ids):
        self.frames = 0
        for cob_id in cob_ids:
            self._count(link, cob_id)

    def _count(self, link, cob_id):
        handler = link._handlers[cob_id]

        def take(data):
            self.frames += 1
            handler(data)

        link.subscribe(cob_id, take)


def test_ten_minutes_lose_nothing(drives, tmp_path):
    robot = load_robot("er50").with_bus("socketcan", "vcan0", None, float(CYCLE_HZ))
    # A virtual machine on a busy host pauses at times; that is not tested here.
    arm = replace(robot.drives.settings, heartbeat_s=0.5)
    cycles, zero, path = round(SECONDS * CYCLE_HZ), np.zeros(6), tmp_path / "soak.mcap"
    missing = skipped = 0
    with can.Bus(interface="socketcan", channel="vcan0") as bus, Recorder(path, {}) as recorder:
        servos = CanopenServos(arm, bus, BcmSync(BroadcastManager("vcan0")))
        servos.connect()
        start = servos.enable().position_rad
        link = servos._link
        feedback_frames = Counted(link, [0x180 + drive.node_id for drive in arm.drives])
        syncs = Counted(link, [0x080])
        begun_s, bits = time.monotonic(), link.bits
        for cycle in range(cycles):
            target = start + 0.1 * np.sin(0.5 * cycle / CYCLE_HZ)
            command = JointCommand(target, zero, zero)
            feedback = servos.exchange(command)
            missing += int(feedback.missing.sum())
            skipped += feedback.skipped_cycles
            recorder.write(feedback, command, Segment.PERIODS, cycle / CYCLE_HZ)
        took_s = time.monotonic() - begun_s
        load = (link.bits - bits) / (1e6 * took_s)
        # The last SYNCs have been sent; their answers may still be on the way.
        link.pump_until(lambda: False, 0.1)
        heard, answers = syncs.frames, feedback_frames.frames
        servos.close()
    lost, _ = drives.communicate("\n", timeout=20)
    recording = read_recording_file(path)
    print(  # noqa: T201 - the figures of the run
        f"\n{cycles} cycles in {took_s:.1f} s: {heard} SYNCs, {answers} frames of feedback, {6 * heard - answers} "
        f"lost, {missing} late, {skipped} cycles skipped, "
        f"{recording.source.rows_read} rows recorded, bus load {load:.1%}, queue full {link.queue_full} times"
    )
    assert answers == 6 * heard
    assert missing == 0
    assert lost.strip() == "0"
    assert link.error_frames == 0
    assert recording.source.rows_read == cycles
    assert recording.source.rows_dropped == 0
