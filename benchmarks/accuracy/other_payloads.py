"""Ten payloads on each of two arms, from 3 or 5 % of the rated payload to all of it.

The required length of a run is determined by the drives' noise and the payload's mass. The table shows for every
payload the number of periods that the bound requires. Both arms are used as shipped, with the excitation and the cycle
of their files. For prbt the periods of its file suffice. er50's wrist is so noisy that a payload of 1 kg requires 96 of
its 5 s; it is judged with as long a run as in the paper, 500 s, and the periods of its file are shown for information.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor

import numpy as np
from scipy.stats import norm

from armload_controller.config.robot import load_robot
from armload_controller.config.robot_simulation import HARSH_GAIN_ERROR
from armload_identification.model.payload import derived
from benchmarks.arms.bodies import ER50_PAYLOADS, PRBT_PAYLOADS, Cuboid
from benchmarks.arms.setups import Twin, setup_of, shipped_motion
from benchmarks.arms.trials import Setup, Trial, run_trials
from benchmarks.results.bound import bound_of
from benchmarks.results.error_statistics import EXACT, Census, Errors
from benchmarks.results.tally import Tally, progress_line

SEEDS = 40
SHOWN_SEEDS = 20
"""Number of seeds if nothing is judged."""
LIGHT_SEEDS = 200
"""Number of seeds below FROM_KG, where the intervals are judged: so many distinguish 95 % from 90 % for four values."""
JUDGED_PERIODS = {"er50": 100}
"""Where they are not those of the file."""
MASS_SHARE = 0.02
MASS_KG = 0.03
CENTER_M = 0.008
OF_SEEDS = 0.90
FROM_KG = 1.0
SATURATED = 0.999


def run(tally: Tally, pool: Executor, twin: Twin, census: Census) -> None:
    """A table per arm and length of the runs, judged on the normative plant."""
    for name, payloads in (("er50", ER50_PAYLOADS), ("prbt", PRBT_PAYLOADS)):
        motion = shipped_motion(load_robot(name))
        judged = JUDGED_PERIODS.get(name, motion.periods)
        period_s = motion.trajectory.period_s
        lengths = sorted({motion.periods, judged}) if twin is Twin.NORMATIVE else [judged]
        for periods in lengths:
            item = "4" if twin is Twin.NORMATIVE else "5"
            tally.heading(f"{item}. Ten payloads on {name}, {twin} plant, {periods} periods of {period_s:g} s")
            print(
                "  payload                     kg | noise asks for | mass error %: median  worst | "
                "centre mm: median  worst | good seeds | intervals hold truth | determined"
            )
            making = [pool.submit(_setup, name, twin, payload, periods) for payload in payloads]
            for payload, setup in zip(payloads, making, strict=True):
                judging = twin is Twin.NORMATIVE and periods == judged
                _one(tally, pool, payload, setup.result(), census, judging=judging)


def periods_for_noise(setup: Setup) -> int:
    """Number of periods with which errors at the bound meet the criterion in 90 % of runs, with noise only."""
    covariance = bound_of(setup) * setup.periods
    _, slope = derived(setup.truth)
    center = slope[1:4] @ covariance @ slope[1:4].T
    draws = np.random.default_rng(0).multivariate_normal(np.zeros(3), center, 20000)
    reach_m = float(np.quantile(np.sqrt(np.sum(draws**2, axis=1)), OF_SEEDS))
    reach_kg = float(norm.ppf(0.5 + 0.5 * OF_SEEDS) * np.sqrt(covariance[0, 0]))
    allowed_kg = max(MASS_SHARE * setup.truth.mass_kg, MASS_KG)
    return math.ceil(max((reach_m / CENTER_M) ** 2, (reach_kg / allowed_kg) ** 2))


def _setup(name: str, twin: Twin, payload: Cuboid, periods: int) -> Setup:
    robot = load_robot(name)
    motion = shipped_motion(robot, periods=periods)
    label = f"{name}, {payload.what}, {twin}, {periods} periods"
    setup = setup_of(label, robot, twin, motion, payload.rigid_body())
    return setup.with_gains(HARSH_GAIN_ERROR) if twin is Twin.HARSH else setup


def _one(tally: Tally, pool: Executor, payload: Cuboid, setup: Setup, census: Census, *, judging: bool) -> None:
    """One row and, if it is judged, its criterion."""
    seeds = SHOWN_SEEDS if not judging else LIGHT_SEEDS if payload.mass_kg < FROM_KG else SEEDS
    with progress_line(setup.name, seeds) as progress:
        trials = run_trials(pool, setup, seeds, progress)
    census.add(trials, setup.truth, EXACT if setup.gain_spread == 0.0 else None)
    errors = Errors.of(trials, setup.truth)
    mass_kg = np.abs(errors.value_errors[:, 0])
    within = mass_kg <= max(MASS_SHARE * payload.mass_kg, MASS_KG)
    good = within & (errors.center_m <= CENTER_M)
    held = errors.inside[:, :4].mean(axis=0) if len(mass_kg) else np.zeros(4)
    needed = periods_for_noise(setup)
    print(
        f"  {payload.what:25s}{payload.mass_kg:5.1f} | {needed:14d} | "
        f"{_two(100.0 * mass_kg / payload.mass_kg, 2):>20s} | {_two(1e3 * errors.center_m, 1):>18s}  | "
        f"{errors.share(good):10.0%} | "
        f"m {held[0]:4.0%} c {held[1:].min():4.0%}{'':7s} | {errors.determined.sum(axis=1).mean():.1f} of 10"
        + _remarks(setup, trials)
    )
    if not judging:
        return
    what = f"{setup.name}, {payload.mass_kg:g} kg"
    if payload.mass_kg >= FROM_KG:
        share = errors.share(good)
        tally.judge(
            f"{what}: mass within max({MASS_SHARE:.0%}, {MASS_KG * 1e3:.0f} g), centre of mass within "
            f"{CENTER_M * 1e3:.0f} mm on {OF_SEEDS:.0%} of seeds",
            f"{share:.0%} ({errors.share(within):.0%} mass, {errors.share(errors.center_m <= CENTER_M):.0%} centre)",
            share >= OF_SEEDS,
        )
    else:
        least = min(errors.share(errors.inside[:, i]) for i in range(4))
        tally.judge(
            f"{what}: the intervals of mass and centre of mass hold the truth on {OF_SEEDS:.0%} of seeds",
            f"{least:.0%} at least",
            least >= OF_SEEDS,
        )


def _two(values: np.ndarray, digits: int) -> str:
    """Median and greatest."""
    if not values.size:
        return "-"
    return f"{np.median(values):8.{digits}f} {values.max():8.{digits}f}"


def _remarks(setup: Setup, trials: Sequence[Trial]) -> str:
    """Remarks on a row."""
    remarks = []
    refused = [trial.refused for trial in trials if trial.refused]
    if refused:
        remarks.append(f"{len(refused)} refused: {refused[0][:60]}")
    if setup.loaded.greatest_share.max() > SATURATED:
        remarks.append(f"joint {int(setup.loaded.greatest_share.argmax()) + 1} saturates")
    return "".join(f"  [{remark}]" for remark in remarks)
