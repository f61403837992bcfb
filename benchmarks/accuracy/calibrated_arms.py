"""Calibration of an arm from many runs: the measured UR10e without one pair, and simulated arms with gain errors.

A simulated arm has six runs with its two shipped excitations: empty, with a weighed payload, and with one that was not
weighed. Its gain errors are drawn within 5 %. A third payload, with the first excitation, is then identified with the
calibration.

    python -m benchmarks.accuracy.calibrated_arms [SEEDS]
"""

from __future__ import annotations

import argparse
import sys
import time
from concurrent.futures import Executor
from dataclasses import dataclass
from itertools import cycle, islice, product

import numpy as np

from armload_controller.config.robot import Robot, load_robot
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.calibration.mounted_runs import MountedRun, WeighedPayload
from armload_identification.float_array import FloatArray
from armload_identification.pipeline.identification_result import Identification
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.recording import Recording
from benchmarks.accuracy.real_currents import FOLDER, MASS_KG, absent
from benchmarks.arms.bodies import ER50_PAYLOADS, PRBT_PAYLOADS, Cuboid
from benchmarks.arms.calibrated import calibrated, identified_with
from benchmarks.arms.setups import Twin, twin_spec
from benchmarks.arms.simulated_recordings import DriveScales, record
from benchmarks.arms.steady_state import SteadyPeriod, Streaming, steady_period
from benchmarks.arms.trials import workers
from benchmarks.results.tally import Tally, progress_line

SEEDS = 40
"""Number of seeds in `make accuracy`."""
SPREAD = 0.05
PERIODS = {"er50": 50, "prbt": 3}
PAYLOADS = {
    "er50": ("gearbox, far off-centre", "welding torch, far out", "spindle"),
    "prbt": ("flat sheet, off-centre", "screwdriver, far out", "gripper with a part"),
}
"""Weighed, not weighed, to be identified."""
STRONG, STRONG_WITHIN, WRIST, WRIST_WITHIN = slice(1, 3), 0.004, slice(3, 6), 0.01
MASS_WITHIN, OF_SEEDS = 0.007, 0.95
RADIUS_WITHIN_M, HEIGHT_WITHIN_M = 0.001, 0.0025
CPU_S = 7.0
MOST_RUNS = 50
NOMINAL_IS_DOUBTED = ("er50",)
"""Arms with measured currents, whose nominal gains are uncertain."""
PAIRS = {"a": "", "b": "_b"}


@dataclass(frozen=True, eq=False)
class SimulatedArm:
    """Steady periods of an arm, by excitation and payload.

    Attributes:
        robot: The arm.
        periods: By role of the excitation and name of the payload, which is empty for an empty arm.
        payloads: Payloads by name.
    """

    robot: Robot
    periods: dict[tuple[str, str], SteadyPeriod]
    payloads: dict[str, Cuboid]


@dataclass(frozen=True, eq=False)
class Outcome:
    """One seed: relative errors, whether the mass lies in its interval, and the benefit of a first commissioning.

    Attributes:
        gain_error: (n,) relative errors of the gains.
        gain_z: (n,) the same in standard deviations.
        mass_error: Relative error of the third payload's mass.
        inside: Whether its interval holds.
        narrower: Ratio of that mass's half width with the calibration of one commissioning to that with nominal gains.
        second_inside: Whether the former interval holds.
    """

    gain_error: FloatArray
    gain_z: FloatArray
    mass_error: float
    inside: bool
    narrower: float
    second_inside: bool


def run_measured(tally: Tally) -> None:
    """The UR10e; skipped with a reason if the measured data are not next to the checkout."""
    tally.heading("3b. One UR10e from its runs, one pair left out")
    if absent(tally, "the UR10e's calibration"):
        return
    robot = load_robot("ur10e")
    started = time.process_time()
    runs = _measured(robot)
    whole = _calibrated(robot, list(runs.values()), dict.fromkeys(PAIRS, MASS_KG))
    used_s = time.process_time() - started
    tally.judge(f"twelve runs read and calibrated in {CPU_S:.0f} s of CPU", f"{used_s:.1f} s", used_s <= CPU_S)
    _print_gains("all twelve runs", whole)
    started = time.process_time()
    _calibrated(robot, list(islice(cycle(runs.values()), MOST_RUNS)), dict.fromkeys(PAIRS, MASS_KG))
    print(f"  {MOST_RUNS} runs, the twelve over and over: {time.process_time() - started:.1f} s of CPU")
    found = {}
    for name in PAIRS:
        left_out = _pair_files(name)
        calibration = _calibrated(
            robot, [run for key, run in runs.items() if key not in left_out], dict.fromkeys(PAIRS, MASS_KG)
        )
        _print_gains(f"without pair {name}", calibration)
        loaded, unloaded = (runs[key].recording for key in left_out)
        found[name] = _identified(robot, calibration, loaded, unloaded)
        _judge_mass(tally, f"pair {name}, the other runs calibrate", found[name], MASS_WITHIN)
        _judge_mass(tally, f"loaded run {name} alone", _identified(robot, calibration, loaded, None), 2.0 * MASS_WITHIN)
    _judge_centers(tally, "", found)
    among = {}
    for name, other in zip(PAIRS, reversed(PAIRS), strict=True):
        calibration = _calibrated(robot, list(runs.values()), {other: MASS_KG})
        loaded, unloaded = (runs[key].recording for key in _pair_files(name))
        among[name] = _identified(robot, calibration, loaded, unloaded)
        _judge_mass(tally, f"pair {name} among the runs, its mass not given", among[name], MASS_WITHIN)
    _judge_centers(tally, "its own runs among the calibration's, mass not given: ", among)
    _judge_halves(tally, robot, runs)


