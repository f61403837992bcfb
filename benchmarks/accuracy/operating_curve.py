"""The verdict's operating characteristic: rates of wrong, right and cannot tell as a function of a payload's error.

Every commissioning consists of an identification and a validation pair with the shipped excitations on the normative
plant, with independent noise; the validation of one seed also judges the payload of the next, so that a right payload
is judged twice per seed. A wrong payload is the identified one with changed mass and inertia, or with its centre of
mass moved along one of the flange's axes.

On the measured arm the first half of a pair of runs is the identification and the second the validation, and vice
versa; every half is tested with every error.

    python -m benchmarks.accuracy.operating_curve
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from armload_controller.config.robot import Robot, load_robot
from armload_drivers.simulation.plant_spec import RigidBody
from armload_identification.calibration.mounted_runs import WeighedPayload
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.pipeline.payload_validation import gains_to_compare_by
from armload_identification.signals.joint_torque import Transmission
from armload_identification.verdict.agreement import Agreement, KnownMassCenter, Outcome, compare_known
from armload_identification.verdict.tolerance import Tolerance
from benchmarks.accuracy.real_currents import MASS_KG, Pair, absent, measured_pairs
from benchmarks.arms.bodies import ER50_PAYLOADS
from benchmarks.arms.calibrated import calibrated_from_pair
from benchmarks.arms.setups import Twin, setup_of, shipped_motion
from benchmarks.arms.simulated_recordings import record
from benchmarks.arms.trials import Setup, workers
from benchmarks.results.error_statistics import Census
from benchmarks.results.tally import Tally, progress_line

ER50_SEEDS = 200
NOMINAL_SEEDS = 50
SHIPPED_SEEDS = 40
SEEDS_PER_TASK = 5
NOMINAL_SPREAD = 0.02
FALSE_ALARMS_PER_400 = 3
NOTICED_SHARE = 0.9
MASS_ERROR = 0.02
CENTER_ERROR_M = 0.010
MASS_CURVE = (0.0, 0.005, 0.01, 0.015, 0.02, 0.03, 0.05, 0.1)
CENTER_CURVE_M = (0.002, 0.005, 0.010, 0.015, 0.020)
FAR_OFF = (0.5, 0.9, 1.1)
FAR_ERROR = 0.05
SIMULATED_PAYLOADS = {"er50": ("paper",), "prbt": ("gripper", "block")}
DIRECTIONS = np.vstack([np.eye(3), -np.eye(3)])
ROLES = ("identification", "validation")


@dataclass(frozen=True, eq=False)
class Commissioning:
    """One seed.

    Attributes:
        judged: Payload from the identification pair.
        measured: Payload from the validation pair.
    """

    judged: KnownMassCenter
    measured: KnownMassCenter


def run(tally: Tally, pool: Executor, census: Census) -> None:
    """Curves and criteria of the simulated arms."""
    tally.heading("7. The verdict on simulated arms: wrong / right / cannot tell in per cent, tolerance 2 % and 10 mm")
    er50 = load_robot("er50")
    spindle = next(payload for payload in ER50_PAYLOADS if payload.what == "spindle")
    body = spindle.rigid_body()
    made = commissionings(pool, census, er50, "er50, 10 kg", body, ER50_SEEDS)
    _judged(tally, "er50, 10 kg", made)
    name = "er50, gains nominal"
    made = commissionings(pool, census, er50, name, body, NOMINAL_SEEDS, gain_spread=NOMINAL_SPREAD)
    _curve("er50, 10 kg, gains nominal", made, _right(made))
    _shipped_payloads(tally, pool, census, (er50, load_robot("prbt")))


def run_measured(tally: Tally) -> None:
    """Halves of the UR10e's pairs; skipped with a reason if the measured data are not next to the checkout."""
    tally.heading("7. The verdict on the UR10e: halves of two pairs, 25 s each, wrong / right / cannot tell")
    if absent(tally, "the verdict on the UR10e"):
        return
    robot = load_robot("ur10e")
    pairs = measured_pairs(robot)
    weighed = WeighedPayload(MASS_KG)
    gains = {"nominal": robot.drives.transmission}
    for name, pair in pairs.items():
        found = calibrated_from_pair(pair.loaded, pair.unloaded, weighed, robot.chain, robot.drives.transmission)
        gains[f"pair {name}'s"] = found.transmission(robot.drives.transmission)
    made: list[Commissioning] = []
    for label, transmission in gains.items():
        for name, pair in pairs.items():
            both = [_halves(pair, half, robot.chain, transmission) for half in (0, 1)]
            every = [each for each in both for _ in DIRECTIONS]
            _curve(f"pair {name}, gains: {label}", every, [judge(each.judged, each.measured) for each in both])
            made += both
    failed = sum(judge(each.judged, each.measured).outcome is Outcome.WRONG for each in made)
    tally.judge("UR10e, halves: the right payload never fails", f"{failed} of {len(made)}", failed == 0)
    noticed = [
        judge(each.judged, each.measured, 1.0 + sense * FAR_ERROR).outcome is Outcome.WRONG
        for each in made
        for sense in (1, -1)
    ]
    tally.judge(
        f"UR10e, halves: an error of {FAR_ERROR:.0%} of the mass always fails",
        f"{sum(noticed)} of {len(noticed)}",
        all(noticed),
    )


