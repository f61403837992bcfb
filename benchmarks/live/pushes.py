"""Load or push, on the recorded motion of a UR10e: pushes added as J^T F, and payloads added as their torque.

    python -m benchmarks.live.pushes [CALIBRATION]

Without CALIBRATION the arm is calibrated from its runs of February 2020; the runs of 31 January are of another day. A
push begins and ends within 50 ms; its force has a vertical part of less than two thirds. A grasp takes 50 to 400 ms.
Times are those at which the last sample used is there, from the first sample of the push.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final

import numpy as np

from armload_controller.analysis.robot_calibration import calibrate_from_runs
from armload_controller.config.robot import Robot, load_robot
from armload_controller.config.robot_runs import read_runs
from armload_core.arrays import FloatArray
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.contact.force_watch import ForceEvent, ForceEventKind
from armload_identification.contact.load_or_push import jacobian
from armload_identification.contact.watched_payload import WatchedPayload
from armload_identification.files.calibration_file import read_calibration
from armload_identification.model.payload import InertialParameters
from armload_identification.model.regressor import payload_regressor
from armload_identification.pipeline.estimator_constants import estimator_constants
from armload_identification.recording.file_reading import read_recording
from armload_identification.recording.reading_options import ReadingOptions
from benchmarks.arms.trials import workers
from benchmarks.live.ros2_feed import DATA

WEIGHED_KG: Final = 2.805
BEFORE_S, AFTER_S = 12.0, 3.5
LATE_S: Final = 0.05
"""A row is known 40 ms after its time, and samples come every 10 ms."""
MOVING_RAD_S: Final = 0.06
STUTTER: Final = ("loaded_b.csv", 10.0, 20.0)
"""Where this recording's own motion stutters: no push or grasp is placed there."""
Motion = tuple[FloatArray, FloatArray, FloatArray]
"""Time stamps, positions, currents."""


@dataclass(frozen=True, eq=False)
class Bench:
    """The arm and its recordings."""

    robot: Robot
    calibration: ArmCalibration
    runs: dict[str, Motion]

    @classmethod
    def of(cls, path: Path | None) -> Bench:
        """With a calibration file, or calibrated from the runs of February."""
        robot = load_robot("ur10e")
        calibration = read_calibration(path) if path is not None else _calibrated(robot)
        files = [DATA / f"{name}{day}.csv" for name in ("unloaded", "loaded") for day in ("", "_b", "_jan31")]
        files += sorted((DATA / "other_paths").glob("*.csv"))
        runs = {}
        for file in files:
            run = read_recording(file, ReadingOptions(robot.csv_columns))
            if run.current_a is not None:
                runs[file.name] = run.time_s - run.time_s[0], run.position_rad, run.current_a
        return cls(robot, calibration, runs)

    def watched(self, motion: Motion) -> tuple[list[ForceEvent], WatchedPayload]:
        """The events of a motion."""
        watch = WatchedPayload(self.calibration, self.robot.chain, self.robot.transmission)
        watch.take(*motion)
        return watch.take_events(), watch

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
        torque = np.array([force_n @ jacobian(chain, position[k])[:3] for k in acting]).reshape(-1, self.robot.n)
        current[acting] += self.current_of(torque * share[acting, None])
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


def outcome(events: list[ForceEvent], at_s: float, force_n: FloatArray | None = None) -> Outcome:
    """Of the first event at a time or later."""
    later = [each for each in events if each.time_s > at_s]
    noticed = next((each.time_s for each in later if each.kind is ForceEventKind.ACTING), np.inf)
    decided = [each for each in later if each.kind in (ForceEventKind.PAYLOAD, ForceEventKind.PUSH)]
    if not decided:
        return Outcome(noticed - at_s + LATE_S, np.inf, payload=False)
    first = decided[0]
    error = np.nan
    if force_n is not None and first.assessment is not None:
        error = float(np.linalg.norm(first.assessment.force_n - force_n) / np.linalg.norm(force_n))
    # a decision that is corrected later is wrong, whichever way
    kinds = [each.kind is ForceEventKind.PAYLOAD for each in decided]
    payload = all(kinds) if force_n is None else any(kinds)
    return Outcome(noticed - at_s + LATE_S, first.time_s - noticed, payload, error)


def _push(
    bench: Bench, size_n: float, lasts_s: tuple[float, float], seed: int, moving: tuple[int, int] = (3, 6)
) -> Outcome:
    """One push, while so many joints move."""
    rng = np.random.default_rng([seed, int(size_n), int(10 * lasts_s[1])])
    force = rng.normal(size=3)
    while abs(force[2]) > 0.65 * np.linalg.norm(force):
        force = rng.normal(size=3)
    force *= size_n / np.linalg.norm(force)
    motion, at_s = bench.pushed(rng, force, float(rng.uniform(*lasts_s)), moving)
    return outcome(bench.watched(motion)[0], at_s, force)


