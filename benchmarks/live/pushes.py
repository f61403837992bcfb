"""Load or push, on the recorded motion of a UR10e: pushes added as J^T F, and payloads added as their torque.

    python -m benchmarks.live.pushes [--part quiet|several|one|pushes|grasps] [--first SEED] [--calibration FILE]

All parts take twenty minutes on two cores. Without a calibration the arm is calibrated from its runs of February 2020;
the runs of 31 January are of another day. A push begins and ends within 50 ms; its force has a vertical part of less
than two thirds. A grasp takes 50 to 400 ms. Times are those of the sample that shows an event, from the first sample of
the push. `BOUNDED` and `UNBOUNDED` were set with seeds from 5000 on.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from pathlib import Path
from typing import Any, Final

import numpy as np

from armload_controller.analysis.robot_calibration import calibrate_from_runs
from armload_controller.config.robot import Robot, load_robot
from armload_controller.config.robot_runs import read_runs
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.contact.force_watch import ForceEvent, ForceEventKind
from armload_identification.contact.watched_payload import WatchedPayload
from armload_identification.files.calibration_file import read_calibration
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_regressor
from armload_identification.pipeline.estimator_constants import estimator_constants
from armload_identification.pipeline.recursive_estimator import LivePayload
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import ReadingOptions
from benchmarks.arms.trials import workers
from benchmarks.live.ros2_feed import DATA
from benchmarks.results.tally import Tally, progress_line

WEIGHED_KG: Final = 2.805
BEFORE_S, AFTER_S = 12.0, 3.5
MOVING_RAD_S: Final = 0.06
STUTTER: Final = ("loaded_b.csv", 10.0, 20.0)
"""Where this recording's own motion stutters: no push or grasp is placed there."""
SIZES_N: Final = (20.0, 30.0, 60.0, 100.0)
MASSES_KG: Final = (0.35, 0.7, 1.5, 3.0)
TRIALS, ALONE, GRASPS = 100, 400, 24
"""Number of pushes of each size, of those of the criterion for one moving joint, and of grasps of each mass. In all
recordings one joint alone moves for half a second, just before the arm stops: whether a push is noticed there depends
on its direction, and shares of a hundred pushes scatter by four hundredths."""
RIGHTLY_S: Final = 1.5
SEVERAL: Final = (3, 6)
"""Number of moving joints."""
REQUIRED: Final = {(True, 30.0): (0.25, 0.95), (True, 60.0): (0.15, 0.95), (False, 60.0): (0.25, 0.8)}
"""Time and share by size, for three or more joints moving and for one."""
Motion = tuple[FloatArray, FloatArray, FloatArray]
"""Time stamps, positions, currents."""


