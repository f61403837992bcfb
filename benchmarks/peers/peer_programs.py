"""Runs and times the programs in this folder and counts their lines."""

from __future__ import annotations

import os
import re
import subprocess
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from typing import Final

_HERE: Final = Path(__file__).parent
_ROOT: Final = Path(__file__).resolve().parents[2]
_MESHES: Final = re.compile(r"<(visual|collision)\b.*?</\1>", re.DOTALL)


def answer_of(python: Path, program: str, words: list[str]) -> tuple[str, float]:
    """The last line that a program prints, and its CPU time in s, start-up included.

    Args:
        python: The interpreter of its environment.
        program: Its file in this folder.
        words: Its arguments.
    """
    command = [str(python), "-W", "ignore", str(_HERE / program), *words]
    before = getrusage(RUSAGE_CHILDREN)
    done = subprocess.run(
        command,
        cwd=_ROOT,
        env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        check=True,
    )
    after = getrusage(RUSAGE_CHILDREN)
    return done.stdout.splitlines()[-1], after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def lines_of(program: str) -> int:
    """Lines of code: neither blank, nor comment, nor module docstring."""
    text = re.sub(r'^""".*?"""', "", (_HERE / program).read_text("utf-8"), flags=re.DOTALL)
    return sum(bool(line.strip()) and not line.lstrip().startswith(("#", '"""')) for line in text.splitlines())


def without_meshes(urdf: Path) -> str:
    """A URDF without the meshes; FIGAROH would require their files."""
    return _MESHES.sub("", urdf.read_text("utf-8"))
