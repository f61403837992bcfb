"""The payload file: every file that is written can be read back, and describes a physically possible body.

`[payload]`, `[determined]` and `[interval_95]` share their keys; `[payload]` and `[interval_95]` contain only
determined values. `[model]` is complete and intended for the feed-forward. `[covariance]` exists if the payload was
identified by a version that writes it; otherwise comparisons use the intervals. `[known_range]` exists if known ranges
narrowed the intervals.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar

import msgspec
import numpy as np
from msgspec import Meta

from armload_identification.files.covariance_table import CovarianceTable, covariance_lines
from armload_identification.files.inertia_table import InertiaTable
from armload_identification.files.provenance_table import ProvenanceTable, provenance_lines
from armload_identification.float_array import FloatArray
from armload_identification.identification_errors import PayloadFileError
from armload_identification.model.payload import (
    AXES,
    SMALLEST_MARGIN,
    TENSOR_ELEMENTS,
    InertialParameters,
    PayloadResult,
)
from armload_identification.storage import toml_text
from armload_identification.storage.strict_toml import (
    BadValue,
    NumberList,
    Table,
    Text,
    parse_toml,
    read_toml,
    require_shape,
    write_text,
)

_KEYS = (
    ("", "mass_kg"),
    *(("center_of_mass_m", key) for key in AXES),
    *(("inertia_kg_m2", key) for key in TENSOR_ELEMENTS),
)
"""Table and key of each of the ten values, in the order of `PARAMETER_NAMES`."""

_MODEL_TOLERANCE = 1e-9
"""Allowed relative difference between [payload] and [model]: a digit lost by other programs."""

_Entry = TypeVar("_Entry")


class _Center(Table, Generic[_Entry]):
    """Entries of the centre of mass."""

    x: _Entry | None = None
    y: _Entry | None = None
    z: _Entry | None = None


class _Inertia(Table, Generic[_Entry]):
    """Entries of the inertia."""

    ixx: _Entry | None = None
    iyy: _Entry | None = None
    izz: _Entry | None = None
    ixy: _Entry | None = None
    ixz: _Entry | None = None
    iyz: _Entry | None = None


class _Entries(Table, Generic[_Entry]):
    """The ten entries common to several sections; `_PayloadFile` checks which of them are required."""

    mass_kg: _Entry | None = None
    center_of_mass_m: _Center[_Entry] = _Center()
    inertia_kg_m2: _Inertia[_Entry] = _Inertia()

    def entries(self) -> dict[str, _Entry | None]:
        """All ten by their dotted keys, in the order of `_KEYS`."""
        within = {group: getattr(self, group) if group else self for group, _ in _KEYS}
        return {f"{group}.{key}".removeprefix("."): getattr(within[group], key) for group, key in _KEYS}


class _PayloadTable(_Entries[float]):
    """The determined values, and their frame."""

    frame: Text


class _ModelTable(Table):
    """The complete body."""

    mass_kg: Annotated[float, Meta(gt=0)]
    center_of_mass_m: NumberList
    inertia_kg_m2: InertiaTable

    def values(self) -> list[float]:
        """All ten, in the order of `_KEYS`."""
        return [self.mass_kg, *self.center_of_mass_m.tolist(), *(getattr(self.inertia_kg_m2, k) for _, k in _KEYS[4:])]

    def body(self) -> InertialParameters:
        """The body's inertial parameters."""
        return InertialParameters.from_center_of_mass(self.mass_kg, self.center_of_mass_m, self.inertia_kg_m2.tensor())


class _ResidualTable(Table):
    """Residual and noise of the torque, per joint."""

    rms_nm: NumberList
    noise_nm: NumberList


