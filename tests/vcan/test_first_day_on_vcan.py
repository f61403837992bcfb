"""The page of the first day to its end, between processes on vcan0: sessions, verdict, calibration, feed-forward.

Drives and plant are a process of their own. Interruptions are those that only processes can have; those of a program in
virtual time, in every part of a run, are in `tests/unit/project/test_first_day.py`. Excitations are short, and cycles
slow, because both processes share the one CPU of the guest; a run that a stall spoils is recorded again, as an
operator would do. It takes ten minutes, so that `ARMLOAD_WHOLE_DAY=1` asks for it.
"""

import os
import re
import signal
import subprocess
import time

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_identification.files.calibration_file import read_calibration
from armload_identification.files.payload_file import read_payload
from tests.first_day import needs_page, page_commands, write_arm
from tests.short_commissioning import RECORDINGS
from tests.started_programs import armload_before_others
from tests.vcan.test_commission import (
    PATIENT,
    forget_what_a_stall_spoilt,
    simulated,
    started_drives,
    wait_until_it_moves,
)

pytestmark = [
    pytest.mark.vcan,
    pytest.mark.skipif("ARMLOAD_WHOLE_DAY" not in os.environ, reason="ten minutes: ARMLOAD_WHOLE_DAY=1 runs it"),
    needs_page,
]

ATTEMPTS = 5
SOCKETCAN = {"interface": '"socketcan"', "channel": '"vcan0"', "cycle_hz": "25"}
UNLOADED, LOADED = "commission arm.toml --runs unloaded", "commission arm.toml --runs loaded"
TRIAL, COMPARE = "feedforward trial", "feedforward compare"
FREE = "drives check"


def program(folder, beginning, *options):
    """The page's first command of this beginning, started."""
    words = next(words for words in page_commands() if words.startswith(beginning)).split()
    allowed = ["--simulated-drives", *([] if beginning.startswith("drives") else ["--yes"])]
    environment = os.environ | {"PYTHONUNBUFFERED": "1"}
    return subprocess.Popen(
        [*armload_before_others(), *words, *allowed, *options],
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def follow(folder, beginning, *options):
    """The page's command to its end, again as often as a stall has spoilt a run; what it printed."""
    for _ in range(ATTEMPTS):
        started = program(folder, beginning, *options)
        output, errors = started.communicate(timeout=300)
        if started.returncode in (0, 3):
            return output
        done = subprocess.CompletedProcess(started.args, started.returncode, output, errors)
        forget_what_a_stall_spoilt(done, folder / "runs" / "first")
    raise AssertionError(output + errors)


def interrupted(folder, beginning, happens, *options):
    """The page's command, with which something happens once it moves the arm; what it printed until it ended."""
    runs = folder / "runs" / "first"
    before = set(runs.glob("*.mcap"))
    started = program(folder, beginning, *options)
    wait_until_it_moves(started, runs, "*.mcap", 90.0)
    happens(started)
    output, errors = started.communicate(timeout=120)
    assert started.returncode, output + errors
    assert before >= {path for path in runs.glob("*.mcap") if path.name in RECORDINGS}
    return output + errors


def cable(up):
    """Plug the bus in or out."""
    subprocess.run(["ip", "link", "set", "vcan0", "up" if up else "down"], check=True)


@pytest.mark.timeout(1500)
def test_the_page_is_followed_to_its_end_between_processes(tmp_path):
    arm = tmp_path / "arm.toml"
    write_arm(tmp_path, 8.0, 1, **SOCKETCAN, **PATIENT)
    truth = load_robot("er50").simulation.payload("paper")
    mass = ("--mass-kg", str(truth.mass_kg))

    with simulated(arm, "none", ()):
        follow(tmp_path, FREE)
        text = interrupted(tmp_path, UNLOADED, lambda started: started.send_signal(signal.SIGINT))
        assert "operator requested a stop: Ctrl-C" in text
        interrupted(tmp_path, UNLOADED, lambda started: started.kill())
        time.sleep(4.0 * float(PATIENT["heartbeat_s"]))  # until the drives have missed their master, and hold
        follow(tmp_path, UNLOADED)

    with started_drives(arm, "paper", ()) as drives:
        assert "6 simulated drives" in drives.stdout.readline()
        text = interrupted(tmp_path, LOADED, lambda started: drives.kill(), *mass)
        assert "Press the emergency stop" in text
    with started_drives(arm, "paper", ()) as drives:
        assert "6 simulated drives" in drives.stdout.readline()
        text = interrupted(tmp_path, LOADED, lambda started: cable(up=False), *mass)
        assert re.search(r"joint_1.*joint_6", text, re.DOTALL), text
        drives.kill()
    cable(up=True)
    with simulated(arm, "paper", ()):
        assert "verdict: " in follow(tmp_path, LOADED, *mass)
        results = tmp_path / "runs" / "first"
        assert {path.name for path in results.glob("*ation.mcap")} == RECORDINGS
        found = read_payload(results / "payload.toml").model
        assert np.linalg.norm(found.center_of_mass_m - truth.center_of_mass_m) < 0.02
        assert read_calibration(results / "arm.calibration.toml").robot == load_robot("er50").name
        assert "torque" in (results / "report.html").read_text("utf-8")

        assert re.search(r"response: .*joint_2 \d+ %.*joint_5 \d+ %", follow(tmp_path, TRIAL), re.DOTALL)
        follow(tmp_path, COMPARE)
        assert (tmp_path / "feedforward.svg").is_file()
        assert "all 72 steps are ok" in follow(tmp_path, FREE), "nothing carries torque"
