"""`armload drives` on vcan0."""

import json
import signal
import subprocess
import sys
import time

import can
import numpy as np
import pytest
from typer.testing import CliRunner

from armload_controller.cli.command_tree import app
from armload_controller.config.robot import load_robot
from armload_drivers.cia402.arm_settings import Identity
from armload_drivers.driver_errors import ServoFault
from armload_drivers.simulation.drives.drive_dictionary import DriveTraits
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from tests.drive_descriptions import eds, maker_drive
from tests.ideal_plant import IdealPlant

pytestmark = pytest.mark.vcan

BUS = ["--bus", "socketcan:vcan0"]


@pytest.fixture
def drives():
    robot = load_robot("prbt").with_bus("socketcan", "vcan0", None, 50.0)
    with (
        can.Bus(interface="socketcan", channel="vcan0") as bus,
        SimulatedDrives(robot.drives.settings, IdealPlant(np.zeros(6)), bus, time.monotonic) as simulated,
    ):
        yield simulated


def armload(*arguments):
    return CliRunner().invoke(app, ["drives", *arguments], env={"COLUMNS": "160"})


def test_scan(drives):
    done = armload("scan", BUS[1])
    assert done.exit_code == 0, done.output
    assert [f"│ {node} " in done.output for node in range(3, 9)] == [True] * 6
    assert "IP" in done.output


def test_a_vendor_with_a_shipped_profile_is_said():
    robot = load_robot("prbt").with_bus("socketcan", "vcan0", None, 50.0)
    traits = {robot.drives.settings.drives[0].node_id: DriveTraits(identity=Identity(0xFB, 0x6552_0000))}
    with (
        can.Bus(interface="socketcan", channel="vcan0") as bus,
        SimulatedDrives(robot.drives.settings, IdealPlant(np.zeros(6)), bus, time.monotonic, traits),
    ):
        done = armload("scan", BUS[1])
    assert done.exit_code == 0, done.output
    assert done.output.count('profile = "maxon_epos4" is for maxon EPOS4') == 1


def test_check(drives):
    done = armload("check", "prbt", *BUS, "--cycle-hz", "50")
    assert done.exit_code == 0, done.output
    assert "steps are ok" in done.output
    wrong = armload("check", "er50", *BUS, "--cycle-hz", "50")
    assert wrong.exit_code == 1
    assert "no answer" in wrong.output


def test_show(drives):
    done = armload("show", "prbt", *BUS, "--once")
    assert done.exit_code == 0, done.output
    assert done.output.count("SWITCH ON DISABLED") == 6
    assert "bus load" in done.output


def test_reset(drives):
    drives.fail(4, 0x4310)
    time.sleep(0.2)
    done = armload("reset", "prbt", "prbt_joint_2", *BUS)
    assert done.exit_code == 0, done.output
    assert "prbt_joint_2: SWITCH ON DISABLED" in done.output
    drives.fail(4, 0x4310)
    time.sleep(0.2)
    printed = json.loads(armload("reset", "prbt", "prbt_joint_2", *BUS, "--json").stdout)
    assert (printed["node_id"], printed["state"]) == (4, "SWITCH ON DISABLED")
    drives.fail(4, 0x4310, persistent=True)
    time.sleep(0.2)
    assert isinstance(armload("reset", "prbt", "prbt_joint_2", *BUS).exception, ServoFault)


def test_check_of_drives_that_serve_a_makers_description(tmp_path):
    """`simulate --description` in one process, `drives check` in another."""
    path = tmp_path / "maker.eds"
    path.write_text(eds(maker_drive([0x6072, 0x6007, 0x1029])))
    command = [sys.executable, "-c", "from armload_controller.cli.entry import main; main()"]
    simulate = ["simulate", "prbt", *BUS, "--cycle-hz", "50", "--description", str(path)]
    with subprocess.Popen([*command, *simulate], stdout=subprocess.PIPE, text=True) as drives:
        try:
            assert "6 simulated drives" in drives.stdout.readline()
            done = armload("check", "prbt", *BUS, "--cycle-hz", "50", "--json")
        finally:
            drives.send_signal(signal.SIGTERM)
    assert done.exit_code == 0, done.output
    ways = {row["property"]: row for row in json.loads(done.stdout)["safety"][5]["properties"]}
    assert ways["torque_limit"]["way"].startswith("6073")
    assert (ways["master_lost"]["way"], ways["master_lost"]["accepted"]) == (None, True)
