"""Coverage of the 95 % intervals on four arms: nominal and calibrated pairs, single runs, both plants.

Every seed draws what the priors state, and payloads: the errors of the gains; their drift from run to run, and since
the calibration; zeros of the joints, other than in the calibration; another friction on the day of the identification,
with the gears' loss by the load; and friction that changes from run to run. Both excitations with the empty arm, with
a heavy payload that was weighed, and with one that was not, calibrate the arm; another payload is identified on one of
them. Exact gains do not drift, nor do nominal ones, whose intervals do not allow for it. The Panda is simulated by
Pinocchio, and has no harsh plant.

    python -m benchmarks.accuracy.interval_coverage [SEEDS [FIRST_SEED [ARM...]]]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import replace
from enum import StrEnum
from functools import cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from armload_controller.config.robot import Robot, load_robot
from armload_drivers.cia402.arm_settings import EffortFeedback
from armload_identification.calibration.calibration_result import COLD
from armload_identification.calibration.mounted_runs import MountedRun, WeighedPayload
from armload_identification.calibration.session_gains import ASSUMED
from armload_identification.estimation.estimation_constants import DisturbanceLimits, Drift
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import IdentificationError
from armload_identification.model.chain import Chain
from armload_identification.model.payload import PARAMETER_NAMES
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission
from benchmarks.arms import sagging_panda
from benchmarks.arms.bodies import ER50_PAYLOADS, PRBT_PAYLOADS, Cuboid
from benchmarks.arms.calibrated import calibrated, identified_with
from benchmarks.arms.drafted_arm import PAYLOAD_KG, drafted_arm
from benchmarks.arms.gears import Gears
from benchmarks.arms.sagging_panda import Effects, SaggingPanda
from benchmarks.arms.setups import Twin, shipped_motion, twin_spec
from benchmarks.arms.simulated_recordings import DriveScales, record
from benchmarks.arms.steady_state import SteadyPeriod, steady_period
from benchmarks.arms.trials import workers
from benchmarks.results.tally import Tally, progress_line

SEEDS, FIRST_SEED = 40, 100
"""Number of seeds in `make accuracy`; what was chosen was chosen on seeds below 100."""
LEAST, MOST, LEAST_OF_ONE = 0.93, 0.97, 33.0 / 40.0
WIDEST = 1.2
"""Greatest ratio of the intervals to those of the errors' standard deviation, with exact gains."""
HEAVY = 4
"""Number of payloads of an arm, the heaviest, of which one is weighed."""
ROLES = ("identification", "validation")
FRICTION = (1.0 - np.sqrt(1.5) * COLD, 1.0, 1.0 + np.sqrt(1.5) * COLD)
"""Factors on all friction on another day: their standard deviation is the prior's."""
PANDA = "panda"
LIGHT_PAYLOADS = tuple(payload for payload in PRBT_PAYLOADS if payload.mass_kg <= PAYLOAD_KG)
SHELF = {"prbt": PRBT_PAYLOADS, "er50": ER50_PAYLOADS, "drafted": LIGHT_PAYLOADS, PANDA: LIGHT_PAYLOADS}


class Mode(StrEnum):
    """What a payload is identified from."""

    EXACT = "pair, exact gains"
    NOMINAL = "nominal pair"
    PAIR = "calibrated pair"
    SINGLE = "single run"


