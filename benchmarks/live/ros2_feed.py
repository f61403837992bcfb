"""`armload watch --ros2` beside a publisher and a subscriber of another DDS implementation, in real time.

    cp -r tests/ros2_peer /tmp && cargo build --release --manifest-path /tmp/ros2_peer/Cargo.toml
    ROS_LOCALHOST_ONLY=1 python -m benchmarks.live.ros2_feed /tmp/ros2_peer/target/release/ros2_peer 600 500

The currents of ../shared/data/ur10e, stamped at the rate asked for, are published on loopback, watched and recorded.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armload_controller.analysis.payload_watch import PayloadWatch, WatchedMoment
from armload_controller.analysis.robot_calibration import calibrate_from_runs
from armload_controller.config.robot import Robot, load_robot
from armload_controller.config.robot_runs import read_runs
from armload_controller.session.bus_watch import BusWatch, recorder_of
from armload_controller.session.joint_feeds import ros2_feed
from armload_identification.files.calibration_file import write_calibration
from armload_identification.float_array import FloatArray
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import Effort, ReadingOptions

DATA = Path(__file__).resolve().parents[2].parent / "shared" / "data" / "ur10e"
TOPIC = "/joint_states"
EMPTY_RUNS = ("unloaded", "unloaded_b")


@dataclass(frozen=True, eq=False)
class WatchedFeed:
    """What became of a published motion.

    Attributes:
        published: Number of samples published.
        moments: All moments while samples arrived.
        from_file: The last moment of the recording.
        lines: What the subscriber printed.
    """

    published: int
    moments: list[WatchedMoment]
    from_file: WatchedMoment
    lines: list[str]

    @property
    def received(self) -> int:
        """Number of samples received."""
        last = self.moments[-1].bus
        return 0 if last is None else last.cycles

    @property
    def lost(self) -> int:
        """Number of samples that were said to be lost."""
        last = self.moments[-1].bus
        return 0 if last is None else last.lost

    @property
    def apart(self) -> float:
        """Greatest difference between the estimate on the topic and that of the recording, in kg and m."""
        live, file = self.moments[-1].payload, self.from_file.payload
        if live is None or file is None:
            return float("inf")
        return float(np.abs(live.theta - file.theta).max())


def ur10e_calibration(robot: Robot, folder: Path) -> Path:
    """A calibration of the UR10e from two runs, in a folder."""
    table = folder / "runs.csv"
    table.write_text("\n".join(["recording,mounting,mass_kg", *(f"{DATA / name}.csv,," for name in EMPTY_RUNS), ""]))
    runs = read_runs(robot, [table])
    path = folder / "ur10e.calibration.toml"
    write_calibration(path, calibrate_from_runs(robot, runs))
    return path


def watched_feed(peer: Path, duration_s: float, rate_hz: float, folder: Path, reliability: str) -> WatchedFeed:
    """Publish, watch and record a motion.

    Args:
        peer: The program of `tests/ros2_peer`.
        duration_s: Duration of the motion.
        rate_hz: Rate of the messages.
        folder: For calibration and recording.
        reliability: reliable or best_effort.
    """
    robot = load_robot("ur10e")
    payload = PayloadWatch(robot, ur10e_calibration(robot, folder))
    lines = _lines(robot, duration_s, rate_hz)
    record = folder / f"{reliability}.mcap"
    with (
        subprocess.Popen(
            [peer, "subscribe", "/armload/ur10e"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        ) as subscriber,
        subprocess.Popen(
            [peer, "publish", TOPIC, f"{rate_hz:g}", reliability], stdin=subprocess.PIPE, text=True
        ) as publisher,
    ):
        (folder / "rows").write_text("\n".join(lines))
        feeder = subprocess.Popen(["cat", folder / "rows"], stdout=publisher.stdin)
        if publisher.stdin is not None:
            publisher.stdin.close()
        moments = []
        with ros2_feed(robot, TOPIC, Effort.CURRENT) as feed, recorder_of(robot, record, None) as recorder:
            watching = BusWatch(robot, payload, recorder, effort=feed.effort)
            end_s = time.monotonic() + duration_s + 60.0
            for moment in watching.moments(feed.cycles, lambda: time.monotonic() < end_s):
                feed.publish(moment)
                moments.append(moment)
                if moment.bus is not None and moment.bus.cycles and moment.bus.silent_s > 2.0:
                    break
        feeder.wait()
        printed = subscriber.communicate()[0].splitlines()
    heard = [each for each in moments if each.bus is not None and each.bus.cycles]
    *_, from_file = PayloadWatch(robot, folder / "ur10e.calibration.toml").file(record)
    return WatchedFeed(len(lines) - 1, heard, from_file, printed)


def _lines(robot: Robot, duration_s: float, rate_hz: float) -> list[str]:
    """Lines for the publisher: names in another order than the arm's, then stamps, positions and currents."""
    run = read_recording_file(DATA / "loaded.csv", ReadingOptions(robot.csv_columns))
    time_s = np.arange(round(duration_s * rate_hz)) / rate_hz
    span_s = run.time_s[-1] - run.time_s[0]
    there = run.time_s[0] + time_s % span_s

    def at(values: FloatArray) -> FloatArray:
        return np.column_stack([np.interp(there, run.time_s, column) for column in values.T])[:, ::-1]

    if run.current_a is None:
        raise SystemExit(f"{DATA / 'loaded.csv'} has no currents")
    stamps = [divmod(1_700_000_000_000_000_000 + round(1e9 * each), 10**9) for each in time_s.tolist()]
    rows = np.hstack([at(run.position_rad), at(run.current_a)]).tolist()
    numbers = [" ".join(map(repr, row)) for row in rows]
    return [
        " ".join(reversed(robot.joint_names)),
        *(f"{sec} {nanosec} {row}" for (sec, nanosec), row in zip(stamps, numbers, strict=True)),
    ]


def main() -> None:
    """Print what was lost and how far the estimates are apart; exit status 1 if it is too much."""
    peer, duration_s, rate_hz = Path(sys.argv[1]).resolve(), float(sys.argv[2]), float(sys.argv[3])
    os.environ.setdefault("ROS_LOCALHOST_ONLY", "1")
    bad = False
    for reliability in ("best_effort", "reliable"):
        with tempfile.TemporaryDirectory() as folder:
            cpu_s = time.process_time()
            found = watched_feed(peer, duration_s, rate_hz, Path(folder), reliability)
            cpu_s = time.process_time() - cpu_s
        missed = found.published - found.received
        bad |= missed > 0.01 * found.published or found.apart > 1e-9 or len(found.moments) < duration_s - 1.0
        print(
            f"{reliability}: {found.published} samples at {rate_hz:g} Hz, {missed} not received, {found.lost} of "
            f"them reported, {len(found.moments)} moments; estimate and that of the recording differ by "
            f"{found.apart:.1e}; {cpu_s / duration_s:.0%} of a core"
        )
    raise SystemExit(bad)


if __name__ == "__main__":
    main()