@dataclass(frozen=True, eq=False)
class Bench:
    """The arm and its recordings."""

    robot: Robot
    calibration: ArmCalibration
    runs: dict[str, Motion]

    @classmethod
    @cache
    def of(cls, path: Path | None) -> Bench:
        """With a calibration file, or calibrated from the runs of February."""
        robot = load_robot("ur10e")
        calibration = read_calibration(path) if path is not None else _calibrated(robot)
        files = [DATA / f"{name}{day}.csv" for name in ("unloaded", "loaded") for day in ("", "_b", "_jan31")]
        files += sorted((DATA / "other_paths").glob("*.csv"))
        runs = {}
        for file in files:
            run = read_recording_file(file, ReadingOptions(robot.csv_columns))
            if run.current_a is not None:
                runs[file.name] = run.time_s - run.time_s[0], run.position_rad, run.current_a
        return cls(robot, calibration, runs)

    @property
    def watch(self) -> WatchedPayload:
        """A new watch of the arm."""
        return WatchedPayload(self.calibration, self.robot.chain, self.robot.transmission)

    def current_of(self, torque_nm: FloatArray) -> FloatArray:
        """(K, n) motor currents of joint torque."""
        constants = estimator_constants(self.calibration, self.robot.chain, self.robot.transmission)
        return np.asarray(torque_nm @ np.linalg.inv(constants.from_effort))

    def scene(self, rng: np.random.Generator, after_s: float, least: int, most: int = 6) -> tuple[Motion, float]:
        """A part of a recording around a random time at which so many joints move."""
        while True:
            name = str(rng.choice(sorted(self.runs)))
            time_s, position, current = self.runs[name]
            at_s = float(rng.uniform(BEFORE_S - 2.0, time_s[-1] - after_s))
            k = int(np.searchsorted(time_s, at_s))
            near = slice(k - 6, k + 7)
            speed = np.gradient(position[near], time_s[near], axis=0)[6]
            in_stutter = name == STUTTER[0] and STUTTER[1] < at_s < STUTTER[2]
            if least <= np.count_nonzero(np.abs(speed) > MOVING_RAD_S) <= most and not in_stutter:
                part = slice(*np.searchsorted(time_s, (at_s - BEFORE_S, at_s + after_s)))
                return (time_s[part], position[part], current[part].copy()), at_s

    def pushed(
        self, rng: np.random.Generator, force_n: FloatArray, lasts_s: float, moving: tuple[int, int]
    ) -> tuple[Motion, float]:
        """A push at a random time at which so many joints move."""
        (time_s, position, current), at_s = self.scene(rng, lasts_s + AFTER_S, *moving)
        share = np.clip(np.minimum(time_s - at_s, at_s + lasts_s - time_s) / 0.05, 0.0, 1.0)
        acting = np.flatnonzero(share)
        chain = self.calibration.level(self.robot.chain)
        torque = force_n @ chain.jacobian(position[acting])[:, :3]
        current[acting] -= self.current_of(torque * share[acting, None])
        return (time_s, position, current), at_s

    def grasped(self, rng: np.random.Generator, mass_kg: float) -> tuple[Motion, float]:
        """A payload, grasped at a random time."""
        (time_s, q, current), at_s = self.scene(rng, 2.0 * AFTER_S, 1)
        center = rng.normal(size=3) * (0.03, 0.03, 0.02) + (0.0, 0.0, 0.06)
        body = InertialParameters.from_center_of_mass(mass_kg, center, 0.0006 * mass_kg * np.eye(3))
        dq = np.gradient(_smooth(q), time_s, axis=0)
        ddq = np.gradient(_smooth(dq), time_s, axis=0)
        position, speed, rate = (np.ascontiguousarray(each) for each in (q, dq, ddq))
        chain = self.calibration.level(self.robot.chain)
        torque = payload_regressor(chain, position, speed, rate) @ body.theta
        arm = self.calibration.body
        added = arm.torque(chain, position, speed, rate, torque) - arm.torque(chain, position, speed, rate)
        share = np.clip((time_s - at_s) / rng.uniform(0.05, 0.4), 0.0, 1.0)
        current += self.current_of(added * share[:, None])
        return (time_s, q, current), at_s


def _smooth(values: FloatArray) -> FloatArray:
    """Means over 15 samples, so that a grasp's inertial torque is not the encoders' noise."""
    kernel = np.hanning(17)[1:-1]
    return np.column_stack([np.convolve(np.pad(x, 7, "edge"), kernel / kernel.sum(), "valid") for x in values.T])


def _calibrated(robot: Robot) -> ArmCalibration:
    """From twelve runs of February 2020."""
    empty = [*(DATA / "other_paths").glob("*.csv"), DATA / "unloaded.csv", DATA / "unloaded_b.csv"]
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "runs.csv"
        rows = ["recording,mounting,mass_kg", *(f"{path},," for path in sorted(empty))]
        rows += [f"{DATA / name}.csv,{name},{WEIGHED_KG}" for name in ("loaded", "loaded_b")]
        table.write_text("\n".join([*rows, ""]))
        return calibrate_from_runs(robot, read_runs(robot, [table]))


@dataclass(frozen=True)
class Outcome:
    """What became of an event.

    Attributes:
        noticed_s: Time until it was noticed; infinite if it was not.
        decided_s: Time from the notice to the decision.
        payload: Whether it was called a payload.
        error: Of the force, as a share.
        mass_kg: Mass 3 s after the notice, and half width of its interval; NaN where not asked for.
    """

    noticed_s: float
    decided_s: float
    payload: bool
    error: float = np.nan
    mass_kg: tuple[float, float] = (np.nan, np.nan)


def events_in_time(watch: WatchedPayload, motion: Motion, part: slice = slice(None)) -> list[ForceEvent]:
    """The events of a motion, sample by sample, at the stamp of the sample that showed them."""
    events = []
    for time_s, *row in zip(*(values[part] for values in motion), strict=True):
        watch.take(np.array([time_s]), *(values[None] for values in row))
        events += [replace(event, time_s=float(time_s)) for event in watch.take_events()]
    return events


