"""The text of TOML values; every number is read back identically."""

from __future__ import annotations

import json
from collections.abc import Mapping
from numbers import Integral, Real

import numpy as np


def value(content: object) -> str:
    """A text, a truth value, a number, a list of texts, an inline table, or an array of floats.

    A matrix, or rows of any lengths, gets one line per row.
    """
    if isinstance(content, str):
        return json.dumps(content, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(content, Mapping):
        return inline({key: value(entry) for key, entry in content.items()})
    if isinstance(content, bool):
        return "true" if content else "false"
    if isinstance(content, Real):
        return repr(int(content) if isinstance(content, Integral) else float(content))
    entries: list[object] = list(content)  # type: ignore[call-overload]
    if not all(isinstance(entry, str) for entry in entries):
        entries = [np.asarray(entry, dtype=np.float64).tolist() for entry in entries]
    values = [value(entry) for entry in entries]
    in_rows = any(isinstance(entry, list) for entry in entries)
    return "[\n" + "".join(f"    {row},\n" for row in values) + "]" if in_rows else "[" + ", ".join(values) + "]"


def table(name: str, values: Mapping[str, object]) -> list[str]:
    """The lines of a table with its values in order, and an empty line; an entry of an array of tables is `[name]`.

    Keys must be bare or quoted, those of inline tables too.
    """
    return [f"[{name}]", *(f"{key} = {value(content)}" for key, content in values.items()), ""]


def inline(values: Mapping[str, str]) -> str:
    """An inline table of values that are TOML already."""
    return "{ " + ", ".join(f"{key} = {value}" for key, value in values.items()) + " }"
