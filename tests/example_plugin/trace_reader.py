"""A reader of recordings: traces of a controller, *.trc, with degrees, percent of the rated torque and decimal commas.

Columns: Time;ActPos1;...;ActTrq1;... in s, deg and %. The entry point's name is the files' suffix.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

RATED_NM = 180.0


def read_trace(path: Path) -> dict[str, NDArray[np.float64]]:
    """Time, positions and torques; a ValueError becomes armload's message about the file."""
    header, *lines = path.read_text("utf-8").splitlines()
    names = header.split(";")
    rows = np.array([[float(cell.replace(",", ".")) for cell in line.split(";")] for line in lines])
    if rows.ndim != 2 or rows.shape[1] != len(names):
        raise ValueError(f"expected {len(names)} columns in every line")

    def columns(prefix: str) -> NDArray[np.float64]:
        found = [i for i, name in enumerate(names) if name.startswith(prefix)]
        return np.asarray(rows[:, found])

    return {
        "time_s": rows[:, names.index("Time")],
        "position_rad": np.radians(columns("ActPos")),
        "torque_nm": columns("ActTrq") * RATED_NM / 100.0,
    }
