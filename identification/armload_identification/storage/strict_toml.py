"""Strict TOML: tables as msgspec structures, and a one-sentence error for an invalid file.

Unknown keys are refused, every number is finite and of its type, nothing is converted. An error names the file, the
key, the value found and what was expected; for an unknown key also the most similar known key, for a missing key the
most similar key in the file. The same reader is used for robot files and files of results.
"""

from __future__ import annotations

import math
import re
import tomllib
from abc import ABCMeta
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from os import PathLike
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Literal, NewType, TypeVar, Union, dataclass_transform, get_args, get_origin

import msgspec
import numpy as np
from msgspec import Meta
from msgspec.structs import FieldInfo

from armload_identification.argument_types import path_of
from armload_identification.float_array import FloatArray
from armload_identification.storage.regular_file import LARGEST_BYTES, read_whole
from armload_identification.storage.replace_file import replace_file

FileErrorClass = Callable[[str, str, object, str], Exception]
"""Makes an error from file, key, value found and what was expected."""

_RECORDED = frozenset({".csv", ".mcap", ".bag", ".db3", ".npz", ".parquet"})
"""Suffixes of recordings and tables."""
_KEYS_ALIKE = 0.6
"""Similarity (`difflib`) from which a key may be a misspelling of another."""

_WORDS: dict[object, str] = {
    list: "a list",
    str: "text in quotes",
    bool: "true or false",
    int: "a whole number",
    float: "a number",
}
"""What a value of a type is in TOML."""
_BOUND = re.compile(r"Expected `\w+` (.+) (\S+)")
_BOUNDS = {
    ">": ("gt", "a number greater than {:g}"),
    ">=": ("ge", "at least {:g}"),
    "<": ("lt", "a number less than {:g}"),
    "<=": ("le", "at most {:g}"),
    "of length >=": ("min_length", "at least {:g} items"),
    "of length <=": ("max_length", "at most {:g} items"),
}
"""Constraint of `Meta` and what was expected, by msgspec's words. Instead, a `Meta` may have a description for every
value that is refused, or a function of the value in `extra["expected"]` for one out of its range."""

Text = Annotated[str, Meta(min_length=1)]
"""A text that is not empty."""


class _TableMeta(msgspec.StructMeta, ABCMeta):
    """Lets required keys follow optional ones in every table, and a table have abstract methods."""

    def __new__(cls, name: str, bases: tuple[type, ...], namespace: dict[str, Any], **settings: Any) -> _TableMeta:
        return super().__new__(cls, name, bases, namespace, kw_only=True, **settings)


@dataclass_transform(kw_only_default=True, frozen_default=True, field_specifiers=(msgspec.field,))
class Table(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True, metaclass=_TableMeta):
    """A table without unknown keys and with finite numbers only.

    Attributes:
        content: What a file with this root table contains, for messages, such as "a payload"; empty for other tables.
    """

    content: ClassVar[str] = ""


_Tables = TypeVar("_Tables", bound=Table)
_Place = tuple[int | str, ...]
_Problem = tuple[_Place, object, str]


class BadValue(ValueError):
    """Raised by a table's `__post_init__` for one of the keys inside the table.

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


def parse_toml(content: str, source: str, tables: type[_Tables], error: FileErrorClass) -> _Tables:
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
    except RecursionError:
        raise error(source, "", None, "not valid TOML: its values are nested too deeply") from None
    except ValueError as problem:  # of an integer of more digits than Python converts, without Python's advice
        raise error(source, "", None, f"not valid TOML: {str(problem).partition('; use ')[0]}") from problem


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
        if not _all_finite(values):
            raise msgspec.ValidationError("inf or nan")
        return msgspec.convert(values, tables, dec_hook=_array)
    except msgspec.ValidationError as problem:
        raise error(source, *_explained(values, tables, within)) from problem


_Order = NewType("_Order", int)
NumberList = np.ndarray[tuple[int], np.dtype[np.float64]]
"""(k,) finite numbers, k >= 1."""
NumberRows = np.ndarray[tuple[int, int], np.dtype[np.float64]]
"""(k, m) finite numbers, k and m >= 1."""
SymmetricRows = np.ndarray[tuple[_Order, _Order], np.dtype[np.float64]]
"""(k, k) finite numbers, written up to the diagonal."""
_ROWS = (list[list[float]], "expected lists of finite numbers, all of the same length")
_ARRAYS: dict[object, tuple[Any, str]] = {
    NumberList: (list[float], "expected a list of finite numbers"),
    NumberRows: _ROWS,
    SymmetricRows: _ROWS,
}
"""What an array is in TOML, and what was expected."""


def _array(kind: Any, value: object) -> FloatArray:
    """An array of finite numbers, at least one, from a value of TOML; other types are msgspec's."""
    if kind not in _ARRAYS:
        raise NotImplementedError(f"{kind} cannot be a key's type")
    listed, expected = _ARRAYS[kind]
    try:
        rows = msgspec.convert(value, listed)
        lower = kind == SymmetricRows and [len(row) for row in rows] == list(range(1, len(rows) + 1))
        numbers = np.array([[*row, *[0.0] * (len(rows) - len(row))] for row in rows] if lower else rows)
    except ValueError as problem:  # of another type, or rows of several lengths
        raise BadValue("", value, expected) from problem
    if not (numbers.size and np.isfinite(numbers).all()):
        raise BadValue("", value, expected)
    return np.asarray(numbers + np.tril(numbers, -1).T if lower else numbers, dtype=np.float64)


