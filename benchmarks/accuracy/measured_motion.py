"""A payload from any motion: windows of the measured UR10e, changing payloads, false alarms, time of an update.

The calibration does not use the pair that is tested, but the other pair and the runs of other paths. A lighter payload
is a weighted mean of the currents of the empty and the loaded run, whose positions agree within 0.2 mrad.
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from armload_controller.config.robot import Robot, load_robot
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.calibration.mounted_runs import MountedRun, WeighedPayload
from armload_identification.float_array import FloatArray
from armload_identification.pipeline.any_motion import identify_windows
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.pipeline.recursive_estimator import PayloadEstimator
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.recording import Recording
from armload_identification.signals.load_signal import time_shift
from armload_identification.signals.spline import fit_motion
from benchmarks.accuracy.real_currents import FOLDER, MASS_KG, absent
from benchmarks.arms.calibrated import calibrated
from benchmarks.results.tally import Tally
from benchmarks.timing.estimator_time import least_times_us

PAIRS = {"a": "", "b": "_b"}
WINDOWS = {20.0: (0.006, 0.015), 10.0: (0.009, 0.027), 5.0: (0.012, 0.04)}
"""Length in s: allowed median and 95 % quantile of the mass's relative error."""
OVERLAP_S = 2.5
COVERAGE, CENTER_M = 0.93, 0.004
SHARE, CHANGE_S = 0.25, 0.7
"""Share of the weighed payload that is grasped or dropped, and time within which 95 % of these must be detected."""
SETTLED_S, EVERY_S, LATEST_S = 10.0, 3.0, 6.0
UPDATE_US, UPDATES = 10.0, 1_000_000


@dataclass(frozen=True, eq=False)
class Pair:
    """One pair, and the arm calibrated with the other runs."""

    loaded: Recording
    unloaded: Recording
    calibration: ArmCalibration


def run_measured(tally: Tally) -> None:
    """The UR10e; skipped with a reason if the measured data are not next to the checkout."""
    tally.heading("3d. A payload from any motion of the UR10e")
    if absent(tally, "payloads from any motion"):
        return
    robot = load_robot("ur10e")
    others = [_read(robot, path.name) for path in sorted((FOLDER / "other_paths").glob("*.csv"))]
    pairs = [_pair(robot, name, others) for name in PAIRS]
    for length_s, limits in WINDOWS.items():
        _judge_windows(tally, robot, pairs, length_s, limits)
    _judge_in_the_loop(tally, robot, pairs)
    _judge_changes(tally, robot, pairs)
    _judge_false_alarms(tally, robot, pairs, others)
    _judge_updates(tally, robot, pairs[0])


def _judge_windows(tally: Tally, robot: Robot, pairs: list[Pair], length_s: float, limits: tuple[float, float]) -> None:
    """Windows of one length, from several start times."""
    error, inside, center = [], [], []
    for pair in pairs:
        chain, known = pair.calibration.level(robot.chain), pair.calibration.known_arm
        transmission = pair.calibration.transmission(robot.drives.transmission)
        whole = identify_runs(pair.loaded, pair.unloaded, chain, transmission, arm=known).parameters.center_of_mass_m
        begin_s = pair.loaded.time_s[0] + _first_movement(pair.loaded)
        for late_s in np.arange(0.0, length_s, OVERLAP_S):
            rows = pair.loaded.time_s >= begin_s + late_s
            for window in identify_windows(pair.loaded.rows(rows), chain, transmission, known, length_s):
                if window.found is None:
                    error.append(np.inf)
                    inside.append(False)
                    continue
                error.append(abs(window.found.parameters.mass_kg / MASS_KG - 1.0))
                inside.append(error[-1] * MASS_KG <= window.found.uncertainty.half_width_95[0])
                center.append(float(np.linalg.norm(window.found.parameters.center_of_mass_m - whole)))
    median, most = np.quantile(error, [0.5, 0.95])
    tally.judge(
        f"{length_s:g} s of any motion: mass within {limits[0]:.1%} (median) and {limits[1]:.1%} (95 %), intervals "
        f"hold {COVERAGE:.0%}",
        f"{median:.2%}, {most:.2%}; {np.mean(inside):.0%} of {len(error)}; centre of mass "
        f"{1e3 * np.median(center):.1f}, {1e3 * np.quantile(center, 0.95):.1f} mm of the pair's difference",
        bool(median <= limits[0] and most <= limits[1] and np.mean(inside) >= COVERAGE),
    )
    if length_s == max(WINDOWS):
        apart = float(np.quantile(center, 0.95))
        tally.judge(
            f"{length_s:g} s: centre of mass within {1e3 * CENTER_M:g} mm (95 %) of the pair's difference",
            f"{1e3 * apart:.1f} mm",
            apart <= CENTER_M,
        )


