"""What an identification makes of recordings in which something is wrong: covered, named, refused, or missed.

Each modification of `benchmarks.arms.modifications` is done to a pair of er50 (currents), of prbt (torque) and of the
measured UR10e, and the payload is identified from the pair with nominal gains, from the pair with a calibration, and
from the loaded run alone. It is

- covered, if no determined value of mass and centre of mass moves by more than the half width of its interval;
- named, if a note appears that the unmodified runs do not have;
- refused, if an error does;
- missed otherwise. A payload that changes during the run is never covered: no single one is right. A steady pull
  downwards is right as the weight that it equals at rest.

    python -m benchmarks.accuracy.modified_recordings [ARM...]
"""

from __future__ import annotations

import argparse
import re
import sys
from collections import Counter
from concurrent.futures import Executor
from dataclasses import dataclass
from enum import StrEnum
from functools import cache
from typing import Final, cast

import numpy as np

from armload_controller.analysis.robot_identification import identify
from armload_controller.config.robot import Robot, load_robot
from armload_identification.calibration.calibration_result import ArmCalibration
from armload_identification.calibration.mounted_runs import MountedRun, WeighedPayload
from armload_identification.identification_errors import IdentificationError
from armload_identification.model.payload import InertialParameters
from armload_identification.pipeline.identification_result import Identification
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.recording import Recording
from armload_identification.recording.row_block import QUANTITIES
from benchmarks.accuracy.real_currents import FOLDER, MASS_KG, absent
from benchmarks.arms.bodies import ER50_PAYLOADS, PRBT_PAYLOADS
from benchmarks.arms.calibrated import calibrated
from benchmarks.arms.modifications import MODIFICATIONS, Acts, Modification, ModifiedRun
from benchmarks.arms.setups import Twin, twin_spec
from benchmarks.arms.simulated_recordings import DriveScales, record
from benchmarks.arms.steady_state import Streaming, steady_period
from benchmarks.arms.trials import workers
from benchmarks.results.tally import Tally

SHELF: Final = {
    "er50": (ER50_PAYLOADS, "gearbox, far off-centre", "welding torch, far out"),
    "prbt": (PRBT_PAYLOADS, "flat sheet, off-centre", "screwdriver, far out"),
}
"""Payloads of a simulated arm: on the modified runs, and weighed for the calibration."""
MEASURED: Final = "ur10e"
PERIODS, SPREAD = 4, 0.02
QUIET: Final = (
    "An error of the drive gain may go",
    "These runs say nothing",
    "Not determined by",
    "The best fit is",
    "The motion determines",
)
"""Beginnings of notes that do not say that anything is wrong."""


class Mode(StrEnum):
    """What a payload is identified from."""

    NOMINAL = "nominal pair"
    PAIR = "calibrated pair"
    SINGLE = "single run"


class Fate(StrEnum):
    """What becomes of a modification."""

    COVERED = "covered"
    NAMED = "named"
    REFUSED = "refused"
    MISSED = "MISSED"


@dataclass(frozen=True, eq=False)
class Case:
    """A pair of an arm, and the arm's calibration from other runs."""

    robot: Robot
    loaded: Recording
    unloaded: Recording
    calibration: ArmCalibration

    def identified(self, mode: Mode, loaded: Recording, unloaded: Recording) -> Identification:
        """The payload, as `armload.identify` finds it.

        Raises:
            IdentificationError: the recordings were refused.
        """
        calibration = None if mode is Mode.NOMINAL else self.calibration
        pair = _cleaned(loaded), None if mode is Mode.SINGLE else _cleaned(unloaded)
        found = identify(self.robot, *pair, calibration=calibration).identification
        return cast("Identification", found)

    def modified(self, modification: Modification, payload: InertialParameters) -> tuple[Recording, Recording]:
        """The pair with a modification."""

        def change(run: Recording) -> Recording:
            return modification.change(ModifiedRun(run, self.robot.chain, self.robot.drives.transmission, payload))

        return change(self.loaded), change(self.unloaded) if modification.acts is Acts.BOTH else self.unloaded


def _cleaned(run: Recording) -> Recording:
    """The recording without the rows that would be left out of its file."""
    given = {name: getattr(run, name) for name in QUANTITIES}
    return Recording.from_arrays(**given, excitation=run.excitation, name=str(run.source.path))


def run(tally: Tally, pool: Executor) -> None:
    """All arms."""
    tally.heading(f"Modified recordings: {len(MODIFICATIONS)} modifications, {len(Mode)} modes")
    names = [*SHELF] if absent(tally, "modified recordings of the UR10e") else [*SHELF, MEASURED]
    for name in names:
        fates = [pool.submit(fates_of, name, number) for number in range(len(MODIFICATIONS))]
        judge(tally, name, [fate.result() for fate in fates])


def judge(tally: Tally, name: str, fates: list[dict[Mode, tuple[Fate, str]]]) -> None:
    """Print the table of an arm and its criteria."""
    print(f"  {name:52s} {'':11s} " + "  ".join(f"{mode:16s}" for mode in Mode))
    for modification, found in zip(MODIFICATIONS, fates, strict=True):
        row = "  ".join(f"{found[mode][0]:16s}" for mode in Mode)
        print(f"  {modification.name:52s} {modification.acts:11s} {row}")
        for mode, (fate, text) in found.items():
            if fate is Fate.MISSED:
                print(f"      {mode}: {text}")
    count = Counter(fate for found in fates for fate, _ in found.values())
    missed = [m.name for m, found in zip(MODIFICATIONS, fates, strict=True) if _misses(found)]
    tally.judge(
        f"{name}: each modification is covered, named or refused, in three modes",
        ", ".join(f"{count[fate]} {fate}" for fate in Fate),
        not missed,
    )
    changes = [found for m, found in zip(MODIFICATIONS, fates, strict=True) if m.of_payload]
    tally.judge(
        f"{name}: {len(changes)} payloads that change during the run are named or refused, in three modes",
        f"{sum(map(_misses, changes))} missed",
        not any(map(_misses, changes)),
    )


