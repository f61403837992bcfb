"""Pairs with the one solve (difference and mean rows, all terms of the arm) beside `identify`, in one run.

`identify` does not use it for the payload of a pair yet: this is what decides whether it may.

Usage: python -m benchmarks.accuracy.pair_by_solve [SEEDS]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain as chain_of

import numpy as np
from threadpoolctl import threadpool_limits

from armload_controller.config.robot import load_robot
from armload_core.arrays import FloatArray
from armload_identification.estimation.arm_rows import RunSignals, arm_rows, base_links
from armload_identification.estimation.arm_terms import GAIN, PAYLOAD, arm_terms, effort_level
from armload_identification.estimation.problem import DIFFERENCE_AND_MEAN, Group, Noise, Problem, RunRows
from armload_identification.estimation.solve import solve
from armload_identification.estimation.uncertainty import derived, student_half_width
from armload_identification.identification_errors import IdentificationError
from armload_identification.model.base_parameters import base_columns
from armload_identification.model.chain import Chain
from armload_identification.model.payload import InertialParameters
from armload_identification.pipeline.payload_identification import identify
from armload_identification.recording.file_reading import read_recording
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission
from armload_identification.signals.load_signal import load_signal
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
Values = tuple[FloatArray, FloatArray]
"""(10,) values and half widths."""


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


def by_solve(loaded: Recording, unloaded: Recording, chain: Chain, transmission: Transmission) -> Values:
    """Values of the payload of a pair by the one solve."""
    signal = load_signal(loaded, unloaded, transmission)
    coupling = transmission.coupling
    base = base_links(base_columns(chain, coupling), chain.n)
    runs = [
        replace(RunSignals.of_motion(run, coupling, name), usable=signal.valid)
        for name, run in (("loaded", signal.loaded), ("unloaded", signal.unloaded))
    ]
    peak = np.max([run.peak_rad_s for run in runs], axis=0)
    rows = [
        arm_rows(run, chain, coupling, base, peak, loaded=load) for run, load in zip(runs, (True, False), strict=True)
    ]
    gains = transmission.deviation
    terms = [
        replace(term, deviation=gains) if term.name == GAIN else term for term in arm_terms(rows, chain, base, peak)
    ]
    group = Group((RunRows(rows[0], PAYLOAD), RunRows(rows[1])), DIFFERENCE_AND_MEAN)
    found = solve(Problem(terms, [group], Noise.unknown(effort_level(rows)), coupling), rough=True)
    place = found.problem.place(PAYLOAD, PAYLOAD)
    values, slope = derived(InertialParameters(found.x[place]))
    contrast = np.zeros((10, found.problem.shared_size))
    contrast[:, place] = slope
    variance, freedom = found.spread(contrast)
    return values, student_half_width(freedom) * np.sqrt(variance)


def by_identify(loaded: Recording, unloaded: Recording, chain: Chain, transmission: Transmission) -> Values:
    """Values of the payload of a pair by `identify`."""
    found = identify(loaded, unloaded, chain, transmission).uncertainty
    return found.values, found.half_width_95


def run(seeds: int) -> None:
    """Print the table."""
    print("  case                              | by       |  mass rms  +-   held |  centre rms  +-   held | CPU s")
    # One after the other: the recordings of all cases would not fit into memory.
    for case in chain_of(measured(), panda(seeds), simulated(seeds)):
        pairs = list(case.pairs)
        for label, method in (("identify", by_identify), ("solve", by_solve)):
            _row(case, pairs, label, method)


def measured() -> Iterator[Case]:
    """The UR10e's pairs with nominal gains; only the mass is known."""
    if not FOLDER.is_dir():
        return
    robot = load_robot("ur10e")

    def read(name: str) -> Recording:
        return read_recording(FOLDER / f"{name}.csv", ReadingOptions(robot.csv_columns))

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


def _row(case: Case, pairs: list[Pair], label: str, method: Callable[..., Values]) -> None:
    """One line of the table."""
    errors, widths, times = [], [], []
    for one in pairs:
        began = time.process_time()
        try:
            with threadpool_limits(1):
                values, width = method(*one)
        except IdentificationError:
            continue
        times.append(time.process_time() - began)
        errors.append(values - case.truth)
        widths.append(width)
    if not errors:
        print(f"  {case.name:33s} | {label:8s} | every pair was refused")
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
    print(f"  {case.name:33s} | {label:8s} | {parts[0]} | {parts[1]} | {np.median(times):.2f}{refused}", flush=True)


if __name__ == "__main__":
    run(int(sys.argv[1]) if len(sys.argv) > 1 else SEEDS)
