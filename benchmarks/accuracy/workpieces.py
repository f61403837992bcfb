"""Coverage of a workpiece's intervals: a part of 0.5 kg in a gripper of 3 kg, each identified from a pair of its own.

The gripper is identified first, then the gripper with the part; the drives of one seed, and their gains' errors, are
the same in both, as are the shipped excitation and the plant of prbt. The unloaded runs are independent. Coverage above
95 % is that of the two identifications: on this arm, with 100 samples per second, 99 % of the gripper's own intervals
hold.

    python -m benchmarks.accuracy.workpieces [SEEDS]
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import Executor

import numpy as np

from armload_controller.config.robot import load_robot
from armload_core.arrays import FloatArray
from armload_drivers.simulation.plant_spec import RigidBody
from armload_identification.model.payload import InertialParameters, PayloadResult
from armload_identification.pipeline.payload_identification import identify, payload_result
from armload_identification.pipeline.payload_validation import gains_to_compare_by
from armload_identification.pipeline.workpiece import Workpiece
from benchmarks.arms.setups import Twin, setup_of, shipped_motion
from benchmarks.arms.simulated_recordings import record
from benchmarks.arms.trials import Setup, workers
from benchmarks.results.tally import Tally, progress_line

SEEDS = 200
SEEDS_PER_TASK = 5
SPREADS = (0.0, 0.02)
LEAST = 0.93
NAMES = ("mass", "cx", "cy", "cz")
GRIPPER = InertialParameters.from_center_of_mass(3.0, [0.004, -0.010, 0.075], np.diag([0.014, 0.012, 0.006]))
PART = InertialParameters.from_center_of_mass(0.5, [0.010, 0.005, 0.190], np.diag([0.0006, 0.0006, 0.0004]))


def run(tally: Tally, pool: Executor, seeds: int = SEEDS) -> None:
    """Pooled coverage of mass and centre of mass."""
    tally.heading(f"A part of {PART.mass_kg:g} kg in a gripper of {GRIPPER.mass_kg:g} kg on prbt, {seeds} seeds each")
    for spread in SPREADS:
        made = _made(pool, spread, seeds)
        held, width = made[:, :4], made[:, 4:]
        shares = "  ".join(f"{name} {share:.1%}" for name, share in zip(NAMES, held.mean(axis=0), strict=True))
        middle = np.median(width, axis=0)
        print(
            f"  gains within {spread:.0%}: {shares}; median half widths {middle[0] * 1e3:.0f} g and "
            f"{' '.join(f'{m * 1e3:.1f}' for m in middle[1:])} mm"
        )
        pooled = float(held.mean())
        tally.judge(
            f"gains within {spread:.0%}: pooled coverage of at least {LEAST:.0%}",
            f"{pooled:.1%}",
            pooled >= LEAST,
        )


def _made(pool: Executor, spread: float, seeds: int) -> FloatArray:
    """(seeds, 8) whether the truth lies in the interval, and the half width, of mass and centre of mass."""
    robot = load_robot("prbt")
    motion = shipped_motion(robot)
    both = InertialParameters(GRIPPER.theta + PART.theta)
    setups = tuple(
        setup_of(f"workpieces, {what}", robot, Twin.NORMATIVE, motion, _rigid(body), gain_spread=spread)
        for what, body in (("gripper", GRIPPER), ("with part", both))
    )
    starts = range(0, seeds, SEEDS_PER_TASK)
    tasks = [pool.submit(_some, setups, range(start, min(start + SEEDS_PER_TASK, seeds))) for start in starts]
    made: list[FloatArray] = []
    with progress_line("workpieces", seeds) as progress:
        for task in tasks:
            made.extend(task.result())
            progress(len(made))
    return np.array(made)


def _rigid(body: InertialParameters) -> RigidBody:
    return RigidBody(body.mass_kg, body.center_of_mass_m, body.inertia_about_com)


def _some(setups: Sequence[Setup], seeds: Sequence[int]) -> list[FloatArray]:
    return [_one(setups, seed) for seed in seeds]


def _one(setups: Sequence[Setup], seed: int) -> FloatArray:
    """Gripper, whole, and the part from both."""
    gain_error = setups[0].gain_spread * setups[0].rng(seed).uniform(-1.0, 1.0, setups[0].scales.n)
    results: list[PayloadResult] = []
    for setup in setups:
        rng = setup.rng(seed + 10_000)
        loaded, unloaded = (
            record(period, setup.scales, setup.periods, rng, gain_error) for period in (setup.loaded, setup.unloaded)
        )
        gains = setup.transmission if not results else gains_to_compare_by(results[0].mass_center, setup.transmission)
        results.append(payload_result(identify(loaded, unloaded, setup.chain, gains), "0", "0"))
    part = Workpiece.of(results[1], results[0])
    held = np.abs(part.model.values[:4] - PART.values[:4]) <= part.half_width_95
    return np.concatenate([held, part.half_width_95])


def main() -> int:
    """Run only this part."""
    tally = Tally()
    with workers() as pool:
        run(tally, pool, int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS)
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
