"""The text of TOML values; every number is read back identically."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from numbers import Integral, Real

import numpy as np
from numpy.typing import ArrayLike


def text(value: str) -> str:
    """A string."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def number(value: float) -> str:
    """A float."""
    return repr(float(value))


def array(values: Iterable[ArrayLike]) -> str:
    """An array of floats; a matrix, or rows of any lengths, gets one line per row."""
    entries = [np.asarray(entry, dtype=np.float64) for entry in values]
    if all(entry.ndim == 0 for entry in entries):
        return "[" + ", ".join(number(float(entry)) for entry in entries) + "]"
    return "[\n" + "".join(f"    {array(row)},\n" for row in entries) + "]"


def value(content: object) -> str:
    """A text, a truth value, a number, a list of texts, an inline table, or an array of floats."""
    if isinstance(content, str):
        return text(content)
    if isinstance(content, bool):
        return "true" if content else "false"
    if isinstance(content, Integral):
        return str(int(content))
    if isinstance(content, Real):
        return number(float(content))
    if isinstance(content, Mapping):
        return inline({key: value(entry) for key, entry in content.items()})
    if isinstance(content, Sequence) and all(isinstance(entry, str) for entry in content):
        return "[" + ", ".join(text(entry) for entry in content) + "]"
    return array(content if isinstance(content, Sequence) else np.asarray(content))


def table(name: str, values: Mapping[str, object]) -> list[str]:
    """The lines of a table with its values in order, and an empty line; an entry of an array of tables is `[name]`.

    Keys must be bare or quoted, those of inline tables too.
    """
    return [f"[{name}]", *(f"{key} = {value(content)}" for key, content in values.items()), ""]


def inline(values: Mapping[str, str]) -> str:
    """An inline table of values that are TOML already."""
    return "{ " + ", ".join(f"{key} = {value}" for key, value in values.items()) + " }"
