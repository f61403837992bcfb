"""Coverage of a workpiece's intervals: a part of 0.5 kg in a gripper of 3 kg, each identified from a pair of its own.

The gripper is identified first, then the gripper with the part. The drives of one seed are the same in both, and so is
the excitation; the unloaded runs are independent. What the intervals allow for is drawn as the priors state it: nominal
gains with their own and their common errors, gears that lose more in one direction of the power, friction that changes
from run to run, and between calibration, gripper and part as much as in a cold arm. Without simulated friction (white
noise) none of it changes.

    python -m benchmarks.accuracy.workpieces [SEEDS]
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np

from armload_controller.config.robot import load_robot
from armload_drivers.cia402.arm_settings import EffortFeedback
from armload_drivers.simulation.plant_spec import RigidBody
from armload_identification.calibration.mounted_runs import WeighedPayload
from armload_identification.estimation.payload_from_posterior import gear_asymmetry
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import InertialParameters, PayloadResult, Provenance
from armload_identification.pipeline.identification_result import payload_result
from armload_identification.pipeline.payload_validation import gains_to_compare_by
from armload_identification.pipeline.workpiece import Workpiece
from armload_identification.recording.recording import Recording
from benchmarks.arms.bodies import ER50_PAYLOADS
from benchmarks.arms.calibrated import calibrated_from_pair, identified_with
from benchmarks.arms.gears import Gears
from benchmarks.arms.setups import Twin, setup_of, shipped_motion
from benchmarks.arms.simulated_recordings import record
from benchmarks.arms.steady_state import SteadyPeriod
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
    """

    robot: str
    twin: Twin
    nominal: bool
    calibrated: bool = False

    @property
    def title(self) -> str:
        """What is printed."""
        gains = "calibrated" if self.calibrated else f"gains {'nominal' if self.nominal else 'exact'}"
        return f"{self.robot}, {self.twin}, {gains}"


CASES = (
    Case("er50", Twin.NORMATIVE, nominal=False),
    Case("er50", Twin.NORMATIVE, nominal=True),
    Case("er50", Twin.NORMATIVE, nominal=True, calibrated=True),
    Case("prbt", Twin.CLEAN, nominal=False),
    Case("prbt", Twin.NORMATIVE, nominal=True),
)


def _drawn(case: Case, setup: Setup) -> tuple[Gears, FloatArray]:
    """The gears of a case, and (n, n) covariance of the logarithms of the gains' errors."""
    joints = load_robot(case.robot).simulation.plant_spec(None).joints
    covariance = np.zeros((setup.chain.n, setup.chain.n))
    if case.nominal:
        uneven = gear_asymmetry(np.array([joint.load_friction for joint in joints]))
        covariance = setup.transmission.gains(from_torque=setup.scales.feedback is EffortFeedback.TORQUE).covariance
        covariance = covariance + np.diag(uneven**2) + np.outer(uneven, uneven)
    if case.twin is Twin.CLEAN:
        joints = tuple(replace(joint, coulomb_nm=0.0, viscous_nm_s_rad=0.0) for joint in joints)
    return Gears.of(joints), covariance


def run(tally: Tally, pool: Executor, seeds: int = SEEDS) -> None:
    """Pooled coverage of mass and centre of mass."""
    tally.heading(f"A part of {PART.mass_kg:g} kg in a gripper of {GRIPPER.mass_kg:g} kg, {seeds} seeds each")
    all_held = []
    for case in CASES:
        made = _made(pool, case, seeds)
        all_held.append(made[:, :4])
        held, gripper, width = made[:, :4], made[:, 4:8], made[:, 8:]
        shares = "  ".join(f"{name} {share:.1%}" for name, share in zip(NAMES, held.mean(axis=0), strict=True))
        middle = np.median(width, axis=0)
        print(
            f"  {case.title}: {shares}; median half widths {middle[0] * 1e3:.0f} g and "
            f"{' '.join(f'{m * 1e3:.1f}' for m in middle[1:])} mm; the gripper's own hold in {np.nanmean(gripper):.1%}"
        )
        pooled = float(held.mean())
        tally.judge(f"{case.title}: pooled coverage at least {LEAST:.0%}", f"{pooled:.1%}", pooled >= LEAST)
    pooled = float(np.mean(all_held))
    tally.judge(f"all of these: pooled coverage {LEAST:.0%} to {MOST:.0%}", f"{pooled:.1%}", LEAST <= pooled <= MOST)


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
            gain_spread=float(case.nominal),
            calibration=WEIGHED if case.calibrated else None,
        )
        for what, body in (("gripper", GRIPPER), ("with part", both))
    )
    starts = range(0, seeds, SEEDS_PER_TASK)
    drawn = _drawn(case, setups[0])
    tasks = [pool.submit(_some, setups, *drawn, range(start, min(start + SEEDS_PER_TASK, seeds))) for start in starts]
    made: list[FloatArray] = []
    with progress_line("workpieces", seeds) as progress:
        for task in tasks:
            made.extend(task.result())
            progress(len(made))
    return np.array(made)


def _rigid(body: InertialParameters) -> RigidBody:
    return RigidBody(body.mass_kg, body.center_of_mass_m, body.inertia_about_com)


def _some(setups: Sequence[Setup], gears: Gears, covariance: FloatArray, seeds: Sequence[int]) -> list[FloatArray]:
    return [_one(setups, gears, covariance, seed) for seed in seeds]


def _one(setups: Sequence[Setup], gears: Gears, covariance: FloatArray, seed: int) -> FloatArray:
    """Gripper, whole, and the part from both."""
    first = setups[0]
    rng = first.rng(seed)
    gain_error = np.expm1(rng.multivariate_normal(np.zeros(first.scales.n), covariance))

    def pair(*loads: SteadyPeriod) -> list[Recording]:
        day, (n, scales) = gears.day(rng), (first.periods, first.scales)
        return [record(gears.run(load, scales.coupling, day, rng), scales, n, rng, gain_error) for load in loads]

    calibration = None
    if first.calibration is not None:
        heavy, empty = pair(first.calibration.loaded, first.unloaded)
        truth = first.calibration.truth
        known = WeighedPayload(truth.mass_kg, truth)
        calibration = calibrated_from_pair(heavy, empty, known, first.chain, first.transmission)
    results: list[PayloadResult] = []
    for setup in setups:
        loaded, unloaded = pair(setup.loaded, setup.unloaded)
        gains = setup.transmission
        if results and calibration is None:
            gains = gains_to_compare_by(results[0].mass_center, gains)
        found = identified_with(calibration, loaded, unloaded, setup.chain, gains)
        results.append(payload_result(found, Provenance("0", "0", {})))
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
