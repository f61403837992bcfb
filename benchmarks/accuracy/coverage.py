"""Coverage of the 95 % intervals over thousands of simulated commissionings."""

from __future__ import annotations

from concurrent.futures import Executor

import numpy as np

from armload_controller.config.robot import load_robot
from armload_identification.model.payload import PARAMETER_NAMES
from benchmarks.arms.setups import Twin, setup_of, shipped_motion
from benchmarks.arms.trials import run_trials
from benchmarks.results.error_statistics import EXACT, NOMINAL, Census, Errors
from benchmarks.results.tally import Tally, progress_line

COMMISSIONINGS = {3: 2000, 10: 1000, 50: 400}
"""Number of commissionings by number of periods, whose cost grows with it; 400 give a share of 95 % to one per cent."""
MODEL_ERROR_SEEDS = 50
LEAST, MOST = 0.93, 0.98
KEPT = 5
"""With model error every fifth of 250 cycles per second is kept: 50 Hz, with the noise scaled by the square root of the
rate. White noise is measured at the full rate: at 50 Hz the intervals allow for setpoints that change only every 20 ms,
and up to 99 % of them hold."""


def run(tally: Tally, pool: Executor, census: Census) -> None:
    """A table of coverage per value and number of periods, then the same with model error."""
    robot = load_robot("er50")
    payload = robot.simulation.plant_spec("paper").payload
    if payload is None:
        raise ValueError("er50 has no payload of the name 'paper'")
    tally.heading("Coverage of the 95 % intervals: er50, six joints, white noise")
    print("  periods, commissionings | " + "  ".join(f"{name:>5s}" for name in PARAMETER_NAMES))
    for periods, seeds in COMMISSIONINGS.items():
        motion = shipped_motion(robot, periods=periods)
        setup = setup_of(f"coverage, {periods} periods", robot, Twin.CLEAN, motion, payload)
        with progress_line(setup.name, seeds) as progress:
            trials = run_trials(pool, setup, seeds, progress)
        census.add(trials, setup.truth, None)
        held = Errors.of(trials, setup.truth).inside.mean(axis=0)
        print(f"  {periods:7d}, {seeds:14d} | " + "  ".join(f"{share:5.1%}" for share in held))
        tally.judge(
            f"white noise, {periods} periods: every interval holds the truth in {LEAST:.0%} to {MOST:.0%}",
            f"{held.min():.1%} to {held.max():.1%}",
            bool(held.min() >= LEAST and held.max() <= MOST),
        )
    print(f"  with model error, as it is, {MODEL_ERROR_SEEDS} each; at 50 Hz ripple folds into the motion's band:")
    for twin, spread in ((Twin.NORMATIVE, 0.0), (Twin.NORMATIVE, 0.02), (Twin.HARSH, 0.02)):
        for periods in COMMISSIONINGS:
            motion = shipped_motion(robot, KEPT, periods)
            name = f"coverage, {twin}, gains within {spread:.0%}, {periods} periods"
            setup = setup_of(name, robot, twin, motion, payload, gain_spread=spread)
            with progress_line(name, MODEL_ERROR_SEEDS) as progress:
                trials = run_trials(pool, setup, MODEL_ERROR_SEEDS, progress)
            census.add(trials, setup.truth, EXACT if spread == 0.0 else NOMINAL if twin is Twin.NORMATIVE else None)
            held = Errors.of(trials, setup.truth).inside.mean(axis=0)
            label = f"{twin}{', gains' if spread else ''}"
            print(f"  {periods:7d} | " + "  ".join(f"{share:5.0%}" for share in held) + f"  {label}")
    if np.isnan(held).any():
        raise ValueError("no commissioning had a result")