class _PayloadFile(Table):
    """The file."""

    content = "a payload"

    determined: _Entries[bool]
    model: _ModelTable
    payload: _PayloadTable
    interval_95: _Entries[NumberList]
    known_range: _Entries[NumberList] | None = None
    residual: _ResidualTable
    covariance: CovarianceTable | None = None
    provenance: ProvenanceTable

    def __post_init__(self) -> None:
        self._a_possible_body()
        self._entries_where_determined()
        self._same_as_model()
        self._intervals_from_low_to_high()
        require_shape("residual.noise_nm", self.residual.noise_nm, self.residual.rms_nm.shape)

    def _a_possible_body(self) -> None:
        require_shape("model.center_of_mass_m", self.model.center_of_mass_m, (3,))
        margin = self.model.body().margin
        if margin < SMALLEST_MARGIN:
            raise BadValue(
                "model",
                msgspec.structs.asdict(self.model),
                f"expected a physically possible body: the margin of its pseudo-inertia is {margin:.3g}, at least "
                f"{SMALLEST_MARGIN:g} is required",
            )

    def _entries_where_determined(self) -> None:
        flags = self.determined.entries()
        for key, flag in flags.items():
            if flag is None:
                raise BadValue(f"determined.{key}", None, "it is required: true or false")
        sections: dict[str, _Entries[Any]] = {"payload": self.payload, "interval_95": self.interval_95}
        for section, table in sections.items():
            for key, value in table.entries().items():
                if value is None and flags[key]:
                    raise BadValue(f"{section}.{key}", None, "it is required, because it is true in [determined]")
                if value is not None and not flags[key]:
                    found = np.asarray(value).tolist()
                    raise BadValue(f"{section}.{key}", found, "expected no entry: it is false in [determined]")

    def _same_as_model(self) -> None:
        for (key, value), expected in zip(self.payload.entries().items(), self.model.values(), strict=True):
            if value is not None and abs(value - expected) > _MODEL_TOLERANCE * abs(expected):
                raise BadValue(f"payload.{key}", value, f"expected the number in [model], {expected!r}")

    def _intervals_from_low_to_high(self) -> None:
        sections = {"interval_95": self.interval_95, "known_range": self.known_range or _Entries[NumberList]()}
        for section, table in sections.items():
            for key, interval in table.entries().items():
                if interval is not None:
                    require_shape(f"{section}.{key}", interval, (2,))
                    if interval[0] > interval[1]:
                        raise BadValue(f"{section}.{key}", interval.tolist(), "expected [low, high]")


def format_payload(result: PayloadResult) -> str:
    """The text of a payload file; `parse_payload` gives back the same numbers."""
    table, known, values = toml_text.table, result.known_range, result.values.tolist()
    lines = [
        "# Inertia: tensor elements (ixy = -int xy dm) about the centre of mass, in the axes of the frame.",
        *table("payload", {"frame": result.frame, **grouped_parameters(values, result.determined)}),
        *table("determined", grouped_parameters(result.determined.tolist())),
        *table("interval_95", grouped_parameters(result.interval_95.tolist(), result.determined)),
    ]
    if known is not None:
        ranges = grouped_parameters(known.tolist(), np.isfinite(known[:, 0]))
        lines += ["# Prior knowledge, narrower than the interval from the data alone.", *table("known_range", ranges)]
    lines += [
        "# Complete and physically possible; values that are not determined are not measurements.",
        *table("model", grouped_parameters(values) | {"center_of_mass_m": values[1:4]}),
        *table("residual", {"rms_nm": result.residual_rms_nm, "noise_nm": result.noise_nm}),
        *covariance_lines(result.mass_center),
        *provenance_lines(result.provenance),
    ]
    return "\n".join(lines)


def grouped_parameters(values: Sequence[Any], wanted: Iterable[object] = (True,) * 10) -> dict[str, Any]:
    """Those of ten values that are wanted, by key; centre of mass and inertia have a table each."""
    table: dict[str, Any] = {}
    for (group, key), value, there in zip(_KEYS, values, wanted, strict=True):
        if there:
            (table.setdefault(group, {}) if group else table)[key] = value
    return table


def write_payload(path: Path, result: PayloadResult) -> None:
    """Write a payload file, after a check that it can be read back as a possible body.

    Args:
        path: The file; an existing one is replaced.
        result: What to write.

    Raises:
        PayloadFileError: the model is impossible or nearly so, or the file cannot be written.
    """
    content = format_payload(result)
    parse_payload(content, str(path))
    write_text(path, content, PayloadFileError)


def read_payload(path: str | PathLike[str]) -> PayloadResult:
    """Read a payload file.

    Args:
        path: TOML as `format_payload` writes it.

    Raises:
        PayloadFileError: not readable, incomplete, contradictory or impossible, naming file, key and value.

    Examples:
        >>> import armload
        >>> payload = armload.read_payload("runs/today/payload.toml")
        >>> round(payload.model.mass_kg, 1), payload.feedforward_ready
        (9.8, True)
    """
    return parse_payload(read_toml(path, PayloadFileError), str(path))


def parse_payload(content: str, source: str = "payload") -> PayloadResult:
    """A payload from the text of its file.

    Raises:
        PayloadFileError: naming source, key, value and what was expected.
    """
    tables = parse_toml(content, source, _PayloadFile, PayloadFileError)
    return PayloadResult(
        frame=tables.payload.frame,
        model=tables.model.body(),
        determined=np.array([*tables.determined.entries().values()], dtype=np.bool_),
        interval_95=_ranges(tables.interval_95, (np.nan, np.nan)),
        residual_rms_nm=tables.residual.rms_nm,
        noise_nm=tables.residual.noise_nm,
        provenance=tables.provenance.provenance(),
        mass_center=None if tables.covariance is None else tables.covariance.covariance(),
        known_range=None if tables.known_range is None else _ranges(tables.known_range, (-np.inf, np.inf)),
    )


def _ranges(table: _Entries[NumberList], absent: tuple[float, float]) -> FloatArray:
    """(10, 2) ranges of a section."""
    return np.array([absent if pair is None else pair for pair in table.entries().values()])
