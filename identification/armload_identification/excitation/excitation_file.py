"""The excitation file: a Fourier trajectory, its design and its margins to the limits, as TOML."""

from __future__ import annotations

from decimal import ROUND_FLOOR, Context
from pathlib import Path
from typing import Annotated

from msgspec import Meta
from msgspec.structs import asdict

from armload_identification.excitation.fourier import CRITERIA, MASS_CRITERION, Excitation, FourierTrajectory
from armload_identification.excitation.limit_margins import PER_JOINT, LimitMargins
from armload_identification.identification_errors import ExcitationFileError
from armload_identification.storage import toml_text
from armload_identification.storage.strict_toml import (
    BadValue,
    NumberList,
    NumberRows,
    Table,
    Text,
    parse_toml,
    read_text,
    require_array_shapes,
    write_text,
)

_SIX_DIGITS_DOWN = Context(prec=6, rounding=ROUND_FLOOR)
_Count = Annotated[int, Meta(ge=1)]


class _ExcitationTable(Table):
    """The trajectory."""

    base_frequency_hz: Annotated[float, Meta(gt=0)]
    harmonics: _Count
    periods: _Count
    offset_rad: NumberList
    sin_rad: NumberRows
    cos_rad: NumberRows


class _DesignTable(Table):
    """How it was designed."""

    criterion: str
    cost: float
    condition_number: float
    seed: Annotated[int, Meta(ge=0)]
    restarts: _Count
    command: Text
    armload_version: Text
    history: NumberList | None = None

    def __post_init__(self) -> None:
        known = (*CRITERIA, MASS_CRITERION)
        if self.criterion not in known:
            raise BadValue("criterion", self.criterion, f"expected one of {', '.join(known)}")


class _ExcitationFile(Table):
    """The file."""

    content = "an excitation"

    excitation: _ExcitationTable
    design: _DesignTable | None = None
    margins: LimitMargins | None = None

    def __post_init__(self) -> None:
        table = self.excitation
        n = len(table.offset_rad)
        require_array_shapes("excitation", table, dict.fromkeys(("sin_rad", "cos_rad"), (n, table.harmonics)))
        if self.margins is not None:
            require_array_shapes("margins", self.margins, dict.fromkeys(PER_JOINT, (n,)))


def read_excitation(path: Path) -> Excitation:
    """Read an excitation file.

    Args:
        path: TOML with `[excitation]` and, if designed, `[design]` and `[margins]`.

    Raises:
        ExcitationFileError: not readable or invalid, naming file, key, value and what was expected.
    """
    return parse_excitation(read_text(path, ExcitationFileError), str(path))


def parse_excitation(content: str, source: str = "excitation") -> Excitation:
    """An excitation from the text of its file.

    Raises:
        ExcitationFileError: naming source, key, value and what was expected.
    """
    tables = parse_toml(content, source, _ExcitationFile, ExcitationFileError)
    table, design = tables.excitation, tables.design
    return Excitation(
        FourierTrajectory(table.base_frequency_hz, table.offset_rad, table.sin_rad, table.cos_rad),
        table.periods,
        {} if design is None else {key: value for key, value in asdict(design).items() if key != "history"},
        () if design is None or design.history is None else tuple(design.history.tolist()),
        tables.margins,
    )


def format_excitation(excitation: Excitation) -> str:
    """The text of an excitation's file; `parse_excitation` gives back the same trajectory.

    Args:
        excitation: What to write. The design's history is rounded to five digits, the margins down to six.
    """
    trajectory = excitation.trajectory
    motion = {
        "base_frequency_hz": float(trajectory.base_frequency_hz),
        "harmonics": trajectory.harmonics,
        "periods": excitation.periods,
        **{key: getattr(trajectory, key) for key in ("offset_rad", "sin_rad", "cos_rad")},
    }
    lines = [
        "# q_i(t) = offset_i + sum_k sin_ik sin(2 pi k f t) + cos_ik cos(2 pi k f t), one row per joint",
        *toml_text.table("excitation", motion),
    ]
    if excitation.design:
        history = [float(f"{cost:.5g}") for cost in excitation.history]
        lines += toml_text.table("design", {**excitation.design, **({"history": history} if history else {})})
    if excitation.margins is not None:
        lines += _margin_lines(excitation.margins)
    return "\n".join(lines)


def write_excitation(path: Path, excitation: Excitation) -> None:
    """Write an excitation file.

    Args:
        path: The file; an existing one is replaced.
        excitation: What to write.

    Raises:
        ExcitationFileError: the text to be written cannot be read back, or the file cannot be written.
    """
    content = format_excitation(excitation)
    parse_excitation(content, str(path))
    write_text(path, content, ExcitationFileError)


def _margin_lines(margins: LimitMargins) -> list[str]:
    """`[margins]`, rounded down to six digits."""
    rounded: dict[str, object] = {name: [_rounded_down(v) for v in getattr(margins, name)] for name in PER_JOINT}
    for key in ("clearance_m", "speed_m_s"):
        if room := getattr(margins, key):
            rounded[key] = {toml_text.value(name): _rounded_down(value) for name, value in room.items()}
    comment = "# minimum margins, within the part of each limit that the design may use"
    return [comment, *toml_text.table("margins", rounded)]


def _rounded_down(value: float) -> float:
    """Six digits, rounded down."""
    return float(_SIX_DIGITS_DOWN.create_decimal(repr(float(value))))
