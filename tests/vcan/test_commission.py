"""A commissioning between processes on real SocketCAN interfaces: `simulate` in one, `commission` in the other.

Test machines are busy, and the two processes share one CPU here. Therefore the cycle is slow, both processes get a
real-time priority if permitted, the configuration tolerates stalls, and runs spoilt by a stall are recorded again, as
an operator would do: the program refuses an uneven motion and continues with the missing runs.
"""

import re
import signal
import subprocess
import time
from contextlib import contextmanager
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from armload_controller.config.robot import load_robot
from armload_identification.excitation.excitation_file import write_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.files.payload_file import read_payload, write_payload
from tests.started_programs import armload_before_others

pytestmark = pytest.mark.vcan

CHANNEL = "vcan0"
CYCLE_HZ = 50
PATIENT = {"heartbeat_s": "2.0", "max_missing_cycles": "100"}
ATTEMPTS = 5
BUS = ["--bus", f"socketcan:{CHANNEL}", "--cycle-hz", str(CYCLE_HZ)]
TWO_BUSES = ["--bus", "socketcan:vcan0,vcan1", "--cycle-hz", str(CYCLE_HZ)]
ARMLOAD = armload_before_others()


@pytest.fixture
def short_robot(tmp_path):
    """er50 with excitations of two periods of 2 s, and with longer timeouts."""
    shipped = resources.files("armload_configs") / "er50.toml"
    text = shipped.read_text("utf-8")
    for key, value in PATIENT.items():
        text, count = re.subn(rf"^{key} = \S+", f"{key} = {value}", text, flags=re.MULTILINE)
        assert count == 1
    offset = np.array([0.0, 0.3, 0.6, 0.0, 0.0, 0.0])
    for seed, role in enumerate(("identification", "validation")):
        rng = np.random.default_rng(seed)
        swing = 0.12 * rng.choice([-1.0, 1.0], (2, 6, 2)) / np.array([1.0, 2.0])
        trajectory = FourierTrajectory(0.5, offset, swing[0], swing[1])
        write_excitation(tmp_path / f"{role}.toml", Excitation(trajectory, 2))
        text = re.sub(rf'^{role} = ".*"$', f'{role} = "{role}.toml"', text, flags=re.MULTILINE)
    path = tmp_path / "short.toml"
    path.write_text(text)
    return path


@pytest.fixture
def robot_on_two_buses(short_robot):
    """The same arm with joints 4 to 6 on a second bus."""
    if not Path("/sys/class/net/vcan1").exists():
        pytest.skip("there is no second interface, vcan1")
    text, count = re.subn(r'^interface = "virtual"\nchannel = .*\n', "", short_robot.read_text(), flags=re.MULTILINE)
    text = re.sub(r"^node_id = ([456]) .*$", r'node_id = \1\nbus = "b"', text, flags=re.MULTILINE)
    parts = "".join(f'[bus.{name}]\ninterface = "virtual"\nchannel = "{name}"\n\n' for name in "ab")
    assert count == text.count('bus = "b"') / 3 == 1
    short_robot.write_text(text.replace("[[joints]]", f"{parts}[[joints]]", 1))
    return short_robot


def started_drives(robot, payload, bus=BUS):
    """Drives in a separate process, which may still be reading the robot's file."""
    words = [*ARMLOAD, "simulate", str(robot), *bus, "--payload", payload]
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True)


@contextmanager
def simulated(robot, payload, bus=BUS):
    """Drives in a separate process, ended by SIGTERM."""
    drives = started_drives(robot, payload, bus)
    try:
        assert "6 simulated drives" in drives.stdout.readline()
        yield
        assert drives.poll() is None, "the drives ended by themselves"
    finally:
        drives.send_signal(signal.SIGTERM)
        rest, _ = drives.communicate(timeout=20)
        assert drives.returncode == 0
        assert "drives stopped" in rest


def armload(*arguments):
    return subprocess.run([*ARMLOAD, *arguments], capture_output=True, text=True, timeout=300, check=False)


def commission(robot, *options, bus=BUS):
    return armload("commission", str(robot), *bus, *options)


def record(robot, output, bus=BUS):
    """Record both halves, each with its drives in a separate process; returns the output of the last."""
    for half, payload in (("unloaded", "none"), ("loaded", "paper")):
        if len(list(output.glob(f"{half}_*.mcap"))) < 2 or half == "loaded":
            with simulated(robot, payload, bus):
                done = commission(robot, "--simulated-drives", "--runs", half, "--output", str(output), bus=bus)
            if done.returncode:
                break
    return done


