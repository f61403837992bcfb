"""The page of the first day: short, numbered, and followed word by word on a simulated arm, interrupted at every step.

The arm is er50, whose file has no `[body]`, in virtual time: empty and loaded session, verdict, calibration, and the
payload's torque in the drives. `tests/vcan` has the page between processes, and against drives on another CANopen
stack.
"""

import json
import re
import signal
import subprocess
import sys

import pytest

from armload_controller.config.robot import load_robot
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.motion.phase import Segment
from armload_drivers.cia402.state_machine import POWERED
from armload_drivers.cyclic.cyclic_servos import CyclicServos
from armload_drivers.simulation.drives.drives_on_bus import SimulatedDrives
from armload_drivers.simulation.plant_interface import FROZEN
from armload_identification.files.calibration_file import read_calibration
from armload_identification.files.payload_file import read_payload
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.run_format import LATENESS_ATTACHMENT
from tests.faulty_disk import FaultyDisk
from tests.first_day import PAGE, needs_page, page_commands, write_arm
from tests.short_commissioning import RECORDINGS
from tests.started_programs import signals_as_before

pytestmark = needs_page
ON_A_BUS = ("drives scan", "init", "drives show")
"""Commands that need a bus, a URDF or a person."""
ROWS = 20
"""After so many rows, or cycles, something happens."""


def test_the_page_is_short_and_its_steps_are_numbered_with_one_command_each():
    text = PAGE.read_text("utf-8")
    assert len(text.split()) <= 1000
    steps = re.split(r"^(?=\d+\. )", text.split("## After an interruption")[0], flags=re.MULTILINE)[1:]
    assert [int(step.split(".")[0]) for step in steps] == list(range(1, len(steps) + 1))
    assert max(step.count("$ armload") for step in steps) == 1


class Day:
    """The arm of the first day; at one moment of a command something happens.

    Args:
        folder: Where the commands are given.
        armload: Gives a command.

    Attributes:
        drives: The simulated drives of the last command.
        disk: The disk of its files.
    """

    def __init__(self, folder, armload, monkeypatch):
        self.folder, self._armload = folder, armload
        self.drives, self.disk = None, FaultyDisk(folder)
        self._left, self._recording, self._happens = 0, None, None
        enter, write, exchange = SimulatedDrives.__enter__, Recorder.write, CyclicServos.exchange

        def entered(drives):
            self.drives = drives
            return enter(drives)

        def written(recorder, feedback, command, segment, *rest):
            self._passed((recorder.partial.name.split(".")[0], segment))
            write(recorder, feedback, command, segment, *rest)

        def exchanged(servos, command):
            self._passed(None)
            return exchange(servos, command)

        monkeypatch.setattr(SimulatedDrives, "__enter__", entered)
        monkeypatch.setattr(Recorder, "write", written)
        monkeypatch.setattr(CyclicServos, "exchange", exchanged)

    def _passed(self, recording):
        """A row of a part of a recording, or a cycle, has passed."""
        if recording == self._recording and self._left:
            self._left -= 1
            if not self._left:
                self._happens(self)

    def do(self, words, happens=None, recording=None, after=ROWS):
        """Give a command; after some rows of a part of a recording, or else of cycles, something happens."""
        self._left, self._recording, self._happens = after if happens else 0, recording, happens
        self.disk = FaultyDisk(self.folder)
        with self.disk.mounted(), signals_as_before():
            done = self._armload(*words.split())
        assert self._left == 0, (words, recording, done.output, done.exception)
        return done

    @property
    def powered(self):
        """Numbers of the drives that carry torque."""
        drives = self.drives._drives.items()
        return [number for number, drive in drives if drive.state and drive.power.machine.state in POWERED]

    @property
    def recorded(self):
        """The complete recordings, with their times of modification."""
        found = (self.folder / "runs" / "first").glob("*.mcap")
        return {path.name: path.stat().st_mtime_ns for path in found if path.name in RECORDINGS}


def ctrl_c(day):
    signal.raise_signal(signal.SIGINT)


def power_of_one_drive(day):
    day.drives.switch_off(3)


def cable(day):
    day.drives._wire.wire.leave(day.drives._wire)


def fault(day):
    day.drives.fail(2, 0x2310)


