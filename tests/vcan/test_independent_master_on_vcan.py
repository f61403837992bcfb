"""canopen's own CiA 402 profile commands simulated drives, two processes on vcan0."""

import subprocess
import sys

import canopen
import pytest

from tests.independent_master import Master, description

pytestmark = pytest.mark.vcan

DRIVES = """
import sys, time
import can, numpy as np
from armload_controller.config.robot import load_robot
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from tests.ideal_plant import IdealPlant

plant = IdealPlant(np.zeros(6))
with (
    can.Bus(interface="socketcan", channel="vcan0") as bus,
    SimulatedDrives(load_robot(sys.argv[1]).drives.settings, plant, bus, time.monotonic),
):
    print("ready", flush=True)
    for line in sys.stdin:
        print(np.rad2deg(plant.position_rad[2]), sum(plant.powered), flush=True)
"""


def ask(drives):
    """Position of the third axis in degrees, and the number of axes with torque."""
    drives.stdin.write("?\n")
    drives.stdin.flush()
    degrees, powered = drives.stdout.readline().split()
    return float(degrees), int(powered)


@pytest.mark.parametrize(
    ("robot", "node_id", "mode"), [("er50", 3, "CYCLIC SYNCHRONOUS POSITION"), ("prbt", 5, "INTERPOLATED POSITION")]
)
@pytest.mark.parametrize("split", [False, True], ids=["one PDO", "two PDOs"])
def test_a_node_is_booted_enabled_moved_by_a_degree_and_disabled(tmp_path, robot, node_id, mode, split):
    drives = subprocess.Popen(
        [sys.executable, "-c", DRIVES, robot], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    network = canopen.Network()
    network.NOTIFIER_CYCLE = 0.05
    try:
        assert drives.stdout.readline() == "ready\n"
        network.connect(interface="socketcan", channel="vcan0")
        master = Master(network, node_id, description(tmp_path / "drive.eds"))
        master.boot()
        degree = round(master.counts_per_turn() / 360.0)
        master.configure(mode, split)
        begin = master.enable()
        degrees, powered = ask(drives)
        assert (degrees, powered) == (pytest.approx(0.0, abs=0.001), 1)
        assert master.move(degree) == begin + degree
        assert ask(drives) == (pytest.approx(1.0, abs=0.001), 1)
        master.disable()
        assert ask(drives) == (pytest.approx(1.0, abs=0.001), 0)
        master.leave()
    finally:
        network.disconnect()
        drives.kill()
        drives.wait()
        drives.stdin.close()
        drives.stdout.close()
