"""The templates of this room, `.in`: `@name` and `@{name}` are replaced by generated text."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from string import Template

from armload_controller.export.text_format import comment


class _AtTemplate(Template):
    """Uses @, which neither C nor CMake needs, while $ occurs in CMake."""

    delimiter = "@"


def filled(template: str, fields: Mapping[str, str]) -> str:
    """A template with its fields.

    Args:
        template: Path of the file below this room, without `.in`.
        fields: Text by name; every name in the template must be given.
    """
    return _AtTemplate(_text(template)).substitute(fields)


def written(template: str, prefix: str, fields: Mapping[str, str]) -> str:
    """A template in which each comment line is a paragraph: it is made safe and wrapped, see `comment`.

    Args:
        template: Path of the file below this room, without `.in`.
        prefix: What begins a comment line.
        fields: Text by name; names from files only in comments.
    """
    lines: list[str] = []
    for line in _text(template).splitlines():
        text, paragraph = _AtTemplate(line).substitute(fields), f"{prefix} "
        lines += comment([text.removeprefix(paragraph)], prefix) if line.startswith(paragraph) else [text]
    return "\n".join(lines) + "\n"


def _text(template: str) -> str:
    """The text of a template."""
    return (resources.files("armload_controller.export") / f"{template}.in").read_text(encoding="ascii")