def encoder(day):
    day.drives.fail_encoder(2, FROZEN)


def full_disk(day):
    day.disk.at = len(day.disk.steps) + 1


def second_start(day):
    program = "from armload_controller.cli.entry import main; main()"
    words = ("commission", "arm.toml", "--runs", "loaded", "--output", "runs/first")
    done = subprocess.run([sys.executable, "-c", program, *words], capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "another commissioning is using" in done.stderr


INTERRUPTIONS = {
    "commission arm.toml --runs unloaded": [
        (ctrl_c, ("unloaded_identification", Segment.SLOW), "operator requested a stop: Ctrl-C"),
        (power_of_one_drive, ("unloaded_identification", Segment.PERIODS), "joint_3.*Press the emergency stop"),
        (cable, ("unloaded_validation", Segment.SLOW), "joint_1.*joint_6.*Press the emergency stop"),
        (fault, ("unloaded_validation", Segment.PERIODS), "joint_2.*continuous overcurrent"),
    ],
    "commission arm.toml --runs loaded": [
        (encoder, ("loaded_identification", Segment.SLOW), "joint_2"),
        (full_disk, ("loaded_identification", Segment.PERIODS), "No space left on device"),
        (ctrl_c, ("loaded_validation", Segment.PERIODS), "operator requested a stop: Ctrl-C"),
    ],
    "feedforward trial": [(ctrl_c, None, "operator requested a stop: Ctrl-C")],
    "feedforward compare": [(fault, None, "joint_2.*continuous overcurrent")],
}
"""By command: what happens, in which part of which recording or in which cycle, and what is said."""


@pytest.fixture
def day(armload, tmp_path, monkeypatch):
    """er50 at 50 Hz with excitations of 8 s; Ctrl-C is a stop also in a background job, which ignores it."""
    monkeypatch.chdir(tmp_path)
    write_arm(tmp_path, 4.0, 2, cycle_hz=50)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield Day(tmp_path, armload, monkeypatch)
    signal.signal(signal.SIGINT, before)


@pytest.mark.long
def test_the_page_is_followed_on_a_simulated_arm_whatever_happens(day):
    """Each time no drive carries torque afterwards, no complete recording is touched, and the same command goes on."""
    weighed_kg = load_robot("er50").simulation.payload("paper").mass_kg
    followed = [words for words in page_commands() if not words.startswith(ON_A_BUS)]
    unloaded, loaded, *torque = INTERRUPTIONS
    beginnings = ["drives check", unloaded, "drives check", loaded, *torque]
    for words, beginning in zip(followed, beginnings, strict=True):
        assert words.startswith(beginning)
        command = f"{words} --mass-kg {weighed_kg}" if "loaded --" in words and "unloaded" not in words else words
        for happens, recording, said in INTERRUPTIONS.get(beginning, ()):
            before = day.recorded
            done = day.do(command, happens, recording)
            assert done.exit_code == 1, (words, happens, done.output)
            text = done.output + str(done.exception)
            assert re.search(said, text, re.DOTALL), text
            # Drives behind a cable that was cut hear nothing, in virtual time not even the time.
            assert happens is cable or day.powered == []
            assert before.items() <= day.recorded.items()
        at_last = (second_start, ("loaded_validation", Segment.SLOW)) if "--mass-kg" in command else ()
        done = day.do(command, *at_last)
        assert done.exit_code in (0, 3), (words, done.output, done.exception)
        if words.startswith("commission"):
            assert ": identification" not in done.output, "only the missing run is repeated"
    folder = day.folder / "runs" / "first"
    assert day.recorded.keys() == RECORDINGS
    assert read_payload(folder / "payload.toml").model.mass_kg == pytest.approx(weighed_kg, rel=0.01)
    assert read_calibration(folder / "arm.calibration.toml").robot == load_robot("er50").name
    report = (folder / "report.html").read_text("utf-8")
    for name in RECORDINGS:
        late = json.loads(read_recording_file(folder / name).source.attachments[LATENESS_ATTACHMENT])
        assert late["cycles"][0] > 0 == sum(late["cycles"][1:]), "nothing is late in virtual time"
        assert f"of {late['cycles'][0]} cycles" in report
    assert (day.folder / "feedforward.svg").is_file()
