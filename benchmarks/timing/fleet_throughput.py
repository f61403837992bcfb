"""Many pairs on Dask: CPU time compared with `armload.identify`, two workers compared with one, and a run with faults.

Distinct pairs of the shipped arms, 30 s per run: the simulated arm's steady period with individual noise, quantisation
and gain errors, as the recorder writes them. In the last part one file in a hundred is damaged, a worker and then the
coordinator are killed with SIGKILL, and a second run completes the work.

    python -m benchmarks.timing.fleet_throughput [PAIRS] [--folder FOLDER]

A folder is used again; 1,000 pairs are 1.5 GB of disk.
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from typing import Final

import numpy as np

import armload
from armload_controller.config.robot import load_robot
from armload_controller.cycle.run_recorder import Recorder
from armload_controller.fleet.job import Job
from armload_controller.fleet.job_listing import list_jobs
from armload_controller.fleet.job_processing import run_job
from armload_controller.fleet.job_table import read_job_table
from armload_controller.fleet.row_store import read_rows
from armload_controller.motion.phase import Segment
from armload_drivers.servos import JointCommand, JointFeedback
from armload_identification.excitation.excitation_file import format_excitation
from armload_identification.recording.recording import Recording
from armload_identification.recording.run_format import CONFIGURATION_ATTACHMENT, EXCITATION_ATTACHMENT, RUN_ATTACHMENT
from benchmarks.arms.setups import Twin, setup_of, shipped_motion
from benchmarks.arms.simulated_recordings import record
from benchmarks.arms.trials import Setup, workers

PAIRS: Final = 24
"""Number of pairs in `make bench`; the criteria refer to 1,000."""
ROBOTS: Final = ("er50", "prbt")
ARMS: Final = 10
GAIN_SPREAD: Final = 0.02
FIRST_DAY: Final = datetime(2026, 3, 1, 22, tzinfo=UTC)
DAMAGED_SHARE: Final = 0.01
EFFICIENCY_LEAST: Final = 0.9
CPU_MOST: Final = 1.3
_ALTERNATING: Final = 12
_LOOPS, _ROUNDS = 3, 10_000_000
_say = partial(print, flush=True)
_COMMAND: Final = (sys.executable, "-c", "from armload_controller.cli.entry import main; main()", "fleet", "identify")


def run(pairs: int = PAIRS, folder: Path | None = None) -> None:
    """Write recordings, identify them in every way, and print.

    Args:
        pairs: Number of pairs.
        folder: Folder for the recordings; existing ones are used, whatever their number. A temporary folder if not
            given.
    """
    with tempfile.TemporaryDirectory() as temporary:
        recordings = folder or Path(temporary)
        table = recordings / "jobs.csv"
        if not table.is_file():
            begun_s = time.monotonic()
            with workers() as pool:
                _write_all(pool, recordings, pairs)
            _say(f"  written to {recordings} in {time.monotonic() - begun_s:.0f} s")
        pairs = len(table.read_text().splitlines()) - 1
        load = os.getloadavg()[0]
        _say(f"Fleet: {pairs} distinct pairs of {' and '.join(ROBOTS)}, 30 s a run; load of the machine {load:.1f}")
        _compare(table, Path(temporary), pairs)
        _with_faults(table, Path(temporary), pairs)


@dataclass(frozen=True)
class _Figures:
    """A run of the command: CPU time of its processes including their start, and time from first job to last row."""

    cpu_s: float
    wall_s: float


def _compare(table: Path, scratch: Path, pairs: int) -> None:
    """Compare the CPU time of a job with that of `identify`, and the fleet with one worker and two."""
    size = sum(file.stat().st_size for file in table.parent.glob("*/*.mcap"))
    _say(f"  {size / pairs / 1e6:.2f} MB a pair")
    identify_s, job_s = _alternating(table)
    _say(f"  armload.identify {identify_s:.3f} s of CPU a pair, a job {job_s:.3f} s: {job_s / identify_s:.2f} x")
    few = _part(table, scratch / "few.csv", slice(0, len(ROBOTS)))
    eighth = min(max(pairs // 8, 4 * len(ROBOTS)), pairs)
    before = _part(table, scratch / "before.csv", slice(0, eighth))
    after = _part(table, scratch / "after.csv", slice(pairs - eighth, pairs))
    # One worker before and after two, so that other load of the machine affects both.
    rates: list[float] = []
    for count, part in ((1, before), (2, table), (1, after)):
        output, start = scratch / f"rows-{len(rates)}", scratch / f"start-{len(rates)}"
        begun, found = _fleet(few, start, count), _fleet(part, output, count)
        rows = read_rows(output, ("outcome", "cpu_s", "wall_s"))
        done = len(rows)
        inside = sum(row["cpu_s"] for row in rows)
        around = found.cpu_s - inside - (begun.cpu_s - sum(row["cpu_s"] for row in read_rows(start, ("cpu_s",))))
        around /= max(done - len(ROBOTS), 1)
        rates.append(done / found.wall_s)
        busy = sum(row["wall_s"] for row in rows) / found.wall_s / count
        _say(
            f"  {count} worker{'s' if count > 1 else ''}, {done} pairs: {inside / done:.3f} s of CPU a pair in jobs "
            f"and {around:.3f} s around them, {begun.cpu_s:.1f} s to start and end; {rates[-1]:.2f} pairs/s; "
            f"{dict(Counter(row['outcome'] for row in rows))}; busy with a job for {busy:.0%} of the time; "
            f"{(job_s + around) / identify_s:.2f} x identify in all, at most {CPU_MOST}"
        )
    _say(
        f"  parallel efficiency of two workers, first job to last row: {rates[1] / (rates[0] + rates[2]):.0%} "
        f"(at least {EFFICIENCY_LEAST:.0%} on two idle cores); of two loops of Python, which need no memory: "
        f"{_machine_efficiency():.0%}"
    )


def _machine_efficiency() -> float:
    """Parallel efficiency of two processes that share nothing but the machine."""
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        list(pool.map(_loop, [1] * 8))
        ratios = []
        for _ in range(_LOOPS):
            alone = pool.submit(_loop, _ROUNDS).result()
            ratios.append(alone / float(np.mean(list(pool.map(_loop, [_ROUNDS] * 2)))))
    return float(np.median(ratios))


def _loop(rounds: int) -> float:
    """Time that a loop takes in s."""
    begun_s, total = time.perf_counter(), 0
    for number in range(rounds):
        total += number * number
    return time.perf_counter() - begun_s


def _part(table: Path, part: Path, pairs: slice) -> Path:
    """A table of some of the pairs."""
    header, *lines = table.read_text().splitlines()
    rows = [line.split(",") for line in lines[pairs]]
    part.write_text("\n".join([header, *(",".join([*row[:2], *_absolute(table, row[2:])]) for row in rows)]) + "\n")
    return part


def _alternating(table: Path) -> tuple[float, float]:
    """Median CPU time of `armload.identify` and of a job on the same pairs, alternating, after a warm-up of both."""
    jobs = list_jobs(read_job_table(table), table).jobs[:_ALTERNATING]
    robots = {name: load_robot(name) for name in ROBOTS}
    ways: tuple[Callable[[Job], object], ...] = (
        lambda job: armload.identify(robots[job.robot], job.loaded, job.recordings["unloaded"]),
        run_job,
    )
    for way in ways:
        way(jobs[0])
    taken: list[list[float]] = [[], []]
    for job in jobs:
        for way, times in zip(ways, taken, strict=True):
            begun_s = time.process_time()
            way(job)
            times.append(time.process_time() - begun_s)
    # The robots alternate and differ: the mean of their medians.
    identify_s, job_s = (
        float(np.mean([np.median(times[first :: len(ROBOTS)]) for first in range(len(ROBOTS))])) for times in taken
    )
    return identify_s, job_s


def _absolute(table: Path, names: list[str]) -> list[str]:
    """A line of the table with absolute paths; its header unchanged."""
    return [str(table.parent / name) if "/" in name else name for name in names]


def _with_faults(table: Path, scratch: Path, pairs: int) -> None:
    """Damage files, kill a worker and the coordinator, run again, and count."""
    rows = [line.split(",") for line in table.read_text().splitlines()]
    damaged = max(round(DAMAGED_SHARE * pairs), 1)
    for row in rows[1 : damaged + 1]:
        bad = scratch / "damaged" / Path(row[2]).parent.name / Path(row[2]).name
        bad.parent.mkdir(parents=True, exist_ok=True)
        content = (table.parent / row[2]).read_bytes()
        bad.write_bytes(content[:100] + b"\0" * (len(content) - 100))
        row[2] = str(bad)
    for row in rows:
        row[2:] = _absolute(table, row[2:])
    faulty, output = scratch / "faulty.csv", scratch / "rows-with-faults"
    faulty.write_text("".join(",".join(row) + "\n" for row in rows))
    coordinator = subprocess.Popen(
        [*_COMMAND, str(faulty), "-o", str(output), "--workers", "2"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    _wait_for_rows(output, coordinator, max(pairs // 4, 1))
    killed = _workers_of(coordinator.pid)[0]
    os.kill(killed, signal.SIGKILL)
    _wait_for_rows(output, coordinator, max(pairs // 2, 2))
    coordinator.kill()
    coordinator.wait()
    kept = _journal_rows(output)
    _fleet(faulty, output, 2)
    found = read_rows(output, ("key", "outcome"))
    _say(
        f"  {damaged} damaged, a worker and the coordinator killed: {kept} rows were kept, the second run added "
        f"{len(found) - kept}; {len({row['key'] for row in found})} of {pairs} recordings have a row, "
        f"{dict(Counter(row['outcome'] for row in found))}"
    )


def _fleet(table: Path, output: Path, count: int) -> _Figures:
    """Run the command in its own processes."""
    before = getrusage(RUSAGE_CHILDREN)
    command = [*_COMMAND, str(table), "-o", str(output), "--workers", str(count), "--json"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    after = getrusage(RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return _Figures(cpu_s, json.loads(done.stdout)["wall_s"])


def _journal_rows(output: Path) -> int:
    """Number of rows on the disk, in journals and in Parquet files."""
    journals = sum(file.read_text().count("\n") for file in output.glob("journal-*.jsonl"))
    return journals + len(read_rows(output, ("key",)))


def _wait_for_rows(output: Path, coordinator: subprocess.Popen[bytes], count: int) -> None:
    """Wait until there are `count` rows, or the coordinator has ended."""
    while coordinator.poll() is None and (not output.is_dir() or _journal_rows(output) < count):
        time.sleep(0.1)


def _workers_of(process_id: int) -> list[int]:
    """Ids of the worker processes that a process has spawned."""
    threads = Path(f"/proc/{process_id}/task").glob("*/children")
    children = [child for thread in threads for child in thread.read_text().split()]
    return [int(child) for child in children if b"spawn_main" in Path(f"/proc/{child}/cmdline").read_bytes()]


def _write_all(pool: Executor, folder: Path, pairs: int) -> None:
    """Recordings and their table."""
    setups = {}
    for name in ROBOTS:
        robot = load_robot(name)
        payload = robot.simulation.plant_spec(robot.simulation.payload_name).payload
        if payload is None:
            raise ValueError(f"{name} names no payload to simulate")
        setups[name] = setup_of(
            f"fleet {name}", robot, Twin.NORMATIVE, shipped_motion(robot), payload, gain_spread=GAIN_SPREAD
        )
    tasks = [
        pool.submit(_write_pair, setups[ROBOTS[number % 2]], ROBOTS[number % 2], number, folder)
        for number in range(pairs)
    ]
    lines = ["arm,robot,loaded,unloaded", *(task.result() for task in tasks)]
    (folder / "jobs.csv").write_text("\n".join(lines) + "\n")


def _write_pair(setup: Setup, name: str, number: int, folder: Path) -> str:
    """A pair of an arm and a day; its line of the table."""
    arm = f"{name}-{number // 2 % ARMS + 1:02d}"
    day = FIRST_DAY + timedelta(days=number // (2 * ARMS))
    gains = np.random.default_rng([7, number // 2 % ARMS]).uniform(-GAIN_SPREAD, GAIN_SPREAD, setup.scales.n)
    rng = setup.rng(number)
    place = folder / f"{arm}-{day:%Y%m%d}"
    place.mkdir(parents=True, exist_ok=True)
    for load, period in (("loaded", setup.loaded), ("unloaded", setup.unloaded)):
        run_of_load = record(period, setup.scales, setup.periods, rng, gains)
        write_run(place / f"{load}.mcap", run_of_load, name, load, day)
    return f"{arm},{name},{place.name}/loaded.mcap,{place.name}/unloaded.mcap"


def write_run(path: Path, run: Recording, name: str, load: str, day: datetime) -> None:
    """Write a run as the recorder does.

    Args:
        path: The file.
        run: The run.
        name: A shipped robot.
        load: "loaded" or "unloaded".
        day: When it was recorded.
    """
    if run.phase_s is None or run.excitation is None:
        raise ValueError("the run follows no excitation")
    said = {"armload_version": "benchmark", "robot": name, "load": load, "created": day.isoformat()}
    attachments = {
        CONFIGURATION_ATTACHMENT: load_robot(name).text,
        EXCITATION_ATTACHMENT: format_excitation(run.excitation),
        RUN_ATTACHMENT: json.dumps(said),
    }
    nothing, missing = np.zeros(run.n), np.zeros(run.n, dtype=bool)
    statusword = np.full(run.n, 0x0637, dtype=np.uint16)
    with Recorder(path, attachments) as recorder:
        for k in range(run.time_s.size):
            current = None if run.current_a is None else run.current_a[k]
            torque = None if run.torque_nm is None else run.torque_nm[k]
            feedback = JointFeedback(
                k, float(run.time_s[k]), run.position_rad[k], None, current, torque, statusword, missing
            )
            command = JointCommand(run.position_rad[k], nothing, nothing)
            recorder.write(feedback, command, Segment.PERIODS, float(run.phase_s[k]))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("pairs", nargs="?", type=int, default=PAIRS)
    parser.add_argument("--folder", type=Path)
    chosen_arguments = parser.parse_args()
    run(chosen_arguments.pairs, chosen_arguments.folder)
