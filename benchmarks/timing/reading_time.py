"""Reading recordings: memory, and time per row compared with a bare read of the same file, in separate processes.

A bare read unpacks the file and parses every message as JSON, one after the other, and keeps nothing: the least that
any reader of this format must do. The library's own record iterator, for comparison, does not parse the messages.

    python -m benchmarks.timing.reading_time [ROWS]
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Final

import numpy as np

from armload_controller.cycle.run_recorder import Recorder
from armload_controller.motion.phase import Segment
from armload_drivers.servos import JointCommand, JointFeedback
from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.excitation.fourier import Excitation, FourierTrajectory
from armload_identification.recording.run_format import EXCITATION_ATTACHMENT
from benchmarks.timing.reading_probe import probe

ROWS: Final = 29_000_000
"""Rows in `make bench`: 8 h at 1 kHz, 5 GB of disk."""
MOST_TIMES_BARE: Final = 1.5
MOST_MB: Final = 1000.0
CYCLE_S: Final = 0.001
PERIOD_ROWS: Final = 20_000
JOINTS: Final = 6
COUNTS_PER_RAD: Final = 1e5
MILLIAMPERE: Final = 1e-3


def run(rows: int = ROWS) -> None:
    """Write a recording, read it in three ways, and print the times.

    Args:
        rows: Rows of the recording.
    """
    print(f"Reading: a recording of {rows:,} rows, {JOINTS} joints, 1 kHz; writing it takes {rows / 1e5:.0f} s")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.mcap"
        _write(path, rows)
        print(f"  file: {path.stat().st_size / 1e6:.0f} MB, {path.stat().st_size / rows:.0f} bytes a row")
        figures = {how: probe(how, path) for how in ("bare", "library", "armload")}
    bare = figures["bare"]["cpu_s"]
    for how, what in (
        ("bare", "bare read: chunks and JSON, nothing kept"),
        ("library", "mcap's record iterator, no JSON"),
        ("armload", "read_recording: cleaned, averaged, hashed"),
    ):
        seconds, megabytes = figures[how]["cpu_s"], figures[how]["peak_mb"]
        print(f"  {what:44} {1e6 * seconds / rows:5.2f} us a row  {seconds / bare:5.2f} x bare  {megabytes:5.0f} MB")
    times, megabytes = figures["armload"]["cpu_s"] / bare, figures["armload"]["peak_mb"]
    met = times <= MOST_TIMES_BARE and megabytes <= MOST_MB
    print(f"  at most {MOST_TIMES_BARE:g} x bare and {MOST_MB:.0f} MB: {'met' if met else 'NOT met'}")


def _write(path: Path, rows: int) -> None:
    """Record a periodic motion with noise, by armload's recorder."""
    rng = np.random.default_rng(1)
    size = 0.2 * rng.normal(size=(2, JOINTS, 5))
    trajectory = FourierTrajectory(1.0 / (PERIOD_ROWS * CYCLE_S), rng.uniform(-0.4, 0.4, JOINTS), *size)
    state = trajectory.evaluate(np.arange(1, PERIOD_ROWS + 1) * CYCLE_S)
    position = np.rint(state.position_rad * COUNTS_PER_RAD) / COUNTS_PER_RAD
    velocity = np.rint(state.velocity_rad_s * COUNTS_PER_RAD) / COUNTS_PER_RAD
    current = np.rint((np.sin(state.position_rad) + 0.1 * rng.normal(size=position.shape)) / MILLIAMPERE) * MILLIAMPERE
    nothing = np.zeros(JOINTS)
    state_word, missing = np.full(JOINTS, 0x1637, np.uint16), np.zeros(JOINTS, dtype=bool)
    excitation = Excitation(trajectory, max(rows // PERIOD_ROWS, 1))
    with Recorder(path, {EXCITATION_ATTACHMENT: format_excitation(excitation)}) as recorder:
        for row in range(rows):
            k = row % PERIOD_ROWS
            # Different noise in every period, without drawing as many numbers.
            other = (k + 7919 * (row // PERIOD_ROWS)) % PERIOD_ROWS
            feedback = JointFeedback(
                row, 100.0 + row * CYCLE_S, position[k], velocity[k], current[other], None, state_word, missing
            )
            command = JointCommand(state.position_rad[k], nothing, nothing)
            recorder.write(feedback, command, Segment.PERIODS, (row + 1) * CYCLE_S)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("rows", nargs="?", type=int, default=ROWS)
    run(parser.parse_args().rows)