def require_shape(key: str, found: FloatArray, shape: tuple[int, ...]) -> None:
    """Raise unless an array has the expected shape.

    Raises:
        BadValue: naming the key.
    """
    if found.shape != shape:
        expected = " lists of ".join(str(size) for size in shape)
        raise BadValue(key, found.tolist(), f"expected {expected} finite numbers")


def require_array_shapes(within: str, table: Table, shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Raise unless arrays of a table have the expected shapes.

    Raises:
        BadValue: naming the table's key `within` the file, and the array's.
    """
    for key, shape in shapes.items():
        require_shape(f"{within}.{key}", getattr(table, key), shape)


def _all_finite(value: object) -> bool:
    """Whether no number in a value of TOML is inf or nan."""
    if isinstance(value, (dict, list)):
        return all(map(_all_finite, value.values() if isinstance(value, dict) else value))
    return not isinstance(value, float) or math.isfinite(value)


def _explained(values: Mapping[str, Any], tables: type[Table], within: str) -> tuple[str, object, str]:
    """Key, value found and what was expected, for the first problem of a file."""
    if other := _other_content(values, tables):
        return "", None, other
    (loc, found, expected), *others = _problems(values, tables, (), tables)
    if others:
        expected += f" (and {len(others)} more problem{'s' if len(others) > 1 else ''} in this file)"
    return _dotted((within, *loc) if within else loc), found, expected


def _other_content(values: Mapping[str, Any], tables: type[Table]) -> str:
    """The message for a file of another kind, most of whose tables are unknown; empty if it is none."""
    fields = _fields(tables)
    unknown = [key for key in values if key not in fields]
    required = [name for name, field in fields.items() if field.required]
    missing = [name for name in required if name not in values]
    if not tables.content or len(unknown) < 2 or 2 * len(unknown) < len(values) or 2 * len(missing) <= len(required):
        return ""
    return f"not {tables.content}: contains {', '.join(unknown)} instead of {', '.join(missing)}"


def _problems(value: object, annotation: Any, loc: _Place, root: type[Table]) -> list[_Problem]:
    """Place, value and what was expected, for each problem of a value; msgspec reports the first, as a text."""
    if inner := list(_problems_within(value, annotation, loc, root)):
        return inner
    if isinstance(value, float) and not math.isfinite(value) and {float, Any} & {*_kinds(annotation)}:
        return [(loc, value, "expected a finite number")]
    try:
        msgspec.convert(value, annotation, dec_hook=_array)
    except msgspec.ValidationError as problem:
        cause = problem.__cause__
        if isinstance(cause, BadValue):
            return [((*loc, cause.key) if cause.key else loc, cause.found, cause.expected)]
        return [(loc, value, str(cause) if cause else _expected_in_toml(value, annotation, str(problem)))]
    return []


def _problems_within(value: object, annotation: Any, loc: _Place, root: type[Table]) -> Iterator[_Problem]:
    """The problems of what a table or a list contains."""
    for kind in _kinds(annotation):
        origin, arguments = get_origin(kind) or kind, get_args(kind)
        if isinstance(value, dict) and _table_in(origin):
            yield from _problems_of_keys(value, _fields(kind), loc, root)
        elif isinstance(value, dict) and origin in (dict, Any):
            of_key, of_value = arguments or (Any, Any)
            for key, part in value.items():
                yield from _problems(key, of_key, (*loc, key), root)
                yield from _problems(part, of_value, (*loc, key), root)
        elif isinstance(value, list) and origin in (list, Any):
            for place, part in enumerate(value):
                yield from _problems(part, (*arguments, Any)[0], (*loc, place), root)


def _problems_of_keys(
    values: Mapping[str, Any], fields: Mapping[str, FieldInfo], loc: _Place, root: type[Table]
) -> Iterator[_Problem]:
    """The problems of a table's values and keys."""
    strangers = [key for key in values if key not in fields]
    for name, field in fields.items():
        if name in values:
            yield from _problems(values[name], field.type, (*loc, name), root)
        elif field.required:
            expected = "it is required" if _table_in(field.type) is None else "the table is required"
            stranger = _most_similar(name, strangers)
            if stranger is not None:
                expected += f"; {stranger} is an unknown key: rename it"
                strangers.remove(stranger)
            yield (*loc, name), None, expected
    for key in strangers:
        yield (*loc, key), values[key], "unknown key" + _near_unknown(key, fields, root)


def _expected_in_toml(value: object, annotation: Any, problem: str) -> str:
    """What was expected, in the terms of TOML, from msgspec's message about one value."""
    bound = _BOUND.fullmatch(problem)
    metas = [m for part in (annotation, *get_args(annotation)) for m in getattr(part, "__metadata__", ())]
    described = [meta.description for meta in metas if meta.description]
    if described:
        return str(described[0])
    if bound is None or bound[1] not in _BOUNDS:
        words = [word for kind in _kinds(annotation) for word in _words(kind)]
        return f"expected {', '.join(words[:-1])}{' or ' if words[1:] else ''}{words[-1]}"
    constraint, expected = _BOUNDS[bound[1]]
    for meta in metas:
        if meta.extra is not None and getattr(meta, constraint) is not None:
            return str(meta.extra["expected"](value))
    if isinstance(value, str):
        return "expected text that is not empty"
    return f"expected {expected}".format(float(bound[2])).replace(" 1 items", " 1 item")


def _words(kind: Any) -> list[str]:
    """What a value of a type is in TOML."""
    if get_origin(kind) is Literal:
        return [repr(value) for value in get_args(kind)]
    return [_WORDS.get(get_origin(kind) or kind, "a table")]


def _near_unknown(key: str, fields: Iterable[str], root: type[Table]) -> str:
    """The table to which an unknown key belongs, else the most similar key of the same table."""
    owner = next((path for path, table in _all_tables(root, "") if path and key in _fields(table)), None)
    if owner is not None:
        return f" here: it belongs to {owner}"
    close = _most_similar(key, fields)
    return f": did you mean {close}?" if close else ""


def _most_similar(key: str, others: Iterable[str]) -> str | None:
    """The key of which this one may be a misspelling."""
    import difflib

    return next(iter(difflib.get_close_matches(key, list(others), n=1, cutoff=_KEYS_ALIKE)), None)


def _dotted(loc: _Place) -> str:
    """Path of a key, with lists counted from 1: the first joint is joints[1]."""
    return "".join(f"[{part + 1}]" if isinstance(part, int) else f".{part}" for part in loc).removeprefix(".")


@cache
def _fields(table: Any) -> dict[str, FieldInfo]:
    """The keys of a table."""
    return {field.name: field for field in msgspec.structs.fields(table)}


def _all_tables(table: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Every table that may be in a file, with its dotted path."""
    yield path, table
    for name, field in _fields(table).items():
        inner = _table_in(field.type)
        if inner is not None:
            yield from _all_tables(inner, f"{path}.{name}" if path else name)


def _table_in(annotation: Any) -> Any:
    """The table in a type such as `list[X] | None`; None if there is none."""
    origin = get_origin(annotation) or annotation
    if isinstance(origin, type) and issubclass(origin, Table):
        return annotation
    return next((table for a in get_args(annotation) if (table := _table_in(a)) is not None), None)


def _kinds(annotation: Any) -> list[Any]:
    """The types that a value may have, without None and bounds."""
    if get_origin(annotation) is Annotated:
        return _kinds(annotation.__origin__)
    if get_origin(annotation) in (Union, UnionType):
        return [kind for argument in get_args(annotation) for kind in _kinds(argument)]
    return [] if annotation is NoneType else [annotation]
