"""The payload file: what is written can be read, and what is read is a body that can exist.

`[payload]`, `[determined]` and `[interval_95]` share their keys; an entry of the first and the last is there
only where it is determined. `[model]` is complete and for the feed-forward.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from armload_core.arrays import FloatArray
from armload_identification import strict_toml
from armload_identification.identification_errors import PayloadFileError
from armload_identification.model.payload import (
    SMALLEST_MARGIN,
    InertialParameters,
    PayloadResult,
    Provenance,
)

_KEYS = (
    ("", "mass_kg"),
    *(("center_of_mass_m", key) for key in ("x", "y", "z")),
    *(("inertia_kg_m2", key) for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")),
)

_Entry = TypeVar("_Entry")


def format_payload(result: PayloadResult) -> str:
    """The text of a payload file; `parse_payload` gives back the same numbers.

    Args:
        result: What to write.
    """
    number = strict_toml.number
    values, ranges = (
        [number(v) for v in result.values],
        [f"[{number(low)}, {number(high)}]" for low, high in result.interval_95],
    )
    flags = ["true" if d else "false" for d in result.determined]
    model = dict(zip(_KEYS, values, strict=True))
    provenance = result.provenance
    lines = [
        "# Inertia: tensor elements (ixy = -int xy dm) about the centre of mass, in the axes of the frame.",
        "[payload]",
        f"frame = {strict_toml.text(result.frame)}",
        *_entries(values, result.determined),
        "",
        "[determined]",
        *_entries(flags, np.ones(10, dtype=np.bool_)),
        "",
        "[interval_95]",
        *_entries(ranges, result.determined),
        "",
        "# Complete and physically possible; where a value is not determined, this is no measurement.",
        "[model]",
        f"mass_kg = {values[0]}",
        f"center_of_mass_m = [{', '.join(values[1:4])}]",
        f"inertia_kg_m2 = {strict_toml.inline({key[1]: model[key] for key in _KEYS[4:]})}",
        "",
        "[residual]",
        f"rms_nm = {strict_toml.array(result.residual_rms_nm)}",
        f"noise_nm = {strict_toml.array(result.noise_nm)}",
        "",
        *strict_toml.provenance_lines(
            provenance.armload_version, provenance.configuration_sha256, provenance.recordings_sha256
        ),
    ]
    return "\n".join(lines) + "\n"


def write_payload(path: Path, result: PayloadResult) -> None:
    """Write a payload file, unless it would not read back as a possible body.

    Args:
        path: Where to; an existing file is replaced.
        result: What to write.

    Raises:
        PayloadFileError: the model is impossible or too close to it, or the file cannot be written.
    """
    content = format_payload(result)
    parse_payload(content, str(path))
    try:
        path.write_text(content, encoding="utf-8")
    except OSError as problem:
        raise PayloadFileError(f"{path}: cannot be written: {problem}") from problem


def read_payload(path: Path) -> PayloadResult:
    """Read a payload file.

    Args:
        path: TOML as `format_payload` writes it.

    Raises:
        PayloadFileError: not readable, incomplete, contradictory or impossible, naming file, key and value.
    """
    try:
        content = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as problem:
        raise PayloadFileError(f"{path}: cannot be read: {problem}") from problem
    return parse_payload(content, str(path))


def parse_payload(content: str, source: str = "payload") -> PayloadResult:
    """A payload from the text of its file.

    Args:
        content: TOML.
        source: What messages call it.

    Raises:
        PayloadFileError: naming source, key, value and what was expected.
    """
    root = strict_toml.parse(content, source, PayloadFileError)
    everything = np.ones(10, dtype=np.bool_)
    flags = root.table("determined")
    determined = np.array([bool(f) for f in _read(flags, everything, strict_toml.TomlTable.boolean)])
    flags.close()

    model = root.table("model")
    inertia = model.table("inertia_kg_m2")
    mass_kg = model.number("mass_kg", above=0.0)
    center = model.array("center_of_mass_m", (3,))
    six = np.array([inertia.number(key) for _, key in _KEYS[4:]])
    inertia.close()
    model.close()
    body = InertialParameters.from_center_of_mass(mass_kg, center, six[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]])
    if body.margin < SMALLEST_MARGIN:
        raise root.refuse(
            "model",
            f"a body that some mass distribution can have: the margin of its pseudo-inertia is {body.margin:.3g}, "
            f"and at least {SMALLEST_MARGIN:g} is needed",
        )

    payload = root.table("payload")
    frame = payload.text("frame")
    complete = [mass_kg, *center, *six]

    def same_as_model(table: strict_toml.TomlTable, key: str) -> float:
        value = table.number(key)
        expected = complete[[k for _, k in _KEYS].index(key)]
        if abs(value - expected) > 1e-9 * abs(expected):
            raise table.refuse(key, f"the number in [model], {expected!r}")
        return value

    _read(payload, determined, same_as_model)
    payload.close()

    ranges = root.table("interval_95")
    intervals = [np.full(2, np.nan) if r is None else r for r in _read(ranges, determined, _range)]
    ranges.close()

    residual = root.table("residual")
    rms = residual.array("rms_nm", None)
    noise = residual.array("noise_nm", (len(rms),))
    residual.close()

    provenance = Provenance(*strict_toml.read_provenance(root))
    root.close()
    return PayloadResult(frame, body, determined, np.array(intervals), rms, noise, provenance)


def _range(table: strict_toml.TomlTable, key: str) -> FloatArray:
    """[low, high], in this order."""
    values = table.array(key, (2,))
    if values[0] > values[1]:
        raise table.refuse(key, "[low, high]")
    return values


def _read(
    table: strict_toml.TomlTable, wanted: NDArray[np.bool_], read: Callable[[strict_toml.TomlTable, str], _Entry]
) -> list[_Entry | None]:
    """The ten entries of a section, None where not wanted; an entry that should not be there is refused."""
    groups = {"": table}
    entries: list[_Entry | None] = []
    for (group, key), want in zip(_KEYS, wanted, strict=True):
        if group not in groups and (want or group in table):
            groups[group] = table.table(group)
        if want:
            entries.append(read(groups[group], key))
            continue
        if group in groups and key in groups[group]:
            raise groups[group].refuse(key, "no entry, because [determined] says that it is not determined")
        entries.append(None)
    for group, inner in groups.items():
        if group:
            inner.close()
    return entries


def _entries(values: list[str], wanted: NDArray[np.bool_]) -> list[str]:
    """The lines of a section: mass, and an inline table each for centre of mass and inertia."""
    lines = []
    for group in dict.fromkeys(group for group, _ in _KEYS):
        present = {k: v for (g, k), v, w in zip(_KEYS, values, wanted, strict=True) if g == group and w}
        if not group:
            lines += [f"{key} = {value}" for key, value in present.items()]
        elif present:
            lines.append(f"{group} = {strict_toml.inline(present)}")
    return lines
