"""Strict TOML: tables as pydantic models, and a one-sentence error for an invalid file.

Unknown keys are refused, every number is finite and of its type, nothing is converted. An error names the file, the
key, the value found and what was expected; for an unknown key also the most similar known key, for a missing key the
most similar key in the file. The same reader is used for robot files and files of results.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Annotated, Any, ClassVar, TypeVar, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, PlainValidator, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from armload_identification.argument_types import path_of
from armload_identification.storage.regular_file import LARGEST_BYTES, read_whole
from armload_identification.storage.replace_file import replace_file

FileErrorClass = Callable[[str, str, object, str], Exception]
"""Makes an error from file, key, value found and what was expected."""

_RECORDED = frozenset({".csv", ".mcap", ".bag", ".db3", ".npz", ".parquet"})
"""Suffixes of recordings and tables."""
_KEYS_ALIKE = 0.6
"""Similarity (`difflib`) from which a key may be a misspelling of another."""

_WANTED = {
    "model_type": "expected a table",
    "dict_type": "expected a table",
    "list_type": "expected a list",
    "string_type": "expected text in quotes",
    "string_too_short": "expected text that is not empty",
    "bool_type": "expected true or false",
    "int_type": "expected a whole number",
    "float_type": "expected a number",
    "finite_number": "expected a finite number",
    "greater_than": "expected a number greater than {gt:g}",
    "greater_than_equal": "expected at least {ge:g}",
    "less_than": "expected a number less than {lt:g}",
    "less_than_equal": "expected at most {le:g}",
    "too_short": "expected at least {min_length} items",
    "too_long": "expected at most {max_length} items",
    "literal_error": "expected {expected}",
}
"""What was expected, by pydantic's type of error."""

Text = Annotated[str, Field(min_length=1)]
"""A text that is not empty."""


class Table(BaseModel):
    """A table without unknown keys and with finite numbers only.

    Attributes:
        content: What a file with this root table contains, for messages, such as "a payload"; empty for other tables.
    """

    content: ClassVar[str] = ""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True)


_Tables = TypeVar("_Tables", bound=Table)


class BadValue(ValueError):
    """Raised by a table's validator for one of the keys inside the table.

    Attributes:
        key: Dotted path of the key within the table.
        found: The value; None if the key is missing.
        expected: What would have been accepted, as the end of a sentence.
    """

    def __init__(self, key: str, found: object, expected: str) -> None:
        super().__init__(f"{key}: {expected}")
        self.key = key
        self.found = found
        self.expected = expected


def read_text(path: Path, error: FileErrorClass, largest_bytes: int = LARGEST_BYTES) -> str:
    """The text of a file in UTF-8.

    Args:
        error: Makes the error that is raised.
        largest_bytes: Largest accepted size.

    Raises:
        Exception: made by `error`; no such file, no permission, a pipe or device, too large, or not UTF-8.
    """
    try:
        return read_whole(path, largest_bytes).decode("utf-8-sig")
    except OSError as problem:
        raise error(str(path), "", None, f"cannot be read: {problem.strerror}") from problem
    except UnicodeDecodeError as problem:
        reason = f"not UTF-8, {problem.reason} at byte {problem.start}; save it as UTF-8"
        raise error(str(path), "", None, f"cannot be read: {reason}") from problem


def read_toml(path: str | PathLike[str], error: FileErrorClass) -> str:
    """The text of a TOML file that a caller names.

    Args:
        error: Makes the error that is raised.

    Raises:
        Exception: made by `error`; it cannot be read, or is a recording or a table.
        TypeError: it is no path.
    """
    file = path_of("path", path, "the path of a TOML file")
    if file.suffix.lower() in _RECORDED and file.exists():
        expected = (
            "a recording or a table, where a file in TOML is expected; `armload identify --loaded` takes recordings, "
            "`armload calibrate` also tables of runs"
        )
        raise error(str(path), "", None, expected)
    return read_text(file, error)


def write_text(path: Path, text: str, error: FileErrorClass) -> None:
    """Write a file atomically.

    Args:
        path: The file; an existing one is replaced.
        text: Its content.
        error: Makes the error that is raised.

    Raises:
        Exception: made by `error`; the file cannot be written.
    """
    try:
        replace_file(path, text)
    except OSError as problem:
        raise error(str(path), "", None, f"cannot be written: {problem.strerror}") from problem


