"""Every estimator on white noise, on the simulated arms and on real currents.

    python -m benchmarks.accuracy.estimators_compared

The default was chosen by this table, which is in identification/README.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from armload_controller.config.robot import load_robot
from armload_identification.calibration.calibrate_arm import WeighedPayload
from armload_identification.estimation.estimator_names import Estimator
from armload_identification.pipeline.payload_identification import identify
from benchmarks.accuracy.real_currents import FOLDER, MASS_KG, measured_pairs
from benchmarks.arms.bodies import ER50_PAYLOADS, PRBT_PAYLOADS
from benchmarks.arms.calibrated import calibrated_from_pair
from benchmarks.arms.setups import CRITERION, Twin, paper_motion, setup_of, shipped_motion
from benchmarks.arms.trials import Setup, run_trials, workers
from benchmarks.results.bound import bound_of, paper_deviation, paper_values
from benchmarks.results.error_statistics import Errors
from benchmarks.results.tally import progress_line

SEEDS = 40
FIRST_HEAVY = 2
"""Index of the first payload, 2 or 1 kg: lighter ones are dominated by noise in a run of three periods."""


def main() -> None:
    """Print a table per setup."""
    with workers() as pool:
        _white(pool)
        er50, prbt = load_robot("er50"), load_robot("prbt")
        motion, payload = paper_motion(er50, CRITERION), er50.simulation.plant_spec("paper").payload
        if payload is None:
            raise ValueError("er50 has no payload of the name 'paper'")
        setups = [setup_of("paper, normative", er50, Twin.NORMATIVE, motion, payload)]
        _errors(pool, "the paper's setup, normative plant", setups)
        for robot, bodies in ((er50, ER50_PAYLOADS), (prbt, PRBT_PAYLOADS)):
            motion = shipped_motion(robot)
            setups = [
                setup_of(f"{robot.name}, {body.what}", robot, Twin.NORMATIVE, motion, body.rigid_body())
                for body in bodies[FIRST_HEAVY:]
            ]
            _errors(pool, f"{robot.name}, {len(setups)} payloads, normative plant, {motion.periods} periods", setups)
    if FOLDER.is_dir():
        _real()


def _white(pool: Executor) -> None:
    robot = load_robot("er50")
    payload = robot.simulation.plant_spec("paper").payload
    if payload is None:
        raise ValueError("er50 has no payload of the name 'paper'")
    setup = setup_of("paper, white noise", robot, Twin.CLEAN, paper_motion(robot, CRITERION), payload)
    bound = paper_deviation(setup.truth, bound_of(setup)) / np.abs(paper_values(setup.truth))
    print(f"\nthe paper's setup, white noise alone, {SEEDS} seeds: RMS error over the bound")
    for estimator in Estimator:
        with progress_line(estimator, SEEDS) as progress:
            trials = run_trials(pool, replace(setup, estimator=estimator), SEEDS, progress)
        ratio = np.sqrt(np.mean(Errors.of(trials, setup.truth).paper_share ** 2, axis=0)) / bound
        print(f"  {estimator:9s} mean {ratio.mean():.2f}, worst {ratio.max():.2f}")


def _errors(pool: Executor, title: str, setups: Sequence[Setup]) -> None:
    print(f"\n{title}, {SEEDS} seeds each: errors")
    for estimator in Estimator:
        mass, center, inside = [], [], []
        with progress_line(estimator, SEEDS * len(setups)) as progress:
            for setup in setups:
                errors = Errors.of(run_trials(pool, replace(setup, estimator=estimator), SEEDS, progress), setup.truth)
                mass.append(np.abs(errors.mass_share))
                center.append(errors.center_m)
                inside.append(errors.inside[errors.determined])
        share, off = np.concatenate(mass), np.concatenate(center)
        print(
            f"  {estimator:9s} mass median {np.median(share):.2%}, 95 % of seeds {np.quantile(share, 0.95):.2%}; "
            f"centre of mass {np.median(off) * 1e3:.1f} mm, {np.quantile(off, 0.95) * 1e3:.1f} mm; "
            f"outside their interval {1.0 - np.concatenate(inside).mean():.1%}"
        )


def _real() -> None:
    robot = load_robot("ur10e")
    pairs = measured_pairs(robot)
    nominal, known = robot.drives.transmission, WeighedPayload(MASS_KG)
    gains = {
        name: calibrated_from_pair(pair.loaded, pair.unloaded, known, robot.chain, nominal).transmission(nominal)
        for name, pair in pairs.items()
    }
    print("\nUR10e, measured currents, gains calibrated on the other pair: mass error a, b; centres apart")
    for estimator in Estimator:
        bodies = [
            identify(
                pairs[name].loaded, pairs[name].unloaded, robot.chain, gains[other], estimator=estimator
            ).parameters
            for name, other in (("a", "b"), ("b", "a"))
        ]
        error = [body.mass_kg / MASS_KG - 1.0 for body in bodies]
        radius, height = (
            1e3 * abs(values[0] - values[1])
            for values in (
                [float(np.hypot(*body.center_of_mass_m[:2])) for body in bodies],
                [float(body.center_of_mass_m[2]) for body in bodies],
            )
        )
        print(
            f"  {estimator:9s} {error[0]:+.2%}, {error[1]:+.2%}; radius {radius:.2f} mm, along the axis {height:.2f} mm"
        )


if __name__ == "__main__":
    main()