def _misses(found: dict[Mode, tuple[Fate, str]]) -> int:
    return sum(fate is Fate.MISSED for fate, _ in found.values())


def fates_of(name: str, number: int) -> dict[Mode, tuple[Fate, str]]:
    """What becomes of a modification of an arm's pair, and why, in every mode.

    Args:
        name: Of the arm.
        number: Of the modification.
    """
    case, modification = _case(name), MODIFICATIONS[number]
    plain = _unmodified(case, Mode.PAIR)
    pair = case.modified(modification, plain.parameters)
    return {mode: _fate(case, mode, pair, modification) for mode in Mode}


def _fate(case: Case, mode: Mode, pair: tuple[Recording, Recording], modification: Modification) -> tuple[Fate, str]:
    """What becomes of a modification in a mode."""
    before = _unmodified(case, mode)
    try:
        after = case.identified(mode, *pair)
    except IdentificationError as error:
        return Fate.REFUSED, str(error)
    known = {_stem(note) for note in before.notes}
    new = [note for note in after.notes if not note.startswith(QUIET) and _stem(note) not in known]
    right = before.uncertainty.values.copy()
    right[1:4] *= right[0] / (right[0] + modification.hangs_kg)
    right[0] += modification.hangs_kg
    moved = np.abs(after.uncertainty.values - right)
    beyond = moved > after.uncertainty.half_width_95
    if not (beyond & after.uncertainty.determined)[:4].any() and not modification.of_payload:
        return Fate.COVERED, ""
    if new:
        return Fate.NAMED, new[0]
    share = 100.0 / before.parameters.mass_kg
    half_width = after.uncertainty.half_width_95
    return Fate.MISSED, (
        f"mass {share * (after.uncertainty.values[0] - right[0]):+.1f} +- "
        f"{share * half_width[0]:.1f} %, centre of mass moved by {_mm(moved[1:4])} +- {_mm(half_width[1:4])} mm"
    )


@cache
def _unmodified(case: Case, mode: Mode) -> Identification:
    return case.identified(mode, case.loaded, case.unloaded)


def _mm(values_m: np.ndarray) -> str:
    return ", ".join(f"{1e3 * value:.0f}" for value in values_m)


def _stem(note: str) -> str:
    """A note without its numbers."""
    return re.sub(r"[\d.,+%()-]+", "", note)


@cache
def _case(name: str) -> Case:
    return _measured() if name == MEASURED else _simulated(name)


def _simulated(name: str) -> Case:
    """A normative arm with gain errors, from MuJoCo or the cache."""
    robot = load_robot(name)
    bodies, carried, weighed = SHELF[name]
    cuboids = {cuboid.what: cuboid for cuboid in bodies}
    streaming = Streaming(robot.drives.settings, robot.limits.motion)
    scales = DriveScales.of(robot.drives.settings, robot.limits.torque_noise_nm, robot.n)
    rng = np.random.default_rng(len(name))
    error = SPREAD * rng.uniform(-1.0, 1.0, robot.n)

    def recorded(role: str, what: str) -> Recording:
        spec = twin_spec(robot, Twin.NORMATIVE, cuboids[what].rigid_body() if what else None)
        period = steady_period(spec, streaming, robot.excitations[role].trajectory)
        return record(period, scales, PERIODS, rng, error)

    runs = [
        MountedRun(recorded(role, what), what) for role in ("identification", "validation") for what in ("", weighed)
    ]
    known = calibrated(
        runs, {weighed: WeighedPayload(cuboids[weighed].mass_kg)}, robot.chain, robot.drives.transmission
    )
    pair = recorded("identification", carried), recorded("identification", "")
    return Case(robot, *pair, known)


def _measured() -> Case:
    """Pair b of the UR10e, calibrated with pair a and the empty runs of other paths."""
    robot = load_robot(MEASURED)

    def read(name: str) -> Recording:
        return read_recording_file(FOLDER / name, ReadingOptions(robot.csv_columns))

    runs = [MountedRun(read("loaded.csv"), "a"), MountedRun(read("unloaded.csv"), "")]
    runs += [MountedRun(read(str(path)), "") for path in sorted((FOLDER / "other_paths").glob("*.csv"))]
    known = calibrated(runs, {"a": WeighedPayload(MASS_KG)}, robot.chain, robot.drives.transmission)
    return Case(robot, read("loaded_b.csv"), read("unloaded_b.csv"), known)


def main() -> int:
    """Run only this part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("arms", nargs="*", default=[*SHELF, MEASURED])
    tally = Tally()
    with workers() as pool:
        for name in parser.parse_args().arms:
            fates = [pool.submit(fates_of, name, number) for number in range(len(MODIFICATIONS))]
            judge(tally, name, [fate.result() for fate in fates])
    return tally.finish()


if __name__ == "__main__":
    sys.exit(main())