def parse(content: str, source: str, tables: type[_Tables], error: FileErrorClass) -> _Tables:
    """The tables of a TOML text.

    Args:
        content: TOML.
        source: Name of the file in messages.
        tables: The root table.
        error: Makes the error that is raised.

    Raises:
        Exception: made by `error`, naming file, key, value and what was expected.
    """
    return validated(toml_values(content, source, error), source, tables, error)


def toml_values(content: str, source: str, error: FileErrorClass) -> dict[str, Any]:
    """The unchecked values of a TOML text.

    Args:
        content: TOML.
        source: Name of the file in messages.
        error: Makes the error that is raised.

    Raises:
        Exception: made by `error`; the text is not TOML.
    """
    try:
        return tomllib.loads(content)
    except tomllib.TOMLDecodeError as problem:
        raise error(source, "", None, f"not valid TOML: {problem}") from problem
    except RecursionError:
        raise error(source, "", None, "not valid TOML: its values are nested too deeply") from None
    except ValueError as problem:  # an integer of more digits than Python converts
        raise error(source, "", None, f"not valid TOML: {str(problem).partition(';')[0]}") from problem


def validated(
    values: Mapping[str, Any], source: str, tables: type[_Tables], error: FileErrorClass, within: str = ""
) -> _Tables:
    """Tables from values that have been read.

    Args:
        values: Value by key.
        source: Name of the source of the values in messages.
        tables: The expected table.
        error: Makes the error that is raised.
        within: Key of that table, for messages.

    Raises:
        Exception: made by `error`, naming source, key, value and what was expected.
    """
    try:
        return tables.model_validate(values)
    except ValidationError as problem:
        other = _other_content(values, tables)
        raise error(source, *(("", None, other) if other else _explained(problem, tables, within))) from problem


def _number_list(value: object) -> NDArray[np.float64]:
    """Finite numbers, at least one."""
    if not (isinstance(value, list) and value and all(_is_finite(v) for v in value)):
        raise BadValue("", value, "expected a list of finite numbers")
    return np.array(value, dtype=np.float64)


def _number_rows(value: object) -> NDArray[np.float64]:
    """Rows of finite numbers, all of the same length."""
    rows = value if isinstance(value, list) else []
    wide = {len(row) if isinstance(row, list) and all(_is_finite(v) for v in row) else 0 for row in rows}
    if len(wide) != 1 or 0 in wide:
        raise BadValue("", value, "expected lists of finite numbers, all of the same length")
    return np.array(value, dtype=np.float64)


def _symmetric_rows(value: object) -> NDArray[np.float64]:
    """A symmetric matrix: rows that end at its diagonal, or whole rows."""
    rows = value if isinstance(value, list) else []
    if [len(row) if isinstance(row, list) else 0 for row in rows] != list(range(1, len(rows) + 1)):
        return _number_rows(value)
    lower = _number_rows([[*row, *[0.0] * (len(rows) - len(row))] for row in rows])
    return np.asarray(lower + np.tril(lower, -1).T)


NumberList = Annotated[NDArray[np.float64], PlainValidator(_number_list)]
"""(k,) finite numbers, k >= 1."""
NumberRows = Annotated[NDArray[np.float64], PlainValidator(_number_rows)]
"""(k, m) finite numbers, k and m >= 1."""
SymmetricRows = Annotated[NDArray[np.float64], PlainValidator(_symmetric_rows)]
"""(k, k) finite numbers, written up to the diagonal."""


def require_shape(key: str, found: NDArray[np.float64], shape: tuple[int, ...]) -> None:
    """Raise unless an array has the expected shape.

    Raises:
        BadValue: naming the key.
    """
    if found.shape != shape:
        expected = " lists of ".join(str(size) for size in shape)
        raise BadValue(key, found.tolist(), f"expected {expected} finite numbers")


