"""TOML files of this package: read strictly, written by hand.

Reading names file, key, value and what was expected for everything that is wrong, unknown keys included.
Writing keeps every digit: a float comes back bit for bit.
"""

from __future__ import annotations

import json
import math
import tomllib
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from armload_identification.identification_errors import IdentificationError


def parse(text: str, source: str, error: type[IdentificationError]) -> TomlTable:
    """The root table of a TOML text.

    Args:
        text: TOML.
        source: Name of the file for messages.
        error: Error class that reading raises.

    Raises:
        IdentificationError: of the given class; no TOML.
    """
    try:
        return TomlTable(tomllib.loads(text), source, "", error)
    except tomllib.TOMLDecodeError as problem:
        raise error(f"{source}: no TOML: {problem}") from problem


class TomlTable:
    """One table of a file that is being read; every key that was asked for counts as known."""

    def __init__(self, values: Mapping[str, Any], source: str, path: str, error: type[IdentificationError]) -> None:
        self._values = values
        self._source = source
        self._path = path
        self._error = error
        self._known: set[str] = set()

    def __contains__(self, key: str) -> bool:
        self._known.add(key)
        return key in self._values

    def refuse(self, key: str, expected: str) -> IdentificationError:
        """The error that names file, key, value and what was expected."""
        found = repr(self._values[key]) if key in self._values else "missing"
        return self._error(f"{self._source}: {self._name(key)} is {found}; expected {expected}")

    def table(self, key: str) -> TomlTable:
        """A sub-table."""
        value = self._get(key, "a table")
        if not isinstance(value, dict):
            raise self.refuse(key, "a table")
        return TomlTable(value, self._source, self._name(key), self._error)

    def text(self, key: str, choices: Iterable[str] | None = None) -> str:
        """A string that is not empty, one of the choices where there are any."""
        expected = "a text" if choices is None else "one of " + ", ".join(choices)
        value = self._get(key, expected)
        if not isinstance(value, str) or not value or (choices is not None and value not in choices):
            raise self.refuse(key, expected)
        return value

    def boolean(self, key: str) -> bool:
        """True or false."""
        value = self._get(key, "true or false")
        if not isinstance(value, bool):
            raise self.refuse(key, "true or false")
        return value

    def integer(self, key: str, least: int) -> int:
        """A whole number."""
        expected = f"a whole number, at least {least}"
        value = self._get(key, expected)
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise self.refuse(key, expected)
        return value

    def number(self, key: str, above: float = -math.inf) -> float:
        """A finite number."""
        expected = "a finite number" if above == -math.inf else f"a finite number above {above:g}"
        value = self._get(key, expected)
        if not _is_number(value) or value <= above:
            raise self.refuse(key, expected)
        return float(value)

    def array(self, key: str, shape: tuple[int, ...] | None) -> NDArray[np.float64]:
        """Finite numbers of the given shape; None is a list of any length but zero."""
        expected = "a list of finite numbers"
        if shape is not None:
            expected = " lists of ".join(str(s) for s in shape) + " finite numbers"
        value = self._get(key, expected)
        if not _all_numbers(value):
            raise self.refuse(key, expected)
        try:
            array = np.array(value, dtype=np.float64)
        except ValueError as problem:
            raise self.refuse(key, expected) from problem
        if array.size == 0 or (array.ndim != 1 if shape is None else array.shape != shape):
            raise self.refuse(key, expected)
        return array

    def names(self) -> tuple[str, ...]:
        """All keys of the table; asking for them makes them known."""
        self._known.update(self._values)
        return tuple(self._values)

    def close(self) -> None:
        """Refuse what nobody asked for.

        Raises:
            IdentificationError: of the file's class, naming the first unknown key.
        """
        for key in self._values:
            if key not in self._known:
                raise self.refuse(key, "no such key; known here: " + ", ".join(sorted(self._known)))

    def _get(self, key: str, expected: str) -> Any:
        if key not in self:
            raise self.refuse(key, expected)
        return self._values[key]

    def _name(self, key: str) -> str:
        return f"{self._path}.{key}" if self._path else key


def text(value: str) -> str:
    """A TOML string."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def number(value: float) -> str:
    """A TOML float that reads back as the same number."""
    return repr(float(value))


def array(value: ArrayLike) -> str:
    """A TOML array of floats; a list of lists gets a line each."""
    numbers = np.asarray(value, dtype=np.float64)
    if numbers.ndim == 1:
        return "[" + ", ".join(number(v) for v in numbers) + "]"
    return "[\n" + "".join(f"    {array(row)},\n" for row in numbers) + "]"


def inline(values: Mapping[str, str]) -> str:
    """A TOML inline table of values that are TOML already; keys must be bare."""
    return "{ " + ", ".join(f"{key} = {value}" for key, value in values.items()) + " }"


def provenance_lines(
    armload_version: str, configuration_sha256: str, recordings_sha256: Mapping[str, str]
) -> list[str]:
    """The lines of `[provenance]`, which every file of this package ends with."""
    return [
        "[provenance]",
        f"armload_version = {text(armload_version)}",
        f"configuration_sha256 = {text(configuration_sha256)}",
        "",
        "[provenance.recordings_sha256]",
        *(f"{text(name)} = {text(value)}" for name, value in recordings_sha256.items()),
    ]


def read_provenance(root: TomlTable) -> tuple[str, str, dict[str, str]]:
    """Version, hash of the configuration and hashes of the recordings from `[provenance]`."""
    origin = root.table("provenance")
    files = origin.table("recordings_sha256")
    told = (
        origin.text("armload_version"),
        origin.text("configuration_sha256"),
        {name: files.text(name) for name in files.names()},
    )
    origin.close()
    return told


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _all_numbers(value: Any) -> bool:
    """True for lists, nested to any depth, whose leaves are all finite numbers."""
    return isinstance(value, list) and all(_is_number(v) or _all_numbers(v) for v in value)
