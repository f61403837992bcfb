"""Both pairs of the UR10e's measured currents: nominal gains, and gains calibrated on the other pair."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from armload_controller.config.robot import Robot, load_robot
from armload_identification.calibration.mounted_runs import WeighedPayload
from armload_identification.float_array import FloatArray
from armload_identification.model.payload import SMALLEST_MARGIN, InertialParameters
from armload_identification.model.regressor import payload_torque
from armload_identification.pipeline.identification_result import Identification
from armload_identification.pipeline.payload_identification import identify_runs
from armload_identification.recording.file_reading import read_recording_file
from armload_identification.recording.reading_options import ReadingOptions
from armload_identification.recording.recording import Recording
from armload_identification.signals.joint_torque import Transmission
from benchmarks.arms.calibrated import calibrated_from_pair
from benchmarks.results.error_statistics import Census
from benchmarks.results.tally import Tally

FOLDER = Path(__file__).resolve().parents[3] / "shared" / "data" / "ur10e"
MASS_KG = 2.805
NOMINAL = {"a": 0.02, "b": 0.04}
CALIBRATED = 0.007
CENTER_M = 0.002
TURN_DEG, TURN_WITHIN_DEG = 184.0, 2.0
LEFT_SHARE = 0.15
PREDICTED = slice(1, 6)
"""Joints 2 to 6."""


@dataclass(frozen=True, eq=False)
class Pair:
    """The runs of one mounting of the mass."""

    loaded: Recording
    unloaded: Recording


def absent(tally: Tally, criterion: str) -> bool:
    """Whether the measured data are not next to the checkout; the criterion is postponed then."""
    if not FOLDER.is_dir():
        tally.postpone(criterion, f"the measured recordings are not at {FOLDER}")
    return not FOLDER.is_dir()


def run(tally: Tally, census: Census) -> None:
    """Print tables and criteria; postponed, with the reason, if the measured data are not in `shared`."""
    tally.heading("3. Real currents: UR10e, a weighed mass of 2.805 kg mounted twice")
    if absent(tally, "both UR10e pairs"):
        return
    robot = load_robot("ur10e")
    pairs = measured_pairs(robot)
    print("  gains             pair |     mass kg  error %  interval +- | centre of mass mm        | possible")
    nominal = {name: _identify(robot, pair, robot.drives.transmission, census) for name, pair in pairs.items()}
    for name, result in nominal.items():
        _row("nominal", name, result)
    for name, result in nominal.items():
        error = result.parameters.mass_kg / MASS_KG - 1.0
        warned = any("nominal" in note for note in result.notes)
        tally.judge(
            f"pair {name}, nominal gains: mass within {NOMINAL[name]:.0%}, with the warning",
            f"{error:+.2%}, {'warned' if warned else 'NOT warned'}",
            abs(error) <= NOMINAL[name] and warned,
        )
    _calibrated(tally, robot, pairs, census)


def measured_pairs(robot: Robot) -> dict[str, Pair]:
    """Pairs a and b.

    Args:
        robot: ur10e, whose columns the files have.
    """
    return {
        name: Pair(
            *(
                read_recording_file(FOLDER / f"{load}{suffix}.csv", ReadingOptions(robot.csv_columns))
                for load in ("loaded", "unloaded")
            )
        )
        for name, suffix in (("a", ""), ("b", "_b"))
    }


def _calibrated(tally: Tally, robot: Robot, pairs: dict[str, Pair], census: Census) -> None:
    """Gains from one pair's weighed mass, applied to the other pair."""
    gains, results = {}, {}
    for name, other in (("a", "b"), ("b", "a")):
        weighed = pairs[other]
        calibration = calibrated_from_pair(
            weighed.loaded, weighed.unloaded, WeighedPayload(MASS_KG), robot.chain, robot.drives.transmission
        )
        gains[name] = calibration.transmission(robot.drives.transmission)
        results[name] = _identify(robot, pairs[name], gains[name], census)
        _row(f"calibrated on {other}", name, results[name])
        share = " ".join(f"{ratio:.3f}" for ratio in calibration.gain_nm_a / calibration.nominal)
        undetermined = " ".join(str(joint + 1) for joint in np.flatnonzero(~calibration.determined)) or "none"
        print(f"    gains over nominal, calibrated on {other}: {share}; not determined: joint {undetermined}")
    for name, result in results.items():
        error = result.parameters.mass_kg / MASS_KG - 1.0
        tally.judge(
            f"pair {name}, gains calibrated on the other pair: mass within {CALIBRATED:.1%}",
            f"{error:+.2%}",
            abs(error) <= CALIBRATED,
        )
    _agreement(tally, robot, pairs, results, gains["b"], "gains calibrated on the other pair")


