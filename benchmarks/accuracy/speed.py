"""From two MCAP files to the payload with intervals: time, memory and their growth, in one process on one core."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from armload_controller.config.robot import load_robot
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.motion.phase import Segment
from armload_drivers.servos import JointCommand, JointFeedback
from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.recording.run_format import CONFIGURATION_ATTACHMENT, EXCITATION_ATTACHMENT, RUN_ATTACHMENT
from benchmarks.arms.setups import Motion, Twin, paper_motion, setup_of
from benchmarks.arms.simulated_recordings import record
from benchmarks.arms.steady_state import Streaming
from benchmarks.arms.trials import Setup
from benchmarks.results.tally import Tally, progress_line

PERIODS = (1, 5, 20, 50)
LONGEST_S = 10.0
LARGEST_BYTES = 2**30
ABOVE_LINE = 0.15
"""Share by which the longest time may be above the straight line through the others; long runs are averaged while they
are read, and may be below."""


def run(tally: Tally, pool: Executor) -> None:
    """Write the files, identify from them, judge."""
    tally.heading("Speed: two MCAP files of 50 periods of 20 s at 250 Hz, 500,000 cycles, one core")
    robot = load_robot("er50")
    slow = paper_motion(robot, "a-optimal")
    motion = Motion(slow.trajectory, Streaming(robot.drives.settings, robot.limits.motion), robot.n, 1)
    payload = robot.simulation.plant_spec("paper").payload
    if payload is None:
        raise ValueError("er50 has no payload of the name 'paper'")
    setup = setup_of("speed", robot, Twin.NORMATIVE, motion, payload)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        directory = Path(folder)
        files = [(periods, load) for periods in PERIODS for load in ("loaded", "unloaded")]
        writing = [pool.submit(write, setup, load, periods, _path(directory, load, periods)) for periods, load in files]
        with progress_line("writing recordings", len(writing)) as progress:
            for done, file in enumerate(writing, 1):
                file.result()
                progress(done)
        print("  periods |  cycles | files MB | wall s | CPU s | of it identify s | largest MB")
        for periods in PERIODS:
            paths = [_path(directory, load, periods) for load in ("loaded", "unloaded")]
            probe = _probe(paths)
            size = sum(path.stat().st_size for path in paths) / 1e6
            rows.append(probe)
            print(
                f"  {periods:7d} | {2 * periods * setup.loaded.samples:7d} | {size:8.1f} | {probe['wall_s']:6.2f} | "
                f"{probe['cpu_s']:5.2f} | {probe['identify_s']:16.2f} | {probe['largest_bytes'] / 2**20:10.0f}"
            )
    longest = rows[-1]
    tally.judge(
        f"50 periods: at most {LONGEST_S:.0f} s of one core, interpreter and imports included",
        f"{longest['cpu_s']:.1f} s of its time, {longest['wall_s']:.1f} s on the clock with what else runs here",
        longest["cpu_s"] <= LONGEST_S,
    )
    largest = longest["largest_bytes"]
    tally.judge("50 periods: at most 1 GiB", f"{largest / 2**20:.0f} MiB", largest <= LARGEST_BYTES)
    seconds = np.array([row["cpu_s"] for row in rows])
    line = np.polyfit(PERIODS[:-1], seconds[:-1], 1)
    expected = float(np.polyval(line, PERIODS[-1]))
    tally.judge(
        f"CPU time grows at most linearly from 1 to {PERIODS[-1]} periods, within {ABOVE_LINE:.0%}",
        f"{seconds[-1]:.2f} s; the line through the shorter ones is at {expected:.2f} s",
        seconds[-1] <= (1.0 + ABOVE_LINE) * expected,
    )


def write(setup: Setup, load: str, periods: int, path: Path) -> None:
    """Write a run with armload's recorder.

    Raises:
        ValueError: the drives report no current.
    """
    robot = load_robot("er50")
    rng = setup.rng(0 if load == "loaded" else 1)
    period = setup.loaded if load == "loaded" else setup.unloaded
    run = record(period, setup.scales, periods, rng, np.zeros(setup.scales.n))
    if run.current_a is None or run.phase_s is None or run.excitation is None:
        raise ValueError("the speed is measured on the currents path")
    attachments = {
        CONFIGURATION_ATTACHMENT: robot.text,
        EXCITATION_ATTACHMENT: format_excitation(run.excitation),
        RUN_ATTACHMENT: json.dumps({"armload_version": "benchmark", "robot": robot.name, "load": load}),
    }
    nothing = np.zeros(run.n)
    statusword = np.full(run.n, 0x0637, dtype=np.uint16)
    missing = np.zeros(run.n, dtype=bool)
    with Recorder(path, attachments) as recorder:
        for k in range(run.time_s.size):
            feedback = JointFeedback(
                cycle=k,
                time_s=float(run.time_s[k]),
                position_rad=run.position_rad[k],
                velocity_rad_s=None,
                current_a=run.current_a[k],
                torque_nm=None,
                statusword=statusword,
                missing=missing,
            )
            command = JointCommand(run.position_rad[k], nothing, nothing)
            recorder.write(feedback, command, Segment.PERIODS, float(run.phase_s[k]))


def _path(directory: Path, load: str, periods: int) -> Path:
    return directory / f"{load}_{periods}.mcap"


def _probe(paths: list[Path]) -> dict[str, float]:
    """Identify in a fresh process; its time and memory."""
    command = [sys.executable, "-m", "benchmarks.accuracy.speed_probe", *map(str, paths)]
    answer = subprocess.run(command, check=True, capture_output=True, text=True)
    figures: dict[str, float] = json.loads(answer.stdout)
    return figures
