"""Coverage of the 95 % intervals over thousands of simulated commissionings.

Usage: python -m benchmarks.accuracy.coverage [FIRST_SEED [SEEDS]]: first commissionings alone
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace

import numpy as np

from armload_controller.config.robot import Robot, load_robot
from armload_core.arrays import FloatArray
from armload_identification.model.payload import PARAMETER_NAMES
from benchmarks.arms.bodies import ER50_PAYLOADS, PRBT_PAYLOADS, Cuboid
from benchmarks.arms.drafted_arm import drafted_arm
from benchmarks.arms.setups import Twin, setup_of, shipped_motion
from benchmarks.arms.trials import Setup, Trial, run_trials, trial, workers
from benchmarks.results.error_statistics import EXACT, NOMINAL, Census, Errors
from benchmarks.results.tally import Tally, progress_line

COMMISSIONINGS = {3: 2000, 10: 1000, 50: 400}
"""Number of commissionings by number of periods, whose cost grows with it; 400 give a share of 95 % to one per cent."""
MODEL_ERROR_SEEDS = 50
LEAST, MOST = 0.93, 0.98
FIRST_SEEDS = 40
"""Number of seeds of each first commissioning; those of the figures start at 100, the method was tuned on 0 to 7."""
FIRST_SEED = 100
FIRST_LEAST = 0.9
DRAFTED_PAYLOADS = (
    Cuboid("light", 1.0, (0.02, 0.0, 0.05), (0.10, 0.08, 0.06), 0.3),
    Cuboid("off-centre", 3.0, (0.06, -0.04, 0.12), (0.20, 0.10, 0.10), 0.4),
)
ROLES = ("identification", "validation")
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


def run_first(tally: Tally, pool: Executor, first_seed: int = FIRST_SEED, seeds: int = FIRST_SEEDS) -> None:
    """First commissionings as shipped: three periods, nominal gains, the normative plant.

    The streams are those of `steady_state`; `one_minute` compares them with commissionings over CANopen.

    Args:
        tally: Judges that every value's interval holds the truth on each arm.
        pool: Processes.
        first_seed: The first seed.
        seeds: Number of seeds.
    """
    tally.heading(f"Coverage of first commissionings: seeds {first_seed} to {first_seed + seeds - 1}")
    print("  share of the intervals that hold the truth; below, the median half width over 20 % of its scale")
    print(f"  {'':42s} | " + "  ".join(f"{name:>5s}" for name in PARAMETER_NAMES))
    arms: tuple[tuple[Callable[[], Robot], tuple[Cuboid, ...]], ...] = (
        (lambda: load_robot("er50"), (ER50_PAYLOADS[1], ER50_PAYLOADS[5], ER50_PAYLOADS[8])),
        (lambda: load_robot("prbt"), (PRBT_PAYLOADS[3], PRBT_PAYLOADS[8])),
        (drafted_arm, DRAFTED_PAYLOADS),
    )
    for robot_of, payloads in arms:
        robot = robot_of()
        setups = _first_setups(robot, payloads)
        inside: list[FloatArray] = []
        for setup in setups:
            tasks = [pool.submit(trial, setup, seed) for seed in range(first_seed, first_seed + seeds)]
            inside.append(_shown(setup, [task.result() for task in tasks]))
        share = np.concatenate(inside).mean(axis=0)
        tally.judge(
            f"{robot.name}, first commissionings: every interval holds the truth in {FIRST_LEAST:.0%} or more",
            f"{share.min():.1%} ({PARAMETER_NAMES[int(np.argmin(share))]}) to {share.max():.1%}, "
            f"together {share.mean():.1%}",
            bool(share.min() >= FIRST_LEAST),
        )


def _first_setups(robot: Robot, payloads: tuple[Cuboid, ...]) -> list[Setup]:
    """The shipped payload on both excitations, and others on the first; gains are nominal, and right."""
    shipped = robot.simulation.plant_spec(robot.simulation.payload_name).payload
    if shipped is None:
        raise ValueError(f"{robot.name} names no payload to simulate")
    cases = [(f"shipped, {role}", shipped, role) for role in ROLES]
    cases += [(payload.what, payload.rigid_body(), ROLES[0]) for payload in payloads]
    setups = []
    for what, body, role in cases:
        motion = shipped_motion(robot, role=role)
        setup = setup_of(f"first, {robot.name}, {what}", robot, Twin.NORMATIVE, motion, body)
        setups.append(replace(setup, transmission=robot.drives.transmission))
    return setups


def _shown(setup: Setup, trials: list[Trial]) -> FloatArray:
    """(S, 10) whether each interval holds, printed with the median half widths."""
    inside = np.asarray(Errors.of(trials, setup.truth).inside, dtype=np.float64)
    width = np.median([found.half_width_95 for found in trials if not found.refused], axis=0)
    mass = setup.truth.mass_kg
    scale = np.array([mass] + [0.1] * 3 + [mass * 0.01] * 6)
    print(f"  {setup.name:42s} | " + "  ".join(f"{share:5.0%}" for share in inside.mean(axis=0)))
    print(f"  {f'{mass:.3g} kg':>42s} | " + "  ".join(f"{share:5.2f}" for share in width / (0.2 * scale)))
    return inside


def main() -> int:
    """Run only the first commissionings."""
    tally = Tally()
    with workers() as pool:
        run_first(tally, pool, *(int(word) for word in sys.argv[1:]))
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
