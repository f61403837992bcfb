"""Start-up: CPU time of help, version, the feed-forward's import and a cold `identify`, relative to `import numpy`.

    python -m benchmarks.timing.startup [PART]      with PART, only processes whose name contains it

The rounds of all candidates are interleaved, so that other load on the machine affects all of them. The median of user
and system time counts; the first round fills the caches and is left out.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from statistics import median

import typer
from rich.console import Console
from rich.table import Table

from armload_controller.cli.command_tree import app
from benchmarks.timing.recorded_pairs import recorded_pairs

ROUNDS = 9
HELP_MOST = 2.0
FEEDFORWARD_MOST = 1.5
COLD_MOST = 11.0
COLD = "identify, 20 s of "
PYTHON = (sys.executable, "-c")
PROGRAM = (*PYTHON, "from armload_controller.cli.entry import main; main()")
REFERENCE = "import numpy"
INSTALLED = {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}
"""Byte code is kept, as in an installation, also where the environment of a developer forbids it."""


def run(part: str = "") -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as folder:
        measure(Path(folder), part)


def measure(folder: Path, part: str) -> None:
    """Print the table, with recordings in a folder."""
    feedforward = "from armload_controller.feedforward.payload_feedforward import PayloadFeedforward"
    commands: dict[str, tuple[str, ...]] = {
        REFERENCE: (*PYTHON, REFERENCE),
        "import of the feed-forward": (*PYTHON, feedforward),
    }
    for name, (urdf, loaded, unloaded) in recorded_pairs(folder).items():
        commands[COLD + name] = (*PROGRAM, "identify", urdf, "--loaded", loaded, "--unloaded", unloaded)
    commands |= {" ".join(["armload", *words]): (*PROGRAM, *words) for words in invocations()}
    commands = {name: command for name, command in commands.items() if part in name or name == REFERENCE}
    seconds: dict[str, list[float]] = {name: [] for name in commands}
    for number in range(ROUNDS + 1):
        for name, command in commands.items():
            taken_s = cpu_s(command)
            if number:
                seconds[name].append(taken_s)
    numpy_s = median(seconds[REFERENCE])
    table = Table(title=f"Start-up, CPU time, median of {ROUNDS}", title_justify="left")
    table.add_column("process")
    for heading in ("ms", f"x `{REFERENCE}`", "at most"):
        table.add_column(heading, justify="right")
    for name, taken in seconds.items():
        most = {REFERENCE: float("inf"), "import of the feed-forward": FEEDFORWARD_MOST}.get(name, HELP_MOST)
        most = COLD_MOST if name.startswith(COLD) else most
        table.add_row(name, f"{1e3 * median(taken):.0f}", f"{median(taken) / numpy_s:.2f}", f"{most:g}")
    Console(highlight=False).print(table)


def invocations() -> list[tuple[str, ...]]:
    """Arguments of every invocation that only prints text: version, help, each command's help."""

    def below(command: object, words: tuple[str, ...]) -> list[tuple[str, ...]]:
        found = [(*words, "--help")]
        for name, inner in getattr(command, "commands", {}).items():
            found += below(inner, (*words, name))
        return found

    return [("--version",), *below(typer.main.get_command(app), ())]


def cpu_s(command: Sequence[str]) -> float:
    """CPU time of a process, user and system, in s."""
    before = getrusage(RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=INSTALLED)
    after = getrusage(RUSAGE_CHILDREN)
    return (after.ru_utime - before.ru_utime) + (after.ru_stime - before.ru_stime)


if __name__ == "__main__":
    run(*sys.argv[1:])