def _judge_in_the_loop(tally: Tally, robot: Robot, pairs: list[Pair]) -> None:
    """The recursive estimator on 20 s of unfiltered samples."""
    length_s = max(WINDOWS)
    error, inside = [], []
    for pair in pairs:
        begin_s = _first_movement(pair.loaded)
        elapsed = pair.loaded.time_s - pair.loaded.time_s[0]
        for start_s in np.arange(begin_s, elapsed[-1] - length_s - begin_s, OVERLAP_S):
            estimator = PayloadEstimator(pair.calibration, robot.chain, robot.drives.transmission)
            rows = (elapsed >= start_s) & (elapsed < start_s + length_s)
            estimator.update_all(*_stream(pair.loaded, rows))
            found = estimator.estimate()
            error.append(abs(found.mass_kg / MASS_KG - 1.0))
            inside.append(error[-1] * MASS_KG <= found.half_width_95[0])
    median, most = np.quantile(error, [0.5, 0.95])
    limits = WINDOWS[length_s]
    tally.judge(
        f"the same {length_s:g} s sample by sample, in the loop",
        f"{median:.2%}, {most:.2%}; {np.mean(inside):.0%} of {len(error)}",
        bool(median <= limits[0] and most <= limits[1] and np.mean(inside) >= COVERAGE),
    )


def _judge_changes(tally: Tally, robot: Robot, pairs: list[Pair]) -> None:
    """A payload that is grasped or dropped while the arm moves."""
    late, early = [], 0
    for pair in pairs:
        time_s, position, loaded = _stream(pair.loaded)
        empty = _at_the_same_places(pair)
        moves = np.flatnonzero(np.abs(np.gradient(position, time_s, axis=0)).max(axis=1) > 0.1)
        for at_s in np.arange(time_s[moves[0]] + SETTLED_S, time_s[moves[-1]] - LATEST_S, EVERY_S):
            for grasped in (True, False):
                share = np.where((time_s >= at_s) == grasped, SHARE, 0.0)[:, None]
                current = np.ascontiguousarray((1.0 - share) * empty + share * loaded)
                estimator = PayloadEstimator(pair.calibration, robot.chain, robot.drives.transmission)
                before = time_s < at_s
                estimator.update_all(time_s[before], position[before], current[before])
                alarms = estimator.changes
                early += alarms
                late.append(_noticed(estimator, alarms, at_s, (time_s, position, current)))
    most = float(np.quantile(late, 0.95))
    tally.judge(
        f"{SHARE * MASS_KG:.2f} kg grasped or dropped: noticed within {CHANGE_S:g} s (95 %), none missed",
        f"median {np.median(late):.2f}, 95 % {most:.2f} s; {np.count_nonzero(np.isinf(late))} of {len(late)} missed, "
        f"{early} alarms before",
        bool(most <= CHANGE_S and np.isfinite(late).all()),
    )


def _noticed(
    estimator: PayloadEstimator, alarms: int, at_s: float, stream: tuple[FloatArray, FloatArray, FloatArray]
) -> float:
    """Delay in s until a change is detected; inf if it is not."""
    time_s, position, current = stream
    begin = int(np.searchsorted(time_s, at_s))
    end = int(np.searchsorted(time_s, at_s + LATEST_S))
    for k in range(begin, end):
        estimator.update(float(time_s[k]), position[k], current[k])
        if estimator.changes > alarms:
            return float(time_s[k] - at_s)
    return np.inf


