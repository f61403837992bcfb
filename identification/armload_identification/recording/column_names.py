"""Recognises the columns of a table by their names: `q1`, `joint_2_pos_deg`, `actual_current_0`, `elbow.effort`.

A name is split into words and numbers. One word is the quantity, others are the unit or show that the column is not a
measurement; the rest is the joint: its number, else its name. Columns without a known unit are assumed to be in SI
units; invalid values and wrong units are detected later, by their magnitude.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from armload_identification.identification_errors import RecordingError
from armload_identification.recording.csv_columns import CsvColumns

_WORDS: Final = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+")
_MILLI: Final = re.compile(r"(?<![a-zA-Z])m(A|Nm)(?![a-zA-Z])")
_QUANTITIES: Final = {
    "position_rad": {"q", "pos", "position", "positions", "angle", "theta"},
    "velocity_rad_s": {"qd", "dq", "qdot", "vel", "velocity", "velocities", "speed"},
    "current_a": {"current", "currents", "curr", "i"},
    "torque_nm": {"torque", "torques", "tau", "effort", "moment", "trq"},
}
_TIMES: Final = ("timestamp", "time", "t", "stamp")
_UNITS: Final = {
    **dict.fromkeys(("deg", "degree", "degrees"), math.pi / 180.0),
    **dict.fromkeys(("ms", "ma", "milli", "mnm"), 1e-3),
    **{"us": 1e-6, "ns": 1e-9},
    **dict.fromkeys(("rad", "rads", "s", "sec", "seconds", "a", "amp", "nm", "n", "m", "per"), 1.0),
}
"""Factor to SI."""
_NOT_MEASURED: Final = {
    *("target", "desired", "des", "command", "commanded", "cmd", "ref", "reference", "setpoint", "goal", "action"),
    *("error", "tcp", "temperature", "temp", "voltage", "window", "limit", "max", "min", "std", "offset"),
}
_FILLERS: Final = {"actual", "measured", "meas", "observation", "state"}
_NEEDED: Final = 2


def columns_by_name(path: Path, names: Sequence[str]) -> CsvColumns:
    """Find time, positions, and velocities, currents and torques of the same joints.

    Raises:
        RecordingError: no time, no positions, an ambiguous choice, or a quantity in two units.
    """
    found: dict[str, dict[int | str, list[tuple[str, float]]]] = {}
    times: list[tuple[int, str, float]] = []
    for name in names:
        words = [word.lower() for word in _WORDS.findall(_MILLI.sub(r" milli \1 ", name))]
        quantity, joint, scale = _meaning(words)
        if quantity is not None:
            found.setdefault(quantity, {}).setdefault(joint, []).append((name, scale))
        elif words and words[0] in _TIMES and all(word in _UNITS for word in words[1:]):
            times.append((_TIMES.index(words[0]), name, scale))
    positions = found.get("position_rad", {})
    joints = sorted(positions, key=lambda joint: (isinstance(joint, str), joint if isinstance(joint, int) else 0))
    if not times or len(joints) < _NEEDED:
        what = "no time column" if not times else "no positions of two or more joints"
        raise RecordingError(
            f"{path}: {what} can be recognised in the header {', '.join(names)}. Specify the columns: "
            '--columns "time=0 position=1-6 current=7-12", or a [log] table in the robot\'s file.'
        )
    chosen: dict[str, list[str]] = {}
    scales: dict[str, float] = {"time_s": min(times)[2]}
    for quantity, by_joint in found.items():
        columns = [by_joint.get(joint, []) for joint in joints]
        if any(not column for column in columns):
            continue
        double = next((column for column in columns if len(column) > 1), None)
        if double is not None:
            raise RecordingError(
                f"{path}: {' and '.join(name for name, _ in double)} could both be the {quantity} of one joint. "
                'Specify which: --columns "time=... position=...", or a [log] table in the robot\'s file.'
            )
        (first, scale), *others = (column[0] for column in columns)
        other = next((name for name, factor in others if factor != scale), None)
        if other is not None:
            raise RecordingError(
                f"{path}: {first} and {other} are the {quantity} of two joints in different units. Convert one of the "
                "columns, or correct its name if only that is wrong; without a unit in the name, SI units are assumed."
            )
        chosen[quantity] = [first, *(name for name, _ in others)]
        scales[quantity] = scale
    return CsvColumns(
        min(times)[1],
        chosen["position_rad"],
        chosen.get("velocity_rad_s"),
        chosen.get("current_a"),
        chosen.get("torque_nm"),
        {quantity: scale for quantity, scale in scales.items() if scale != 1.0},
        tuple(joint for joint in joints if isinstance(joint, str)),
    )


def _meaning(words: Sequence[str]) -> tuple[str | None, int | str, float]:
    """Quantity, joint and factor of a column; no quantity if it is not a measurement of a joint."""
    scale = math.prod(_UNITS[word] for word in words[1:] if word in _UNITS)
    if _NOT_MEASURED & set(words):
        return None, "", scale
    quantities = [name for name, synonyms in _QUANTITIES.items() if synonyms & set(words)]
    # A single letter may be part of a name: longer words have priority, such as "position" over "i".
    if len(quantities) > 1:
        quantities = [name for name in quantities if any(len(word) > 1 for word in _QUANTITIES[name] & set(words))]
    if len(quantities) != 1:
        return None, "", scale
    rest = [word for word in words if word not in _QUANTITIES[quantities[0]] and word not in _UNITS]
    numbers = [int(word) for word in rest if word.isdecimal() and len(word) <= 4]
    if numbers:
        return quantities[0], numbers[-1], scale
    joint = "_".join(word for word in rest if word not in _FILLERS)
    return (quantities[0], joint, scale) if joint else (None, "", scale)
