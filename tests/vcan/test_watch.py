"""`armload watch` on a real SocketCAN interface: it records the frames and sends none."""

from __future__ import annotations

import subprocess
import sys
import time

import can
import pytest

from armload_controller.config.robot import load_robot
from armload_identification.recording.file_reading import read_recording_file
from benchmarks.canopen_runs.canopen_master import arm_under_canopen
from tests.bounded import await_that, overheard

pytestmark = pytest.mark.vcan

CYCLE_HZ = 50.0
BUS = ("--bus", "socketcan:vcan0")


@pytest.fixture(scope="module")
def frames():
    """The frames of a shift of some seconds under canopen as the master."""
    robot = load_robot("er50").with_bus(None, None, None, CYCLE_HZ)
    kept = []
    spec = robot.simulation.plant_spec(None)
    with arm_under_canopen(robot.drives.settings, spec, lambda *frame: kept.append(frame)) as master:
        here = master.enable()
        master.go(here, here + 0.6, 0.2 * robot.limits.motion.velocity_max_rad_s)
    return kept


def play(bus, frames, monitor):
    """Send frames at their times; returns all frames that a third node receives until a second later."""
    begun_s, first_s, heard = time.monotonic(), frames[0][2], []
    for cob_id, data, time_s in frames:
        left_s = begun_s + time_s - first_s - time.monotonic()
        if left_s > 0.0:
            time.sleep(left_s)
        bus.send(can.Message(arbitration_id=cob_id, data=data, is_extended_id=False))
        heard += overheard(monitor)
    return heard + overheard(monitor, 1.0)


def test_the_watch_records_and_the_bus_carries_only_the_others_frames(tmp_path, frames):
    path = tmp_path / "shift.mcap"
    words = ["watch", "er50", *BUS, "--record", str(path), "--load", "unloaded", "--for", "60s"]
    with (
        can.Bus(interface="socketcan", channel="vcan0") as player,
        can.Bus(interface="socketcan", channel="vcan0") as monitor,
        subprocess.Popen(
            [sys.executable, "-c", "from armload_controller.cli.entry import main; main()", *words],
            stdout=subprocess.PIPE,
            text=True,
        ) as watch,
    ):
        try:
            assert "nothing is sent" in watch.stdout.readline()
            heard = play(player, frames, monitor)
            await_that(lambda: next(tmp_path.glob("*.partial.mcap"), None), "a recording in progress")
            watch.terminate()
            assert watch.wait(30.0) == 0
        finally:
            watch.kill()
    assert [(m.arbitration_id, bytes(m.data)) for m in heard] == [(cob_id, data) for cob_id, data, _ in frames]
    recording = read_recording_file(path)
    syncs = sum(cob_id == 0x80 for cob_id, _, _ in frames)
    assert recording.size > 0.8 * syncs - 10
    assert recording.source.run()["overheard"] is True