def _halves(pair: Pair, half: int, chain: Chain, transmission: Transmission) -> Commissioning:
    """One half of a pair judged by the other."""
    judged = _half(pair, half, chain, transmission)
    gains = gains_to_compare_by(judged.covariance, transmission)
    return Commissioning(judged, _half(pair, 1 - half, chain, gains))


def _half(pair: Pair, half: int, chain: Chain, transmission: Transmission) -> KnownMassCenter:
    """Payload from the first or the second half of a pair."""
    loaded, unloaded = (
        run.rows((run.time_s >= middle_s) == bool(half))
        for run in (pair.loaded, pair.unloaded)
        for middle_s in (0.5 * (run.time_s[0] + run.time_s[-1]),)
    )
    result = identify_runs(loaded, unloaded, chain, transmission)
    return KnownMassCenter(result.parameters, result.mass_center)


def commissionings(
    pool: Executor,
    census: Census,
    robot: Robot,
    name: str,
    payload: RigidBody,
    seeds: int,
    *,
    gain_spread: float = 0.0,
) -> list[Commissioning]:
    """Identification and validation of one payload with many seeds."""
    setups = tuple(
        setup_of(f"verdict, {name}, {role}", robot, Twin.NORMATIVE, shipped_motion(robot, role=role), payload)
        for role in ROLES
    )
    if gain_spread:
        setups = tuple(setup.with_gains(gain_spread) for setup in setups)
    starts = range(0, seeds, SEEDS_PER_TASK)
    tasks = [pool.submit(_some, setups, range(start, min(start + SEEDS_PER_TASK, seeds))) for start in starts]
    made: list[Commissioning] = []
    with progress_line(f"verdict, {name}", seeds) as progress:
        for task in tasks:
            made.extend(task.result())
            progress(len(made))
    census.results += 2 * len(made)
    return made


def _some(setups: Sequence[Setup], seeds: Sequence[int]) -> list[Commissioning]:
    identification, validation = setups
    made = []
    for seed in seeds:
        judged = _known(identification, seed, identification.name, identification.transmission)
        gains = gains_to_compare_by(judged.covariance, validation.transmission)
        made.append(Commissioning(judged, _known(validation, seed, identification.name, gains)))
    return made


def _known(setup: Setup, seed: int, arm: str, transmission: Transmission) -> KnownMassCenter:
    """One pair; the drives are the same in both pairs of a seed."""
    gain_error = setup.gain_spread * replace(setup, name=arm).rng(seed).uniform(-1.0, 1.0, setup.scales.n)
    rng = setup.rng(seed)
    rng.uniform(size=setup.scales.n)
    loaded, unloaded = (
        record(period, setup.scales, setup.periods, rng, gain_error) for period in (setup.loaded, setup.unloaded)
    )
    result = identify_runs(loaded, unloaded, setup.chain, transmission)
    return KnownMassCenter(result.parameters, result.mass_center)


def _judged(tally: Tally, name: str, made: Sequence[Commissioning]) -> None:
    """The curve with its criteria."""
    right = _right(made)
    _curve(name, made, right)
    _judge_false_alarms(tally, name, right)
    errors = {
        f"{MASS_ERROR:.0%} of the mass": _mass_errors(made, MASS_ERROR),
        f"{CENTER_ERROR_M * 1e3:.0f} mm": _center_errors(made, CENTER_ERROR_M),
    }
    for what, results in errors.items():
        noticed = sum(result.outcome is Outcome.WRONG for result in results)
        tally.judge(
            f"{name}: an error of {what} fails in {NOTICED_SHARE:.0%}",
            f"{noticed} of {len(results)}",
            noticed >= NOTICED_SHARE * len(results),
        )


def _curve(name: str, made: Sequence[Commissioning], right: Sequence[Agreement]) -> None:
    """Wrong / right / cannot tell, in per cent, over the error."""
    kg = np.median([result.noticeable_kg for result in right])
    mm = 1e3 * np.median([result.noticeable_m for result in right])
    print(f"  {name}: smallest noticeable error {kg:.3f} kg and {mm:.1f} mm (median)")
    mass = [(f"{100.0 * error:g} %", right if error == 0.0 else _mass_errors(made, error)) for error in MASS_CURVE]
    center = [(f"{1e3 * error:g} mm", _center_errors(made, error)) for error in CENTER_CURVE_M]
    for row in (mass, center):
        print("    " + "  ".join(f"{label}: {_shares(results)}" for label, results in row))