def run_simulated(tally: Tally, pool: Executor, seeds: int = SEEDS) -> None:
    """er50 and prbt, normative."""
    tally.heading(f"3c. Simulated arms from six runs, gains within {SPREAD:.0%}, {seeds} seeds each")
    for name, periods in PERIODS.items():
        arm = _simulated(name)
        futures = [pool.submit(_seed, arm, seed, periods) for seed in range(seeds)]
        outcomes = []
        with progress_line(f"{name}, {periods} periods", seeds) as progress:
            for done, future in enumerate(futures, 1):
                outcomes.append(future.result())
                progress(done)
        gain = np.array([outcome.gain_error for outcome in outcomes])
        rms = np.sqrt(np.mean(gain**2, axis=0))
        z = np.sqrt(np.mean(np.array([outcome.gain_z for outcome in outcomes]) ** 2, axis=0))
        print(f"  {name}: rms error of the gains %: {_list(100.0 * rms)}; in standard deviations: {_list(z)}")
        for what, joints, within in (("2 and 3", STRONG, STRONG_WITHIN), ("4 to 6", WRIST, WRIST_WITHIN)):
            tally.judge(
                f"{name}: gains of joints {what} within {within:.1%} (rms over {seeds} seeds)",
                _list(100.0 * rms[joints]) + " %",
                bool((rms[joints] <= within).all()),
            )
        mass = np.abs([outcome.mass_error for outcome in outcomes])
        share = float(np.mean(mass <= MASS_WITHIN))
        tally.judge(
            f"{name}: another payload's mass within {MASS_WITHIN:.1%} on {OF_SEEDS:.0%} of {seeds} seeds",
            f"{share:.0%}, greatest {mass.max():.2%}; intervals hold {np.mean([o.inside for o in outcomes]):.0%}",
            share >= OF_SEEDS,
        )
        narrower = np.array([outcome.narrower for outcome in outcomes])
        inside = float(np.mean([outcome.second_inside for outcome in outcomes]))
        text = f"intervals {narrower.min():.0%} to {narrower.max():.0%} as wide as the first one's; {inside:.0%} hold"
        if name in NOMINAL_IS_DOUBTED:
            tally.judge(
                f"{name}: the second commissioning of an arm knows the mass better than the first, on every seed",
                text,
                bool((narrower < 1.0).all()),
            )
        else:
            print(f"  {name}: second commissioning, {text}; torque that drives report is not doubted before")


def _measured(robot: Robot) -> dict[str, MountedRun]:
    """All twelve runs by file name; the mounting of a loaded run is the name of its pair."""
    paths = {FOLDER / f"loaded{suffix}.csv": name for name, suffix in PAIRS.items()}
    paths |= {FOLDER / f"unloaded{suffix}.csv": "" for suffix in PAIRS.values()}
    paths |= dict.fromkeys(sorted((FOLDER / "other_paths").glob("*.csv")), "")
    return {
        path.name: MountedRun(read_recording_file(path, ReadingOptions(robot.csv_columns)), name)
        for path, name in paths.items()
    }


def _pair_files(name: str) -> tuple[str, str]:
    return f"loaded{PAIRS[name]}.csv", f"unloaded{PAIRS[name]}.csv"


def _calibrated(robot: Robot, runs: list[MountedRun], masses_kg: dict[str, float]) -> ArmCalibration:
    weighed = {name: WeighedPayload(mass_kg) for name, mass_kg in masses_kg.items()}
    return calibrated(runs, weighed, robot.chain, robot.drives.transmission)


def _identified(
    robot: Robot, calibration: ArmCalibration, loaded: Recording, unloaded: Recording | None
) -> Identification:
    return identified_with(calibration, loaded, unloaded, robot.chain, robot.drives.transmission)


def _judge_mass(tally: Tally, what: str, found: Identification, within: float) -> None:
    error = found.parameters.mass_kg / MASS_KG - 1.0
    width = found.uncertainty.half_width_95[0] / MASS_KG
    tally.judge(
        f"{what}: mass within {within:.1%}, inside its interval",
        f"{error:+.2%} +- {width:.2%}",
        abs(error) <= min(within, width),
    )


