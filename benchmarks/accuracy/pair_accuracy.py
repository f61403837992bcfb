"""How accurate a payload from a pair of runs is on the measured and all simulated arms, and how many intervals hold.

Usage: python -m benchmarks.accuracy.pair_accuracy [SEEDS]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import chain as chain_of

import numpy as np
from threadpoolctl import threadpool_limits

from armload_controller.config.robot import load_robot
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import IdentificationError
from armload_identification.model.chain import Chain
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission
from benchmarks.accuracy.real_currents import FOLDER, MASS_KG
from benchmarks.arms import sagging_panda
from benchmarks.arms.bodies import ER50_PAYLOADS, PRBT_PAYLOADS
from benchmarks.arms.setups import Twin, setup_of, shipped_motion
from benchmarks.arms.trials import pair

SEEDS = 8
PERIODS = 3
KEPT = {"er50": 5, "prbt": 1}
SPREADS = (0.0, 0.02)

Pair = tuple[Recording, Recording, Chain, Transmission]


@dataclass(frozen=True, eq=False)
class Case:
    """Pairs of one arm and payload.

    Attributes:
        name: Printed.
        pairs: One for each seed.
        truth: (10,) true values; NaN where unknown.
    """

    name: str
    pairs: Iterator[Pair]
    truth: FloatArray


def run(seeds: int) -> None:
    """Print the table."""
    print("  case                              |  mass rms  +-   held    |  centre rms  +-   held   | CPU s")
    # One after the other: the recordings of all cases would not fit into memory.
    for case in chain_of(measured(), panda(seeds), simulated(seeds)):
        _row(case, list(case.pairs))


def measured() -> Iterator[Case]:
    """The UR10e's pairs with nominal gains; only the mass is known."""
    if not FOLDER.is_dir():
        return
    robot = load_robot("ur10e")

    def read(name: str) -> Recording:
        return read_recording_file(FOLDER / f"{name}.csv", ReadingOptions(robot.csv_columns))

    pairs = (
        (read(f"loaded{day}"), read(f"unloaded{day}"), robot.chain, robot.drives.transmission)
        for day in ("", "_b", "_jan31")
    )
    yield Case("ur10e, nominal gains", pairs, np.array([MASS_KG, *[np.nan] * 9]))


def panda(seeds: int) -> Iterator[Case]:
    """The arm of seven joints with all disturbances, by Pinocchio."""
    arm, chain = sagging_panda.SaggingPanda(), sagging_panda.chain()
    for spread in SPREADS:
        transmission = sagging_panda.nominal_transmission(exact=spread == 0.0)
        errors = [spread * np.random.default_rng([seed, 99]).uniform(-1.0, 1.0, chain.n) for seed in range(seeds)]
        pairs = ((*arm.pair(seed, error, with_phase=True), chain, transmission) for seed, error in enumerate(errors))
        yield Case(f"panda, gains within {spread:.0%}", pairs, sagging_panda.PAYLOAD.values)


def simulated(seeds: int) -> Iterator[Case]:
    """The robots' own excitations, three periods, by MuJoCo."""
    for name, bodies in (("er50", ER50_PAYLOADS), ("prbt", PRBT_PAYLOADS)):
        robot = load_robot(name)
        motion = shipped_motion(robot, KEPT[name], PERIODS)
        for twin, spread in ((Twin.CLEAN, 0.0), (Twin.NORMATIVE, 0.0), (Twin.NORMATIVE, 0.02), (Twin.HARSH, 0.02)):
            for body in (bodies[0], bodies[-1]):
                label = f"{name} {twin.name.lower()} {spread:.0%} {body.what}"
                setup = setup_of(label, robot, twin, motion, body.rigid_body(), gain_spread=spread)
                pairs = ((*pair(setup, seed)[:2], setup.chain, setup.transmission) for seed in range(seeds))
                yield Case(label, pairs, setup.truth.values)


def _row(case: Case, pairs: list[Pair]) -> None:
    """One line of the table."""
    errors, widths, times = [], [], []
    for one in pairs:
        began = time.process_time()
        try:
            with threadpool_limits(1):
                found = identify_runs(*one).uncertainty
        except IdentificationError:
            continue
        times.append(time.process_time() - began)
        errors.append(found.values - case.truth)
        widths.append(found.half_width_95)
    if not errors:
        print(f"  {case.name:33s} | every pair was refused")
        return
    error, half = np.array(errors), np.array(widths)
    parts = [
        "not known".ljust(24)
        if np.isnan(error[:, at]).any()
        else f"{factor * np.sqrt(np.mean(error[:, at] ** 2)):7.2f} {factor * half[:, at].mean():7.2f} "
        f"{np.mean(np.abs(error[:, at]) <= half[:, at]):5.0%} {unit}"
        for at, factor, unit in ((slice(0, 1), 1e3, "g"), (slice(1, 4), 1e3, "mm"))
    ]
    refused = f", {len(pairs) - len(errors)} refused" if len(errors) < len(pairs) else ""
    print(f"  {case.name:33s} | {parts[0]} | {parts[1]} | {np.median(times):.2f}{refused}", flush=True)


if __name__ == "__main__":
    run(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS)
