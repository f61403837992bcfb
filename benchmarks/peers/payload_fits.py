"""The payload from the UR10e's measured currents by armload, FIGAROH and the textbook method.

Each is a separate program, from the files and nominal gains to the body. CPU time is the program's, start-up included,
the median of three alternating rounds. The mass was weighed; both pairs carry the same body, mounted 184 degrees apart
about the flange axis. FIGAROH fits arms: its program takes the difference of the base parameters, loaded minus empty.
"""

from __future__ import annotations

import json
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Final

import numpy as np
from rich.console import Console
from rich.table import Table

from armload_controller.config.robot import load_robot
from benchmarks.accuracy.real_currents import FOLDER, MASS_KG
from benchmarks.peers.peer_environment import PEERS_PYTHON
from benchmarks.peers.peer_programs import answer_of, lines_of, without_meshes

PAIRS: Final = {"a": ("loaded.csv", "unloaded.csv"), "b": ("loaded_b.csv", "unloaded_b.csv")}
PROGRAMS: Final = {
    "armload": "by_armload.py",
    "FIGAROH 1.0.2": "by_figaroh.py",
    "textbook, Pinocchio": "by_textbook.py",
}
FLANGE: Final = "tool0"
TURNS: Final = 3


@dataclass(frozen=True, eq=False)
class Answer:
    """What a program found, and its CPU time in s."""

    mass_kg: float
    radius_mm: float
    height_mm: float
    possible: bool
    half_width_kg: float
    cpu_s: float

    @classmethod
    def parsed(cls, text: str, cpu_s: float) -> Answer:
        """From a program's output."""
        found = json.loads(text)
        x, y, z = found["center_m"]
        inertia = np.array(found["inertia_kg_m2"])
        spread = 0.5 * np.trace(inertia) * np.eye(3) - inertia
        return cls(
            found["mass_kg"],
            1e3 * float(np.hypot(x, y)),
            1e3 * z,
            bool(found["mass_kg"] > 0.0 and np.linalg.eigvalsh(spread)[0] > -1e-9),
            found["half_width_kg"],
            cpu_s,
        )


def run() -> None:
    """Print the table, or why it cannot be measured here."""
    if not FOLDER.is_dir():
        print(f"not measured: the recordings of the UR10e are not at {FOLDER}")
        return
    gains = ",".join(f"{gain:g}" for gain in load_robot("ur10e").drives.transmission.gain_nm_a)
    table = Table(title=f"a weighed mass of {MASS_KG} kg on a UR10e, pairs a and b, nominal gains")
    for column in ("", "mass, error %", "95 % +- %", "holds", "radius mm", "height mm", "possible", "CPU s", "lines"):
        table.add_column(column, justify="left" if not column else "right")
    with tempfile.TemporaryDirectory() as folder:
        urdf = Path(folder) / "ur10e.urdf"
        urdf.write_text(without_meshes(FOLDER / "ur10e.urdf"), "utf-8")
        arguments = [str(urdf), FLANGE]
        answers: dict[tuple[str, str], list[Answer]] = {}
        for _ in range(TURNS):
            for pair, files in PAIRS.items():
                paths = [str(FOLDER / file) for file in files]
                for name, program in PROGRAMS.items():
                    ours = program == "by_armload.py"
                    words = paths if ours else [*arguments, *paths, gains]
                    python = Path(sys.executable) if ours else PEERS_PYTHON
                    answers.setdefault((name, pair), []).append(Answer.parsed(*answer_of(python, program, words)))
    for name, program in PROGRAMS.items():
        a, b = (answers[name, pair] for pair in PAIRS)
        errors = [100.0 * (found[0].mass_kg / MASS_KG - 1.0) for found in (a, b)]
        widths = [100.0 * found[0].half_width_kg / found[0].mass_kg for found in (a, b)]
        table.add_row(
            name,
            *(", ".join(f"{value:+.1f}" for value in errors), ", ".join(f"{value:.1f}" for value in widths)),
            ", ".join("yes" if abs(e) <= w * (1 + e / 100.0) else "no" for e, w in zip(errors, widths, strict=True)),
            *(", ".join(f"{getattr(found[0], key):.1f}" for found in (a, b)) for key in ("radius_mm", "height_mm")),
            ", ".join("yes" if found[0].possible else "no" for found in (a, b)),
            f"{median(found.cpu_s for found in (*a, *b)):.1f}",
            str(lines_of(program)),
        )
    Console(width=120).print(table)
