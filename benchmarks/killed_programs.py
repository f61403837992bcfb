"""kill -9 at twenty moments each of three programs: nothing is corrupt, and at most 0.25 s is lost.

    python -m benchmarks.killed_programs [MOMENTS] [PROGRAM]

`calibrate`: its runs are unchanged, the calibration file is absent, or whole, and the next start writes it.
`feedforward run --expect`: every line of the log of decisions is whole, and one that is missing was made within 0.25 s
before the kill. `watch --record`: the recording is readable, and its last row at most 0.25 s old. Moments are shares of
the CPU time of a program that is not killed, of `watch` times, from a seed. The exit status is 1 if anything is wrong.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
import tempfile
import time
from importlib import resources
from pathlib import Path

import numpy as np

from armload_controller.config.robot import load_robot
from armload_controller.cycle.control_cycle import Cycle
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.cycle.torque_gate import TorqueGate
from armload_controller.motion.checked_path import check_path
from armload_controller.motion.motion_control import MotionControl
from armload_controller.session.arm_access import simulated_arm
from armload_controller.session.run_session import run_leg
from armload_controller.session.session_load import SessionLoad
from armload_identification.excitation.excitation_file import format_excitation, write_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.files.calibration_file import read_calibration
from tests.faults.test_killed_commissioning import PROMISED_S, Notes, cpu_s
from tests.rtde_controller import Controller, row

MOMENTS, SEED = 20, 28
OFFSET_RAD = np.array([0.0, 0.5, 1.2, 0.0, 0.6, 0.0])
SWING_RAD = np.array([[0.2, 0.9, 0.0, 0.0, 0.3, 0.2], [0.0, 0.0, 0.9, 0.2, -0.7, 0.0]])[:, :, None]
WATCHED_S, WATCHED_ROWS, RATE_HZ = 4.0, 5000, 500
PROGRAM = """
import json, os, sys, time
from pathlib import Path
from armload_controller.session.decision_log import DecisionLog
from tests.faults.test_killed_commissioning import Notes
notes = Path(sys.argv.pop(1))
if "watch" in sys.argv:
    Notes(notes).watch()
report, log = DecisionLog.report, os.open(notes, os.O_WRONLY | os.O_CREAT | os.O_APPEND)

def noted(self, decision):
    os.write(log, (json.dumps([time.monotonic(), decision.to_dict()]) + "\\n").encode())
    report(self, decision)

