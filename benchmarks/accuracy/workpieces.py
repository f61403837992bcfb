"""Coverage of a workpiece's intervals: a part of 0.5 kg in a gripper of 3 kg, each identified from a pair of its own.

The gripper is identified first, then the gripper with the part; the drives of one seed, and their gains' errors, are
the same in both, and so is the excitation. The unloaded runs are independent.

The workpiece's intervals are as honest as those of the two identifications. Where theirs hold in about 95 % (white
noise; er50, 250 samples a second) so do the workpiece's. prbt has 100 samples a second, of setpoints that change as
often: the intervals of each identification allow for the ripple of that, 99 % of them hold, and the ripple is the same
in both and cancels. Of a calibrated arm each also allows for what no term describes; with nominal gains for gears that
lose more in one direction of the power, an error that both share, but that counts twice. There the criterion has no
upper end, and the share of the gripper's own intervals is shown beside it.

    python -m benchmarks.accuracy.workpieces [SEEDS]
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from armload_controller.config.robot import load_robot
from armload_core.arrays import FloatArray
from armload_drivers.simulation.plant_spec import RigidBody
from armload_identification.calibration.calibrate_arm import WeighedPayload
from armload_identification.model.payload import InertialParameters, PayloadResult
from armload_identification.pipeline.payload_identification import payload_result
from armload_identification.pipeline.payload_validation import gains_to_compare_by
from armload_identification.pipeline.workpiece import Workpiece
from armload_identification.signals.signal_constants import NominalGain
from benchmarks.arms.bodies import ER50_PAYLOADS
from benchmarks.arms.calibrated import calibrated_from_pair, identified_with
from benchmarks.arms.setups import Twin, setup_of, shipped_motion
from benchmarks.arms.simulated_recordings import record
from benchmarks.arms.trials import Setup, workers
from benchmarks.results.tally import Tally, progress_line

SEEDS = 100
SEEDS_PER_TASK = 5
LEAST, MOST = 0.93, 0.97
NAMES = ("mass", "cx", "cy", "cz")
GRIPPER = InertialParameters.from_center_of_mass(3.0, [0.004, -0.010, 0.075], np.diag([0.014, 0.012, 0.006]))
WEIGHED = ER50_PAYLOADS[8]
"""Payload that an arm is calibrated with."""
PART = InertialParameters.from_center_of_mass(0.5, [0.010, 0.005, 0.190], np.diag([0.0006, 0.0006, 0.0004]))


@dataclass(frozen=True)
class Case:
    """An arm and what is known of its drives.

    Attributes:
        robot: Name of the robot.
        twin: What disturbs it.
        nominal: Whether gains have errors as uncertain as the intervals assume; else they are exact, and known to be.
        calibrated: Whether the arm is calibrated first, from a pair of each seed with a weighed payload.
        most: Greatest pooled coverage that is right; 1 where the identifications themselves hold more often.
    """

    robot: str
    twin: Twin
    nominal: bool
    calibrated: bool = False
    most: float = MOST

    @property
    def title(self) -> str:
        """What is printed."""
        gains = "calibrated" if self.calibrated else f"gains {'nominal' if self.nominal else 'exact'}"
        return f"{self.robot}, {self.twin}, {gains}"


CASES = (
    Case("er50", Twin.NORMATIVE, nominal=False),
    Case("er50", Twin.NORMATIVE, nominal=True, most=1.0),
    Case("er50", Twin.NORMATIVE, nominal=True, calibrated=True, most=1.0),
    Case("prbt", Twin.CLEAN, nominal=False, most=1.0),
    Case("prbt", Twin.NORMATIVE, nominal=True, most=1.0),
)


def run(tally: Tally, pool: Executor, seeds: int = SEEDS) -> None:
    """Pooled coverage of mass and centre of mass."""
    tally.heading(f"A part of {PART.mass_kg:g} kg in a gripper of {GRIPPER.mass_kg:g} kg, {seeds} seeds each")
    for case in CASES:
        made = _made(pool, case, seeds)
        held, gripper, width = made[:, :4], made[:, 4:8], made[:, 8:]
        shares = "  ".join(f"{name} {share:.1%}" for name, share in zip(NAMES, held.mean(axis=0), strict=True))
        middle = np.median(width, axis=0)
        print(
            f"  {case.title}: {shares}; median half widths {middle[0] * 1e3:.0f} g and "
            f"{' '.join(f'{m * 1e3:.1f}' for m in middle[1:])} mm; the gripper's own hold in {np.nanmean(gripper):.1%}"
        )
        pooled = float(held.mean())
        wanted = f"{LEAST:.0%} to {case.most:.0%}" if case.most < 1.0 else f"at least {LEAST:.0%}"
        tally.judge(f"{case.title}: pooled coverage {wanted}", f"{pooled:.1%}", LEAST <= pooled <= case.most)


def _made(pool: Executor, case: Case, seeds: int) -> FloatArray:
    """(seeds, 12) whether the truth lies in the part's and in the gripper's interval, and the part's half width.

    The gripper's is nan where it is not determined.
    """
    robot = load_robot(case.robot)
    motion = shipped_motion(robot)
    both = InertialParameters(GRIPPER.theta + PART.theta)
    setups = tuple(
        setup_of(
            f"workpieces, {what}",
            robot,
            case.twin,
            motion,
            _rigid(body),
            gain_spread=NominalGain.deviation if case.nominal else 0.0,
            calibration=WEIGHED if case.calibrated else None,
        )
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
    first = setups[0]
    rng = first.rng(seed)
    gain_error = np.zeros(first.scales.n)
    if first.gain_spread > 0.0:
        gain_error = first.gain_spread * rng.normal(size=first.scales.n) + NominalGain.common_deviation * rng.normal()
    calibration = None
    if first.calibration is not None:
        heavy, empty = (
            record(period, first.scales, first.periods, rng, gain_error)
            for period in (first.calibration.loaded, first.unloaded)
        )
        truth = first.calibration.truth
        known = WeighedPayload(truth.mass_kg, truth)
        calibration = calibrated_from_pair(heavy, empty, known, first.chain, first.transmission)
    results: list[PayloadResult] = []
    for setup in setups:
        loaded, unloaded = (
            record(period, setup.scales, setup.periods, rng, gain_error) for period in (setup.loaded, setup.unloaded)
        )
        gains = setup.transmission
        if results and calibration is None:
            gains = gains_to_compare_by(results[0].mass_center, gains)
        results.append(payload_result(identified_with(calibration, loaded, unloaded, setup.chain, gains), "0", "0"))
    gripper, whole = results
    part = Workpiece.of(whole, gripper)
    low, high = gripper.interval_95[:4].T
    own = np.where(np.isnan(low), np.nan, (low <= GRIPPER.values[:4]) & (GRIPPER.values[:4] <= high))
    held = np.abs(part.model.values[:4] - PART.values[:4]) <= part.half_width_95
    return np.concatenate([held, own, part.half_width_95])


def main() -> int:
    """Run only this part."""
    tally = Tally()
    with workers() as pool:
        run(tally, pool, int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS)
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