def _shipped_payloads(tally: Tally, pool: Executor, census: Census, robots: Sequence[Robot]) -> None:
    """The curve of every payload in a shipped configuration, and the verdicts on 0.5, 0.9 and 1.1 times the payload."""
    passed = tried = 0
    for robot in robots:
        right: list[Agreement] = []
        for number, payload in enumerate(_shipped(robot), start=1):
            name = f"{robot.name}, shipped payload {number}"
            made = commissionings(pool, census, robot, name, payload, SHIPPED_SEEDS)
            itself = _right(made)
            _curve(f"{name}, {payload.mass_kg:g} kg", made, itself)
            right += itself
            far = {factor: [judge(each.judged, each.measured, factor) for each in made] for factor in FAR_OFF}
            print("    " + "  ".join(f"{factor:g} of it: {_shares(results)}" for factor, results in far.items()))
            passed += sum(result.outcome is Outcome.RIGHT for results in far.values() for result in results)
            tried += len(FAR_OFF) * len(made)
        _judge_false_alarms(tally, f"{robot.name}, shipped payloads", right)
    tally.judge(
        f"half, 0.9 and 1.1 of every shipped payload never pass, {SHIPPED_SEEDS} seeds",
        f"{passed} of {tried} passed",
        passed == 0,
    )


def _judge_false_alarms(tally: Tally, name: str, right: Sequence[Agreement]) -> None:
    """Judge how often a right payload is called wrong."""
    failed = sum(result.outcome is Outcome.WRONG for result in right)
    tally.judge(
        f"{name}: the right payload fails at most {FALSE_ALARMS_PER_400} times of 400",
        f"{failed} of {len(right)}",
        400 * failed <= FALSE_ALARMS_PER_400 * len(right),
    )


def _shipped(robot: Robot) -> list[RigidBody]:
    """The payloads in a shipped configuration: those to design for, and those of its simulation."""
    bodies = [
        RigidBody(payload.mass_kg, payload.center_of_mass_m, payload.inertia_about_com)
        for payload in robot.payloads.design_set
    ]
    for name in SIMULATED_PAYLOADS[robot.name]:
        payload = robot.simulation.plant_spec(name).payload
        if payload is not None and all(payload.mass_kg != body.mass_kg for body in bodies):
            bodies.append(payload)
    return bodies


def judge(
    judged: KnownMassCenter, measured: KnownMassCenter, factor: float = 1.0, shift_m: ArrayLike = (0.0, 0.0, 0.0)
) -> Agreement:
    """The verdict on the identified payload with changed mass and centre of mass.

    Args:
        judged: The identified payload.
        measured: The payload from the validation.
        factor: Factor on mass and inertia.
        shift_m: Displacement of the centre of mass.
    """
    body = judged.parameters
    wrong = InertialParameters.from_center_of_mass(
        factor * body.mass_kg, body.center_of_mass_m + np.array(shift_m), factor * body.inertia_about_com
    )
    return compare_known(replace(judged, parameters=wrong), measured, Tolerance())


def _right(made: Sequence[Commissioning]) -> list[Agreement]:
    """Every validation applied to its own payload and to the next seed's."""
    following = [*made[1:], made[0]]
    return [
        judge(each.judged, other.measured)
        for pairs in (zip(made, made, strict=True), zip(following, made, strict=True))
        for each, other in pairs
    ]


def _mass_errors(made: Sequence[Commissioning], share: float) -> list[Agreement]:
    """Verdicts on payloads that are alternately too heavy and too light."""
    return [judge(each.judged, each.measured, 1.0 + share * (1 if seed % 2 else -1)) for seed, each in enumerate(made)]


def _center_errors(made: Sequence[Commissioning], distance_m: float) -> list[Agreement]:
    """Verdicts on payloads with centres of mass moved along +-x, y and z in turn."""
    return [
        judge(each.judged, each.measured, shift_m=distance_m * DIRECTIONS[seed % len(DIRECTIONS)])
        for seed, each in enumerate(made)
    ]


def _shares(results: Sequence[Agreement]) -> str:
    """Wrong / right / cannot tell in per cent."""
    return "/".join(
        f"{100.0 * sum(result.outcome is outcome for result in results) / len(results):.0f}"
        for outcome in (Outcome.WRONG, Outcome.RIGHT, Outcome.CANNOT_TELL)
    )


def main() -> int:
    """Run only this part."""
    tally, census = Tally(), Census()
    run_measured(tally)
    with workers() as pool:
        run(tally, pool, census)
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