def run(
    tally: Tally, pool: Executor, seeds: int = SEEDS, first_seed: int = FIRST_SEED, arms: Sequence[str] = tuple(SHELF)
) -> None:
    """A table, and criteria for every arm, plant and mode.

    Args:
        tally: Criteria.
        pool: Processes.
        seeds: Number of seeds.
        first_seed: The first of them.
        arms: Names from `SHELF`.
    """
    tally.heading(f"Coverage of the 95 % intervals: seeds {first_seed} to {first_seed + seeds - 1}")
    print("  of each value, the number of seeds whose interval holds the truth; intervals over 1.96 x RMS error")
    print(f"  {'':36s} | {' '.join(f'{name:>4s}' for name in PARAMETER_NAMES)} | ratio, pooled")
    pooled: dict[tuple[Twin, Mode], list[NDArray[np.bool_]]] = {}
    for arm in arms:
        for twin in (Twin.NORMATIVE,) if arm == PANDA else (Twin.NORMATIVE, Twin.HARSH):
            tasks = [pool.submit(deviations, arm, twin, seed) for seed in range(first_seed, first_seed + seeds)]
            found = []
            with progress_line(f"{arm}, {twin}", seeds) as progress:
                for task in tasks:
                    found.append(task.result())
                    progress(len(found))
            for mode in found[0]:
                shares = np.array([each[mode] for each in found])
                pooled.setdefault((twin, mode), []).append(_judged(tally, f"{arm}, {twin}, {mode}", mode, shares))
    for (twin, mode), held in pooled.items():
        share = np.concatenate(held).mean()
        tally.judge(
            f"{twin}, {mode}: of all arms' values {LEAST:.0%} to {MOST:.0%} in their intervals",
            f"{share:.1%}",
            bool(LEAST <= share <= MOST),
        )


def _judged(tally: Tally, what: str, mode: Mode, shares: FloatArray) -> NDArray[np.bool_]:
    """A row of (S, 10) errors as shares of the half widths, NaN if refused; (K, 10) those of the others that hold."""
    known = shares[~np.isnan(shares).any(axis=1)]
    held = np.abs(known) <= 1.0
    ratio = 1.0 / (1.96 * np.sqrt(np.mean(known**2, axis=0)))
    counts = " ".join(f"{count:4d}" for count in held.sum(axis=0))
    print(f"  {what:36s} | {counts} | {np.median(ratio):.2f}, {held.mean():.1%} of {held.size}")
    least = int(np.argmin(held.mean(axis=0)))
    tally.judge(
        f"{what}: of each value at least {LEAST_OF_ONE:.1%} in their intervals",
        f"{PARAMETER_NAMES[least]} {held[:, least].mean():.1%}, {len(shares) - len(known)} refused",
        bool(held.mean(axis=0).min() >= LEAST_OF_ONE),
    )
    if mode is Mode.EXACT:
        tally.judge(
            f"{what}: intervals at most {WIDEST:g} times 1.96 standard deviations of the errors (median)",
            f"{np.median(ratio):.2f}",
            bool(np.median(ratio) <= WIDEST),
        )
    return held


def deviations(name: str, twin: Twin, seed: int) -> dict[Mode, FloatArray]:
    """(10,) errors of mass, centre of mass and inertia as shares of their half widths, NaN if refused, by mode.

    Args:
        name: Of the arm.
        twin: Its plant.
        seed: Draws gains, payloads and noise.
    """
    chain, nominal, from_torque = _arm(name)
    rng = np.random.default_rng([seed, *name.encode(), *twin.encode()])
    covariance = nominal.gains(from_torque=from_torque).covariance
    error = np.expm1(rng.multivariate_normal(np.zeros(chain.n), covariance))
    shelf = SHELF[name]
    weighed = shelf[-1 - rng.integers(HEAVY)]
    other, carried = rng.permutation([index for index, payload in enumerate(shelf) if payload is not weighed])[:2]
    role, truth = ROLES[rng.integers(len(ROLES))], shelf[carried].inertial().values

    friction, since = FRICTION[rng.integers(len(FRICTION))], rng.normal(0.0, ASSUMED)
    zero_rad = rng.normal(0.0, DisturbanceLimits.usual_rad, chain.n)

    def recorded(role: str, payload: Cuboid | None, friction: float = 1.0, since: float = 0.0) -> Recording:
        drift = since + rng.normal(0.0, Drift.between_runs / np.sqrt(2.0))
        return _recorded(name, twin, role, payload, friction, (1.0 + error) * (1.0 + drift) - 1.0, rng)

    def steady(error: FloatArray) -> tuple[Recording, Recording]:
        loaded, unloaded = (_recorded(name, twin, role, on, friction, error, rng) for on in (shelf[carried], None))
        return moved(loaded), moved(unloaded)

    def moved(run: Recording) -> Recording:
        return replace(run, position_rad=run.position_rad + zero_rad, velocity_rad_s=None)

    pair = moved(recorded(role, shelf[carried], friction, since)), moved(recorded(role, None, friction, since))
    held = steady(error)
    calibration = calibrated(
        [
            MountedRun(recorded(on, payload), payload.what if payload else "")
            for on, payload in product(ROLES, (None, weighed, shelf[other]))
        ],
        {weighed.what: WeighedPayload(weighed.mass_kg)},
        chain,
        nominal,
    )
    cases = {
        Mode.NOMINAL: (None, *held, chain, nominal),
        Mode.PAIR: (calibration, *pair, chain, nominal),
        Mode.SINGLE: (calibration, pair[0], None, chain, nominal),
    }
    if twin is Twin.NORMATIVE:
        exact = Transmission(nominal.gain_nm_a, nominal.coupling, np.ones(chain.n, dtype=bool))
        cases[Mode.EXACT] = (None, *steady(np.zeros(chain.n)), chain, exact)
    found = {}
    for mode, case in cases.items():
        try:
            uncertainty = identified_with(*case, drifts=True).uncertainty
            found[mode] = (uncertainty.values - truth) / uncertainty.half_width_95
        except IdentificationError:
            found[mode] = np.full(len(truth), np.nan)
    return found


