"""Changes of payload that the estimator in the loop reports on the harsh arms: false, noticed and missed ones.

The arms are those of `any_motion_simulated`: elastic joints, and gears whose losses follow no law that two payloads
share. Each payload is carried through the same random motion. A window of 20 s with one payload contains no change; an
exchange is a part with one payload followed by a part with another. No criterion: the figures are in
`identification/README.md`.

    python -m benchmarks.accuracy.exchanged_payloads [FIRST] [LAST]
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from functools import partial
from itertools import permutations

import numpy as np

from armload_controller.config.robot import load_robot
from armload_controller.config.robot_simulation import HARSH_GAIN_ERROR
from armload_identification.float_array import FloatArray
from armload_identification.pipeline.recursive_estimator import PayloadEstimator
from benchmarks.accuracy.simulated_motion import (
    ARMS,
    IN_THE_LOOP_S,
    RUN_S,
    TWINS,
    calibration_of,
    scales_of,
    shelf,
    signals_of,
)
from benchmarks.arms.setups import Twin, twin_spec
from benchmarks.arms.streamed_arm import streamed
from benchmarks.arms.streams import as_recorded, point_to_point
from benchmarks.arms.trials import workers

FIRST, LAST = 20, 30
"""Seeds, both included."""
PAYLOADS = {
    "prbt": ("gripper with a part", "rated load", "screwdriver, far out"),
    "er50": ("spindle", "gearbox, far off-centre"),
}
EXCHANGED_S, LATEST_S, STEP_S = (20.0, 40.0), 6.0, 0.01
"""Times of the exchanges, the time within which one must be noticed, and the resolution."""
Signals = tuple[FloatArray, FloatArray, FloatArray]
Found = tuple[dict[str, list[int]], dict[str, list[float]]]
"""By payload the changes in each window, and by pair of payloads the delays; inf for a missed exchange."""


def run(first: int = FIRST, last: int = LAST) -> None:
    """Print the figures."""
    seeds = range(first, last + 1)
    print(f"\nChanges of payload reported by the estimator in the loop, harsh arms, seeds {first} to {last}")
    with workers() as pool:
        for name in PAYLOADS:
            changes: dict[str, list[int]] = {}
            delays: dict[str, list[float]] = {}
            for counted, late in pool.map(partial(_seed, name), seeds):
                for what, counts in counted.items():
                    changes.setdefault(what, []).extend(counts)
                for pair, more in late.items():
                    delays.setdefault(pair, []).extend(more)
            for what, counts in changes.items():
                number = f"{sum(counts)} false changes in {len(counts)} windows of {IN_THE_LOOP_S:g} s"
                print(f"  {name}, {what}: {number}")
            for pair, more in delays.items():
                missed = np.count_nonzero(np.isinf(more))
                print(
                    f"  {name}, {pair}: {missed} of {len(more)} exchanges not noticed within {LATEST_S:g} s, "
                    f"half after {np.median(more):.2f} s"
                )


def _seed(name: str, seed: int) -> Found:
    """All windows and exchanges of an arm."""
    robot = load_robot(name)
    rng = np.random.default_rng([seed, ARMS.index(name), TWINS.index(Twin.HARSH)])
    gain_error = HARSH_GAIN_ERROR * rng.uniform(-1.0, 1.0, robot.n)
    calibration = calibration_of(robot, Twin.HARSH, rng, gain_error)
    setpoints = point_to_point(robot, 1000 + seed, RUN_S)
    carried: dict[str, Signals] = {}
    for what in PAYLOADS[name]:
        spec = twin_spec(robot, Twin.HARSH, shelf()[what].rigid_body())
        moved = streamed(spec, robot.drives.settings, setpoints)
        carried[what] = signals_of(as_recorded(moved, scales_of(robot), rng, gain_error, what))

    def estimator() -> PayloadEstimator:
        return PayloadEstimator(calibration, robot.chain, robot.drives.transmission)

    changes = {what: [_changes(estimator(), part) for part in _windows(signals)] for what, signals in carried.items()}
    delays: dict[str, list[float]] = {}
    for before, after in permutations(carried, 2):
        late = delays.setdefault(" and ".join(sorted((before, after))), [])
        late += [_delay(estimator(), carried[before], carried[after], at_s) for at_s in EXCHANGED_S]
    return changes, delays


def _windows(signals: Signals) -> Iterator[Signals]:
    """Parts of equal length."""
    for start_s in np.arange(0.0, RUN_S - IN_THE_LOOP_S, IN_THE_LOOP_S):
        begin, end = np.searchsorted(signals[0], (start_s, start_s + IN_THE_LOOP_S))
        time_s, position, effort = (part[begin:end] for part in signals)
        yield time_s, position, effort


def _changes(estimator: PayloadEstimator, signals: Signals) -> int:
    """Number of reported changes."""
    estimator.update_all(*signals)
    return estimator.changes


def _delay(estimator: PayloadEstimator, before: Signals, after: Signals, at_s: float) -> float:
    """Delay in s until an exchange is noticed; inf if it is not."""
    begin = int(np.searchsorted(before[0], at_s))
    estimator.update_all(*(part[:begin] for part in before))
    alarms, step = estimator.changes, round(STEP_S / float(after[0][1] - after[0][0])) or 1
    for k in range(begin, int(np.searchsorted(after[0], at_s + LATEST_S)), step):
        estimator.update_all(*(part[k : k + step] for part in after))
        if estimator.changes > alarms:
            return float(after[0][min(k + step, len(after[0])) - 1] - at_s)
    return float(np.inf)


def main() -> None:
    """Run this benchmark."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("first", nargs="?", type=int, default=FIRST)
    parser.add_argument("last", nargs="?", type=int, default=LAST)
    wanted = parser.parse_args()
    run(wanted.first, wanted.last)


if __name__ == "__main__":
    main()
