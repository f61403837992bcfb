"""kill -9 at any moment of a commissioning: at most a quarter of a second of rows is lost; the next start continues.

The moments come from a seed. In the suite the motion of both halves is killed repeatedly, on servos without a bus.
`pytest -m soak -s` on this file kills the complete program, with identification and report, at twenty moments (six
minutes on an idle core).
"""

import os
import signal
import struct
import subprocess
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pytest

from armload_controller.cycle.run_recorder import Recorder
from armload_identification.identification_errors import RecordingError
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reader import ReadingAccount
from armload_identification.recording.reader_registry import reader_of
from armload_identification.recording.reading_options import ReadingOptions
from tests.short_commissioning import MIDDLE_RAD, RECORDINGS, least_robot, record, write_short_robot

SEED = 12
PROMISED_S = 0.25
CYCLE_S = 0.01
RESULTS = {"payload.toml", "report.html"}


class Notes:
    """Row times that a process, to be killed later, stores outside its recordings.

    Args:
        path: File for the times of the first and the last row that the recorder of the run in progress was given.
    """

    FORMAT = struct.Struct("qdd")

    def __init__(self, path):
        self._path = path

    def watch(self, act=lambda row: None):
        """From now on store the time of every row before it is recorded, then call `act` with its number."""
        descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT | os.O_TRUNC)
        write_row, seen = Recorder.write, [0]

        def write(recorder, feedback, *rest):
            seen[0] += 1
            first_s = feedback.time_s if recorder.rows == 0 else self.FORMAT.unpack(os.pread(descriptor, 24, 0))[1]
            os.pwrite(
                descriptor, self.FORMAT.pack(os.fstat(recorder._file.fileno()).st_ino, first_s, feedback.time_s), 0
            )
            act(seen[0])
            write_row(recorder, feedback, *rest)

        Recorder.write = write

    def lost_s(self, folder):
        """Duration of the rows measured but not in the file; 0 if no run was in progress."""
        if not self._path.exists() or self._path.stat().st_size == 0:
            return 0.0
        inode, first_s, last_s = self.FORMAT.unpack(self._path.read_bytes())
        (file,) = (path for path in folder.iterdir() if path.stat().st_ino == inode)
        if file.name in RECORDINGS:
            return 0.0
        try:  # not read as a recording, which needs twenty rows
            *_, block = reader_of(file, ReadingOptions()).blocks(ReadingAccount())
        except RecordingError:  # no row
            return last_s - first_s + CYCLE_S
        return last_s - block.time_s[-1]


def finished(folder):
    """The complete recordings and results of a folder, with their times of modification."""
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir() if path.name in RECORDINGS | RESULTS}


def killed_in_row(robot, folder, make_servos, notes, row):
    """A separate process that is killed by kill -9 after measuring this row, before recording it."""

    def kill(seen):
        if seen == row:
            os.kill(os.getpid(), signal.SIGKILL)

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # of threads of the test runner
        child = os.fork()
    if child == 0:
        try:
            notes.watch(kill)
            record(robot, folder, make_servos)
        finally:
            os._exit(1)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


@pytest.mark.long
def test_the_motion_killed_again_and_again_loses_a_quarter_of_a_second_and_goes_on(ideal_servos, tmp_path):
    robot, folder, notes = least_robot(), tmp_path / "run", Notes(tmp_path / "notes")
    folder.mkdir()

    def make_servos():
        servos = ideal_servos(6, CYCLE_S, position_rad=MIDDLE_RAD)
        servos.simulated = True
        return servos

    for row in np.random.default_rng(SEED).integers(1, 1000, 2):
        before = finished(folder)
        assert killed_in_row(robot, folder, make_servos, notes, int(row)) == -signal.SIGKILL
        assert notes.lost_s(folder) <= PROMISED_S
        assert before.items() <= finished(folder).items()
    before = finished(folder)
    record(robot, folder, make_servos)
    assert before.items() <= finished(folder).items()
    assert set(finished(folder)) == RECORDINGS
    for name in RECORDINGS:
        assert np.isfinite(read_recording_file(folder / name).phase_s).sum() == 50


def cpu_s(process):
    """CPU time of a process, which does not depend on the computer's other load."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


PROGRAM = """
import sys
from pathlib import Path
from tests.faults.test_killed_commissioning import Notes
Notes(Path(sys.argv.pop(1))).watch()
from armload_controller.cli.entry import main
main()
"""


def started(robot, folder, notes):
    words = [sys.executable, "-c", PROGRAM, notes, "commission", robot, "--output", folder]
    return subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def has_ended(process):
    printed, _ = process.communicate(timeout=600)
    assert process.returncode in (0, 3), printed


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """The robot's file, and the CPU time of a commissioning that is not killed."""
    folder = tmp_path_factory.mktemp("undisturbed")
    robot = write_short_robot(folder)
    before_s = os.times()
    has_ended(started(robot, folder / "run", folder / "notes"))
    after_s = os.times()
    assert set(finished(folder / "run")) == RECORDINGS | RESULTS
    return robot, sum(after_s[2:4]) - sum(before_s[2:4])


@pytest.mark.soak
@pytest.mark.timeout(800)
@pytest.mark.parametrize("share", np.random.default_rng(SEED).uniform(0.0, 1.0, 20).round(3))
def test_a_kill_of_the_program_loses_a_quarter_of_a_second_and_the_next_start_has_a_result(
    undisturbed, tmp_path, share
):
    (robot, takes_s), folder, notes = undisturbed, tmp_path / "run", Notes(tmp_path / "notes")
    process = started(robot, folder, tmp_path / "notes")
    while process.poll() is None and cpu_s(process) < share * takes_s:
        time.sleep(0.001)
    process.kill()
    process.communicate()
    before = finished(folder) if folder.exists() else {}
    lost_s = notes.lost_s(folder)
    print(f"killed at {100 * share:3.0f} %: {len(before)} files complete, {lost_s:.3f} s of rows lost")  # noqa: T201
    assert lost_s <= PROMISED_S
    if set(before) != RECORDINGS | RESULTS:
        has_ended(started(robot, folder, tmp_path / "notes"))
    after = finished(folder)
    assert set(after) == RECORDINGS | RESULTS
    assert all(after[name] == when for name, when in before.items() if name in RECORDINGS)