def _judge_false_alarms(tally: Tally, robot: Robot, pairs: list[Pair], others: list[Recording]) -> None:
    """Empty runs without changes."""
    alarms, watched_s = 0, 0.0
    for pair in pairs:
        for run in (pair.unloaded, *others):
            estimator = PayloadEstimator(pair.calibration, robot.chain, robot.drives.transmission)
            estimator.update_all(*_stream(run))
            alarms += estimator.changes
            watched_s += float(run.time_s[-1] - run.time_s[0])
    tally.judge(
        "empty runs: at most one false alarm in all of them", f"{alarms} in {watched_s:.0f} s", alarms <= len(pairs)
    )


def _judge_updates(tally: Tally, robot: Robot, pair: Pair) -> None:
    """Time of an update, and numerical stability over a million updates."""

    def make() -> PayloadEstimator:
        return PayloadEstimator(pair.calibration, robot.chain, robot.drives.transmission)

    time_s, position, current = _stream(pair.loaded)
    took = least_times_us(make, (time_s, position, current))
    median, row, most, worst = np.quantile(took, [0.5, 0.95, 0.999, 1.0])
    tally.judge(
        f"an update of six joints, called from Python: {UPDATE_US:g} us on 99.9 %",
        f"median {median:.2f}, with a row {row:.2f}, 99.9 % {most:.2f}, greatest {worst:.2f} us",
        bool(most <= UPDATE_US),
    )
    estimator, done, length_s = make(), 0, time_s[-1] - time_s[0] + 0.01
    begin_s = time.process_time()
    while done < UPDATES:
        estimator.update_all(time_s, position, current)
        time_s = time_s + length_s
        done += len(time_s)
    mean_us = 1e6 * (time.process_time() - begin_s) / done
    found = estimator.estimate()
    tally.judge(
        f"a million updates: still positive definite, {1e2 * WINDOWS[20.0][1]:.1f} % of the mass at most off",
        f"{found.mass_kg:.4f} +- {found.half_width_95[0]:.4f} kg; {mean_us:.2f} us each in C",
        bool(np.isfinite(found.half_width_95).all() and abs(found.mass_kg / MASS_KG - 1.0) <= WINDOWS[20.0][1]),
    )


def _read(robot: Robot, name: str) -> Recording:
    folder = FOLDER if "loaded" in name else FOLDER / "other_paths"
    return read_recording_file(folder / name, ReadingOptions(robot.csv_columns))


def _pair(robot: Robot, name: str, others: list[Recording]) -> Pair:
    """A pair, with the arm calibrated by the other pair and the other paths."""
    runs = {key: [_read(robot, f"{load}{end}.csv") for load in ("loaded", "unloaded")] for key, end in PAIRS.items()}
    (other,) = (key for key in PAIRS if key != name)
    mounted = [MountedRun(runs[other][0], "weighed"), MountedRun(runs[other][1], "")]
    mounted += [MountedRun(run, "") for run in others]
    calibration = calibrated(mounted, {"weighed": WeighedPayload(MASS_KG)}, robot.chain, robot.drives.transmission)
    loaded, unloaded = runs[name]
    return Pair(loaded, unloaded, calibration)


def _stream(run: Recording, rows: NDArray[np.bool_] | slice = slice(None)) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time, positions and currents."""
    if run.current_a is None:
        raise SystemExit(f"{run.source.path}: no current")
    time_s, position, current = (np.ascontiguousarray(x[rows]) for x in (run.time_s, run.position_rad, run.current_a))
    return time_s, position, current


def _first_movement(run: Recording) -> float:
    """Time of the first movement since the first sample, s."""
    speed = np.abs(np.gradient(run.position_rad, run.time_s, axis=0)).max(axis=1)
    return float(run.time_s[np.flatnonzero(speed > 0.1)[0]] - run.time_s[0])


def _at_the_same_places(pair: Pair) -> FloatArray:
    """(N, n) currents of the empty run at the loaded run's positions."""
    time_s, _, _ = _stream(pair.loaded)
    other_s, position, current = _stream(pair.unloaded)
    shift_s = time_shift(fit_motion(time_s, pair.loaded.position_rad), fit_motion(other_s, position))
    at = time_s - time_s[0] + shift_s
    return np.column_stack([np.interp(at, other_s - other_s[0], column) for column in current.T])


def main() -> int:
    """Run only this part."""
    tally = Tally()
    run_measured(tally)
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