def _grasp(bench: Bench, mass_kg: float, seed: int) -> Outcome:
    """One grasp."""
    rng = np.random.default_rng([seed, round(100 * mass_kg)])
    motion, at_s = bench.grasped(rng, mass_kg)
    events, _ = bench.watched(motion)
    found = outcome(events, at_s)
    if not np.isfinite(found.noticed_s):
        return found
    known_s = at_s + found.noticed_s + 3.0
    end = int(np.searchsorted(motion[0], known_s))
    before = int(np.searchsorted(motion[0], at_s - 0.2))
    _, earlier = bench.watched((motion[0][:before], motion[1][:before], motion[2][:before]))
    _, later = bench.watched((motion[0][:end], motion[1][:end], motion[2][:end]))
    was, now = earlier.estimate(), later.estimate()
    width = float(np.hypot(was.half_width_95[0], now.half_width_95[0]))
    return Outcome(found.noticed_s, found.decided_s, found.payload, mass_kg=(now.mass_kg - was.mass_kg, width))


def _quiet(bench: Bench) -> Iterator[tuple[str, ForceEvent]]:
    """False events of all recordings."""
    for name, motion in bench.runs.items():
        for event in bench.watched(motion)[0]:
            if event.kind is ForceEventKind.ACTING:
                yield name, event


def main() -> None:
    """Print the figures beside what is asked for."""
    bench = Bench.of(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
    hours = sum(time_s[-1] for time_s, _, _ in bench.runs.values()) / 3600.0
    false = list(_quiet(bench))
    print(f"false events in {hours:.2f} h of recordings: {len(false)} (at most 1)", flush=True)
    for name, event in false:
        print(f"  {name} at {event.time_s:.1f} s")
    with workers() as pool:
        for what, moving in (
            ("three or more joints moving (30 N: 95 % in 0.25 s, 60 N in 0.15 s)", (3, 6)),
            ("one joint moving (60 N: 80 %)", (1, 1)),
        ):
            print(f"noticed within 0.1, 0.15, 0.25, 0.5 s; {what}")
            for size_n in (20.0, 30.0, 60.0, 100.0):
                found = list(pool.map(partial(_push, bench, size_n, (1.0, 1.0), moving=moving), range(100)))
                late = np.array([each.noticed_s for each in found])
                shares = ", ".join(f"{np.mean(late <= s):.0%}" for s in (0.1, 0.15, 0.25, 0.5))
                print(f"  {size_n:3.0f} N: {shares}", flush=True)
        for lasts_s, allowed in (((0.3, 2.0), 1), ((4.0, 4.0), 2)):
            found = [
                each for n in (30.0, 60.0) for each in pool.map(partial(_push, bench, n, lasts_s), range(1000, 1100))
            ]
            called = sum(each.payload for each in found)
            early = np.mean([each.decided_s <= 1.5 for each in found])
            error = np.nanmedian([each.error for each in found])
            print(
                f"of {len(found)} pushes of {lasts_s[0]:g} to {lasts_s[1]:g} s, {called} are called a payload "
                f"(at most {allowed}); {early:.0%} decided within 1.5 s; error of the force {error:.0%} (median)"
            )
        masses = (0.35, 0.7, 1.5, 3.0)
        grasps = {mass: list(pool.map(partial(_grasp, bench, mass), range(24))) for mass in masses}
    every = [(mass, each) for mass, found in grasps.items() for each in found]
    contacts = sum(np.isfinite(each.decided_s) and not each.payload for _, each in every)
    inside = sum(abs(each.mass_kg[0] - mass) <= each.mass_kg[1] for mass, each in every)
    print(
        f"of {len(every)} grasps {contacts} are called a contact (at most 1); "
        f"{inside} masses within their interval 3 s later (92)"
    )
    decided = [each.decided_s <= 1.5 + LATE_S for _, each in every if np.isfinite(each.noticed_s)]
    print(f"decided within {1.5 + LATE_S:g} s of the notice: {np.mean(decided):.0%} of them (95 %)")
    for mass, found in grasps.items():
        late = np.array([each.noticed_s for each in found])
        width = np.nanmedian([each.mass_kg[1] for each in found])
        error = np.nanmedian([abs(each.mass_kg[0] - mass) for each in found])
        print(
            f"  {mass:g} kg: noticed within 1 s {np.mean(late <= 1.0):.0%}, 3 s {np.mean(late <= 3.0):.0%}; "
            f"3 s later wrong by {error:.3f} kg (median), half width {width:.2f} kg"
        )


if __name__ == "__main__":
    main()
