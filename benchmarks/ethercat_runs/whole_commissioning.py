"""er50 commissioned with its whole excitations over EtherCAT and over CANopen, with the same plant.

First with noise, of which each run has its own: mass and the intervals. Then without: what is left is the difference of
the buses, such as a torque that belongs to the position of another cycle would make.

python -m tests.ethercat_drives er50 .venv/bin/python -m benchmarks.ethercat_runs.whole_commissioning
"""

import sys
import tempfile
from pathlib import Path

from tests.both_buses import commissioned_twice

PERIODS = 3
MASS_TOLERANCE = 0.015
BUS_SHARE = 0.01
"""Greatest difference of the buses without noise, as a share of the half width of the interval with noise."""


def run() -> bool:
    """Print values and intervals of both; whether the requirements are met."""
    with tempfile.TemporaryDirectory() as noisy, tempfile.TemporaryDirectory() as quiet:
        (found, intervals, verdict), (other, other_intervals, _), truth = commissioned_twice(Path(noisy), PERIODS)
        (here, _, _), (there, _, _), _ = commissioned_twice(Path(quiet), PERIODS, noisy=False)
    true = dict(zip(found, (truth.mass_kg, *truth.center_of_mass_m), strict=True))
    print(f"{'':6}{'true':>10}{'EtherCAT':>10}{'95 %':>20}{'CANopen':>10}{'95 %':>20}{'without noise':>16}")
    met = abs(found["mass"] / true["mass"] - 1) <= MASS_TOLERANCE
    for name, value in found.items():
        (low, high), (other_low, other_high) = intervals[name], other_intervals[name]
        of_bus = here[name] - there[name]
        met &= abs(of_bus) <= BUS_SHARE * (high - low) / 2
        print(
            f"{name:6}{true[name]:10.4f}{value:10.4f}{f'{low:.4f} .. {high:.4f}':>20}"
            f"{other[name]:10.4f}{f'{other_low:.4f} .. {other_high:.4f}':>20}{of_bus:16.1e}"
        )
    print(
        f"verdict: {verdict}; mass within {MASS_TOLERANCE:.1%}, and the buses within {BUS_SHARE:.0%} of the intervals: "
        f"{met}"
    )
    return bool(met)


if __name__ == "__main__":
    sys.exit(not run())