DecisionLog.report = noted
from armload_controller.cli.entry import main
main()
"""


class PacedRows(list):
    """Rows that a controller sends at its rate."""

    def __iter__(self):
        begun = time.monotonic()
        for number, each in enumerate(super().__iter__()):
            time.sleep(max(0.0, begun + number / RATE_HZ - time.monotonic()))
            yield each


def started(notes, *words):
    """The program, which notes outside its files what it is about to write."""
    command = [sys.executable, "-c", PROGRAM, str(notes), *map(str, words)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def killed(process, cpu_share_s):
    """Kill a program when it has used this CPU time, unless it ends before; the moment."""
    while process.poll() is None and cpu_s(process) < cpu_share_s:
        time.sleep(0.001)
    moment = time.monotonic()
    process.kill()
    process.communicate()
    return moment


def undisturbed(notes, *words):
    """CPU time in s of the program when it is not killed."""
    before = os.times()
    printed, _ = (process := started(notes, *words)).communicate()
    if process.returncode:
        raise RuntimeError(printed)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


def prepared(folder):
    """A robot with a short excitation, and recordings of the empty arm on two longer ones."""
    write_excitation(folder / "sweep.toml", Excitation(FourierTrajectory(0.25, OFFSET_RAD, *SWING_RAD), 1))
    text = (resources.files("armload_configs") / "prbt.toml").read_text("utf-8")
    text = re.sub(r'^(identification|validation) = ".*"$', r'\1 = "sweep.toml"', text, flags=re.MULTILINE)
    (folder / "prbt.toml").write_text(text.replace("cycle_hz = 100.0", "cycle_hz = 50.0"))
    run = json.dumps({"robot": "prbt", "load": "unloaded", "cycle_hz": 50})
    robot, recordings = load_robot(str(folder / "prbt.toml")), []
    for role, each in load_robot("prbt").excitations.items():
        longer = Excitation(each.trajectory, 2)
        attached = {"excitation.toml": format_excitation(longer), "run.json": run}
        recordings.append(folder / f"{role}.mcap")
        with simulated_arm(robot, SessionLoad.UNLOADED) as servos, Recorder(recordings[-1], attached) as kept:
            servos.connect()
            gate = TorqueGate(robot.limits.torque_max_nm, 0.02)
            cycle = Cycle(servos, robot.limits.motion, gate, MotionControl(), [kept])
            path = check_path(longer, robot.motion_constraints, 0.02, file="long.toml", key="excitation")
            run_leg(cycle, path, path.measured, lambda done: None)
    return folder / "prbt.toml", recordings


def calibrate(folder, shares):
    """What is wrong after each kill of `calibrate`."""
    robot, recordings = prepared(folder)
    words = ["calibrate", robot, *recordings, "-o", folder / "arm.toml", "--report", folder / "arm.html"]
    takes_s = undisturbed(folder / "notes", *words)
    given, whole = [path.read_bytes() for path in recordings], (folder / "arm.toml").read_text().splitlines()
    for number, share in enumerate(shares):
        if number % 2:  # with and without an older file
            (folder / "arm.toml").unlink(missing_ok=True)
        killed(started(folder / "notes", *words), share * takes_s)
        if (folder / "arm.toml").exists():
            read_calibration(folder / "arm.toml")
            yield "" if len((folder / "arm.toml").read_text().splitlines()) == len(whole) else "another file"
        else:
            yield "" if [path.read_bytes() for path in recordings] == given else "a changed recording"
    undisturbed(folder / "notes", *words)
    read_calibration(folder / "arm.toml")


def feedforward(folder, shares):
    """What is wrong after each kill of `feedforward run --expect`."""
    robot, recordings = prepared(folder)
    undisturbed(folder / "notes", "calibrate", robot, *recordings, "-o", folder / "arm.toml")
    words = ["feedforward", "run", robot, "--expect", "0..4", "--mounted", "gripper", "--yes"]
    words += ["--calibration", folder / "arm.toml", "--decisions", folder / "decisions.jsonl"]
    takes_s = undisturbed(folder / "notes", *words)
    for share in shares:
        before = (folder / "decisions.jsonl").read_text().splitlines()
        (folder / "notes").unlink(missing_ok=True)
        moment = killed(started(folder / "notes", *words), share * takes_s)
        lines = (folder / "decisions.jsonl").read_text().splitlines()
        kept = [json.loads(line) for line in lines][len(before) :]
        made = [json.loads(line) for line in (folder / "notes").read_text().splitlines()] if kept else []
        missing = [when for when, _ in made[len(kept) :] if when < moment - PROMISED_S]
        same = lines[: len(before)] == before and all(
            one.items() >= decision.items() for one, (_, decision) in zip(kept, made, strict=False)
        )
        yield "" if same and not missing else f"{len(missing)} decisions lost, or other lines"


def watch(folder, shares):
    """What is wrong after each kill of `watch --record`."""
    rows = PacedRows(row(0.002 * k, (0.001 * k,) * 6, (0.5,) * 6) for k in range(WATCHED_ROWS))
    for number, share in enumerate(shares):
        to = folder / f"watched {number}"
        to.mkdir()
        with Controller(rows).listening() as address:
            process = started(folder / "notes", "watch", "ur10e", "--rtde", address, "--record", to / "shift.mcap")
            while not (to / "shift.partial.mcap").exists():
                time.sleep(0.01)
            time.sleep(share * WATCHED_S)
            process.kill()
            process.communicate()
        lost_s = Notes(folder / "notes").lost_s(to)
        yield "" if lost_s <= PROMISED_S else f"{lost_s:.3f} s lost"


def run(moments=MOMENTS, only=""):
    """Kill each program; the number of failures."""
    failures = 0
    for program in (calibrate, feedforward, watch):
        if only not in program.__name__:
            continue
        shares = np.random.default_rng(SEED).uniform(0.05, 1.0, moments)
        with tempfile.TemporaryDirectory() as folder:
            found = list(program(Path(folder), shares))
        wrong = [f"at {share:.2f}: {what}" for share, what in zip(shares, found, strict=True) if what]
        failures += len(wrong)
        print(f"{program.__name__}: killed {moments} times, {len(wrong)} failures", *wrong, sep="\n  ", flush=True)
    return failures


if __name__ == "__main__":
    given = [int(word) if word.isdecimal() else word for word in sys.argv[1:]]
    sys.exit(1 if run(*given) else 0)
