"""er50 commissioned with its whole excitations over EtherCAT and over CANopen, with the same plant and noise.

python -m tests.ethercat_drives er50 .venv/bin/python -m benchmarks.ethercat_runs.whole_commissioning
"""

import sys
import tempfile
from pathlib import Path

from tests.both_buses import commissioned_twice

PERIODS = 3
MASS_TOLERANCE = 0.015


def run() -> bool:
    """Print values and intervals of both; whether the requirements are met."""
    with tempfile.TemporaryDirectory() as folder:
        (found, intervals, verdict), (other, other_intervals, _), truth = commissioned_twice(Path(folder), PERIODS)
    true = dict(zip(found, (truth.mass_kg, *truth.center_of_mass_m), strict=True))
    print(f"{'':6}{'true':>10}{'EtherCAT':>10}{'95 %':>20}{'CANopen':>10}{'95 %':>20}")
    met = abs(found["mass"] / true["mass"] - 1) <= MASS_TOLERANCE
    for name, value in found.items():
        (low, high), (other_low, other_high) = intervals[name], other_intervals[name]
        met &= low <= other[name] <= high and other_low <= value <= other_high
        print(
            f"{name:6}{true[name]:10.4f}{value:10.4f}{f'{low:.4f} .. {high:.4f}':>20}"
            f"{other[name]:10.4f}{f'{other_low:.4f} .. {other_high:.4f}':>20}"
        )
    print(f"verdict: {verdict}; mass within {MASS_TOLERANCE:.1%}, each within the other's interval: {met}")
    return bool(met)


if __name__ == "__main__":
    sys.exit(not run())
