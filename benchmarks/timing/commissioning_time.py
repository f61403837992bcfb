"""CPU time per cycle of a simulated commissioning, compared with another commit's.

    python -m benchmarks.timing.commissioning_time CHECKOUT [--robot prbt] [--rounds 3]

CHECKOUT is a working copy of the other commit with its own `.venv`: `git worktree add CHECKOUT COMMIT`, and `make env`
in it. Both commission the same robot alternately, as `make commission` does: start-up, motion with all drives and the
plant, identification, report. The figure is user and system CPU time divided by the number of recorded rows. A
preceding run excludes what the other commit compiles at its first start. Load on the machine penalises the one with
more threads.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import tempfile
from pathlib import Path
from statistics import median

from mcap.reader import make_reader

HERE = Path(__file__).resolve().parents[2]


def main() -> None:
    """Print every pair of runs and the median of their ratios."""
    options = argparse.ArgumentParser(prog="python -m benchmarks.timing.commissioning_time")
    options.add_argument("checkout", type=Path, help="working copy to compare with")
    options.add_argument("--robot", default="er50")
    options.add_argument("--rounds", type=int, default=3)
    given = options.parse_args()
    _commission(given.checkout, given.robot)
    print(f"{given.robot}: CPU time per cycle of a simulated commissioning, us")
    print(f"{'other':>10}{'this':>10}{'ratio':>8}")
    ratios = []
    for _ in range(given.rounds):
        other, this = _commission(given.checkout, given.robot), _commission(HERE, given.robot)
        ratios.append(this / other)
        print(f"{other:10.0f}{this:10.0f}{ratios[-1]:8.3f}", flush=True)
    print(f"{'median':>20}{median(ratios):8.3f}")


def _commission(checkout: Path, robot: str) -> float:
    """CPU time per cycle of one commissioning by a checkout, us."""
    with tempfile.TemporaryDirectory() as directory:
        output = Path(directory) / "run"
        before = _children_s()
        command = [str(checkout / ".venv/bin/armload"), "commission", robot, "--output", str(output)]
        done = subprocess.run(command, cwd=checkout, capture_output=True, text=True, check=False)
        used_s = _children_s() - before
        if done.returncode:
            raise SystemExit(f"{checkout}: {done.stderr or done.stdout}")
        return used_s / sum(map(_rows, output.glob("*.mcap"))) * 1e6


def _children_s() -> float:
    """Processor time of all processes that have been waited for."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _rows(path: Path) -> int:
    """Rows of a recording."""
    with path.open("rb") as file:
        summary = make_reader(file).get_summary()
    if summary is None or summary.statistics is None:
        raise SystemExit(f"{path}: no statistics in its summary")
    return int(summary.statistics.message_count)


if __name__ == "__main__":
    main()