def _judge_centers(tally: Tally, with_what: str, found: dict[str, Identification]) -> None:
    """Comparison of the two mountings' centres of mass."""
    one, two = (found[name].parameters.center_of_mass_m for name in PAIRS)
    for what, first, second, within in (
        ("radius", np.hypot(*one[:2]), np.hypot(*two[:2]), RADIUS_WITHIN_M),
        ("height", one[2], two[2], HEIGHT_WITHIN_M),
    ):
        tally.judge(
            f"{with_what}{what} of the two mountings' centres of mass within {within * 1e3:g} mm of each other",
            f"{first * 1e3:.2f} and {second * 1e3:.2f} mm",
            abs(first - second) <= within,
        )


def _judge_halves(tally: Tally, robot: Robot, runs: dict[str, MountedRun]) -> None:
    """Comparison of calibrations from disjoint sets of runs."""
    others = [run for key, run in runs.items() if "loaded" not in key]
    for number, (one, two) in enumerate(((others[0::2], others[1::2]), (others[1::2], others[0::2])), 1):
        first, second = (
            _calibrated(robot, [*(runs[key] for key in _pair_files(name)), *half], {name: MASS_KG})
            for name, half in (("a", one), ("b", two))
        )
        apart = np.abs(np.log(first.gain_nm_a / second.gain_nm_a))
        width = 1.96 * np.hypot(first.gain_deviation, second.gain_deviation)
        tally.judge(
            f"disjoint sets of runs, {number}: gains of joints 4 to 6 within their intervals, 2 and 3 within "
            f"{STRONG_WITHIN:.1%}",
            f"apart {_list(100.0 * apart)} %, intervals {_list(100.0 * width)} %",
            bool((apart[WRIST] <= width[WRIST]).all() and (apart[STRONG] <= STRONG_WITHIN).all()),
        )


def _print_gains(label: str, calibration: ArmCalibration) -> None:
    ratio, width = calibration.gain_nm_a / calibration.nominal, calibration.gain_half_width_95 / calibration.gain_nm_a
    print(f"  {label}: gains over nominal {_list(ratio, 4)}, 95 % +- {_list(100.0 * width)} %")


def _simulated(name: str) -> SimulatedArm:
    """An arm's steady periods, from MuJoCo or the cache."""
    robot = load_robot(name)
    shelf = {cuboid.what: cuboid for cuboid in (*ER50_PAYLOADS, *PRBT_PAYLOADS)}
    known = {cuboid: shelf[cuboid] for cuboid in PAYLOADS[name]}
    streaming = Streaming(robot.drives.settings, robot.limits.motion)
    periods = {
        (role, what): steady_period(
            twin_spec(robot, Twin.NORMATIVE, shelf[what].rigid_body() if what else None),
            streaming,
            robot.excitations[role].trajectory,
        )
        for role, what in product(("identification", "validation"), ("", *known))
    }
    return SimulatedArm(robot, periods, known)


def _seed(arm: SimulatedArm, seed: int, periods: int) -> Outcome:
    """Six runs and a calibration, and a third payload identified with it."""
    robot, n = arm.robot, arm.robot.n
    rng = np.random.default_rng([seed, n, periods])
    error = SPREAD * rng.uniform(-1.0, 1.0, n)
    scales = DriveScales.of(robot.drives.settings, robot.limits.torque_noise_nm, n)
    weighed, other, third = PAYLOADS[robot.name]

    def run(role: str, what: str) -> Recording:
        return record(arm.periods[role, what], scales, periods, rng, error)

    six = [
        MountedRun(run(role, what), what)
        for role, what in product(("identification", "validation"), ("", weighed, other))
    ]
    calibration = _calibrated(robot, six, {weighed: arm.payloads[weighed].mass_kg})
    off = np.log(calibration.gain_nm_a / calibration.nominal) - np.log1p(error)
    found = _identified(robot, calibration, run("identification", third), run("identification", ""))
    truth = arm.payloads[third].mass_kg

    def holds(result: Identification) -> bool:
        low, high = result.uncertainty.interval_95[0]
        return bool(low <= truth <= high)

    # A commissioning with the weighed payload, and a second one with the third payload.
    first = _calibrated(
        robot, [each for each in six if each.mounting != other], {weighed: arm.payloads[weighed].mass_kg}
    )
    pair = run("validation", third), run("validation", "")
    before = identified_with(None, *pair, robot.chain, robot.drives.transmission)
    second = _identified(robot, first, *pair)
    return Outcome(
        gain_error=off,
        gain_z=off / calibration.gain_deviation,
        mass_error=found.parameters.mass_kg / truth - 1.0,
        inside=holds(found),
        narrower=float(second.uncertainty.half_width_95[0] / before.uncertainty.half_width_95[0]),
        second_inside=holds(second),
    )


def _list(values: FloatArray, digits: int = 2) -> str:
    return " ".join(f"{value:.{digits}f}" for value in values)


def main() -> int:
    """Run only this part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seeds", nargs="?", type=int, default=SEEDS)
    tally = Tally()
    run_measured(tally)
    with workers() as pool:
        run_simulated(tally, pool, parser.parse_args().seeds)
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
