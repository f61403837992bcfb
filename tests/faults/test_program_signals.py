"""The program, started as by a shell, under signals: the arm comes to rest before its torque is removed.

Master and drives of a simulated `prbt` run in real time in one process. At the end the plant reports which axes still
have torque, and the speed of each axis when its torque was removed.
"""

import json
import os
import re
import signal
import subprocess
import sys
import time
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from armload_identification.excitation.excitation_file import write_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from tests.bounded import await_that
from tests.started_programs import BACKGROUND, as_started

PROGRAM = """
import json, sys, time
from dataclasses import replace
from pathlib import Path
import can, numpy as np
from armload_controller.config.robot import load_robot
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from tests.ideal_plant import IdealPlant

robot = load_robot(sys.argv[2])
arm = robot.drives.settings
speeds = []

class Plant(IdealPlant):
    def set_powered(self, axis, on):
        if self.powered[axis] and not on:
            speeds.append(float(np.abs(self.velocity_rad_s).max()))
        super().set_powered(axis, on)

    def sample(self, cycle_s):
        sample = super().sample(cycle_s)
        return replace(sample, axis_torque_nm=np.copysign(1.0, sample.axis_velocity_rad_s))

plant = Plant(robot.simulation.start_rad, np.full(robot.n, 2.0))
begun_s = time.monotonic()
from armload_controller.cli.entry import main
with can.Bus(interface="bench", channel="signals") as bus:
    with SimulatedDrives(arm, plant, bus, lambda: time.monotonic() - begun_s):
        try:
            main()
        finally:
            found = {"powered": plant.powered, "released": speeds}
            Path(sys.argv[0]).with_name("found.json").write_text(json.dumps(found))
"""
PATIENCE = {"heartbeat_s": "2.0", "max_missing_cycles": "100"}
"""Tolerances for a busy machine."""
LONGEST_S = 60.0
STANDING_RAD_S = 1e-3


@pytest.fixture
def robot(tmp_path):
    """prbt with longer timeouts, and with excitations that outlast these tests."""
    text = (resources.files("armload_configs") / "prbt.toml").read_text("utf-8")
    for key, value in PATIENCE.items():
        text, count = re.subn(rf"^{key} = \S+", f"{key} = {value}", text, flags=re.MULTILINE)
        assert count == 1
    swing = np.full((6, 1), 0.1)
    trajectory = FourierTrajectory(0.5, np.array([0.0, 0.6, 1.2, 0.0, 0.5, 0.0]), swing, 0.5 * swing)
    write_excitation(tmp_path / "long.toml", Excitation(trajectory, 100))
    text = re.sub(r'^(identification|validation) = ".*"$', r'\1 = "long.toml"', text, flags=re.MULTILINE)
    path = tmp_path / "patient.toml"
    path.write_text(text)
    return path


@pytest.fixture
def started(robot, tmp_path):
    """Start a commissioning with some signals ignored; returns when the arm is in motion."""
    program = tmp_path / "program.py"
    program.write_text(PROGRAM)
    plugin = tmp_path / "bench-1.dist-info"
    plugin.mkdir()
    (plugin / "METADATA").write_text("Metadata-Version: 2.1\nName: bench\nVersion: 1\n")
    (plugin / "entry_points.txt").write_text("[can.interface]\nbench = can.interfaces.virtual:VirtualBus\n")
    running = []

    def started(ignored=()):
        words = ["commission", robot, "--bus", "bench:signals", "--simulated-drives"]
        process = subprocess.Popen(
            as_started([sys.executable, program, *words, "--output", tmp_path / "run"], ignored),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=os.environ | {"PYTHONPATH": str(Path(__file__).parents[2])},
        )
        running.append(process)
        wait_for_rows(process, tmp_path / "run", 20_000)
        return process

    yield started
    for process in running:
        process.kill()
        process.wait()
        process.stdout.close()


def wait_for_rows(process, folder, size):
    """Wait until this much has been recorded; fails if the program ends first."""
    until_s = time.monotonic() + LONGEST_S
    while sum(path.stat().st_size for path in Path(folder).glob("*.mcap")) < size:
        assert process.poll() is None, process.communicate()[0]
        assert time.monotonic() < until_s, "nothing is recorded"
        time.sleep(0.02)


def ended(process, tmp_path, number=signal.SIGTERM):
    """The program's output, after checks of its exit status and of the arm."""
    printed, _ = process.communicate(timeout=LONGEST_S)
    assert process.returncode == 128 + number, printed
    assert "Motion stopped (along the path): the system requested termination" in printed
    assert "While stopping" not in printed
    assert "Traceback" not in printed
    assert not (tmp_path / "run" / "unloaded_identification.mcap").exists()
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["powered"] == [False] * 6
    assert len(found["released"]) == 6
    assert max(found["released"]) < STANDING_RAD_S
    return printed


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGHUP, signal.SIGQUIT])
def test_a_signal_brings_the_arm_to_rest_and_removes_its_torque(started, tmp_path, number):
    process = started()
    process.send_signal(number)
    ended(process, tmp_path, number)


def test_a_background_job_goes_on_where_signals_are_ignored_and_is_stopped_by_sigterm(started, tmp_path):
    """A background job of a shell script ignores SIGINT, nohup ignores SIGHUP; the program keeps it so."""
    process = started(ignored=BACKGROUND)
    for name in BACKGROUND:
        process.send_signal(getattr(signal, name))
    recorded = sum(path.stat().st_size for path in (tmp_path / "run").glob("*.mcap"))
    wait_for_rows(process, tmp_path / "run", recorded + 20_000)
    process.send_signal(signal.SIGTERM)
    ended(process, tmp_path)


@pytest.mark.long
def test_an_operator_who_presses_again_and_again_leaves_no_torque(started, tmp_path):
    """Signals until the program has ended: none of them interrupts the removal of torque, nor the message about it."""
    process = started()

    def has_ended():
        process.send_signal(signal.SIGTERM)
        return process.poll() is not None

    await_that(has_ended, "the program has ended", LONGEST_S, every_s=0.01)
    printed, _ = process.communicate()
    assert process.returncode > 0, "killed by a signal"
    assert "Traceback" not in printed
    assert "Motion stopped" in printed
    assert json.loads((tmp_path / "found.json").read_text())["powered"] == [False] * 6
