"""A payload from random motion of simulated arms, normative and harsh; false alarms of arms that start cold or warm.

An arm is calibrated with its four runs of a commissioning, empty and with a weighed payload, and with two empty runs of
random motion. Another payload, in another random motion, is then identified from windows of a file and by the estimator
in the loop. The harsh arm has gain errors of up to 2 % and 3 % more friction in loaded runs.

    python -m benchmarks.accuracy.simulated_motion [SEEDS]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import cache
from itertools import product

import numpy as np
from scipy.stats import binom

from armload_controller.config.robot import Robot, load_robot
from armload_controller.config.robot_simulation import HARSH_GAIN_ERROR
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.calibration.mounted_runs import MountedRun, WeighedPayload
from armload_identification.float_array import FloatArray
from armload_identification.model.smooth_sign import smooth_sign
from armload_identification.pipeline.any_motion import identify_windows
from armload_identification.pipeline.recursive_estimator import PayloadEstimator
from armload_identification.recording.recording import Recording
from benchmarks.arms.bodies import ER50_PAYLOADS, PRBT_PAYLOADS, Cuboid
from benchmarks.arms.calibrated import calibrated
from benchmarks.arms.setups import Twin, twin_spec
from benchmarks.arms.simulated_recordings import DriveScales, record
from benchmarks.arms.steady_state import SteadyPeriod, Streaming, steady_period
from benchmarks.arms.streamed_arm import Stream, streamed
from benchmarks.arms.streams import as_recorded, point_to_point
from benchmarks.arms.trials import workers
from benchmarks.results.tally import Tally, progress_line

SEEDS = 40
"""Number of seeds in `make accuracy`: ten minutes of CPU."""
ARMS, TWINS = ("er50", "prbt"), (Twin.NORMATIVE, Twin.HARSH)
WINDOWS_S = (20.0, 10.0, 5.0)
IN_THE_LOOP_S = 20.0
RUN_S, EMPTY_S = 62.0, 60.0
COVERAGE, CHANCE = 0.93, 0.01
WINDOWS_PER_ALARM = 20
PAYLOADS = {
    "er50": ("gearbox, far off-centre", "spindle"),
    "prbt": ("flat sheet, off-centre", "gripper with a part"),
}
"""The weighed payload, and the one to identify."""
HOUR_S, PIECES, COLD = 3600.0, 12, 0.2
"""An hour as repetitions of one motion, with friction initially higher or lower by this share."""
BEGINNINGS, BEGINNING_S = 16, 30.0
"""Number and length of motions that start with such friction."""
_WARMING_S = 600.0
_ROLES = ("identification", "validation")


Signals = tuple[FloatArray, FloatArray, FloatArray]
"""Time, positions and efforts."""
Empty = tuple[Robot, ArmCalibration, Iterator[Signals]]
"""An arm, and motions of it without a payload."""


@dataclass(frozen=True, eq=False)
class Found:
    """One window, or the end of a part in the loop: errors in kg and m, and half widths; NaN if refused.

    In the loop also the number of changes of the payload, all of them false.
    """

    mass_kg: float
    half_width_kg: float
    center_m: float
    changes: int = 0


def run(tally: Tally, pool: Executor, seeds: Sequence[int] = range(SEEDS)) -> None:
    """All arms and plants.

    Args:
        tally: Criteria.
        pool: Processes.
        seeds: Seeds of motion, noise and gains.
    """
    tally.heading(f"3e. A payload from random motion of simulated arms, {len(seeds)} seeds")
    kinds = list(product(ARMS, TWINS))
    signs = (1.0, -1.0)
    jobs = {(name, twin, seed): pool.submit(_seed, name, twin, seed) for name, twin in kinds for seed in seeds}
    hours = {(name, sign): pool.submit(_alarms_of_an_hour, name, sign * COLD) for name, sign in product(ARMS, signs)}
    begun = {(name, sign): pool.submit(_alarms_of_beginnings, name, sign * COLD) for name, sign in product(ARMS, signs)}
    print("  arm, plant, window | error of the mass: median g, 95 % g; % of rated | intervals hold | centre of mass mm")
    for name, twin in kinds:
        rated_kg = load_robot(name).rated_payload_kg
        by_window: dict[str, list[Found]] = {}
        with progress_line(f"{name}, {twin}", len(seeds)) as progress:
            for done, seed in enumerate(seeds, 1):
                for label, found in jobs[name, twin, seed].result().items():
                    by_window.setdefault(label, []).extend(found)
                progress(done)
        for label, found in by_window.items():
            _report(tally, f"{name}, {twin}, {label}", found, rated_kg)
    for what, alarms_of in (
        ("an hour of empty motion", hours),
        (f"{BEGINNINGS} beginnings of {BEGINNING_S:g} s each", begun),
    ):
        for (name, sign), job in alarms_of.items():
            alarms = job.result()
            tally.judge(
                f"{name}: no false alarm in {what}, friction {sign * COLD:+.0%} when it begins",
                f"{alarms}",
                alarms == 0,
            )


def _report(tally: Tally, what: str, found: list[Found], rated_kg: float) -> None:
    """A row of the table, and whether the intervals hold."""
    known = [one for one in found if np.isfinite(one.mass_kg)]
    error = np.abs([one.mass_kg for one in known])
    holds = float(np.mean([abs(one.mass_kg) <= one.half_width_kg for one in known]))
    median, most = np.quantile(error, [0.5, 0.95])
    center = np.nanquantile([one.center_m for one in known], [0.5, 0.95])
    text = (
        f"{1e3 * median:.0f}, {1e3 * most:.0f} g; {median / rated_kg:.2%}, {most / rated_kg:.2%} | {holds:.0%} of "
        f"{len(known)}, {len(found) - len(known)} refused | {1e3 * center[0]:.1f}, {1e3 * center[1]:.1f}"
    )
    print(f"  {what:40s} | {text}")
    # So few intervals would hold by chance in one case of a hundred.
    least = int(binom.ppf(CHANCE, len(known), COVERAGE))
    held = round(holds * len(known))
    tally.judge(
        f"{what}: intervals of the mass hold {COVERAGE:.0%}, so at least {least} of {len(known)}",
        f"{held}",
        held >= least,
    )
    if "loop" in what:
        alarms = sum(one.changes for one in found)
        tally.judge(
            f"{what}: false changes of the payload, at most one in {WINDOWS_PER_ALARM} windows",
            f"{alarms} in {len(found)}",
            alarms * WINDOWS_PER_ALARM <= len(found),
        )


def _seed(name: str, twin: Twin, seed: int) -> dict[str, list[Found]]:
    """Calibrate, simulate a loaded motion, and identify."""
    robot = load_robot(name)
    rng = np.random.default_rng([seed, ARMS.index(name), TWINS.index(twin)])
    gain_error = HARSH_GAIN_ERROR * rng.uniform(-1.0, 1.0, robot.n) if twin is Twin.HARSH else np.zeros(robot.n)
    calibration = calibration_of(robot, twin, rng, gain_error)
    body = shelf()[PAYLOADS[name][1]]
    spec = twin_spec(robot, twin, body.rigid_body())
    moved = streamed(spec, robot.drives.settings, point_to_point(robot, 1000 + seed, RUN_S))
    loaded = as_recorded(moved, scales_of(robot), rng, gain_error, f"loaded {seed}")
    found: dict[str, list[Found]] = {}
    truth = body.inertial()
    chain, known = calibration.level(robot.chain), calibration.known_arm
    for length_s in WINDOWS_S:
        windows = identify_windows(loaded, chain, calibration.transmission(robot.drives.transmission), known, length_s)
        found[f"{length_s:g} s"] = [
            Found(np.nan, np.nan, np.nan)
            if window.found is None
            else Found(
                window.found.parameters.mass_kg - truth.mass_kg,
                float(window.found.uncertainty.half_width_95[0]),
                float(np.linalg.norm(window.found.parameters.center_of_mass_m - truth.center_of_mass_m)),
            )
            for window in windows
        ]
    time_s, position, effort = signals_of(loaded)
    found[f"{IN_THE_LOOP_S:g} s, loop"] = in_the_loop = []
    for start_s in np.arange(0.0, RUN_S - IN_THE_LOOP_S, IN_THE_LOOP_S):
        rows = (time_s >= start_s) & (time_s < start_s + IN_THE_LOOP_S)
        estimator = PayloadEstimator(calibration, robot.chain, robot.drives.transmission)
        estimator.update_all(time_s[rows], position[rows], effort[rows])
        live = estimator.estimate()
        off = float(np.linalg.norm(live.values[1:] - truth.center_of_mass_m))
        in_the_loop.append(Found(live.mass_kg - truth.mass_kg, float(live.half_width_95[0]), off, live.changes))
    return found


def calibration_of(robot: Robot, twin: Twin, rng: np.random.Generator, gain_error: FloatArray) -> ArmCalibration:
    """An arm from its commissioning and two runs of random motion."""
    scales, weighed = scales_of(robot), PAYLOADS[robot.name][0]
    runs = [
        MountedRun(
            record(_period(robot.name, twin, role, what), scales, robot.excitations[role].periods, rng, gain_error),
            what,
        )
        for role, what in product(_ROLES, ("", weighed))
    ]
    runs += [
        MountedRun(as_recorded(empty_stream(robot.name, twin, number), scales, rng, gain_error, f"empty {number}"), "")
        for number in range(2)
    ]
    known = {weighed: WeighedPayload(shelf()[weighed].mass_kg)}
    return calibrated(runs, known, robot.chain, robot.drives.transmission)


def _alarms_of_an_hour(name: str, cold: float) -> int:
    """False changes in an hour of the same motion with new noise and friction that settles."""
    robot, calibration, pieces = an_hour(name, cold)
    estimator = PayloadEstimator(calibration, robot.chain, robot.drives.transmission)
    for piece in pieces:
        estimator.update_all(*piece)
    return estimator.changes


def an_hour(name: str, cold: float) -> Empty:
    """An hour of the same motion with new noise and friction that settles, in pieces."""
    robot = load_robot(name)
    rng, right = np.random.default_rng(5), np.zeros(robot.n)
    calibration = calibration_of(robot, Twin.NORMATIVE, rng, right)
    setpoints = point_to_point(robot, 77, HOUR_S / PIECES)
    # The end of the motion is connected to its start, so that it can be repeated.
    cycle = np.vstack(
        [setpoints, setpoints[-1] + (setpoints[0] - setpoints[-1]) * _smooth(round(4.0 * robot.bus.cycle_hz))[:, None]]
    )
    moved = streamed(twin_spec(robot, Twin.NORMATIVE, None), robot.drives.settings, np.vstack([cycle[-1:], cycle]))
    friction = _friction_at_axes(robot, calibration, moved)
    lasts_s = len(friction) * moved.sample_s

    def piece_of(piece: int) -> Signals:
        elapsed_s = piece * lasts_s + np.arange(len(friction)) * moved.sample_s
        more = cold * (1.0 - np.log1p(elapsed_s / _WARMING_S) / np.log1p(HOUR_S / _WARMING_S))
        colder = replace(moved, axis_torque_nm=moved.axis_torque_nm + more[:, None] * friction)
        time_s, position, effort = signals_of(as_recorded(colder, scales_of(robot), rng, right, f"piece {piece}"))
        return time_s + piece * lasts_s, position, effort

    return robot, calibration, map(piece_of, range(PIECES))


def _alarms_of_beginnings(name: str, cold: float) -> int:
    """False changes in the first half minute of empty motions with different friction."""
    robot, calibration, motions = beginnings(name, cold)
    alarms = 0
    for motion in motions:
        estimator = PayloadEstimator(calibration, robot.chain, robot.drives.transmission)
        estimator.update_all(*motion)
        alarms += estimator.changes
    return alarms


def beginnings(name: str, cold: float) -> Empty:
    """The first half minute of empty motions with different friction."""
    robot = load_robot(name)
    rng, right = np.random.default_rng(6), np.zeros(robot.n)
    calibration = calibration_of(robot, Twin.NORMATIVE, rng, right)

    def beginning(number: int) -> Signals:
        moved = empty_stream(name, Twin.NORMATIVE, 5000 + number, BEGINNING_S)
        friction = cold * _friction_at_axes(robot, calibration, moved)
        colder = replace(moved, axis_torque_nm=moved.axis_torque_nm + friction)
        return signals_of(as_recorded(colder, scales_of(robot), rng, right, f"beginning {number}"))

    return robot, calibration, map(beginning, range(BEGINNINGS))


def _friction_at_axes(robot: Robot, calibration: ArmCalibration, moved: Stream) -> FloatArray:
    """(K, n) friction of the joints without load, as torque of the axes."""
    coupling, body = robot.drives.settings.coupling, calibration.body
    speed = np.gradient(moved.axis_position_rad @ coupling.T, moved.sample_s, axis=0)
    steady = body.coulomb_nm + body.root_nm * np.sqrt(np.abs(speed))
    friction = smooth_sign(speed, body.reversal_speed_rad_s) * steady + speed * body.viscous_nm_s_rad
    return np.asarray(friction @ coupling)


def _smooth(count: int) -> FloatArray:
    """(K,) from 0 to 1, at rest at both ends."""
    u = np.linspace(0.0, 1.0, count)
    return np.asarray(u**3 * (10.0 - 15.0 * u + 6.0 * u * u))


def signals_of(run: Recording) -> Signals:
    """Time, positions and efforts."""
    effort = run.current_a if run.torque_nm is None else run.torque_nm
    if effort is None:
        raise SystemExit(f"{run.source.path}: no effort")
    time_s, position, effort = (np.ascontiguousarray(part) for part in (run.time_s, run.position_rad, effort))
    return time_s, position, effort


def scales_of(robot: Robot) -> DriveScales:
    """Units and noise of an arm's drives."""
    return DriveScales.of(robot.drives.settings, robot.limits.torque_noise_nm, robot.n)


def shelf() -> dict[str, Cuboid]:
    """All payloads by name."""
    return {cuboid.what: cuboid for cuboid in (*ER50_PAYLOADS, *PRBT_PAYLOADS)}


@cache
def _period(name: str, twin: Twin, role: str, what: str) -> SteadyPeriod:
    """A period of a shipped excitation."""
    robot = load_robot(name)
    body = shelf()[what].rigid_body() if what else None
    streaming = Streaming(robot.drives.settings, robot.limits.motion)
    return steady_period(twin_spec(robot, twin, body), streaming, robot.excitations[role].trajectory)


@cache
def empty_stream(name: str, twin: Twin, number: int, lasts_s: float = EMPTY_S) -> Stream:
    """Random motion of the empty arm."""
    robot = load_robot(name)
    return streamed(twin_spec(robot, twin, None), robot.drives.settings, point_to_point(robot, number, lasts_s))


def main() -> int:
    """Run only this part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seeds", nargs="?", type=int, default=SEEDS)
    tally = Tally()
    with workers() as pool:
        run(tally, pool, range(parser.parse_args().seeds))
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
