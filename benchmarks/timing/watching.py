"""Watching a recording: memory, and time compared with a bare read of the same file, in separate processes.

er50 repeats the same two minutes of point-to-point motion at 250 Hz; `armload watch` estimates every second what it
carries. With two lengths: the time per row, without start-up, and the memory must not grow.

    python -m benchmarks.timing.watching [HOURS]        24 are a day: 21.6 million rows, 4 GB of disk, ten minutes
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Final

import numpy as np

from armload_controller.config.robot import Robot, load_robot
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.motion.phase import Segment
from armload_drivers.servos import JointCommand, JointFeedback
from armload_identification.files.calibration_file import write_calibration
from armload_identification.float_array import FloatArray
from benchmarks.accuracy.simulated_motion import calibration_of, empty_stream, scales_of, signals_of
from benchmarks.arms.setups import Twin
from benchmarks.arms.streams import as_recorded
from benchmarks.timing.reading_probe import CALIBRATION, WATCHED, probe

HOURS: Final = 1.0
"""Hours in `make bench`."""
PART: Final = 0.25
"""Length of the shorter recording as a share of the longer."""
MOST: Final = 3.0
"""Limit of the time, in times of a bare read."""
_HOUR_S: Final = 3600.0


def run(hours: float = HOURS) -> None:
    """Write two recordings, read and watch them, and print the times.

    Args:
        hours: Length of the longer one.
    """
    robot = load_robot(WATCHED)
    rows = round(hours * _HOUR_S * robot.bus.cycle_hz)
    print(f"Watching: {WATCHED} at {robot.bus.cycle_hz:g} Hz, at most {MOST:g} times a bare read", flush=True)
    with tempfile.TemporaryDirectory() as folder:
        calibration = calibration_of(robot, Twin.NORMATIVE, np.random.default_rng(5), np.zeros(robot.n))
        write_calibration(Path(folder) / CALIBRATION, calibration)
        for count in (round(PART * rows), rows):
            path = Path(folder) / "watched.mcap"
            _write(path, robot, count)
            size_mb = path.stat().st_size / 1e6
            bare, watched = (probe(how, path) for how in ("bare", "watch"))
            ratio = watched["cpu_s"] / bare["cpu_s"]
            print(
                f"  {count / robot.bus.cycle_hz / _HOUR_S:5.2f} h, {count:,} rows, {size_mb:.0f} MB: bare "
                f"{1e6 * bare['cpu_s'] / count:.2f} us a row, watched {1e6 * watched['cpu_s'] / count:.2f}, "
                f"{ratio:.2f} x bare, {watched['peak_mb']:.0f} MB of memory",
                flush=True,
            )
            path.unlink()
    print(f"  {'met' if ratio <= MOST else 'NOT met'}")


def _write(path: Path, robot: Robot, rows: int) -> None:
    """Record the empty arm's motion, by armload's recorder."""
    position, effort = _signals(robot)
    nothing = np.zeros(robot.n)
    with_current = robot.drives.settings.drives[0].feedback.name == "CURRENT"
    state_word, missing = np.full(robot.n, 0x1637, np.uint16), np.zeros(robot.n, dtype=bool)
    with Recorder(path, {}) as recorder:
        for row in range(rows):
            k = row % len(position)
            current, torque = (effort[k], None) if with_current else (None, effort[k])
            time_s = 100.0 + row / robot.bus.cycle_hz
            feedback = JointFeedback(row, time_s, position[k], None, current, torque, state_word, missing)
            command = JointCommand(position[k], nothing, nothing)
            recorder.write(feedback, command, Segment.SLOW, (row + 1) / robot.bus.cycle_hz)


def _signals(robot: Robot) -> tuple[FloatArray, FloatArray]:
    """(K, n) positions and efforts of a motion and its reverse, so that it ends where it began."""
    stream, rng = empty_stream(robot.name, Twin.NORMATIVE, 0), np.random.default_rng(1)
    _, position, effort = signals_of(as_recorded(stream, scales_of(robot), rng, np.zeros(robot.n), "a minute"))
    return np.vstack([position, position[::-1]]), np.vstack([effort, effort[::-1]])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("hours", nargs="?", type=float, default=HOURS)
    run(parser.parse_args().hours)
