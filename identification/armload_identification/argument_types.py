"""Arguments of Python callers that are of another type than expected, or paths."""

from __future__ import annotations

from os import PathLike
from pathlib import Path


def wrong_type(argument: str, value: object, expected: str) -> TypeError:
    """The error for an argument of another type.

    Args:
        argument: Its name.
        value: What was given.
        expected: What it may be.
    """
    return TypeError(f"`{argument}=` is {value!r:.80} ({type(value).__name__}): expected {expected}.")


def require_type(argument: str, value: object, kind: type) -> None:
    """Raise unless an optional argument is None or of its one type.

    Raises:
        TypeError: it is something else.
    """
    if value is not None and not isinstance(value, kind):
        raise wrong_type(argument, value, f"armload.{kind.__name__}")


def path_of(argument: str, value: object, expected: str = "a path") -> Path:
    """A path.

    Raises:
        TypeError: it is something else.
    """
    if isinstance(value, str | PathLike):
        return Path(value)
    raise wrong_type(argument, value, expected)