def _arm(name: str) -> tuple[Chain, Transmission, bool]:
    """An arm's chain, nominal gains, and whether its drives report torque."""
    if name == PANDA:
        return sagging_panda.chain(), sagging_panda.nominal_transmission(exact=False), False
    robot = _robot(name)
    return robot.chain, robot.drives.transmission, _scales(name).feedback is EffortFeedback.TORQUE


def _recorded(
    name: str,
    twin: Twin,
    role: str,
    payload: Cuboid | None,
    friction: float,
    error: FloatArray,
    rng: np.random.Generator,
) -> Recording:
    """A run with noise and gain errors, and with its own friction."""
    if name == PANDA:
        panda = _panda(role, payload, friction)
        loaded, unloaded = panda.pair(int(rng.integers(2**31)), error, with_phase=True)
        run = unloaded if payload is None else loaded
        speed = panda.motion.evaluate(run.time_s).velocity_rad_s
        gears = Gears(sagging_panda.COULOMB_NM, sagging_panda.VISCOUS_NM_S_RAD)
        changed = gears.changed_nm(speed, 0.0, rng) / (1.0 + error)
        return replace(run, current_a=np.asarray(run.current_a) + changed)
    periods, scales = _robot(name).excitations[role].periods, _scales(name)
    gears = Gears.of(twin_spec(_robot(name), twin, None).joints)
    period = gears.run(_period(name, twin, role, payload, friction), scales.coupling, 0.0, rng)
    return record(period, scales, periods, rng, error)


@cache
def _robot(name: str) -> Robot:
    return drafted_arm() if name == "drafted" else load_robot(name)


@cache
def _scales(name: str) -> DriveScales:
    robot = _robot(name)
    return DriveScales.of(robot.drives.settings, robot.limits.torque_noise_nm, robot.n)


@cache
def _panda(role: str, payload: Cuboid | None, friction: float) -> SaggingPanda:
    motion = sagging_panda.excitation(1 + ROLES.index(role))
    body = sagging_panda.PAYLOAD if payload is None else payload.inertial()
    return SaggingPanda(Effects(friction=friction), motion, body)


@cache
def _period(name: str, twin: Twin, role: str, payload: Cuboid | None, friction: float) -> SteadyPeriod:
    """A period of a shipped excitation, with its slow round, from MuJoCo or the cache."""
    motion = shipped_motion(_robot(name), role=role)
    spec = twin_spec(_robot(name), twin, None if payload is None else payload.rigid_body())
    spec = replace(spec, friction_scale=friction * spec.friction_scale)
    return steady_period(spec, motion.streaming, motion.trajectory)


def main() -> int:
    """Run only this part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("seeds", nargs="?", type=int, default=SEEDS)
    parser.add_argument("first_seed", nargs="?", type=int, default=FIRST_SEED)
    parser.add_argument("arms", nargs="*", default=[*SHELF])
    tally = Tally()
    with workers() as pool:
        run(tally, pool, **vars(parser.parse_args()))
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