def forget_what_a_stall_spoilt(done, output):
    """Delete the recordings that were refused or not completed; fail on any other error."""
    uneven = r"error: \S*_(\w+)\.mcap: (?:the phase is up to|the torque of joint)"
    slower = r"error: one period took .*_(\w+)\.mcap"
    # In so short a motion a sound joint can look flipped if much of its feedback was late.
    late = r"periods of feedback differ[\s\S]*error: \S*_(\w+)\.mcap and \S+: joint \d measures the opposite"
    spoilt = re.search(uneven, done.stderr) or re.search(slower, done.stderr) or re.search(late, done.stderr)
    # After a stall, setpoints are held and motion resumes at full speed: a monitor then stops the motion.
    stopped = re.search("Motion stopped|no complete period was run at full speed", done.stderr)
    assert spoilt or stopped, done.stdout + done.stderr
    for path in output.glob(f"*_{spoilt[1]}.mcap" if spoilt else "*.partial.mcap"):
        path.unlink()


def recorded(robot, output, bus=BUS):
    """Record both halves, again as often as stalls have spoilt runs; what the last command has printed."""
    done = record(robot, output, bus)
    for _ in range(ATTEMPTS - 1):
        if done.returncode == 0:
            break
        forget_what_a_stall_spoilt(done, output)
        done = record(robot, output, bus)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def wait_until_it_moves(program, folder, pattern, within_s):
    """Until a started program has written the first file of its run, or has ended, and a second longer."""
    before, until_s = set(folder.glob(pattern)), time.monotonic() + within_s
    while set(folder.glob(pattern)) == before and program.poll() is None and time.monotonic() < until_s:
        time.sleep(0.1)
    time.sleep(1.0)


def interrupted(robot, output, happens):
    """Start the unloaded half; once it moves, something happens. What it printed until it ended."""
    words = ["commission", str(robot), *BUS, "--simulated-drives", "--runs", "unloaded", "--output", str(output)]
    with subprocess.Popen([*ARMLOAD, *words], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as program:
        wait_until_it_moves(program, output, "*", 60.0)
        happens(program)
        text, _ = program.communicate(timeout=120)
    assert program.returncode in (1, 130), text
    return text


def test_an_interruption_leaves_no_torque_and_no_recording(short_robot, tmp_path):
    """By Ctrl-C, after which the drives are free, and by the loss of all drives' power.

    `tests/unit/project/test_first_day.py` has the other interruptions, and going on.
    """
    output = tmp_path / "run"
    with simulated(short_robot, "none"):
        assert "Ctrl-C" in interrupted(short_robot, output, lambda program: program.send_signal(signal.SIGINT))
        free = armload("drives", "check", str(short_robot), *BUS)
        assert free.returncode == 0, free.stdout + free.stderr
    with started_drives(short_robot, "none") as drives:
        assert "6 simulated drives" in drives.stdout.readline()
        assert "Press the emergency stop" in interrupted(short_robot, output, lambda program: drives.kill())
    assert not list(output.glob("*ation.mcap"))


@pytest.mark.timeout(900)  # two minutes, and as much again for every attempt that a stall has spoilt
def test_two_halves_in_two_processes(short_robot, tmp_path):
    output = tmp_path / "run"
    recorded(short_robot, output)
    result = read_payload(output / "payload.toml")
    truth = load_robot("er50").simulation.payload("paper")
    assert result.model.mass_kg == pytest.approx(truth.mass_kg, rel=0.15)
    assert result.model.is_physical
    assert (output / "report.html").stat().st_size > 10_000
    assert sorted(p.name for p in Path(output).glob("*.mcap")) == [
        f"{load}_{role}.mcap" for load in ("loaded", "unloaded") for role in ("identification", "validation")
    ]


@pytest.mark.timeout(900)
def test_commissioning_and_feed_forward_on_two_buses(robot_on_two_buses, tmp_path):
    output = tmp_path / "run"
    assert "SYNC reached the last bus" in recorded(robot_on_two_buses, output, TWO_BUSES)
    result = read_payload(output / "payload.toml")
    truth = load_robot("er50").simulation.payload("paper")
    assert result.model.mass_kg == pytest.approx(truth.mass_kg, rel=0.3), "four seconds of gears with load friction"
    # So short a motion does not determine the centre of mass, without which nothing is fed forward.
    exact = replace(
        result, model=truth, mass_center=None, determined=np.ones(10, bool), interval_95=np.stack([truth.theta] * 2, 1)
    )
    write_payload(tmp_path / "exact.toml", exact)
    with simulated(robot_on_two_buses, "paper", TWO_BUSES):
        words = ("feedforward", "run", str(robot_on_two_buses), str(tmp_path / "exact.toml"))
        done = armload(*words, *TWO_BUSES, "--simulated-drives", "--yes")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "SYNC reached the last bus" in done.stdout
    assert re.search(r"torque offset trial at standstill, response: joint_2 \d+ %.*joint_[56] \d+ %", done.stdout)


def test_a_bus_without_simulated_drives_is_refused(short_robot, tmp_path):
    with simulated(short_robot, "none"):
        done = commission(short_robot, "--output", str(tmp_path / "run"))
    assert done.returncode == 1
    assert "--simulated-drives" in done.stderr


def test_a_bus_where_nobody_answers_is_named(short_robot, tmp_path):
    done = commission(short_robot, "--simulated-drives", "--output", str(tmp_path / "run"))
    assert done.returncode == 1
    assert "joint_1 (node 1)" in done.stderr
