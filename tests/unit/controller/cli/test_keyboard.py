"""Keys while an arm moves: their meaning, their effect on a commissioning, and the terminal restored afterwards."""

import os
import pty
import re
import select
import subprocess
import sys
import termios
import time
from importlib import resources

import numpy as np
import pytest

from armload_controller.cli.keyboard import Key, Keyboard, described, press, requests_in
from armload_controller.motion.motion_control import MotionControl, OperatorStop
from armload_identification.excitation.excitation_file import write_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from tests.started_programs import as_started

PROGRAM = "from armload_controller.cli.entry import main; main()"


@pytest.mark.parametrize(
    ("typed", "keys"),
    [
        (b" ", [Key.PAUSE]),
        (b"+=-", [Key.FASTER, Key.FASTER, Key.SLOWER]),
        (b"xyz\r\n\t", []),
        (b"\x1b[A-\x1b[1;5C \x1bOP+", [Key.SLOWER, Key.PAUSE, Key.FASTER]),
        (b"\x1b[+~\x1b[", []),
        (b"\xff\xc3\xa4 ", [Key.PAUSE]),
    ],
)
def test_keys_and_what_means_nothing(typed, keys):
    assert requests_in(typed) == keys


def test_space_pauses_and_resumes():
    control = MotionControl()
    press(control, Key.PAUSE)
    assert described(control.goal) == "paused"
    press(control, Key.PAUSE)
    assert described(control.goal) == ""


def test_the_speed_goes_in_tenths_and_stays_between_a_tenth_and_the_whole():
    control = MotionControl()
    shares = []
    for key in [Key.FASTER] + 12 * [Key.SLOWER] + 3 * [Key.FASTER]:
        press(control, key)
        shares.append(control.goal.share)
    assert shares[:4] == [1.0, 0.9, 0.8, 0.7]
    assert shares[9:] == [0.1, 0.1, 0.1, 0.1, 0.2, 0.3, 0.4]
    assert described(control.goal) == "speed 40 %"


def test_a_speed_between_the_steps_goes_to_the_next_one():
    control = MotionControl(0.25)
    press(control, Key.FASTER)
    assert control.goal.share in {0.3, 0.4}


def test_a_stop_is_what_the_line_states():
    control = MotionControl()
    control.pause()
    control.stop(OperatorStop("Ctrl-C"))
    assert described(control.goal) == "stopping"


def test_a_terminal_that_went_away_is_nothing_to_stumble_over():
    """Reading keys gives end of file or an error, and the settings cannot be restored."""
    program = """
import os, pty, sys
from armload_controller.cli.keyboard import Keyboard
from armload_controller.motion.motion_control import MotionControl
child, keys = pty.fork()
if child == 0:
    import signal
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    os.write(1, b"ready")
    control = MotionControl()
    keyboard = Keyboard(control, 0)
    with keyboard.awake():
        os.kill(os.getpid(), signal.SIGSTOP)
        keyboard.poll()
    os._exit(7 if control.goal.share == 1.0 else 8)
os.read(keys, 5)
os.waitpid(child, os.WUNTRACED)
os.close(keys)
os.kill(child, 18)
sys.exit(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    assert subprocess.run([sys.executable, "-c", program], timeout=60, check=False).returncode == 7


def test_a_terminal_that_listens_to_somebody_else_is_left_alone():
    """The pseudo-terminal belongs to another process: nothing is read from it, and its settings stay."""
    keys, terminal = pty.openpty()
    try:
        control = MotionControl()
        keyboard = Keyboard(control, terminal)
        before = termios.tcgetattr(terminal)
        with keyboard.awake():
            assert termios.tcgetattr(terminal) == before
            os.write(keys, b" \n")
            assert keyboard.poll() == ""
    finally:
        os.close(keys)
        os.close(terminal)


@pytest.fixture
def short_robot(tmp_path):
    """prbt with excitations of two periods of 4 s."""
    text = (resources.files("armload_configs") / "prbt.toml").read_text("utf-8")
    for seed, role in enumerate(("identification", "validation")):
        swing = 0.07 * np.random.default_rng(seed).choice([-1.0, 1.0], (2, 6, 2)) / np.array([1.0, 2.0])
        trajectory = FourierTrajectory(0.25, np.array([0.0, 0.6, 1.2, 0.0, 0.5, 0.0]), *swing)
        write_excitation(tmp_path / f"{role}.toml", Excitation(trajectory, 2))
        text = re.sub(rf'^{role} = ".*"$', f'{role} = "{role}.toml"', text, flags=re.MULTILINE)
    path = tmp_path / "short.toml"
    path.write_text(text)
    return path


CONTROLLING = "import fcntl, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0); "
"""Makes a pseudo-terminal the controlling terminal of this process."""


class Terminal:
    """A program at a terminal: its output and its keys."""

    def __init__(self, code, *words):
        self.keys, self.terminal = pty.openpty()
        self.before = termios.tcgetattr(self.terminal)
        self.shown = b""
        self.running = subprocess.Popen(
            as_started([sys.executable, "-c", CONTROLLING + code, *words]),
            stdin=self.terminal,
            stdout=self.terminal,
            stderr=self.terminal,
            start_new_session=True,
            env=os.environ | {"TERM": "xterm", "COLUMNS": "150"},
        )

    def type(self, typed):
        os.write(self.keys, typed)

    def until(self, text, seconds=60.0):
        """Wait for a text and discard the output up to it."""
        end = time.monotonic() + seconds
        while text not in self.shown:
            assert time.monotonic() < end, self.shown.decode(errors="replace")
            if select.select([self.keys], [], [], 0.2)[0]:
                self.shown += os.read(self.keys, 4096)
        self.shown = self.shown[self.shown.index(text) + len(text) :]

    def close(self):
        self.running.kill()
        self.running.wait()
        os.close(self.keys)
        os.close(self.terminal)


def test_a_commissioning_at_a_terminal_is_paused_resumed_slowed_and_stopped(short_robot, tmp_path):
    words = ["commission", str(short_robot), "--output", str(tmp_path / "run")]
    at = Terminal(PROGRAM, *words)
    try:
        at.until(b"keys: space pauses")
        at.until(b"slow round")
        at.type(b" ")
        at.until(b"paused")
        at.type(b"--")
        at.type(b" ")
        at.until(b"speed 80 %")
        at.type(b"\x03")
        at.until(b"Motion stopped (along the path): the operator requested a stop")
        assert at.running.wait(timeout=30) == 130
        assert termios.tcgetattr(at.terminal) == at.before
    finally:
        at.close()


def test_a_question_is_not_answered_before_it_is_asked():
    code = (
        "import sys\n"
        "from armload_controller.cli.keyboard import Keyboard\n"
        "from armload_controller.cli.screen import Screen\n"
        "from armload_controller.motion.motion_control import MotionControl\n"
        "screen = Screen()\n"
        "screen.keyboard = Keyboard.of_this_process(MotionControl())\n"
        "screen.step('ready')\n"
        "import time; time.sleep(0.5)\n"
        "screen.step(f'answer: {screen.confirm(sys.argv[1])}')"
    )
    at = Terminal(code, "Go?")
    try:
        at.until(b"ready")
        at.type(b"y\n")
        at.until(b"Go? [y/N]")
        at.type(b"n\n")
        at.until(b"answer: False")
    finally:
        at.close()