def outcome(events: list[ForceEvent], at_s: float, force_n: FloatArray | None = None) -> Outcome:
    """Of the first event at a time or later."""
    later = [each for each in events if each.time_s >= at_s]
    noticed = next((each.time_s for each in later if each.kind is ForceEventKind.ACTING), np.inf)
    decided = [each for each in later if each.kind in (ForceEventKind.PAYLOAD, ForceEventKind.PUSH)]
    if not decided:
        return Outcome(noticed - at_s, np.inf, payload=False)
    first = decided[0]
    error = np.nan
    if force_n is not None and first.assessment is not None:
        error = float(np.linalg.norm(first.assessment.force_n - force_n) / np.linalg.norm(force_n))
    # a decision that is corrected later is wrong, whichever way
    kinds = [each.kind is ForceEventKind.PAYLOAD for each in decided]
    payload = all(kinds) if force_n is None else any(kinds)
    return Outcome(noticed - at_s, first.time_s - noticed, payload, error)


def _push(
    calibration: Path | None, size_n: float, lasts_s: tuple[float, float], moving: tuple[int, int], seed: int
) -> Outcome:
    """One push, while so many joints move."""
    bench, rng = Bench.of(calibration), np.random.default_rng([seed, int(size_n), int(10 * lasts_s[1])])
    force = rng.normal(size=3)
    while abs(force[2]) > 0.65 * np.linalg.norm(force):
        force = rng.normal(size=3)
    force *= size_n / np.linalg.norm(force)
    motion, at_s = bench.pushed(rng, force, float(rng.uniform(*lasts_s)), moving)
    return outcome(events_in_time(bench.watch, motion), at_s, force)


def _grasp(calibration: Path | None, mass_kg: float, seed: int) -> Outcome:
    """One grasp."""
    bench, rng = Bench.of(calibration), np.random.default_rng([seed, round(100 * mass_kg)])
    motion, at_s = bench.grasped(rng, mass_kg)
    watch = bench.watch
    events: list[ForceEvent] = []
    estimates: list[LivePayload] = []
    due_s = at_s - 0.2
    for k in range(motion[0].size):
        if motion[0][k] > due_s:
            estimates.append(watch.estimate())
            due_s = np.inf
        events += events_in_time(watch, motion, slice(k, k + 1))
        found = outcome(events, at_s)
        if len(estimates) == 1 and np.isfinite(found.noticed_s):
            due_s = at_s + found.noticed_s + 3.0
    if len(estimates) < 2:
        return found
    before, after = estimates
    width = float(np.hypot(before.half_width_95[0], after.half_width_95[0]))
    return replace(found, mass_kg=(after.mass_kg - before.mass_kg, width))


def _false(calibration: Path | None, seed: int) -> list[str]:
    """Times of the false events of the recording of this number."""
    bench = Bench.of(calibration)
    name = list(bench.runs)[seed % len(bench.runs)]
    events = events_in_time(bench.watch, bench.runs[name])
    return [f"{name} at {event.time_s:.1f} s" for event in events if event.kind is ForceEventKind.ACTING]


Trials = Callable[[str, Callable[[int], Any], int], list[Any]]
"""Runs so many trials of one kind."""


def quiet(tally: Tally, trials: Trials, calibration: Path | None) -> None:
    """False events of all recordings."""
    runs = Bench.of(calibration).runs
    hours = sum(time_s[-1] for time_s, _, _ in runs.values()) / 3600.0
    false = [text for texts in trials("recordings", partial(_false, calibration), len(runs)) for text in texts]
    tally.judge(f"false events in {hours:.2f} h of recordings, at most 1", ", ".join(false) or "none", len(false) <= 1)


def noticed(what: str, moving: tuple[int, int], tally: Tally, trials: Trials, calibration: Path | None) -> None:
    """Shares of pushes of a second that are noticed in time, while so many joints move."""
    for size_n in SIZES_N:
        push = partial(_push, calibration, size_n, (1.0, 1.0), moving)
        within_s, least = REQUIRED.get((moving == SEVERAL, size_n), (0.25, None))
        number = ALONE if moving != SEVERAL and least is not None else TRIALS
        late = np.array([each.noticed_s for each in trials(f"{size_n:g} N, {what}", push, number)])
        shares = ", ".join(f"{np.mean(late <= s):.0%}" for s in (0.1, 0.15, 0.25, 0.5))
        print(f"    {size_n:3.0f} N, {what} moving: noticed within 0.1, 0.15, 0.25, 0.5 s: {shares}", flush=True)
        if least is not None:
            share = float(np.mean(late <= within_s))
            tally.judge(f"{size_n:g} N, {what} moving: {least:.0%} in {within_s:g} s", f"{share:.0%}", share >= least)


