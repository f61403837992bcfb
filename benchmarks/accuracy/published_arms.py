"""Coverage and words on arms that nothing was tuned on: of URDFs that PyPI's `example-robot-data` publishes.

Every specimen has other links than its file, gears, drives and a heavy payload that was weighed; torque is reported. A
calibration is of two motions with it and without. A lighter payload is then moved on a third, on a day with another
friction and with gains that have drifted, and identified with nominal gains and with the calibration, from both runs
and from the loaded one. Nothing else is wrong: each note that names something is false.

    python -m benchmarks.accuracy.published_arms FOLDER [SEEDS [FIRST_SEED]]

FOLDER holds the robots, as for `tests/real_arms`.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Final, cast

import numpy as np

import armload
from armload_identification.calibration.mounted_runs import MountedRun, WeighedPayload
from armload_identification.calibration.session_gains import ASSUMED
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import IdentificationError
from armload_identification.model.payload import InertialParameters, derived
from armload_identification.pipeline.identification_result import Identification
from benchmarks.accuracy.interval_coverage import LEAST, MOST, Mode
from benchmarks.arms.calibrated import calibrated
from benchmarks.arms.published_arm import PublishedArm
from benchmarks.arms.trials import workers
from benchmarks.results.tally import Tally, progress_line
from tests.urdf_simulation import PUBLISHED

RATED_KG: Final = {
    "UR3": 3.0,
    "UR5": 5.0,
    "UR10": 10.0,
    "Panda": 3.0,
    "Kinova": 2.0,
    "xArm7": 3.5,
    "Z1": 2.0,
    "Baxter": 2.2,
    "Talos": 4.0,
}
MODES: Final = (Mode.NOMINAL, Mode.PAIR, Mode.SINGLE)
FALSE: Final = 0.01
SCALE: Final = 0.02
"""Standard deviation of the reported torque's error of each joint, and of that of all together: the prior's."""
DAY: Final = 0.05
"""Standard deviation of all friction from the calibration's."""
NAMED: Final = ("as if", "times that of the links")
"""Words of notes that name something that is not there; a gain that is named may be that far off."""


def main() -> int:
    """Run it; the exit status is 1 if a criterion is not met."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("seeds", nargs="?", type=int, default=4)
    parser.add_argument("first_seed", nargs="?", type=int, default=0)
    given = parser.parse_args()
    seeds = range(given.first_seed, given.first_seed + given.seeds)
    tally, found = Tally(), []
    tally.heading(f"{len(RATED_KG)} published arms, seeds {seeds[0]} to {seeds[-1]}")
    with workers() as pool:
        tasks = [(name, pool.submit(specimen, given.folder, name, seed)) for name in RATED_KG for seed in seeds]
        with progress_line("specimens", len(tasks)) as progress:
            for name, task in tasks:
                found.append((name, task.result()))
                progress(len(found))
    for place, mode in enumerate(MODES):
        shares = np.array([each[place][0] for _, each in found])
        held = np.abs(shares[~np.isnan(shares)]) <= 1.0
        masses = np.abs(shares[~np.isnan(shares[:, 0]), 0]) <= 1.0
        tally.judge(
            f"{mode}: {LEAST:.0%} to {MOST:.0%} of determined values in their intervals",
            f"{held.mean():.1%} of {held.size}, masses {masses.mean():.1%} of {masses.size}",
            bool(LEAST <= held.mean() <= MOST),
        )
        words = [(name, note) for name, each in found for note in each[place][1]]
        for name, note in words:
            print(f"      {name}: {note[:150]}")
        tally.judge(
            f"{mode}: something is named in at most {FALSE:.0%}",
            f"{len(words)} of {len(found)}",
            len(words) <= FALSE * len(found),
        )
    return tally.finish()


def specimen(folder: Path, name: str, seed: int) -> list[tuple[FloatArray, list[str]]]:
    """(10,) errors as shares of the half widths, NaN if not determined, and what is named, for every mode."""
    (file, base, flange), rated_kg = PUBLISHED[name], RATED_KG[name]
    rng = np.random.default_rng([seed, *name.encode()])
    arm = PublishedArm(folder / file, base, flange, rng)
    gain = 1.0 / (1.0 + SCALE * (rng.normal() + rng.normal(size=arm.urdf.n)))
    heavy, light = _body(rng, rated_kg * rng.uniform(0.6, 1.0)), _body(rng, rated_kg * rng.uniform(0.25, 1.0))
    motions = [arm.motion(), arm.motion()]
    runs = [
        MountedRun(arm.run(motion, payload, gain), "weighed" if payload else "")
        for motion in motions
        for payload in (None, heavy)
    ]
    weighed = {"weighed": WeighedPayload(heavy.mass_kg)}
    known = calibrated(runs, weighed, arm.urdf.chain, arm.urdf.transmission)
    motion, day, today = arm.motion(), 1.0 + DAY * rng.normal(), gain * (1.0 + ASSUMED * rng.normal())
    loaded, unloaded = (arm.run(motion, payload, today, day) for payload in (light, None))
    truth, _ = derived(light)
    found = []
    for pair, calibration in (((loaded, unloaded), None), ((loaded, unloaded), known), ((loaded, None), known)):
        try:
            result = cast("Identification", armload.identify(arm.urdf, *pair, calibration=calibration).identification)
        except IdentificationError as error:
            found.append((np.full(10, np.nan), [f"refused: {error}"]))
            continue
        spread = result.uncertainty
        share = np.where(spread.determined, (spread.values - truth) / spread.half_width_95, np.nan)
        found.append((share, [note for note in result.notes if any(words in note for words in NAMED)]))
    return found


def _body(rng: np.random.Generator, mass_kg: float) -> InertialParameters:
    """A box of random size, place and direction."""
    size_m = rng.uniform(0.04, 0.2, 3)
    center_m = rng.uniform([-0.06, -0.06, 0.02], [0.06, 0.06, 0.15])
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    squares = size_m**2
    inertia = turn @ np.diag(mass_kg / 12.0 * (squares.sum() - squares)) @ turn.T
    return InertialParameters.from_center_of_mass(mass_kg, center_m, inertia)


if __name__ == "__main__":
    sys.exit(main())