def _agreement(
    tally: Tally,
    robot: Robot,
    pairs: dict[str, Pair],
    results: dict[str, Identification],
    transmission: Transmission,
    gains: str,
) -> None:
    """One body, mounted twice: same radius and height, rotated; one mounting's payload predicts the other's torque."""
    one, two = (results[name].parameters for name in ("a", "b"))
    radius = [float(np.hypot(*body.center_of_mass_m[:2])) for body in (one, two)]
    height = [float(body.center_of_mass_m[2]) for body in (one, two)]
    turn = float(np.subtract(*(np.arctan2(b.center_of_mass_m[1], b.center_of_mass_m[0]) for b in (two, one))))
    both = [float(np.degrees(sense * turn) % 360.0) for sense in (1.0, -1.0)]
    for what, values in (("radius", radius), ("height along the flange axis", height)):
        off = abs(values[0] - values[1])
        tally.judge(
            f"{gains}: {what} of the two centres of mass within {CENTER_M * 1e3:.0f} mm",
            f"{values[0] * 1e3:.1f} and {values[1] * 1e3:.1f} mm, {off * 1e3:.2f} mm apart",
            off <= CENTER_M,
        )
    tally.judge(
        f"{gains}: the turn of about 184 degrees is found, within {TURN_WITHIN_DEG:.0f} degrees",
        f"{min(both):.1f} degrees, the other way round {max(both):.1f}",
        any(abs(angle - TURN_DEG) <= TURN_WITHIN_DEG for angle in both),
    )
    tally.judge(
        f"{gains}: both results are possible bodies",
        f"margins {one.margin:.1e} and {two.margin:.1e}",
        min(one.margin, two.margin) >= SMALLEST_MARGIN,
    )
    signal = identify_runs(pairs["b"].loaded, pairs["b"].unloaded, robot.chain, transmission).signal
    predicted = payload_torque(robot.chain, _turned(one, turn).theta, *signal.loaded.states)
    used = signal.valid
    left, raw = (
        np.sqrt(np.mean((measured - predicted)[used] ** 2, axis=0) / np.mean(measured[used] ** 2, axis=0))
        for measured in (signal.torque_nm, signal.raw_nm)
    )
    tally.judge(
        f"{gains}: pair b predicted with pair a's payload, turned, leaves at most {LEFT_SHARE:.0%} on joints 2 to 6",
        f"{_percent(left[PREDICTED])} of the low-passed difference ({_percent(raw[PREDICTED])} of the raw one)",
        bool((left[PREDICTED] <= LEFT_SHARE).all()),
    )


def _identify(robot: Robot, pair: Pair, transmission: Transmission, census: Census) -> Identification:
    result = identify_runs(pair.loaded, pair.unloaded, robot.chain, transmission)
    census.results += 1
    census.impossible += result.parameters.margin < SMALLEST_MARGIN
    return result


def _turned(body: InertialParameters, angle_rad: float) -> InertialParameters:
    """The body rotated about the flange axis."""
    pose = np.eye(4)
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    pose[:2, :2] = [[c, -s], [s, c]]
    return body.transformed(pose)


def _row(gains: str, name: str, result: Identification) -> None:
    body = result.parameters
    center = "  ".join(f"{1e3 * x:+7.2f}" for x in body.center_of_mass_m)
    print(
        f"  {gains:18s} {name:>3s} | {body.mass_kg:11.4f} {100 * (body.mass_kg / MASS_KG - 1):8.2f} "
        f"{result.uncertainty.half_width_95[0]:12.4f} | {center} | margin {body.margin:.1e}"
    )


def _percent(values: FloatArray) -> str:
    return " ".join(f"{100 * value:.1f}" for value in values) + " %"