def pushes(tally: Tally, trials: Trials, calibration: Path | None) -> None:
    """What pushes are called."""
    for lasts_s, allowed in (((0.3, 2.0), 1), ((4.0, 4.0), 2)):
        found = []
        for size_n in (30.0, 60.0):
            push = partial(_push, calibration, size_n, lasts_s, SEVERAL)
            found += trials(f"{size_n:g} N for {lasts_s[1]:g} s", push, TRIALS)
        called = sum(each.payload for each in found)
        what = f"{len(found)} pushes of {lasts_s[0]:g} to {lasts_s[1]:g} s"
        tally.judge(f"of {what} at most {allowed} are called a payload", f"{called}", called <= allowed)
        _judge_rightly(tally, what, [each for each in found if np.isfinite(each.noticed_s)], payload=False)
        error = np.nanmedian([each.error for each in found])
        print(f"    error of the force {error:.0%} (median)", flush=True)


def grasps(tally: Tally, trials: Trials, calibration: Path | None) -> None:
    """What grasps are called, and how well their mass is known."""
    by_mass = {mass: trials(f"{mass:g} kg", partial(_grasp, calibration, mass), GRASPS) for mass in MASSES_KG}
    every = [(mass, each) for mass, found in by_mass.items() for each in found]
    contacts = sum(np.isfinite(each.decided_s) and not each.payload for _, each in every)
    inside = sum(abs(each.mass_kg[0] - mass) <= each.mass_kg[1] for mass, each in every)
    tally.judge(f"of {len(every)} grasps at most 1 is called a contact", f"{contacts}", contacts <= 1)
    tally.judge(f"92 of {len(every)} masses are within their interval 3 s later", f"{inside}", inside >= 92)
    _judge_rightly(tally, "grasps", [each for _, each in every if np.isfinite(each.noticed_s)], payload=True)
    for mass, found in by_mass.items():
        late = np.array([each.noticed_s for each in found])
        width = np.nanmedian([each.mass_kg[1] for each in found])
        error = np.nanmedian([abs(each.mass_kg[0] - mass) for each in found])
        print(f"    {mass:g} kg: 3 s later wrong by {error:.3f} kg (median), half width {width:.2f} kg")
        within_s = 3.0 if mass == MASSES_KG[0] else 1.0
        share = float(np.mean(late <= within_s))
        tally.judge(f"{mass:g} kg: noticed within {within_s:g} s in 95 %", f"{share:.0%}", share >= 0.95)


def _judge_rightly(tally: Tally, what: str, found: list[Outcome], *, payload: bool) -> None:
    """Whether what was noticed is decided rightly in time."""
    rightly = float(np.mean([each.payload is payload and each.decided_s <= RIGHTLY_S for each in found]))
    tally.judge(f"{what}: 95 % decided rightly {RIGHTLY_S:g} s after the notice", f"{rightly:.0%}", rightly >= 0.95)


def main() -> int:
    """Print the figures beside what is asked for; exit status 1 if a criterion is not met."""
    parts: dict[str, Callable[[Tally, Trials, Path | None], None]] = {
        "quiet": quiet,
        "several": partial(noticed, "three or more joints", SEVERAL),
        "one": partial(noticed, "one joint", (1, 1)),
        "grasps": grasps,
        "pushes": pushes,
    }
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--part", action="append", choices=parts, help="by default all of them")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--calibration", type=Path)
    given = parser.parse_args()
    tally = Tally()
    with workers() as pool:

        def trials(what: str, task: Callable[[int], Any], number: int) -> list[Any]:
            jobs = [pool.submit(task, seed) for seed in range(given.first, given.first + number)]
            with progress_line(what, number) as progress:
                found = []
                for job in jobs:
                    found.append(job.result())
                    progress(len(found))
            return found

        for part in given.part or parts:
            tally.heading(part)
            parts[part](tally, trials, given.calibration)
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