def require_shapes(within: str, table: Table, shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Raise unless arrays of a table have the expected shapes.

    Raises:
        BadValue: naming the table's key `within` the file, and the array's.
    """
    for key, shape in shapes.items():
        require_shape(f"{within}.{key}", getattr(table, key), shape)


def _is_finite(value: object) -> bool:
    """Whether a TOML value is a number that a float can hold."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return math.isfinite(float(value))
    except OverflowError:
        return False


def _explained(problem: ValidationError, tables: type[Table], within: str) -> tuple[str, object, str]:
    """Key, value found and what was expected, for the first problem found by pydantic."""
    problems = problem.errors(include_url=False)
    first, more = problems[0], len(problems) - 1
    key, found = _dotted((within, *first["loc"]) if within else first["loc"]), first["input"]
    cause = first.get("ctx", {}).get("error")
    if isinstance(cause, BadValue):
        key = f"{key}.{cause.key}" if key and cause.key else key or cause.key
        found, expected = cause.found, cause.expected
    elif first["type"] == "missing":
        found, expected = None, _required(first["loc"], tables)
        stranger = _near_missing(first, tables)
        if stranger is not None:
            expected += f"; {stranger} is an unknown key: rename it"
            more -= 1
    elif first["type"] == "extra_forbidden":
        expected = "unknown key" + _near_unknown(first["loc"], tables)
    else:
        expected = _wanted(first)
    if more:
        expected += f" (and {more} more problem{'s' if more > 1 else ''} in this file)"
    return key, found, expected


def _other_content(values: Mapping[str, Any], tables: type[Table]) -> str:
    """The message for a file of another kind, most of whose tables are unknown; empty if it is none."""
    unknown = [key for key in values if key not in tables.model_fields]
    required = [name for name, field in tables.model_fields.items() if field.is_required()]
    missing = [name for name in required if name not in values]
    if not tables.content or len(unknown) < 2 or 2 * len(unknown) < len(values) or 2 * len(missing) <= len(required):
        return ""
    return f"not {tables.content}: contains {', '.join(unknown)} instead of {', '.join(missing)}"


def _wanted(problem: ErrorDetails) -> str:
    """What was expected, in the terms of TOML."""
    limits = problem.get("ctx", {})
    if problem["type"] == "value_error":
        return str(limits["error"])
    return _WANTED.get(problem["type"], problem["msg"]).format(**limits).replace(" 1 items", " 1 item")


def _dotted(loc: Sequence[int | str]) -> str:
    """Path of a key, with lists counted from 1: the first joint is joints[1]."""
    path = ""
    for part in loc:
        path += f"[{part + 1}]" if isinstance(part, int) else f".{part}" if path else part
    return path


def _required(loc: Sequence[int | str], tables: type[Table]) -> str:
    """The end of the message for a missing table or value."""
    field = _fields_at(loc[:-1], tables)[str(loc[-1])]
    return "the table is required" if _table_in(field.annotation) is not None else "it is required"


def _near_missing(problem: ErrorDetails, tables: type[Table]) -> str | None:
    """An unknown key of the same table that is similar to the missing one."""
    fields = _fields_at(problem["loc"][:-1], tables)
    strangers = [key for key in problem["input"] if key not in fields]
    return _most_similar(str(problem["loc"][-1]), strangers)


def _near_unknown(loc: Sequence[int | str], tables: type[Table]) -> str:
    """The table to which an unknown key belongs, else the most similar key of the same table."""
    key = str(loc[-1])
    owner = next((path for path, model in _all_tables(tables, "") if path and key in model.model_fields), None)
    if owner is not None:
        return f" here: it belongs to {owner}"
    close = _most_similar(key, _fields_at(loc[:-1], tables))
    return f": did you mean {close}?" if close else ""


def _most_similar(key: str, others: Iterable[str]) -> str | None:
    """The key of which this one may be a misspelling."""
    import difflib

    return next(iter(difflib.get_close_matches(key, list(others), n=1, cutoff=_KEYS_ALIKE)), None)


def _fields_at(loc: Sequence[int | str], tables: type[Table]) -> Mapping[str, FieldInfo]:
    """Keys of the table at a path; empty if there is no table."""
    annotation: Any = tables
    for part in loc:
        model = _table_in(annotation)
        if model is not None and part in model.model_fields:
            annotation = model.model_fields[str(part)].annotation
        elif model is not None:  # an entry of a list, or a name in a table of tables
            annotation = model
    model = _table_in(annotation)
    return {} if model is None else model.model_fields


def _all_tables(tables: type[BaseModel], path: str) -> Iterator[tuple[str, type[BaseModel]]]:
    """Every table that may be in a file, with its dotted path."""
    yield path, tables
    for name, field in tables.model_fields.items():
        inner = _table_in(field.annotation)
        if inner is not None:
            yield from _all_tables(inner, f"{path}.{name}" if path else name)


def _table_in(annotation: Any) -> type[BaseModel] | None:
    """The table in a type such as `list[X] | None`."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((table for a in get_args(annotation) if (table := _table_in(a)) is not None), None)
