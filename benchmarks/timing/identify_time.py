"""CPU time of `armload identify`, compared with another commit's: start-up, reading, identification, text.

    python -m benchmarks.timing.identify_time CHECKOUT ROBOT LOADED UNLOADED [--rounds 7]

CHECKOUT is a working copy of the other commit with its own `.venv`, as for `commissioning_time`. Both identify the same
recordings alternately; a preceding run of each fills the caches and is left out.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from statistics import median

from benchmarks.timing.startup import cpu_s

HERE = Path(__file__).resolve().parents[2]


def main() -> None:
    """Print every pair of runs and the median of their ratios."""
    options = argparse.ArgumentParser(prog="python -m benchmarks.timing.identify_time")
    options.add_argument("checkout", type=Path, help="working copy to compare with")
    options.add_argument("robot")
    options.add_argument("loaded", type=Path)
    options.add_argument("unloaded", type=Path)
    options.add_argument("--rounds", type=int, default=7)
    given = options.parse_args()
    recordings = ["--loaded", str(given.loaded.resolve()), "--unloaded", str(given.unloaded.resolve())]
    programs = [str(folder.resolve() / ".venv/bin/armload") for folder in (given.checkout, HERE)]
    ratios = []
    print(f"{'other, s':>10}{'this, s':>10}{'ratio':>8}")
    for number in range(given.rounds + 1):
        other_s, this_s = (cpu_s([program, "identify", given.robot, *recordings]) for program in programs)
        if number:
            ratios.append(this_s / other_s)
            print(f"{other_s:10.2f}{this_s:10.2f}{ratios[-1]:8.3f}", flush=True)
    print(f"{'median':>20}{median(ratios):8.3f}")


if __name__ == "__main__":
    main()
